"""The paper's quasi-linear model: second order, surfaces of its coefficients over x and y, equation
(3)."""

from .model import FitError, QuasiLinearModel, Surface
from .reduction import SecondOrderFamily, reduce_order
from .surfaces import PoorFitWarning, fit_surfaces

__all__ = [
    "FitError",
    "PoorFitWarning",
    "QuasiLinearModel",
    "SecondOrderFamily",
    "Surface",
    "fit_surfaces",
    "reduce_order",
]
