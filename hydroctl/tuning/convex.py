"""Gains by the convex-concave procedure: the largest integral gain whose loop keeps the Ms and Mt circles at every model.

For a fixed filter and notch the loop gain is linear in the gains g: L = sum_t g_t phi_t. Both limits keep L out of a circle,

    |1 + L| >= 1/Ms          |L + c| >= r,   c = Mt^2/(Mt^2 - 1),  r = Mt/(Mt^2 - 1)

and each is replaced by the half-plane that touches its circle nearest to the present L. That is a linear program; its solution
is feasible for the circles, and becomes the next L. (Hast, Astrom, Bernhardsson, Boyd: PID design by convex-concave
optimization, ECC 2013.) The half-planes contain the straight path between two iterates, so L never crosses -1 on the way from
a small stable gain: the loop stays stable, which the poles of the sampled closed loop confirm afterwards.
"""

from __future__ import annotations

import numpy as np

_ITERATIONS = 30
_CONVERGED = 1e-4
_FIRST_GAIN = 0.05
_HALVINGS = 40
_CEILING = 1e3
_ROW_TOLERANCE = 1e-7


def circles(Ms: float, Mt: float) -> list[tuple[float, float]]:
    """(centre, radius) on the real axis of the circles that L must stay out of."""
    return [(-1.0, 1.0 / Ms), (-(Mt**2) / (Mt**2 - 1.0), Mt / (Mt**2 - 1.0))]


def small_gains(phi: np.ndarray, limits: list[tuple[float, float]], *, first: int) -> np.ndarray | None:
    """A small gain on term `first` alone with which L = phi @ g stays out of all circles; None where there is none."""
    gains = np.zeros(phi.shape[1])
    gains[first] = _FIRST_GAIN / np.abs(phi[:, first]).max()
    for _ in range(_HALVINGS):
        L = phi @ gains
        if all(np.abs(L - centre).min() >= radius for centre, radius in limits):
            return gains
        gains = gains / 2.0
    return None


def largest_gains(phi: np.ndarray, gains: np.ndarray, objective: int, limits: list[tuple[float, float]]) -> np.ndarray:
    """Gains g >= 0 (t,) that maximize g[objective] with L = phi @ g outside all circles, from `gains`; phi (rows, t) complex."""
    column = np.median(np.abs(phi), axis=0)
    ceiling = _CEILING * column / np.abs(phi).min(axis=0)
    working = np.zeros(0, dtype=int)
    for _ in range(_ITERATIONS):
        rows, bounds = _half_planes(phi / column, phi @ gains, limits)
        scaled, working = _linear_program(rows, bounds, objective, ceiling, working)
        change = abs(scaled[objective] / column[objective] - gains[objective])
        gains = scaled / column
        if change <= _CONVERGED * gains[objective]:
            break
    return gains


def _half_planes(phi, present, limits):
    """(rows, bounds) of rows @ g <= bounds: the half-planes that touch each circle nearest to `present`."""
    rows, bounds = [], []
    for centre, radius in limits:
        offset = present - centre
        normal = (offset / np.abs(offset)).conj()
        rows.append(-(normal[:, None] * phi).real)
        bounds.append(-(normal * centre).real - radius)
    rows, bounds = np.concatenate(rows), np.concatenate(bounds)
    scale = np.abs(rows).max(axis=1)
    return rows / scale[:, None], bounds / scale


def _linear_program(rows, bounds, objective: int, ceiling, working):
    """(g, working): max g[objective] with rows @ g <= bounds and 0 <= g <= ceiling.

    Of thousands of rows only a handful binds: violated rows join a working set until none is left.
    """
    from scipy.optimize import linprog

    cost = np.zeros(rows.shape[1])
    cost[objective] = -1.0
    box = np.stack([np.zeros_like(ceiling), ceiling], axis=-1)
    while True:
        solved = linprog(cost, A_ub=rows[working], b_ub=bounds[working], bounds=box, method="highs")
        if solved.x is None:
            raise RuntimeError(f"the linear program of the tuner failed: {solved.message}")
        excess = rows @ solved.x - bounds
        excess[working] = 0.0
        violated = _local_maxima(excess, _ROW_TOLERANCE)
        if violated.size == 0:
            return solved.x, working
        working = np.concatenate([working, violated])


def _local_maxima(values, floor) -> np.ndarray:
    """Indices of the peaks of `values` above `floor`."""
    padded = np.concatenate([[-np.inf], values, [-np.inf]])
    return np.nonzero((values > floor) & (values >= padded[:-2]) & (values > padded[2:]))[0]
