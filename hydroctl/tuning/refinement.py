"""Gains that keep every limit at every frequency, from linear programs that see some frequencies
only.

The tuner begins on a grid of frequencies, and subdivides it where L comes nearest to a limit's set.
The frequencies at which the result still breaks a limit join the grid until none does. A gain or
phase margin is imposed near the crossings that miss it, on a finer grid.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ..digits import apart
from ..errors import InfeasibleError
from ..loop.margins import Crossings, Loop, analyse, peaks
from ..loop.sampled_plant import frequency_grid
from ..regulator.structures import Regulators
from ..specification import Specification
from .convex import Demands, half_of_largest, largest_gains, retreat, small_gains
from .limits import Disc, Limit, Segment, limits_of, phrase
from .nodes import mixing_matrix
from .task import Task

if TYPE_CHECKING:
    from scipy import sparse

_ROUNDS = 10
_NEAR = 0.35
"""relative change of gains after which the same frequencies stay the critical ones"""
_NEAREST = 8
_PARTS = 8
_WINDOW = 1.5
_ACROSS = 81
"""frequencies throughout the window of a margin: with few of them L crosses the thin set of a phase
margin between two"""
_TOLERANCE = {"Ms": 2.5e-5, "Mt": 2.5e-5, "gain_margin": 1e-4, "phase_margin": 1e-4}
"""how far L may enter the sets of Ms and Mt (1e-4 of either at most), and what may lack of the
margins (relative, rad)"""
_DISTANT = -0.05
"""so far outside a set on the grid, L is outside between its frequencies too"""


@dataclass(frozen=True, eq=False)
class Problem:
    """Gains at the nodes of `mix` (points, N) for all points of a task, whose notches stand at
    `notch_frequency` (nx, ny)."""

    task: Task
    notch_frequency: np.ndarray
    mix: sparse.csr_array
    worth: np.ndarray
    """(points,) what the gain that is maximized weighs at each"""

    @classmethod
    def pointwise(cls, task: Task) -> Problem:
        """Every point with gains of its own."""
        points = task.notch_frequency.size
        return cls(
            task,
            task.notch_frequency,
            mixing_matrix(task.x, task.y, task.x, task.y),
            np.ones(points),
        )

    def regulators(self, gains: np.ndarray) -> Regulators:
        """The regulators (nx, ny) at the points with gains (N, t) at the nodes."""
        return self.task.regulators(self.mix @ gains, self.notch_frequency)

    def loops(self, gains: np.ndarray) -> Loop:
        """The loops (variants, nx, ny) with gains (N, t)."""
        return Loop(self.task.plants, self.regulators(gains).broadcast_to(self.task.plants.shape))

    def demands(self, omega: np.ndarray, windows: dict[str, np.ndarray]) -> Demands:
        """What L must keep at omega (variants, nx, ny, n); a limit with a window (variants, nx, ny,
        2) only inside it, in rad/s."""
        limits = limits_of(self.task.specification)
        phi = self.task.terms(self.notch_frequency, omega)
        everywhere = np.ones(omega.shape, dtype=bool)
        inside = {
            name: (window[..., :1] <= omega) & (omega <= window[..., 1:])
            for name, window in windows.items()
        }
        imposed = [self.task.by_point(inside.get(name, everywhere)) for name in limits]
        return Demands(
            phi, tuple(limits.values()), np.stack(imposed), self.task.bounds(self.notch_frequency)
        )

    def safe_gains(self) -> np.ndarray:
        """(N, t): small gains with which every point keeps Ms, Mt and the bounds."""
        small = small_gains(
            self.demands(frequency_grid(self.task.plants), self.closed_windows()),
            first=self.task.first,
        )
        return np.array([small[column.nonzero()[0]].min(axis=0) for column in self.mix.toarray().T])

    def closed_windows(self) -> dict[str, np.ndarray]:
        """Of every limit beside Ms and Mt: imposed nowhere."""
        nowhere = np.broadcast_to([np.inf, -np.inf], (*self.task.plants.shape, 2))
        return {
            name: nowhere for name in limits_of(self.task.specification) if name not in ("Ms", "Mt")
        }


def rough_gains(problem: Problem) -> np.ndarray:
    """(N, t): the largest gains with Ms and Mt on the first grid of frequencies."""
    demands = problem.demands(frequency_grid(problem.task.plants), problem.closed_windows())
    return largest_gains(
        demands, problem.mix, problem.safe_gains(), problem.task.objective, problem.worth
    )


def exact_gains(problem: Problem, start: np.ndarray) -> np.ndarray:
    """(N, t): the largest gains that keep every limit at every frequency, from `start` (N, t), of
    stable loops.

    Raises InfeasibleError that names the limit, point and plant where the last round still breaks
    one or a loop is unstable.
    """
    task, windows = problem.task, problem.closed_windows()
    omega = _subdivided(problem, frequency_grid(task.plants), start)
    gains, find_safe = start, partial(_safe, problem, omega)
    for _ in range(_ROUNDS):
        demands = problem.demands(omega, windows)
        outside = retreat(demands, problem.mix, gains, find_safe)
        gains = _larger(problem, demands, outside, seen=np.allclose(outside, gains, rtol=_NEAR))
        found = _shortfalls(problem.loops(gains), limits_of(task.specification), omega)
        if all((shortfall.worst <= _TOLERANCE[name]).all() for name, shortfall in found.items()):
            break
        windows = {name: found[name].widened(window) for name, window in windows.items()}
        more = [
            found[name].across(window, highest=omega[..., -1:]) for name, window in windows.items()
        ]
        worst = [shortfall.omega[..., None] for shortfall in found.values()]
        omega = np.sort(np.concatenate([omega, *worst, *more], axis=-1), axis=-1)
    _require_kept(problem, gains, found)
    return gains


def _larger(problem: Problem, demands: Demands, gains: np.ndarray, *, seen: bool) -> np.ndarray:
    """(N, t): the largest gains from `gains`, of which `seen` says that near them the critical
    frequencies are known: then they are found on the tightest rows, unless they come out so far
    away that other rows may count there."""
    mix, objective, worth = problem.mix, problem.task.objective, problem.worth
    if seen:
        found = largest_gains(demands.tightest(mix @ gains), mix, gains, objective, worth)
        if np.allclose(found, gains, rtol=_NEAR):
            return found
    return largest_gains(demands, mix, gains, objective, worth)


def _safe(problem: Problem, omega: np.ndarray) -> np.ndarray:
    """Gains (N, t) towards which a limit's set can be left: small ones, but kp alone of a position
    loop, because less of both gains brings L of a double integrator nearer to -1."""
    task, small = problem.task, problem.safe_gains()
    if task.first == task.objective:
        return small
    return half_of_largest(
        problem.demands(omega, problem.closed_windows()),
        problem.mix,
        small,
        task.first,
        problem.worth,
    )


def _subdivided(problem: Problem, omega: np.ndarray, gains: np.ndarray) -> np.ndarray:
    """omega (variants, nx, ny, n) with more frequencies in those intervals of each plant where L
    comes nearest to a set."""
    L = problem.loops(gains).frequency_response(omega)
    limits = limits_of(problem.task.specification)
    depth = np.max([limits[name].intrusion(L) for name in ("Ms", "Mt")], axis=0)
    depth = np.maximum(depth[..., :-1], depth[..., 1:])
    start = np.argpartition(-depth, _NEAREST, axis=-1)[..., :_NEAREST]
    low, high = (np.take_along_axis(omega, start + step, axis=-1)[..., None] for step in (0, 1))
    between = low + (high - low) * np.arange(1, _PARTS) / _PARTS
    return np.sort(
        np.concatenate([omega, between.reshape(*omega.shape[:-1], -1)], axis=-1), axis=-1
    )


@dataclass(frozen=True, eq=False)
class _Shortfall:
    """By how much one limit is broken in each loop (variants, nx, ny), positive where it is, and
    where."""

    worst: np.ndarray
    omega: np.ndarray
    """rad/s of the worst"""
    lowest: np.ndarray
    """rad/s of the lowest crossing that breaks the limit; infinite where none does"""
    highest: np.ndarray
    """rad/s of the highest; minus infinity where none does"""

    def widened(self, window: np.ndarray) -> np.ndarray:
        """`window` (variants, nx, ny, 2), made to hold what lies around the crossings that break
        the limit."""
        low, high = window[..., 0], window[..., 1]
        return np.stack(
            [np.minimum(low, self.lowest / _WINDOW), np.maximum(high, self.highest * _WINDOW)],
            axis=-1,
        )

    def across(self, window: np.ndarray, highest: np.ndarray) -> np.ndarray:
        """(variants, nx, ny, n) rad/s: frequencies throughout `window` (variants, nx, ny, 2), but
        not above `highest`, of the loops that break the limit; of the others `omega` alone."""
        low, high = window[..., :1], np.minimum(window[..., 1:], highest)
        across = np.repeat(self.omega[..., None], _ACROSS, axis=-1)
        broken = np.isfinite(self.lowest)
        across[broken] = low[broken] * (high[broken] / low[broken]) ** np.linspace(
            0.0, 1.0, _ACROSS
        )
        return across


def _shortfalls(loops: Loop, limits: dict[str, Limit], omega: np.ndarray) -> dict[str, _Shortfall]:
    """Every limit's, from the loops near the grid omega (variants, nx, ny, n)."""
    values, where = peaks(
        loops, [limits[name].intrusion for name in ("Ms", "Mt")], omega=omega, floor=_DISTANT
    )
    never = np.full(loops.shape, np.inf)
    found = {
        name: _Shortfall(values[..., i], where[..., i], never, -never)
        for i, name in enumerate(("Ms", "Mt"))
    }
    if len(limits) == len(found):
        return found
    margins = analyse(loops, omega)
    if isinstance(disc := limits.get("gain_margin"), Disc):
        crossings = margins.phase_crossings.select(lambda response: np.abs(response) < 1.0)
        lacking = 1.0 - 1.0 / np.abs(crossings.response) / disc.gain_margin
        found["gain_margin"] = _crossing_shortfall(crossings, lacking, omega)
    if isinstance(segment := limits.get("phase_margin"), Segment):
        lacking = segment.phase_margin - np.abs(margins.gain_crossings.phase_margins())
        found["phase_margin"] = _crossing_shortfall(margins.gain_crossings, lacking, omega)
    return found


