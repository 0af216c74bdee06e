"""J1: operating points, A, B, transfer-function coefficients, zero, poles and second-order
coefficients over a grid of (x, y).

Times are for the whole grid, through the public functions; python-control does some of the points,
and its time is scaled. Errors are the largest relative ones of the poles against eigenvalues of A
by complex step, where the residual is below 1e-12. All but python-control find operating points
along x only, where nothing depends on y.
"""

from __future__ import annotations

import sys
from functools import partial
from importlib.util import find_spec

import numpy as np

import hydroctl as hc
from hydroctl.model import plant

from .grid_peers import grid_casadi, grid_jax, grid_numba
from .grids import grid_numpy
from .measure import Contender, Row, compare
from .peers import plant_of, slope_function

_GRIDS = ((21, 11, 80), (101, 51, 10))
"""(nx, ny, how often in a turn)"""
_CONTROL_POINTS = 20


def rows(*, smallest: bool) -> list[Row]:
    """The grids 21 by 11 and 101 by 51, or one of 3 by 3."""
    found = []
    for nx, ny, times in ((3, 3, 1),) if smallest else _GRIDS:
        found += _grid(nx, ny, times, 1 if smallest else 9)
    return found


def _grid(nx: int, ny: int, times: int, repeats: int) -> list[Row]:
    actuator = hc.load_actuator("reference")
    parameters = plant_of(actuator)
    x, y = np.linspace(0.05, 1.0, nx), np.linspace(0.0, actuator.stroke, ny)
    expected = _exact_poles(actuator, x, y)
    some = np.unique(np.linspace(0, nx * ny - 1, min(_CONTROL_POINTS, nx * ny)).astype(int))
    system, guess = _control_system(actuator), [0.5e-5 * actuator.supply_pressure] * 2 + [0.05]

    def error(poles, among=slice(None)):
        return float(np.abs(np.sort_complex(poles.reshape(-1, 3)) / expected[among] - 1.0).max())

    def by_hydroctl():
        points = hc.find_operating_points(actuator, x[:, None], y)
        family = hc.linearize(actuator, points)
        reduced = hc.reduce_order(family)
        return family.poles(), (
            family.A,
            family.B,
            family.numerator,
            family.denominator,
            family.zeros(),
            reduced.a1,
            reduced.b,
        )

    def contender(name, run, **changes):
        def several():
            for _ in range(times):
                poles = run()[0]
            return poles

        return Contender(f"{nx} by {ny}: {name}", several, error, units=times, **changes)

    contenders = [
        Contender(
            f"{nx} by {ny}: python-control, per point",
            lambda: np.array([_by_control(system, guess, x[k // ny], y[k % ny]) for k in some]),
            partial(error, among=some),
            units=some.size / (nx * ny),
        ),
        contender("CasADi map", partial(grid_casadi, parameters, x, y), needs=("casadi",)),
        contender(
            "NumPy, batched eigvals", partial(grid_numpy, parameters, x, y, batched_eigvals=True)
        ),
        contender(
            "NumPy, closed-form poles", partial(grid_numpy, parameters, x, y, batched_eigvals=False)
        ),
        contender("JAX vmap", partial(grid_jax, parameters, x, y), needs=("jax",)),
        contender("numba", partial(grid_numba, parameters, x, y)),
        contender("hydroctl", by_hydroctl),
    ]
    return compare("J1", contenders, repeats)


def _control_system(actuator):
    """Pressures in bar, y frozen. Without Slycot, python-control would search the disk for it in
    every conversion."""
    import control

    if find_spec("slycot") is None:
        sys.modules["slycot"] = None
    slope = slope_function(actuator)

    def update(t, z, u, parameters):
        p_a, p_b, v = z.tolist()
        dp_a, dp_b, dv, _ = slope((1e5 * p_a, 1e5 * p_b, v, parameters["y"]), float(u[0]))
        return [1e-5 * dp_a, 1e-5 * dp_b, dv]

    return control.nlsys(
        update, lambda t, z, u, _: z[2:3], states=3, inputs=1, outputs=1, params={"y": 0.0}
    )


def _by_control(system, guess, x, y):
    """As a user would: operating point, linear model, transfer function with its zeros, poles."""
    import control

    z, u = control.find_operating_point(
        system, guess, [x], params={"y": y}, root_kwargs={"tol": 1e-12}
    )
    model = control.linearize(system, z, u, params={"y": y})
    control.ss2tf(model.A, model.B, model.C, model.D).zeros()
    return model.poles()


def _exact_poles(actuator, x, y):
    """(nx ny, 3), sorted; A by complex step through the plant's own equations, each point's states
    as hydroctl finds them."""
    points = hc.find_operating_points(actuator, x[:, None], y)
    assert points.residual.max() <= 1e-12
    p, step = plant.parameters(actuator), 1e-30
    A = np.empty((*points.shape, 3, 3))
    for k in range(3):
        z = [points.p_a + 0j, points.p_b + 0j, points.v + 0j]
        z[k] = z[k] + 1j * step
        slopes = plant.rates(*z, points.y, points.x, 0.0, p)
        A[..., k] = (
            np.stack([np.broadcast_to(s, points.shape) for s in slopes], axis=-1).imag / step
        )
    scale = np.array([1e7, 1e7, 1.0])
    return np.sort_complex(np.linalg.eigvals(A * scale / scale[:, None]).reshape(-1, 3))
