"""`tune_search`: the regulator's settings searched for the largest gain, and what that did.

A larger gain is what the search looks for, not what a machine is asked for. So the schedule with
the settings that were found is set beside that with the specification's own, on the nonlinear
nominal plant, in quantities of which less is better.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..digits import apart
from ..loop.quantity import ControlledQuantity, LoopName
from ..machine.actuator import Actuator
from ..schedule.schedule import GainSchedule
from ..simulation import Scenario
from ..specification import Specification
from ..tuning import search_settings
from ..tuning.task import task_of
from ..validation import Metrics, Run, Verdict, failures, tracking_scenarios, validate
from .prove import prove, proven

_NOTICED = 0.01
"""relative change that counts as one"""
_SMALLEST_OVERSHOOT = 1e-3
"""of the step; what is below it counts as none, a twentieth of the settling band"""


@dataclass(frozen=True)
class Change:
    """A quantity, the less the better, with the specification's settings and with those found."""

    name: str
    unit: str
    before: float
    after: float
    smallest: float
    """what is below it counts as this much"""

    @property
    def worse(self) -> bool:
        """True where it grew by more than 1 %."""
        return self._counted(self.after) > (1.0 + _NOTICED) * self._counted(self.before)

    @property
    def better(self) -> bool:
        """True where it shrank by more than 1 %."""
        return self._counted(self.before) > (1.0 + _NOTICED) * self._counted(self.after)

    def _counted(self, value: float) -> float:
        return max(value, self.smallest)

    def __str__(self) -> str:
        before, after = apart(self.before, self.after, digits=4)
        word = "worse" if self.worse else "better" if self.better else "same"
        return f"{word:6s}  {self.name}: {before} -> {after} {self.unit}".rstrip()


@dataclass(frozen=True, eq=False)
class SearchedTuning:
    """The schedule with the settings of the largest gain found, and what else they did."""

    schedule: GainSchedule
    """with its proof"""
    specified: GainSchedule
    """with the specification's own settings, likewise"""
    settings: dict[str, float]
    """those searched, as in `tuning.SearchedSettings`"""
    gain_ratio: float
    """the gain that `tune` maximizes over that with the specification's own settings"""
    trials: tuple[tuple[dict[str, float], float], ...]
    """of the search, as in `tuning.SearchedSettings`"""
    changes: tuple[Change, ...]
    """settling, overshoot and error after a load step, each at its worst scenario on the nominal
    plant, and |C| at the Nyquist frequency at its worst node"""
    verdicts_before: tuple[Verdict, ...]
    """on margins and nominal plant, as in a design, with the specification's own settings"""
    verdicts: tuple[Verdict, ...]
    """the same with the settings found"""

    @property
    def worse(self) -> tuple[str, ...]:
        """Names of what got worse: quantities that grew, then requirements met before and not
        now."""
        met = {verdict.name for verdict in self.verdicts_before if verdict.passed}
        broken = [
            verdict.name for verdict in self.verdicts if not verdict.passed and verdict.name in met
        ]
        return tuple(
            dict.fromkeys([*(change.name for change in self.changes if change.worse), *broken])
        )

    @property
    def better(self) -> tuple[str, ...]:
        """Names of the quantities that shrank."""
        return tuple(change.name for change in self.changes if change.better)

    def summary(self) -> str:
        """The outcome first, then the settings, every quantity, and the requirements not met."""
        outcome = f"WORSE in {', '.join(self.worse)}" if self.worse else "nothing got worse"
        gained = f"better in {', '.join(self.better)}" if self.better else "nothing got better"
        found = ", ".join(f"{name} {value:.4g}" for name, value in self.settings.items())
        return "\n".join(
            [
                f"{outcome}; {gained}",
                (
                    f"settings found: {found}; the gain is {self.gain_ratio:.4g} times that with"
                    " the specification's own"
                ),
                "with the specification's own settings -> with those found, on the nominal plant",
                *(f"  {change}" for change in self.changes),
                *_unmet("the specification's own settings", self.verdicts_before),
                *_unmet("the settings found", self.verdicts),
            ]
        )


