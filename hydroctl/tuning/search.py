"""`search_settings`: what enters the loop nonlinearly, searched for the largest gain around the
convex tuner.

For fixed notch, sections and derivative filter the best gains are a convex matter (see `convex`).
These settings themselves are searched: on a coarse grid around those of the specification, then by
Nelder-Mead from the best of them. Every trial is a full convex design at a few points, on all
plants (of a box, on its corners and on those that are worst for the specification's own settings),
and counts only if the poles of its sampled loops are stable. The settings are scaled
logarithmically; the first trial is the specification as it stands, so that the gain is never
smaller. What a larger gain does to the motion is not asked here (see `hydroctl.searched_tuning`).
"""

from __future__ import annotations

import itertools
import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..errors import InfeasibleError, InputError
from ..loop.plant_family import Change
from ..regulator.structures import GAINS, section_count
from ..schedule.schedule import GainSchedule
from .refinement import Problem, rough_gains
from .synthesis import schedule_for, scheduled, worst_plants
from .task import Task

_GRID = (0.6, 1.0, 1.7)
"""multiples of each setting of the specification"""
_BOUNDS = {
    "notch_ratio": (0.6, 1.5),
    "zz": (0.05, 1.0),
    "zp": (0.2, 3.0),
    "Tf": (0.2, 20.0),
    "zero": (0.1, 5.0),
    "pole": (0.1, 5.0),
}
"""Tf over that of the specification, the corners of the first section over the notch frequency"""
_BELOW_NYQUIST = 0.95
_TRIALS = 60
_REPRESENTATIVE = (0.0, 0.5, 1.0)


@dataclass(frozen=True, eq=False)
class SearchedSettings:
    """The schedule with the settings of the largest gain that were found, and that with the
    specification's own."""

    schedule: GainSchedule
    specified: GainSchedule
    """with the specification's own settings"""
    settings: dict[str, float]
    """notch_ratio (notch frequency over natural frequency), zz, zp, Tf in s, zero and pole of the
    first section: those searched"""
    gain_ratio: float
    """the gain that `tune` maximizes, over that with the specification's own settings (geometric
    mean over the points)"""
    trials: tuple[tuple[dict[str, float], float], ...]
    """(settings, gain over the specification's own at a few points) of every trial; 0 where no
    stable design was found"""


def search_settings(task: Task) -> SearchedSettings:
    """The settings that the structure of `task` has, searched for the largest gain. Raises
    InputError where it has none."""
    own = _settings(task)
    if not own:
        raise InputError(
            f"structure {task.structure!r} has neither notch nor section nor derivative to be"
            " searched for; use tune."
        )
    few = task.part(_spread(task.x.size), _spread(task.y.size))
    few = few.with_plants(_tried_plants(few))
    trials: list[tuple[dict[str, float], float]] = []
    base = _gain(few)

    def score(settings: dict[str, float]) -> float:
        found = _gain(_with(few, settings)) / base
        trials.append((settings, found))
        return found

    highest = (
        _BELOW_NYQUIST
        * np.pi
        / (task.specification.sample_time * task.plants.resonance[0, ..., 0].max())
    )
    best = _best_settings(own, highest, score)
    schedule, specified = schedule_for(_with(task, best)), schedule_for(task)
    ratio = _mean(task, schedule) / _mean(task, specified)
    if ratio < 1.0:
        schedule, best, ratio = specified, own, 1.0
    return SearchedSettings(schedule, specified, best, ratio, tuple(trials))


def _tried_plants(task: Task) -> tuple[Change, ...]:
    """What further plants of the task's box differ by on which settings are tried: the corners, so
    that none is worst for the specification's own settings alone, and those that are worst for
    these; none without a box."""
    if task.family.box is None:
        return ()
    others, counted = (
        [*task.family.box.corners, *worst_plants(task, scheduled)],
        task.family.changes,
    )
    return tuple(change for k, change in enumerate(others) if change not in [*counted, *others[:k]])


