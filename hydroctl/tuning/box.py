"""The plants of a box on which a schedule is worst, searched: a sample of the whole box, then
uphill from its worst.

A box is what an uncertainty spans between its ends. Between its corners a loop may be worse than on
them: a notch that stands apart from the natural frequency on either side meets it somewhere inside.
The sample is a low-discrepancy sequence, stretched so that part of it lies on the faces; the climb
is a pattern search at the worst place. Neither proves anything: what they find is a lower bound of
the worst.
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass
from functools import lru_cache

import numpy as np

from ..errors import InputError
from ..loop.allowances import ALLOWANCE
from ..loop.margins import Loop, analyse
from ..loop.plant_family import Box, Change
from ..loop.points import with_midpoints
from ..loop.sampled_plant import SampledFamily, frequency_grid
from ..schedule.margins import WorstPoint
from ..schedule.schedule import GainSchedule

_SAMPLE = 400
_ROWS, _COLUMNS = 10, 13
"""openings and positions at which a plant of the sample is looked at"""
_STRIDE = 5
"""of the first of them, from one plant to the next"""
_STRETCH = 1.4
_FIRST_STEP, _LAST_STEP = 0.125, 0.01
"""of the climb, in widths of the box"""
_TOLERATED = 0.2 * ALLOWANCE, 0.6 * ALLOWANCE
"""by how much a limit may be missed at the design points, and between them, before a plant counts
as worse"""
_CLIMBS, _FEW_CLIMBS = 12, 2
"""openings, the worst of the sample, from which a climb starts for each limit"""
_AT_ONCE = 4
"""plants that one search offers"""
_COVERED = 0.7
"""part of the excess at a place that a plant must have there to stand for the worst one"""
_COARSE, _FINE = 60, 720
"""logarithmic frequencies of the sample and of the climb, besides those about the modes"""
_MARGINS = {"min_crossover": "crossover"}
"""the margins that limits of another name limit"""
_EXCESS = {
    "Ms": lambda found, limit: found.Ms - limit,
    "Mt": lambda found, limit: found.Mt - limit,
    "gain_margin": lambda found, limit: 1.0 - found.gain_margin / limit,
    "phase_margin": lambda found, limit: limit - found.phase_margin,
    "min_crossover": lambda found, limit: 1.0 - found.crossover / limit,
}
"""by how much margins miss each limit of a specification"""


@dataclass(frozen=True)
class BoxSearch:
    """What a search of a schedule's box found, at its design points and half-way between them."""

    worst: dict[str, WorstPoint]
    """by limit ("Ms", "Mt" and those that the specification states): the worst margin that was
    found"""
    worse: tuple[Change, ...]
    """what the plants differ by on which a limit is missed by more than the tuner
    tolerates"""


@lru_cache(maxsize=4)
def search_box(schedule: GainSchedule) -> BoxSearch:
    """Search the box of the schedule's specification at its design points and half-way between
    them.

    InputError where the specification counts its plants, and for a plant of the box without an
    operating point.
    """
    return _Search(
        schedule, with_midpoints(schedule.design_x), with_midpoints(schedule.design_y)
    ).result(_CLIMBS)


def search_design_points(schedule: GainSchedule) -> BoxSearch:
    """As `search_box`, at the design points alone, and with fewer climbs."""
    return _Search(schedule, schedule.design_x, schedule.design_y).result(_FEW_CLIMBS)


@dataclass(frozen=True)
class _Place:
    """A plant of the box, its coordinates from 0 to 1, at point (i, j), with the excess of one
    limit there."""

    limit: int
    plant: np.ndarray
    i: int
    j: int
    excess: float