def _unmet(settings: str, verdicts: Sequence[Verdict]) -> list[str]:
    failed = failures(verdicts)
    count = (
        f"{len(failed)} of the {len(verdicts)} requirements not met"
        if failed
        else f"all {len(verdicts)} requirements met"
    )
    return [f"{count} with {settings}", *(f"  {text}" for text in failed)]


def tune_search(
    actuator: Actuator,
    x,
    y,
    *,
    loop: LoopName = "velocity",
    structure: str = "pi+notch",
    specification: Specification | None = None,
) -> SearchedTuning:
    """As `tune`, with notch dampings and frequency, derivative filter and first lead-lag section
    searched for the largest gain.

    Those that `structure` has are searched; a second section stays as specified, because a slower
    lag always gives more integral gain. The largest gain may be the worse regulator: `summary` says
    what it did. Raises InputError for a structure with nothing to search and for a machine that
    cannot move both ways, else as `tune` does.
    """
    task = task_of(actuator, x, y, loop, structure, specification)
    tracking = tracking_scenarios(actuator, loop, Ts=task.specification.sample_time)
    loads = [scenario for scenario in tracking if np.ptp(scenario.load_force) > 0.0]
    found = search_settings(task)
    before, after = (_tried(schedule, loads) for schedule in (found.specified, found.schedule))
    measured = zip(
        _quantities(task.quantity, task.specification.sample_time),
        before.values,
        after.values,
        strict=True,
    )
    return SearchedTuning(
        schedule=after.schedule,
        specified=before.schedule,
        settings=found.settings,
        gain_ratio=found.gain_ratio,
        trials=found.trials,
        changes=tuple(
            Change(name, unit, old, new, none) for (name, unit, none), old, new in measured
        ),
        verdicts_before=before.verdicts,
        verdicts=after.verdicts,
    )


class _Trial(NamedTuple):
    """A schedule as it was judged and measured."""

    schedule: GainSchedule
    verdicts: tuple[Verdict, ...]
    values: tuple[float, ...]
    """in the order of `_quantities`"""


def _tried(schedule: GainSchedule, loads: Sequence[Scenario]) -> _Trial:
    steps = validate(schedule.machine, schedule)
    loaded = validate(schedule.machine, schedule, scenarios=loads, requirements=())
    proof = prove(schedule, validation=steps)
    values = (
        _largest(
            steps.runs, ("step", "saturated", "reversal"), lambda metrics: metrics.settling_time
        ),
        _largest(steps.runs, ("step",), lambda metrics: metrics.overshoot),
        _largest(steps.runs, ("saturated",), lambda metrics: metrics.overshoot),
        _largest(loaded.runs, ("tracking",), lambda metrics: metrics.iae),
        float(schedule.regulators.nyquist_gain.max()),
    )
    return _Trial(proven(schedule, proof), proof.verdicts, values)


def _largest(
    runs: Sequence[Run], kinds: tuple[str, ...], quantity: Callable[[Metrics], float]
) -> float:
    """Over the runs of these kinds; infinite where one did not reach its end."""
    return max(
        quantity(run.metrics) if run.metrics else math.inf
        for run in runs
        if run.scenario.kind in kinds
    )


def _quantities(quantity: ControlledQuantity, Ts: float) -> tuple[tuple[str, str, float], ...]:
    """(name, unit, what counts as none) of what `_tried` measures."""
    return (
        ("settling time", "s", Ts),
        ("overshoot of a step", "", _SMALLEST_OVERSHOOT),
        ("overshoot after saturation", "of the step", _SMALLEST_OVERSHOOT),
        ("integral of |error| after a load step", quantity.integral_unit, 0.0),
        ("gain at the Nyquist frequency", quantity.gain_units["kp"], 0.0),
    )