def _settings(task: Task) -> dict[str, float]:
    """The settings of the specification that the structure uses."""
    specification = task.specification
    found: dict[str, float] = {}
    if "notch" in task.structure:
        assert specification.notch_damping is not None  # the task has settled both
        assert specification.notch_ratio is not None
        found |= {
            "notch_ratio": specification.notch_ratio,
            **dict(zip(("zz", "zp"), specification.notch_damping, strict=True)),
        }
    if section_count(task.structure):
        found |= dict(zip(("zero", "pole"), specification.lead_lag[0], strict=True))
    if "kd" in [GAINS[i] for i in task.used]:
        found["Tf"] = specification.Tf
    return found


def _with(task: Task, settings: dict[str, float]) -> Task:
    """The task with other settings; those that are not named stay."""
    s = _settings(task) | settings
    specification = task.specification
    changed: dict[str, Any] = {name: s[name] for name in ("Tf", "notch_ratio") if name in s}
    if "zz" in s:
        changed["notch_damping"] = (s["zz"], s["zp"])
    if "zero" in s:
        changed["lead_lag"] = ((s["zero"], s["pole"]), *specification.lead_lag[1:])
    return replace(task, specification=replace(specification, **changed))


def _spread(size: int) -> np.ndarray:
    """Indices of the first, the middle and the last of `size` points."""
    return np.unique([round(share * (size - 1)) for share in _REPRESENTATIVE])


def _gain(task: Task) -> float:
    """The gain that the tuner maximizes: geometric mean over the points, each on its own; 0 where a
    loop is not stable."""
    problem = Problem.pointwise(task)
    try:
        gains = rough_gains(problem)
    except InfeasibleError:
        return 0.0
    if not np.abs(problem.loops(gains).poles()).max() < 1.0:
        return 0.0
    return float(np.exp(np.log(np.maximum(gains[:, task.objective], np.finfo(float).tiny)).mean()))


def _mean(task: Task, schedule: GainSchedule) -> float:
    gains = getattr(schedule.gains(task.x[:, None], task.y), GAINS[task.used[task.objective]])
    return float(np.exp(np.log(gains).mean()))


def _best_settings(own: dict[str, float], highest_ratio: float, score) -> dict[str, float]:
    """The settings with the largest score: the grid first, then Nelder-Mead from its best, both
    within the bounds."""
    from scipy.optimize import minimize

    names = list(own)
    unit = {name: own["Tf"] if name == "Tf" else 1.0 for name in names}
    bounds = _BOUNDS | {
        "notch_ratio": (_BOUNDS["notch_ratio"][0], min(_BOUNDS["notch_ratio"][1], highest_ratio))
    }
    low, high = (np.log([unit[name] * bounds[name][side] for name in names]) for side in (0, 1))

    def loss(logs) -> float:
        settings = dict(zip(names, map(float, np.exp(logs)), strict=True))
        if "zz" in settings and not settings["zz"] < settings["zp"]:
            return 0.0
        return -score(settings)

    start = np.log(list(own.values()))
    grid = [
        np.clip(start + np.log(steps), low, high)
        for steps in itertools.product(_GRID, repeat=len(names))
    ]
    first = [start, *_thinned(grid)]
    losses = [loss(logs) for logs in first]
    best = first[int(np.argmin(losses))]
    simplex = np.clip(np.vstack([best, best + 0.2 * np.eye(len(names))]), low, high)
    options = {"initial_simplex": simplex, "maxfev": _TRIALS, "xatol": 0.02, "fatol": 2e-3}
    found = minimize(
        loss, best, method="Nelder-Mead", bounds=list(zip(low, high, strict=True)), options=options
    )
    return dict(
        zip(names, map(float, np.exp(found.x if found.fun <= min(losses) else best)), strict=True)
    )


def _thinned(grid: list) -> list:
    """At most about `_TRIALS` of the grid's points, evenly."""
    return grid[:: max(1, math.ceil(len(grid) / _TRIALS))]