class _Search:
    """The search of one schedule at x (mx,) by y (my,). Excesses are those beyond what is
    tolerated."""

    def __init__(self, schedule: GainSchedule, x: np.ndarray, y: np.ndarray):
        self.schedule, self.x, self.y = schedule, x, y
        box = schedule.plants.box
        if box is None:
            raise InputError(
                f"uncertainty = {schedule.specification.uncertainty!r} counts its plants; there is"
                " no box to search."
            )
        self.box = box
        designed = np.isin(x, schedule.design_x)[:, None] & np.isin(y, schedule.design_y)
        self.tolerated = np.where(designed, *_TOLERATED)
        stated = {name: getattr(schedule.specification, name) for name in _EXCESS}
        self.limits = {name: limit for name, limit in stated.items() if limit is not None}
        self.only_peaks = set(self.limits) <= {"Ms", "Mt"}

    def result(self, climbs: int) -> BoxSearch:
        starts = self.starts()
        tops: list[_Place] = []
        worst: dict[str, WorstPoint] = {}
        worse: list[dict[str, float]] = []
        for limit, name in enumerate(self.limits):
            highest = sorted((start for start in starts if start.limit == limit), key=_by_excess)[
                -climbs:
            ]
            found = [self.climb(start) for start in highest]
            worst[name] = self.point(name, max(found, key=_by_excess))
            tops += [top for top in found if top.excess > 0.0]
        while tops and len(worse) < _AT_ONCE:
            plant = max(tops, key=_by_excess).plant
            worse.append(self.change(plant))
            tops = [top for top in tops if not self.stands_for(plant, top)]
        return BoxSearch(worst, tuple(worse))

    def starts(self) -> list[_Place]:
        """The worst place of the sample at every opening for every limit: the corners of the box at
        all points, then each other plant at points of its own, evenly spread."""
        best: dict[tuple[int, int], _Place] = {}
        corners, inside = _sample(len(self.box.ends))
        for k, plant in enumerate([*corners, *inside]):
            rows, columns = (
                self.spread(k, size, most)
                for size, most in ((self.x.size, _ROWS), (self.y.size, _COLUMNS))
            )
            if k < len(corners):
                rows, columns = np.arange(self.x.size), np.arange(self.y.size)
            excess = (
                self.missed(self.sampled_loops(k, plant, rows, columns), _COARSE)[:, 0]
                - self.tolerated[np.ix_(rows, columns)]
            )
            for limit, r in np.ndindex(excess.shape[:2]):
                c = int(np.argmax(excess[limit, r]))
                place = _Place(
                    limit, plant, int(rows[r]), int(columns[c]), float(excess[limit, r, c])
                )
                best[limit, place.i] = max(best.get((limit, place.i), place), place, key=_by_excess)
        return list(best.values())

    @staticmethod
    def spread(k: int, size: int, most: int) -> np.ndarray:
        """About `most` of `size` indices at equal steps, from another one for every k."""
        step = math.ceil(size / most)
        return np.arange(_STRIDE * k % step, size, step)

    def stands_for(self, plant: np.ndarray, top: _Place) -> bool:
        """Whether a design that counts `plant` takes care of `top`."""
        excess = self.excess(plant[None], [top.i], [top.j])[top.limit].item()
        return excess >= _COVERED * top.excess

    def climb(self, start: _Place) -> _Place:
        """Uphill from `start`: to the best of the neighbours in the box, then among the points, or
        to shorter steps."""
        limit, plant, i, j, step = start.limit, start.plant, start.i, start.j, _FIRST_STEP
        excess = self.excess(plant[None], [i], [j])[limit].item()
        while step >= _LAST_STEP:
            moves = step * np.concatenate([np.eye(plant.size), -np.eye(plant.size)])
            near = np.unique(np.clip(plant + moves, 0.0, 1.0), axis=0)
            rows, columns = (_beside(k, size) for k, size in ((i, self.x.size), (j, self.y.size)))
            in_box = self.excess(near, [i], [j])[limit, :, 0, 0]
            around = self.excess(plant[None], rows, columns)[limit, 0]
            if max(in_box.max(), around.max()) <= excess:
                step /= 2.0
            elif in_box.max() >= around.max():
                plant, excess = near[np.argmax(in_box)], float(in_box.max())
            else:
                row, column = np.unravel_index(np.argmax(around), around.shape)
                i, j, excess = rows[row], columns[column], float(around.max())
        return _Place(limit, plant, i, j, excess)

    def excess(self, plants: np.ndarray, rows, columns) -> np.ndarray:
        """(limits, plants, rows, columns); infinite where the loop is unstable."""
        loops = self.loops(plants, rows, columns)
        stable = np.abs(loops.poles()).max(axis=-1) < 1.0
        return (
            np.where(stable, self.missed(loops, _FINE), np.inf)
            - self.tolerated[np.ix_(rows, columns)]
        )

    def missed(self, loops: Loop, frequencies: int) -> np.ndarray:
        """(limits, plants, rows, columns): by how much each limit is missed; Ms and Mt from so many
        frequencies."""
        found = _on_grid(loops, frequencies) if self.only_peaks else analyse(loops)
        return np.stack([_EXCESS[name](found, limit) for name, limit in self.limits.items()])

    def sampled_loops(self, k: int, plant: np.ndarray, rows, columns) -> Loop:
        """(1, rows, columns): plant number k of the sample, whose models the searches of one box at
        the same points share."""
        s = self.schedule
        points = tuple(self.x.tolist()), tuple(self.y.tolist())
        shared = _models_of_sample(self.box, points, s.loop, s.Ts, s.delay_samples)
        if k not in shared:
            shared[k] = self.loops(plant[None], rows, columns).plant
        regulators = s.gains(self.x[rows][:, None], self.y[columns])
        return Loop(shared[k], regulators.broadcast_to(shared[k].shape))

    def loops(self, plants: np.ndarray, rows, columns) -> Loop:
        """(plants, rows, columns)"""
        s, x, y = self.schedule, self.x[rows], self.y[columns]
        family = self.box.plants([self.change(plant) for plant in plants])
        models = family.sampled(x, y, s.quantity, sample_time=s.Ts, delay_samples=s.delay_samples)
        return Loop(models, s.gains(x[:, None], y).broadcast_to(models.shape))

    def change(self, plant: np.ndarray) -> dict[str, float]:
        """What the plant at these coordinates differs by, SI."""
        return {
            name: float(low + at * (high - low))
            for (name, (low, high)), at in zip(self.box.ends.items(), plant, strict=True)
        }

    def label(self, plant: np.ndarray) -> str:
        return self.box.plants([self.change(plant)]).labels[0]

    def point(self, name: str, found: _Place) -> WorstPoint:
        """The margin of limit `name` at the place that was found."""
        margin = _MARGINS.get(name, name)
        value = getattr(analyse(self.loops(found.plant[None], [found.i], [found.j])), margin).item()
        return WorstPoint(
            margin, value, self.label(found.plant), float(self.x[found.i]), float(self.y[found.j])
        )


