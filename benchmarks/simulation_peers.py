"""Peers of J2. `by_...(plant, levels, held)` makes a call from the first state to the states (4, n)
at every ms; x is held at each level for `held` ms, and integration restarts at its steps."""

from __future__ import annotations

from collections.abc import Callable

import numba
import numpy as np
from scipy.integrate import odeint

from .peers import Plant, casadi_root, either, jax_root, runge_kutta_4, signed_root, slopes

RTOL, ATOL = 1e-6, np.array([1.0, 1.0, 1e-8, 1e-8])
_SCALE = np.array([1e7, 1e7, 0.1, 0.1])
_SUBSTEPS = 4


def in_segments(solve: Callable, levels, held: int) -> Callable:
    """From `solve(times, state, level)` -> (4, held + 1), one segment of x after the other."""
    times = 1e-3 * np.arange(held + 1)

    def whole(start):
        parts, state = [np.array(start)[:, None]], np.array(start)
        for level in levels:
            parts.append(solve(times, state, level)[:, 1:])
            state = parts[-1][:, -1]
        return np.concatenate(parts, axis=1)

    return whole


def by_odeint(plant: Plant, levels, held: int):
    """scipy's odeint (LSODA) on equations that numba compiles."""

    @numba.njit(error_model="numpy")
    def right_hand_side(z, t, x):
        return np.array(slopes(plant, (z[0], z[1], z[2], z[3]), x, either, signed_root))

    def solve(times, state, level):
        return odeint(right_hand_side, state, times, args=(level,), rtol=RTOL, atol=ATOL).T

    return in_segments(solve, levels, held)


def by_sundials(plant: Plant, levels, held: int):
    """scikit-sundae's CVODE (BDF) on equations that numba compiles."""
    from sksundae.cvode import CVODE

    @numba.njit(error_model="numpy")
    def fill(z, dz, x):
        dz[0], dz[1], dz[2], dz[3] = slopes(plant, (z[0], z[1], z[2], z[3]), x, either, signed_root)

    def solve(times, state, level):
        return (
            CVODE(lambda t, z, dz: fill(z, dz, level), rtol=RTOL, atol=ATOL).solve(times, state).y.T
        )

    return in_segments(solve, levels, held)


def by_casadi(plant: Plant, levels, held: int):
    """CasADi's CVODES, scaled states."""
    import casadi

    z, x = casadi.SX.sym("z", 4), casadi.SX.sym("x")
    rates = casadi.vertcat(
        *slopes(plant, casadi.vertsplit(z * _SCALE), x, casadi.if_else, casadi_root)
    )
    field = {"x": z, "p": x, "ode": rates / _SCALE}
    options = {"reltol": RTOL, "abstol": 1e-8}
    cvodes = casadi.integrator("cvodes", "cvodes", field, 0.0, 1e-3 * np.arange(held + 1), options)
    return in_segments(
        lambda _, z, x: np.array(cvodes(x0=z / _SCALE, p=x)["xf"]) * _SCALE[:, None], levels, held
    )


def by_diffrax(plant: Plant, levels, held: int):
    """diffrax: Tsit5 with PIDController, one segment after the other in a compiled scan, double
    precision."""
    import diffrax
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    term = diffrax.ODETerm(lambda t, z, x: jnp.stack(slopes(plant, z, x, jnp.where, jax_root)))
    times = 1e-3 * np.arange(held + 1)

    def segment(z, x):
        found = diffrax.diffeqsolve(
            term,
            diffrax.Tsit5(),
            times[0],
            times[-1],
            1e-5,
            z,
            x,
            saveat=diffrax.SaveAt(ts=times[1:]),
            stepsize_controller=diffrax.PIDController(rtol=RTOL, atol=ATOL),
            adjoint=diffrax.ForwardMode(),
            max_steps=100_000,
        )
        return found.ys[-1], found.ys

    whole = jax.jit(lambda start: jax.lax.scan(segment, start, np.array(levels))[1].reshape(-1, 4))
    return lambda start: np.concatenate([np.array(start)[None], whole(np.array(start))]).T


def by_runge_kutta(plant: Plant, levels, held: int):
    """The classic Runge-Kutta 4 with steps of 0.25 ms, compiled by numba."""
    h = 1e-3 / _SUBSTEPS

    @numba.njit(error_model="numpy")
    def run(times, state, x):
        out = np.empty((4, times.size))
        z = (state[0], state[1], state[2], state[3])
        for k in range(times.size):
            out[0, k], out[1, k], out[2, k], out[3, k] = z
            for _ in range(_SUBSTEPS):
                z = runge_kutta_4(plant, z, x, h, either, signed_root)
        return out

    return in_segments(run, levels, held)
