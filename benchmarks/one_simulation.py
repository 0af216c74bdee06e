"""J2: one nonlinear simulation of the reference machine, an alternating staircase of x from 0.1 to 1, output every 1 ms.

Errors are the largest over all states, relative to the range of each, against DOP853 at 1e-12 restarted at every step of x.
"""

from __future__ import annotations

import numpy as np
from scipy.integrate import solve_ivp

import hydroctl as hc

from .measure import Contender, Row, compare
from .peers import casadi_slope, slope_function

_RTOL = 5e-6
_TIMES = 20


def rows(*, smallest: bool) -> list[Row]:
    """Five seconds with steps of x every half second, or one step of 50 ms."""
    actuator = hc.load_actuator("reference")
    levels, held = ((0.1,), 50) if smallest else ((0.1, -0.2, 0.3, -0.4, 0.5, -0.6, 0.7, -0.8, 0.9, -1.0), 500)
    t = 1e-3 * np.arange(len(levels) * held + 1)
    x = np.append(np.repeat(levels, held), levels[-1])
    start = list(hc.rest_state(actuator))[:4]
    slope = slope_function(actuator)

    def by_scipy(method, rtol, atol):
        parts, state = [np.array(start)[:, None]], start
        for k, level in enumerate(levels):
            times = t[k * held : (k + 1) * held + 1]
            span = (times[0], times[-1])
            answer = solve_ivp(lambda _, z, u: slope(z, u), span, state, method, times[1:], args=(level,), rtol=rtol, atol=atol)
            parts.append(answer.y)
            state = answer.y[:, -1]
        return np.concatenate(parts, axis=1)

    expected = by_scipy("DOP853", 1e-12, [1e-5, 1e-5, 1e-13, 1e-13])
    atol = [1.0, 1.0, 1e-8, 1e-8]

    def error(found):
        return float((np.abs(found - expected).max(axis=1) / np.ptp(expected, axis=1)).max())

    def by_hydroctl():
        for _ in range(_TIMES):
            r = hc.simulate(actuator, t, x, rtol=_RTOL)
        return error(np.array([r.p_a, r.p_b, r.v, r.y]))

    def by_control():
        import control

        system = control.nlsys(lambda t, z, u, _: np.array(slope(z, u[0])), lambda t, z, u, _: z, states=4, inputs=1, outputs=4)
        return error(control.input_output_response(system, t, x, start).outputs)

    def in_segments(solve):
        """The states of `solve(times, state, level)`, (4, n), segment by segment."""
        parts, state = [np.array(start)[:, None]], np.array(start)
        for level in levels:
            parts.append(solve(1e-3 * np.arange(held + 1), state, level))
            state = parts[-1][:, -1]
        return np.concatenate(parts, axis=1)

    def by_sundials():
        from sksundae.cvode import CVODE

        def solve(times, state, level):
            def right_hand_side(t, z, dz):
                dz[:] = slope(z, level)

            return CVODE(right_hand_side, rtol=1e-6, atol=np.array(atol)).solve(times, state).y[1:].T

        return error(in_segments(solve))

    def by_casadi():
        import casadi

        scale = np.array([1e7, 1e7, 0.1, 0.1])
        z, x = casadi.SX.sym("z", 4), casadi.SX.sym("x")
        field = {"x": z, "p": x, "ode": casadi.vertcat(*casadi_slope(actuator, z * scale, x)) / scale}
        times = 1e-3 * np.arange(held + 1)
        cvodes = casadi.integrator("cvodes", "cvodes", field, 0.0, times[1:], {"reltol": 1e-6, "abstol": 1e-8})
        return error(in_segments(lambda _, state, level: np.array(cvodes(x0=state / scale, p=level)["xf"]) * scale[:, None]))

    contenders = [
        Contender("python-control input_output_response", by_control, note="it ramps x between samples"),
        Contender("scipy RK45, restarted at steps", lambda: error(by_scipy("RK45", 1e-6, atol))),
        Contender("scipy LSODA, restarted at steps", lambda: error(by_scipy("LSODA", 1e-6, atol))),
        Contender("scikit-sundae CVODE, restarted at steps", by_sundials, needs=("sksundae",)),
        Contender("CasADi CVODES, restarted at steps", by_casadi, needs=("casadi",)),
        Contender(f"hydroctl simulate, rtol {_RTOL:g}", by_hydroctl, units=_TIMES),
    ]
    return compare("J2", contenders, 1 if smallest else 7)