@lru_cache(maxsize=4)
def _models_of_sample(
    box: Box, points: tuple, loop: str, Ts: float, delay: float
) -> dict[int, SampledFamily]:
    """The models of the sample's plants at points (x, y), by their number in it; empty at first."""
    return {}


@dataclass(frozen=True, eq=False)
class _Peaks:
    Ms: np.ndarray
    Mt: np.ndarray


def _on_grid(loops: Loop, points: int) -> _Peaks:
    """Ms and Mt as far as that many logarithmic frequencies and those about the plants' modes show
    them."""
    L = loops.frequency_response(frequency_grid(loops.plant, points=points))
    S = 1.0 / np.abs(1.0 + L)
    return _Peaks(S.max(axis=-1), (np.abs(L) * S).max(axis=-1))


def _sample(parameters: int) -> tuple[np.ndarray, np.ndarray]:
    """(corners, others), each (n, parameters) from 0 to 1: the others are the sequence of the
    generalized golden ratio (Roberts, 2018), stretched beyond the faces and brought back onto
    them."""
    corners = np.array(list(itertools.product((0.0, 1.0), repeat=parameters)))
    ratio = np.roots(
        [1.0, *[0.0] * (parameters - 1), -1.0, -1.0]
    ).real.max()  # of ratio^(parameters + 1) = ratio + 1
    steps = ratio ** -np.arange(1.0, parameters + 1.0)
    inside = (0.5 + np.arange(1, _SAMPLE + 1)[:, None] * steps) % 1.0
    return corners, np.clip(0.5 + _STRETCH * (inside - 0.5), 0.0, 1.0)


def _beside(index: int, size: int) -> list[int]:
    """The indices next to `index` and itself, within `size`."""
    return list(range(max(index - 1, 0), min(index + 2, size)))


def _by_excess(place: _Place) -> float:
    return place.excess
