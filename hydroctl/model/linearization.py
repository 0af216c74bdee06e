"""Equation (2) of the source paper: the linear model of the plant at every operating point, for
arrays of them.

With b(z) the column by which x enters and At = A + x db/dz at the operating point z_r,

    tangent:  bt = b(z_r)                 the Jacobian, static gain dv/dx: for feedback design
    secant:   bt = b(z_r) - (db/dz) z_r   the paper's, static gain v/x: for simulation

Both have the same poles. A load or dry friction adds a constant to the secant model's equation of
motion, so that v/x is its static gain only without them. Behind a dead band x is the effective
opening; the columns are then scaled to the spool position, by its slope (tangent) or by the
quotient of the two (secant). From x to v there are one zero and three poles,

    v/x(s) = (n1 s + n0) / (s^3 + d2 s^2 + d1 s + d0)
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING, Literal

import numpy as np

from ..errors import InputError, OperatingPointError, unknown_name
from . import chambers, plant, valve
from .cubic_roots import cubic_roots
from .operating_point import OperatingPoints
from .transfer_function import coefficients

if TYPE_CHECKING:
    import control

    from ..machine.actuator import Actuator

STATES = ("p_a", "p_b", "v")
_FORMS = ("tangent", "secant")


@dataclass(frozen=True, eq=False)
class LinearFamily:
    """Linear models over the shape of the operating points; states p_a, p_b (Pa) and v (m/s), input
    x, output v."""

    points: OperatingPoints
    form: Literal["tangent", "secant"]
    """"tangent" or "secant"""
    A: np.ndarray
    """(..., 3, 3)"""
    B: np.ndarray
    """(..., 3, 1)"""

    @property
    def C(self) -> np.ndarray:
        """(1, 3): the output is v."""
        return np.array([[0.0, 0.0, 1.0]])

    @property
    def D(self) -> np.ndarray:
        """(1, 1): zero."""
        return np.zeros((1, 1))

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of the grid of operating points."""
        return self.points.shape

    @property
    def numerator(self) -> np.ndarray:
        """(..., 2): n1, n0 of v/x(s)."""
        return self._coefficients[0]

    @property
    def denominator(self) -> np.ndarray:
        """(..., 4): 1, d2, d1, d0 of v/x(s)."""
        return self._coefficients[1]

    @cached_property
    def _coefficients(self) -> tuple[np.ndarray, np.ndarray]:
        return coefficients(self.A, self.B)

    def poles(self) -> np.ndarray:
        """(..., 3) complex, rad/s: first the real pole nearest the zero (the one that nearly
        cancels), then the other two."""
        return self._poles

    @cached_property
    def _poles(self) -> np.ndarray:
        return cubic_roots(self.denominator[..., 1:], self.zeros()[..., 0])

    def zeros(self) -> np.ndarray:
        """(..., 1) rad/s: the zero of v/x(s)."""
        return -self.numerator[..., 1:] / self.numerator[..., :1]

    def static_gain(self) -> np.ndarray:
        """(...) v/x at s = 0 in m/s: dv/dx (tangent) or v/x (secant, no load)."""
        return self.numerator[..., 1] / self.denominator[..., 3]

    def frequency_response(self, omega) -> np.ndarray:
        """(..., n) complex: v/x at the n frequencies omega (rad/s)."""
        s = 1j * np.asarray(omega, dtype=float)
        (n1, n0), (_, d2, d1, d0) = (
            np.moveaxis(c, -1, 0)[..., None] for c in (self.numerator, self.denominator)
        )
        with np.errstate(invalid="ignore"):  # flagged points are NaN
            return (n1 * s + n0) / (((s + d2) * s + d1) * s + d0)

    def __getitem__(self, index) -> LinearModel:
        """One member as a `LinearModel`; `index` must select a single point. A flagged point raises
        OperatingPointError."""
        if np.shape(self.points.x[index]) != ():
            raise InputError(
                f"index {index!r} selects several points of shape {self.shape}; give one index per"
                " axis."
            )
        if not self.points.feasible[index]:
            raise OperatingPointError(self.points.reason[index])
        return LinearModel(self.A[index], self.B[index], self.C, self.D)


@dataclass(frozen=True, eq=False)
class LinearModel:
    """One linear model; its conversions make python-control objects with named signals."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray

    def state_space(self) -> control.StateSpace:
        """x -> v with states p_a, p_b (Pa), v (m/s). Scale the states before calling routines that
        need a balanced model."""
        import control

        return control.ss(
            self.A, self.B, self.C, self.D, inputs=["x"], outputs=["v"], states=list(STATES)
        )

    def transfer_function(self) -> control.TransferFunction:
        """v/x(s), from the closed-form coefficients: one zero, three poles, no spurious terms."""
        import control

        return control.tf(*coefficients(self.A, self.B), inputs=["x"], outputs=["v"])


def linearize(
    actuator: Actuator, points: OperatingPoints, *, form: Literal["tangent", "secant"] = "tangent"
) -> LinearFamily:
    """The linear model at every operating point, from the analytic Jacobian. A point that is not
    feasible holds NaN.

    Raises InputError if `points` belong to another actuator, or for an unknown form.
    """
    if form not in _FORMS:
        raise InputError(unknown_name("form", form, _FORMS))
    if points.actuator is not actuator and points.actuator.parameters() != actuator.parameters():
        raise InputError(
            "points were found for another actuator; call find_operating_points with this one."
        )
    p = plant.parameters(actuator)
    with np.errstate(divide="ignore", invalid="ignore"):
        p_a, p_b, v, y, x = (
            _compact(values) for values in (points.p_a, points.p_b, points.v, points.y, points.x)
        )
        opening = valve.effective_opening(x, p.valve)
        A, B = plant.jacobian(p_a, p_b, v, y, opening, p)
        if form == "secant":
            drop_a, drop_b = valve.pressure_gains(p_a, p_b, opening, p.valve, p.supply)
            stiff_a, stiff_b = chambers.stiffnesses(y, p.chambers)
            B[..., 0, 0] += stiff_a * (drop_a * p_a / opening)
            B[..., 1, 0] += stiff_b * (drop_b * p_b / opening)
        if p.valve.dead_band > 0.0:
            B *= (valve.opening_slope(x, p.valve) if form == "tangent" else opening / x)[
                ..., None, None
            ]
    if not points.feasible.all():
        A[~points.feasible], B[~points.feasible] = np.nan, np.nan
    return LinearFamily(points, form, A, B)


def _compact(values: np.ndarray) -> np.ndarray:
    """The same values with length 1 along every axis on which they are broadcast."""
    return values[tuple(slice(0, 1) if stride == 0 else slice(None) for stride in values.strides)]
