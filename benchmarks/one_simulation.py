"""J2: one nonlinear simulation of the reference machine, an alternating staircase of x from 0.1 to
1, output every 1 ms.

Errors are the largest over all states, relative to the range of each, against DOP853 at 1e-12
restarted at every step of x.
"""

from __future__ import annotations

from functools import cache, partial

import numpy as np
from scipy.integrate import solve_ivp

import hydroctl as hc

from . import simulation_peers as peers
from .measure import Contender, Row, compare
from .peers import plant_of, slope_function

_RTOL = 8e-6
_TIMES = 100


def rows(*, smallest: bool) -> list[Row]:
    """Five seconds with steps of x every half second, or one step of 50 ms."""
    actuator = hc.load_actuator("reference")
    levels, held = (
        ((0.1,), 50) if smallest else ((0.1, -0.2, 0.3, -0.4, 0.5, -0.6, 0.7, -0.8, 0.9, -1.0), 500)
    )
    t = 1e-3 * np.arange(len(levels) * held + 1)
    x = np.append(np.repeat(levels, held), levels[-1])
    start = list(hc.rest_state(actuator))[:4]
    slope = slope_function(actuator)

    def by_scipy(method, rtol, atol):
        def solve(times, state, level):
            return solve_ivp(
                lambda _, z: slope(z.tolist(), level),
                times[[0, -1]],
                state,
                method,
                times,
                rtol=rtol,
                atol=atol,
            ).y

        return peers.in_segments(solve, levels, held)(start)

    expected = by_scipy("DOP853", 1e-12, [1e-5, 1e-5, 1e-13, 1e-13])

    def error(found):
        return float((np.abs(found - expected).max(axis=1) / np.ptp(expected, axis=1)).max())

    def by_hydroctl():
        for _ in range(_TIMES):
            r = hc.simulate(actuator, t, x, rtol=_RTOL)
        return np.array([r.p_a, r.p_b, r.v, r.y])

    def by_control():
        import control

        system = control.nlsys(
            lambda t, z, u, _: slope(z.tolist(), float(u[0])), None, states=4, inputs=1
        )
        return control.input_output_response(system, t, x, start).outputs

    def contender(name, make, times=1, needs=()):
        made = cache(partial(make, plant_of(actuator), levels, held))

        def several():
            for _ in range(times):
                found = made()(start)
            return found

        return Contender(name, several, error, units=times, needs=needs)

    contenders = [
        Contender(
            "python-control input_output_response",
            by_control,
            error,
            note="it ramps x between samples",
        ),
        Contender(
            "scipy RK45, restarted at steps",
            lambda: by_scipy("RK45", peers.RTOL, peers.ATOL),
            error,
        ),
        Contender(
            "scipy LSODA, restarted at steps",
            lambda: by_scipy("LSODA", peers.RTOL, peers.ATOL),
            error,
        ),
        contender("scipy odeint, compiled equations", peers.by_odeint),
        contender(
            "scikit-sundae CVODE, compiled equations", peers.by_sundials, needs=("sksundae",)
        ),
        contender("CasADi CVODES, restarted at steps", peers.by_casadi, needs=("casadi",)),
        contender("diffrax Tsit5, restarted at steps", peers.by_diffrax, needs=("diffrax",)),
        contender("numba Runge-Kutta 4, 0.25 ms", peers.by_runge_kutta, _TIMES),
        Contender(f"hydroctl simulate, rtol {_RTOL:g}", by_hydroctl, error, units=_TIMES),
    ]
    return compare("J2", contenders, 1 if smallest else 7)
