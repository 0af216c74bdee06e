"""Gains by the convex-concave procedure: the largest integral gain whose loop keeps out of every
limit's set at every model.

For a fixed filter and notch the loop gain is linear in the gains g: L = sum_t g_t phi_t. Each limit
keeps L out of a convex set (see `limits`), and is replaced by the half-plane that touches this set
nearest to the present L. That is a linear program; its solution keeps out of the sets, and becomes
the next L. (Hast, Astrom, Bernhardsson, Boyd: PID design by convex-concave optimization, ECC 2013.)
The half-planes contain the straight path between two iterates, so L never crosses -1 on the way
from a small stable gain: the loop stays stable, which the poles of the sampled closed loop confirm
afterwards.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InfeasibleError
from .limits import Limit

if TYPE_CHECKING:
    from scipy import sparse

_ITERATIONS = 30
_CONVERGED = 1e-4
_FIRST_GAIN = 0.05
_HALVINGS = 40
_CEILING = 1e4
"""a contribution to L, at the median frequency, that no gain of a good loop makes"""
_RETREATS = (0.99, 0.97, 0.9, 0.7, 0.3)
_ROW_TOLERANCE = 1e-7
_NEARLY, _SLACK = 0.003, 0.1
"""so near to binding, one of the `_CANDIDATES` nearest rows, or a local maximum over the rows, may
bind at the next solution"""
_CANDIDATES = 24
_KEPT_ROWS = 100
"""for each limit"""


def _weighted(terms: np.ndarray, gains: np.ndarray) -> np.ndarray:
    """(M, rows): terms (M, rows, t) times gains (M, t), summed over t; for so few t ten times as
    fast as `matmul`."""
    return sum(terms[:, :, t] * gains[:, None, t] for t in range(gains.shape[1]))


@dataclass(frozen=True, eq=False)
class Bounds:
    """Linear bounds rows @ g <= most on the gains g (M, t) at M points: rows (M, m, t), most (M, m)
    above 0."""

    rows: np.ndarray
    most: np.ndarray

    def only(self, term: int) -> Bounds:
        """The bounds on `term` where the other gains are 0."""
        return Bounds(self.rows[:, :, [term]], self.most)

    def exceeded(self, gains: np.ndarray) -> np.ndarray:
        """(M,) bool: at which points a bound is broken."""
        return np.any(_weighted(self.rows, gains) > self.most, axis=1)


@dataclass(frozen=True, eq=False)
class Demands:
    """What L = phi @ g must keep at M points: out of each limit's set, at the rows where it is
    imposed, and g within `bounds`."""

    phi: np.ndarray
    """(M, rows, t) complex: the contribution of each gain to the loop gain at each frequency of
    each model"""
    limits: tuple[Limit, ...]
    imposed: np.ndarray
    """(limits, M, rows) bool"""
    bounds: Bounds

    def only(self, term: int) -> Demands:
        """The demands on `term` where the other gains are 0."""
        return Demands(self.phi[:, :, [term]], self.limits, self.imposed, self.bounds.only(term))

    def intrusions(self, gains: np.ndarray) -> np.ndarray:
        """(limits, M, rows): how far L with `gains` (M, t) lies inside each set; -inf where it is
        not imposed."""
        L = self.loop_gain(gains)
        return np.stack(
            [
                np.where(on, limit.intrusion(L), -np.inf)
                for limit, on in zip(self.limits, self.imposed, strict=True)
            ]
        )

    def loop_gain(self, gains: np.ndarray) -> np.ndarray:
        """(M, rows) complex L with `gains` (M, t)."""
        return _weighted(self.phi, gains)

    def tightest(self, gains: np.ndarray) -> Demands:
        """The demands at those rows of each point whose L comes nearest to each of the sets with
        `gains` (M, t)."""
        if self.phi.shape[1] <= _KEPT_ROWS * len(self.limits):
            return self
        nearest = np.argpartition(-self.intrusions(gains), _KEPT_ROWS, axis=2)[:, :, :_KEPT_ROWS]
        kept = np.sort(np.concatenate(list(nearest), axis=1), axis=1)
        imposed = np.take_along_axis(self.imposed, kept[None], axis=2)
        return Demands(
            np.take_along_axis(self.phi, kept[:, :, None], axis=1),
            self.limits,
            imposed,
            self.bounds,
        )


def small_gains(demands: Demands, *, first: int) -> np.ndarray:
    """(M, t): a small gain on term `first` alone with which L keeps every demand; NaN where none
    does."""
    gains = np.zeros((demands.phi.shape[0], demands.phi.shape[2]))
    gains[:, first] = _FIRST_GAIN / np.abs(demands.phi[:, :, first]).max(axis=1)
    for _ in range(_HALVINGS):
        refused = (demands.intrusions(gains).max(axis=(0, 2)) > 0.0) | demands.bounds.exceeded(
            gains
        )
        if not refused.any():
            return gains
        gains[refused] /= 2.0
    gains[refused] = np.nan
    return gains


def half_of_largest(
    demands: Demands, mix, small: np.ndarray, term: int, worth: np.ndarray
) -> np.ndarray:
    """(N, t): half the largest gain that `term` may have alone, found from `small` (N, t); the
    other gains are 0.

    In an integrating loop the crossover then lies inside the grid, so that low frequencies are
    outside the unit circle.
    """
    gains = np.zeros_like(small)
    gains[:, [term]] = largest_gains(demands.only(term), mix, small[:, [term]], 0, worth) / 2.0
    return gains


def retreat(
    demands: Demands, mix, gains: np.ndarray, find_safe: Callable[[], np.ndarray]
) -> np.ndarray:
    """(N, t): `gains`, drawn towards `find_safe()` (N, t), then 0, at the nodes that put L clearly
    inside a set, until it is out.

    From inside, the half-planes need not allow any gains at all.
    """

    def inside(gains):
        depth = demands.intrusions(mix @ gains).max(axis=2)
        return mix.T @ (depth > [[limit.shallow] for limit in demands.limits]).any(axis=0) > 0.0

    nodes, start = inside(gains), gains
    if not nodes.any():
        return gains
    safe, gains = find_safe(), gains.copy()
    for nearer in (
        *(safe + share * (start - safe) for share in _RETREATS),
        *(0.5**k * safe for k in range(_HALVINGS)),
    ):
        gains[nodes] = nearer[nodes]
        nodes = inside(gains)
        if not nodes.any():
            break
    return gains


def largest_gains(
    demands: Demands, mix, start: np.ndarray, objective: int, worth: np.ndarray
) -> np.ndarray:
    """Gains g >= 0 (N, t) that maximize worth @ (mix @ g)[:, objective] while mix @ g keeps the
    demands; from `start` (N, t).

    `mix` (M, N) sparse: how the gains at the points follow from those at the nodes (the identity
    where each point is a node, a column of ones for one fixed regulator). Raises InfeasibleError
    where the linear program cannot be solved.
    """
    gains, size = start, np.abs(demands.phi)
    column = (mix.T @ np.median(size, axis=1)) / (mix.T @ np.ones((len(size), 1)))
    local = mix @ column
    for _ in range(_ITERATIONS):
        present = mix @ gains
        rows, most = _half_planes(demands, local, present)
        gains = _Program(rows, most, mix, column).solve(mix.T @ worth, objective, present)
        before, after = present[:, objective], (mix @ gains)[:, objective]
        if np.all(np.abs(after - before) <= _CONVERGED * after):
            break
    return gains


def _half_planes(demands: Demands, local, present):
    """(rows, most) of rows @ g <= most: the half-planes that touch each set nearest to L with gains
    `present` (M, t), then the bounds; each row is of size one in the variables g * local."""
    L, normals, bounds = demands.loop_gain(present), [demands.bounds.rows], [demands.bounds.most]
    for limit, on in zip(demands.limits, demands.imposed, strict=True):
        normal, least = limit.half_planes(L)
        normals.append(-(normal.conj()[:, :, None] * demands.phi).real)
        bounds.append(np.where(on, -least, np.inf))
    rows, most = np.concatenate(normals, axis=1), np.concatenate(bounds, axis=1)
    scale = np.abs(rows / local[:, None, :]).max(axis=2)
    return rows / scale[:, :, None], most / scale


@dataclass(frozen=True)
class _Program:
    """rows[m, r] @ (mix @ g)[m] <= most[m, r] and g >= 0, in the variables g * column of size
    one."""

    rows: np.ndarray
    most: np.ndarray
    mix: sparse.csr_array
    column: np.ndarray

    def solve(self, worth: np.ndarray, objective: int, present: np.ndarray) -> np.ndarray:
        """g (N, t): the largest worth @ g[:, objective].

        Of thousands of rows only a handful binds: the working set begins with those that nearly
        bind at gains `present`, and violated rows join it until none is left.
        """
        from scipy.optimize import LinearConstraint

        cost = np.zeros(self.column.shape)
        cost[:, objective] = -worth / self.column[:, objective]
        cost /= np.abs(cost).max()
        excess = self._excess(present)
        working = (_highest(excess, _CANDIDATES) & (excess > -_NEARLY)) | (
            _peaks(excess) & (excess > -_SLACK)
        )
        while True:
            rows = LinearConstraint(self._matrix(working), ub=self.most[working])
            gains = _solution(cost.T.ravel(), rows).reshape(cost.T.shape).T / self.column
            excess = self._excess(self.mix @ gains)
            violated = _peaks(np.where(working, 0.0, excess)) & (excess > _ROW_TOLERANCE)
            if not (violated & ~working).any():
                return gains
            working = working | violated

    def _excess(self, gains):
        return _weighted(self.rows, gains) - self.most

    def _matrix(self, working):
        """The rows of the working set over all variables, term by term."""
        from scipy import sparse

        point, row = np.nonzero(working)
        mixed = self.mix[point]
        owner = np.repeat(np.arange(point.size), np.diff(mixed.indptr))
        values = self.rows[point, row][owner] * mixed.data[:, None] / self.column[mixed.indices]
        nodes, terms = self.column.shape
        variable = mixed.indices[:, None] + nodes * np.arange(terms)
        place = np.repeat(owner, terms), variable.ravel()
        return sparse.csr_array((values.ravel(), place), shape=(point.size, nodes * terms))


def _solution(cost: np.ndarray, rows) -> np.ndarray:
    """The variables from 0 to the ceiling with the least cost, by HiGHS (`milp` without integers
    skips much of `linprog`).

    HiGHS is quickest without presolving, and surest with it.
    """
    from scipy.optimize import Bounds, milp

    for presolve in (False, True):
        solved = milp(
            cost, constraints=rows, bounds=Bounds(0.0, _CEILING), options={"presolve": presolve}
        )
        if solved.x is not None:
            return solved.x
    raise InfeasibleError(
        f"The linear program of the tuner has no solution: {solved.message} Relax a limit or move"
        " the points."
    )


def _highest(values, count: int) -> np.ndarray:
    """True at the `count` largest values along the last axis."""
    if values.shape[-1] <= count:
        return np.ones(values.shape, dtype=bool)
    return values >= np.partition(values, -count, axis=-1)[..., [-count]]


def _peaks(values) -> np.ndarray:
    """True at the local maxima along the last axis."""
    padded = np.pad(values, ((0, 0), (1, 1)), constant_values=-np.inf)
    return (values >= padded[:, :-2]) & (values > padded[:, 2:])
