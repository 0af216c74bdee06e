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
_SLACK = 0.1


def circles(Ms: float, Mt: float) -> list[tuple[float, float]]:
    """(centre, radius) on the real axis of the circles that L must stay out of."""
    return [(-1.0, 1.0 / Ms), (-(Mt**2) / (Mt**2 - 1.0), Mt / (Mt**2 - 1.0))]


def small_gains(phi: np.ndarray, limits: list[tuple[float, float]], *, first: int) -> np.ndarray:
    """(N, t): a small gain on term `first` alone with which L stays out of all circles; NaN where there is none."""
    gains = np.zeros((phi.shape[0], phi.shape[2]))
    gains[:, first] = _FIRST_GAIN / np.abs(phi[:, :, first]).max(axis=1)
    for _ in range(_HALVINGS):
        L = _loop_gain(phi, gains)
        inside = np.any([np.abs(L - centre).min(axis=1) < radius for centre, radius in limits], axis=0)
        if not inside.any():
            return gains
        gains[inside] /= 2.0
    gains[inside] = np.nan
    return gains


def largest_gains(phi: np.ndarray, gains: np.ndarray, objective: int, limits: list[tuple[float, float]]) -> np.ndarray:
    """Gains g >= 0 (N, t) that maximize g[:, objective] with L = phi @ g outside all circles, for N designs at once.

    `phi` (N, rows, t) complex: the contribution of each gain to the loop gain at each frequency of each model; `gains` (N, t):
    where to start.
    """
    gains = gains.copy()
    column = np.median(np.abs(phi), axis=1)
    ceiling = _CEILING * column / np.abs(phi).min(axis=1)
    scaled = phi / column[:, None, :]
    working = np.zeros((phi.shape[0], len(limits) * phi.shape[1]), dtype=bool)
    active = np.arange(phi.shape[0])
    for _ in range(_ITERATIONS):
        rows, bounds = _half_planes(scaled[active], _loop_gain(phi[active], gains[active]), limits)
        improved, working[active] = _linear_programs(rows, bounds, objective, ceiling[active], working[active])
        improved /= column[active]
        change = np.abs(improved[:, objective] - gains[active, objective])
        gains[active] = improved
        active = active[change > _CONVERGED * improved[:, objective]]
        if active.size == 0:
            break
    return gains


def _loop_gain(phi, gains):
    return (phi @ gains[:, :, None])[:, :, 0]


def _half_planes(phi, present, limits):
    """(rows, bounds) of rows @ g <= bounds: the half-planes that touch each circle nearest to `present`."""
    rows, bounds = [], []
    for centre, radius in limits:
        offset = present - centre
        normal = (offset / np.abs(offset)).conj()
        rows.append(-(normal[:, :, None] * phi).real)
        bounds.append(-(normal * centre).real - radius)
    rows, bounds = np.concatenate(rows, axis=1), np.concatenate(bounds, axis=1)
    scale = np.abs(rows).max(axis=2)
    return rows / scale[:, :, None], bounds / scale


def _linear_programs(rows, bounds, objective: int, ceiling, working):
    """(g, working): for each design max g[objective] with rows @ g <= bounds and 0 <= g <= ceiling.

    Of thousands of rows only a handful binds: violated rows join the working set (N, rows) until none is left; those far from
    binding then leave it. The designs are the blocks of one sparse program.
    """
    from scipy.optimize import linprog
    from scipy.sparse import csr_array

    designs, _, terms = rows.shape
    cost = np.zeros((designs, terms))
    cost[:, objective] = -1.0
    box = np.stack([np.zeros(designs * terms), ceiling.ravel()], axis=-1)
    while True:
        design, row = np.nonzero(working)
        columns = design[:, None] * terms + np.arange(terms)
        starts = np.arange(design.size + 1) * terms
        A = csr_array((rows[design, row].ravel(), columns.ravel(), starts), shape=(design.size, designs * terms))
        solved = linprog(cost.ravel(), A_ub=A, b_ub=bounds[design, row], bounds=box, method="highs")
        if solved.x is None:
            raise RuntimeError(f"the linear program of the tuner failed: {solved.message}")
        gains = solved.x.reshape(designs, terms)
        excess = (rows @ gains[:, :, None])[:, :, 0] - bounds
        violated = _peaks(np.where(working, 0.0, excess)) & (excess > _ROW_TOLERANCE)
        if not (violated & ~working).any():
            return gains, working & (excess > -_SLACK)
        working = working | violated


def _peaks(values) -> np.ndarray:
    """True at the local maxima along the last axis."""
    padded = np.pad(values, ((0, 0), (1, 1)), constant_values=-np.inf)
    return (values >= padded[:, :-2]) & (values > padded[:, 2:])
