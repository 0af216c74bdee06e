"""Gains by the convex-concave procedure: the largest integral gain whose loop keeps out of every limit's set at every model.

For a fixed filter and notch the loop gain is linear in the gains g: L = sum_t g_t phi_t. Each limit keeps L out of a convex set
(see `limits`), and is replaced by the half-plane that touches this set nearest to the present L. That is a linear program; its
solution keeps out of the sets, and becomes the next L. (Hast, Astrom, Bernhardsson, Boyd: PID design by convex-concave
optimization, ECC 2013.) The half-planes contain the straight path between two iterates, so L never crosses -1 on the way from
a small stable gain: the loop stays stable, which the poles of the sampled closed loop confirm afterwards.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from .limits import Limit

if TYPE_CHECKING:
    from scipy import sparse

_ITERATIONS = 30
_CONVERGED = 1e-4
_FIRST_GAIN = 0.05
_HALVINGS = 40
_CEILING = 1e3
_SHALLOW = 0.005
"""so little inside a set, L need not retreat"""
_RETREATS = (0.99, 0.97, 0.9, 0.7, 0.3)
_ROW_TOLERANCE = 1e-7
_SLACK = 0.1
_KEPT_ROWS = 100
"""for each limit"""


@dataclass(frozen=True, eq=False)
class Bounds:
    """Linear bounds rows @ g <= most on the gains g (M, t) at M points: rows (M, m, t), most (M, m) above 0."""

    rows: np.ndarray
    most: np.ndarray

    def only(self, term: int) -> Bounds:
        """The bounds on `term` where the other gains are 0."""
        return Bounds(self.rows[:, :, [term]], self.most)

    def exceeded(self, gains: np.ndarray) -> np.ndarray:
        """(M,) bool: at which points a bound is broken."""
        return ((self.rows @ gains[:, :, None])[:, :, 0] > self.most).any(axis=1)


def small_gains(phi: np.ndarray, limits: list[Limit], bounds: Bounds, *, first: int) -> np.ndarray:
    """(M, t): a small gain on term `first` alone with which L is outside all sets and within `bounds`; NaN where none is."""
    gains = np.zeros((phi.shape[0], phi.shape[2]))
    gains[:, first] = _FIRST_GAIN / np.abs(phi[:, :, first]).max(axis=1)
    for _ in range(_HALVINGS):
        refused = (_intrusion(phi, gains, limits) > 0.0) | bounds.exceeded(gains)
        if not refused.any():
            return gains
        gains[refused] /= 2.0
    gains[refused] = np.nan
    return gains


def half_of_largest(phi, mix, small: np.ndarray, term: int, worth: np.ndarray, limits: list[Limit], bounds: Bounds) -> np.ndarray:
    """(N, t): half the largest gain that `term` may have alone, found from `small` (N, t); the other gains are 0.

    In an integrating loop the crossover then lies inside the grid, so that low frequencies are outside the unit circle.
    """
    gains = np.zeros_like(small)
    gains[:, [term]] = largest_gains(phi[:, :, [term]], mix, small[:, [term]], 0, worth, limits, bounds.only(term)) / 2.0
    return gains


def retreat(phi: np.ndarray, mix, gains: np.ndarray, safe: np.ndarray, limits: list[Limit]) -> np.ndarray:
    """(N, t): `gains`, drawn towards `safe` (N, t) at the nodes that put L clearly inside a set, as far as it takes to leave.

    From inside, the half-planes need not allow any gains at all.
    """
    gains = gains.copy()
    for share in (*_RETREATS, *np.zeros(len(gains))):
        nodes = mix.T @ (_intrusion(phi, mix @ gains, limits) > _SHALLOW) > 0.0
        if not nodes.any():
            break
        gains[nodes] = safe[nodes] + share * (gains[nodes] - safe[nodes])
    return gains


def largest_gains(
    phi: np.ndarray, mix, start: np.ndarray, objective: int, worth: np.ndarray, limits: list[Limit], bounds: Bounds
) -> np.ndarray:
    """Gains g >= 0 (N, t) that maximize worth @ (mix @ g)[:, objective] with L = phi @ (mix @ g) outside all sets and mix @ g
    within `bounds`.

    `phi` (M, rows, t) complex: the contribution of each gain to the loop gain at each frequency of each model, at M points;
    `mix` (M, N) sparse: how the gains at the points follow from those at the nodes (the identity where each point is a node, a
    column of ones for one fixed regulator); `start` (N, t).
    """
    gains = start
    column = (mix.T @ np.median(np.abs(phi), axis=1)) / (mix.T @ np.ones((len(phi), 1)))
    local = mix @ column
    scaled_bounds = Bounds(bounds.rows / local[:, None, :], bounds.most)
    ceiling = _CEILING * np.min(mix.T @ (np.abs(phi).max(axis=1) / np.abs(phi).min(axis=1)), axis=0) * np.ones_like(gains)
    working = np.zeros((len(phi), len(limits) * phi.shape[1] + bounds.most.shape[1]), dtype=bool)
    for _ in range(_ITERATIONS):
        present = mix @ gains
        rows, most = _half_planes(phi / local[:, None, :], _loop_gain(phi, present), limits, scaled_bounds)
        program = _Program(rows * local[:, None, :], most, mix, column, ceiling)
        gains, working = program.solve(mix.T @ worth, objective, working)
        before, after = present[:, objective], (mix @ gains)[:, objective]
        if np.all(np.abs(after - before) <= _CONVERGED * after):
            break
    return gains


def tightest(phi: np.ndarray, gains: np.ndarray, limits: list[Limit]) -> np.ndarray:
    """(M, kept, t): of each point's rows those whose L comes nearest to a set with `gains` (M, t)."""
    count = _KEPT_ROWS * len(limits)
    if phi.shape[1] <= count:
        return phi
    L = _loop_gain(phi, gains)
    distance = -np.max([limit.intrusion(L) for limit in limits], axis=0)
    kept = np.argpartition(distance, count, axis=1)[:, :count]
    return np.take_along_axis(phi, np.sort(kept, axis=1)[:, :, None], axis=1)


