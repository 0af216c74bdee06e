"""Gains by the convex-concave procedure: the largest integral gain whose loop keeps the Ms and Mt circles at every model.

For a fixed filter and notch the loop gain is linear in the gains g: L = sum_t g_t phi_t. Both limits keep L out of a circle,

    |1 + L| >= 1/Ms          |L + c| >= r,   c = Mt^2/(Mt^2 - 1),  r = Mt/(Mt^2 - 1)

and each is replaced by the half-plane that touches its circle nearest to the present L. That is a linear program; its solution
is feasible for the circles, and becomes the next L. (Hast, Astrom, Bernhardsson, Boyd: PID design by convex-concave
optimization, ECC 2013.) The half-planes contain the straight path between two iterates, so L never crosses -1 on the way from
a small stable gain: the loop stays stable, which the poles of the sampled closed loop confirm afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from scipy import sparse

_ITERATIONS = 30
_CONVERGED = 1e-4
_FIRST_GAIN = 0.05
_HALVINGS = 40
_CEILING = 1e3
_ROW_TOLERANCE = 1e-7
_SLACK = 0.1
_KEPT_ROWS = 200


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


def largest_gains(phi: np.ndarray, mix, start: np.ndarray, objective: int, worth: np.ndarray, limits) -> np.ndarray:
    """Gains g >= 0 (N, t) that maximize worth @ (mix @ g)[:, objective] with L = phi @ (mix @ g) outside all circles.

    `phi` (M, rows, t) complex: the contribution of each gain to the loop gain at each frequency of each model, at M points;
    `mix` (M, N) sparse: how the gains at the points follow from those at the nodes (the identity where each point is a node, a
    column of ones for one fixed regulator); `start` (N, t).
    """
    gains = start
    column = (mix.T @ np.median(np.abs(phi), axis=1)) / (mix.T @ np.ones((len(phi), 1)))
    local = mix @ column
    ceiling = _CEILING * np.min(mix.T @ (np.abs(phi).max(axis=1) / np.abs(phi).min(axis=1)), axis=0) * np.ones_like(gains)
    working = np.zeros((len(phi), len(limits) * phi.shape[1]), dtype=bool)
    for _ in range(_ITERATIONS):
        present = mix @ gains
        rows, bounds = _half_planes(phi / local[:, None, :], _loop_gain(phi, present), limits)
        program = _Program(rows * local[:, None, :], bounds, mix, column, ceiling)
        gains, working = program.solve(mix.T @ worth, objective, working)
        before, after = present[:, objective], (mix @ gains)[:, objective]
        if np.all(np.abs(after - before) <= _CONVERGED * after):
            break
    return gains


def tightest(phi: np.ndarray, gains: np.ndarray, limits) -> np.ndarray:
    """(M, kept, t): of each point's rows those whose L comes nearest to a circle with `gains` (M, t)."""
    if phi.shape[1] <= _KEPT_ROWS:
        return phi
    L = _loop_gain(phi, gains)
    distance = np.min([np.abs(L - centre) - radius for centre, radius in limits], axis=0)
    kept = np.argpartition(distance, _KEPT_ROWS, axis=1)[:, :_KEPT_ROWS]
    return np.take_along_axis(phi, np.sort(kept, axis=1)[:, :, None], axis=1)


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


@dataclass(frozen=True)
class _Program:
    """rows[m, r] @ (mix @ g)[m] <= bounds[m, r] and g >= 0, in the variables g * column of size one, each below `ceiling`."""

    rows: np.ndarray
    bounds: np.ndarray
    mix: sparse.csr_array
    column: np.ndarray
    ceiling: np.ndarray

    def solve(self, worth: np.ndarray, objective: int, working: np.ndarray):
        """(g, working): the largest worth @ g[:, objective].

        Of thousands of rows only a handful binds: violated rows join the working set (M, rows) until none is left; those far
        from binding then leave it.
        """
        from scipy.optimize import linprog

        cost = np.zeros(self.column.shape)
        cost[:, objective] = -worth / self.column[:, objective]
        cost /= np.abs(cost).max()
        box = np.stack([np.zeros(cost.size), self.ceiling.T.ravel()], axis=-1)
        while True:
            solved = linprog(cost.T.ravel(), A_ub=self._matrix(working), b_ub=self.bounds[working], bounds=box, method="highs")
            if solved.x is None:
                raise RuntimeError(f"the linear program of the tuner failed: {solved.message}")
            gains = solved.x.reshape(cost.T.shape).T / self.column
            excess = (self.rows @ (self.mix @ gains)[:, :, None])[:, :, 0] - self.bounds
            violated = _peaks(np.where(working, 0.0, excess)) & (excess > _ROW_TOLERANCE)
            if not (violated & ~working).any():
                return gains, working & (excess > -_SLACK)
            working = working | violated

    def _matrix(self, working):
        from scipy import sparse

        point, row = np.nonzero(working)
        mix = self.mix[point]
        blocks = [
            sparse.diags_array(self.rows[point, row, t]) @ mix @ sparse.diags_array(1.0 / self.column[:, t])
            for t in range(self.rows.shape[2])
        ]
        return sparse.hstack(blocks, format="csr")


def _peaks(values) -> np.ndarray:
    """True at the local maxima along the last axis."""
    padded = np.pad(values, ((0, 0), (1, 1)), constant_values=-np.inf)
    return (values >= padded[:, :-2]) & (values > padded[:, 2:])
