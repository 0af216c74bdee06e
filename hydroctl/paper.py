"""The source paper's own recipe and tables, reproduced to the printed digits, with its errata.

Recipe of the coefficient table below equation (3), for each sign of x:

    points   x = 0 (the limit), +-0.1, ..., +-1 and y = 0, 0.05, ..., 0.5 m, with leakage Kv = 0;
             secant form, equation (2)
    a1, a2   from the complex pole pair
    b        the leading coefficient n1 of the numerator, times ONE constant z/p taken at
             x = +-0.1, y = 0.25 m
    surface  ordinary least squares in the paper's monomials

Errata, each checked by a test:

* The paper states Kv = 5e-12, but Table 1 and the coefficient table belong to Kv = 0.
* The half for x < 0 was computed at the operating point of x > 0: the closed form for (p_1n, p_2n,
  v_n) is even in x, but holds for x > 0 only, and for x < 0 it is no equilibrium.
  `corrected_coefficient_table` takes the true one.
* z/p is not one constant: it varies with y, so that the static gain b/a2 of the printed model is
  wrong by up to about 15 % (x > 0) and 30 % (x < 0) away from y = 0.25 m. Matching it at every
  point (`reduce_order`) removes that.
* "Close" pole and zero (8 to 12 % apart in Table 1) belong to the secant form; in the tangent form,
  which feedback design needs, they agree to better than 3e-4.
* sqrt|dp| lets the flow keep its direction when a pressure drop reverses; see `plant`.
* The unit printed for alpha is a slip: it is m^3/s per root of Pa.
"""

from __future__ import annotations

import dataclasses

import numpy as np

from .machine.actuator import Actuator
from .machine.datasheet import load_actuator
from .model.linearization import LinearFamily, linearize
from .model.operating_point import find_operating_points
from .quasi_linear.bases import Basis
from .quasi_linear.model import SIDES, QuasiLinearModel, Surface
from .quasi_linear.reduction import reduce_order
from .quasi_linear.region import Region

LIMIT = 1e-9
"""|x| that stands for the limit x -> 0; the tables do not change from 1e-6 on"""
OPENINGS = np.array([LIMIT, *np.linspace(0.1, 1.0, 10)])
POSITIONS = np.linspace(0.0, 0.5, 11)
_REFERENCE = (1, 5)
"""index of x = +-0.1, y = 0.25 m in the grid of OPENINGS and POSITIONS"""

PRINTED_ZEROS_AND_POLES = (
    (0.1, 0.1, -0.553428, -0.602292, -100.373 + 540.126j),
    (0.1, 0.4, -0.696633, -0.624809, -100.316 + 491.445j),
    (1.0, 0.1, -5.5559, -6.04729, -103.749 + 540.736j),
    (1.0, 0.4, -6.99936, -6.27291, -103.179 + 492.015j),
)
"""Table 1 as printed: x, y (m), zero, real pole and upper complex pole (rad/s)."""

PRINTED_COEFFICIENTS = {
    "+": {
        "a1": [200.762, 8.22294, -10.2406, -4.532, 20.487],
        "a2": [363017.0, 1415.21, -657273.0, 932269.0],
        "b": [63318.5, 1.11302, -136751.0, 157578.0],
    },
    "-": {
        "a1": [200.878, -10.0721, -11.5788, 8.84922, 23.133],
        "a2": [363146.0, -1567.8, -657959.0, 932790.0],
        "b": [38871.0, -54.1975, -35404.1, 106421.0],
    },
}
"""The table below equation (3) as printed; a1 multiplies 1, x, y, x y, y^2 and the others 1, x, y,
y^2."""


def actuator() -> Actuator:
    """The paper's machine with which its tables were made: the shipped reference without
    leakage."""
    return load_actuator("reference").replace(leakage=0.0)


def zero_pole_table() -> list[tuple[float, float, float, float, complex]]:
    """Table 1 computed: rows of x, y (m), zero, real pole and upper complex pole (rad/s), as
    PRINTED_ZEROS_AND_POLES."""
    x, y = np.array([[0.1], [1.0]]), np.array([0.1, 0.4])
    family = linearize(actuator(), find_operating_points(actuator(), x, y), form="secant")
    zero, poles = family.zeros()[..., 0], family.poles()
    return [
        (
            float(family.points.x[i]),
            float(family.points.y[i]),
            float(zero[i]),
            float(poles[i][0].real),
            complex(poles[i][1]),
        )
        for i in np.ndindex(family.shape)
    ]


def coefficient_table() -> dict[str, dict[str, list[float]]]:
    """The table below equation (3) by the paper's recipe, its mistake for x < 0 included; laid out
    as PRINTED_COEFFICIENTS."""
    return {"+": _fit(equilibrium_family("+")), "-": _fit(_family_at_the_wrong_point())}


def corrected_coefficient_table() -> dict[str, dict[str, list[float]]]:
    """The same recipe with the true equilibrium for x < 0; the half for x > 0 is the paper's."""
    return {side: _fit(equilibrium_family(side)) for side in SIDES}


def quasi_linear_model(table: dict[str, dict[str, list[float]]]) -> QuasiLinearModel:
    """Equation (3) with the coefficients of a table laid out as PRINTED_COEFFICIENTS."""
    surfaces = {}
    for side, rows in table.items():
        coefficients = {name: np.array(row) for name, row in rows.items()} | {"offset": np.zeros(4)}
        surfaces[side] = Surface(
            coefficients, Region.rectangle(SIDES[side] * np.array([0.0, 1.0]), POSITIONS)
        )
    return QuasiLinearModel(Basis("paper"), surfaces)


def equilibrium_family(side: str) -> LinearFamily:
    """Secant models on the paper's grid at the true operating points, for x > 0 ("+") or x < 0
    ("-")."""
    machine = actuator()
    points = find_operating_points(machine, SIDES[side] * OPENINGS[:, None], POSITIONS)
    return linearize(machine, points, form="secant")


def _family_at_the_wrong_point() -> LinearFamily:
    """The paper's half for x < 0: its equations for x < 0, linearized about the operating point of
    -x."""
    machine = actuator()
    extending, retracting = (
        find_operating_points(machine, sign * OPENINGS[:, None], POSITIONS) for sign in (1.0, -1.0)
    )
    points = dataclasses.replace(retracting, p_a=extending.p_a, p_b=extending.p_b, v=extending.v)
    return linearize(machine, points, form="secant")


def leading_coefficient_constant(family: LinearFamily) -> float:
    """The one constant z/p at x = +-0.1, y = 0.25 m by which the paper multiplies n1, for a family
    on its grid."""
    return float(family.zeros()[_REFERENCE][0] / family.poles()[_REFERENCE][0].real)


def _fit(family: LinearFamily) -> dict[str, list[float]]:
    reduced = reduce_order(family)
    constant = leading_coefficient_constant(family)
    surfaces = {"a1": reduced.a1, "a2": reduced.a2, "b": constant * family.numerator[..., 0]}
    basis, x, y = Basis("paper"), family.points.x.ravel(), family.points.y.ravel()
    return {
        name: np.linalg.lstsq(basis.terms(name, x, y), values.ravel(), rcond=None)[0].tolist()
        for name, values in surfaces.items()
    }