def _loop_gain(phi, gains):
    return (phi @ gains[:, :, None])[:, :, 0]


def _intrusion(phi, gains, limits) -> np.ndarray:
    """(M,): how far L goes into a set, at the worst frequency of any model."""
    L = _loop_gain(phi, gains)
    return np.max([limit.intrusion(L).max(axis=1) for limit in limits], axis=0)


def _half_planes(phi, present, limits, bounds: Bounds):
    """(rows, most) of rows @ g <= most: the half-planes that touch each set nearest to `present`, then `bounds`."""
    rows, most = [], []
    for limit in limits:
        normal, least = limit.half_planes(present)
        rows.append(-(normal.conj()[:, :, None] * phi).real)
        most.append(-least)
    rows, most = np.concatenate([*rows, bounds.rows], axis=1), np.concatenate([*most, bounds.most], axis=1)
    scale = np.abs(rows).max(axis=2)
    return rows / scale[:, :, None], most / scale


@dataclass(frozen=True)
class _Program:
    """rows[m, r] @ (mix @ g)[m] <= most[m, r] and g >= 0, in the variables g * column of size one, each below `ceiling`."""

    rows: np.ndarray
    most: np.ndarray
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
            solved = linprog(cost.T.ravel(), A_ub=self._matrix(working), b_ub=self.most[working], bounds=box, method="highs")
            if solved.x is None:
                raise RuntimeError(f"the linear program of the tuner failed: {solved.message}")
            gains = solved.x.reshape(cost.T.shape).T / self.column
            excess = (self.rows @ (self.mix @ gains)[:, :, None])[:, :, 0] - self.most
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