def _crossing_shortfall(crossings: Crossings, lacking: np.ndarray, omega: np.ndarray) -> _Shortfall:
    """`lacking` of each crossing, brought to the loops it belongs to; a loop without crossings
    lacks nothing."""
    shape = omega.shape[:-1]
    worst, lowest, highest = (
        np.full(shape, -np.inf),
        np.full(shape, np.inf),
        np.full(shape, -np.inf),
    )
    where, bad, rising = omega[..., 0].copy(), lacking > 0.0, np.argsort(lacking)
    worst.reshape(-1)[crossings.index[rising]] = lacking[rising]
    where.reshape(-1)[crossings.index[rising]] = crossings.omega[rising]
    np.minimum.at(lowest.reshape(-1), crossings.index[bad], crossings.omega[bad])
    np.maximum.at(highest.reshape(-1), crossings.index[bad], crossings.omega[bad])
    return _Shortfall(worst, where, lowest, highest)


def broken(loops: Loop, specification: Specification) -> np.ndarray:
    """(variants, nx, ny) bool: which loops break a limit of `specification` on Ms, Mt or the
    margins."""
    found = _shortfalls(loops, limits_of(specification), frequency_grid(loops.plant))
    return np.max([shortfall.worst for shortfall in found.values()], axis=0) > 0.0


def _require_kept(problem: Problem, gains: np.ndarray, found: dict[str, _Shortfall]) -> None:
    """InfeasibleError where a limit is broken, or a loop is unstable."""
    task = problem.task
    for name, shortfall in found.items():
        k, i, j = np.unravel_index(np.argmax(shortfall.worst), shortfall.worst.shape)
        if not shortfall.worst[k, i, j] <= _TOLERANCE[name]:
            limit = phrase(name, task.specification)
            raise InfeasibleError(
                f"{task.place(k, i, j)}: the tuner ended with gains that break {limit}. Relax this"
                " limit or move the points."
            )
    size = np.abs(problem.loops(gains).poles()).max(axis=-1)
    k, i, j = np.unravel_index(np.argmax(size), size.shape)
    if not size[k, i, j] < 1.0:
        reached, _ = apart(size[k, i, j], 1.0)
        raise InfeasibleError(
            f"{task.place(k, i, j)}: the tuner ended with an unstable loop (a pole of size"
            f" {reached}). Relax a limit or choose another structure."
        )
