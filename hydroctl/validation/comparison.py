"""`compare`: several schedules for one machine, side by side on the same scenarios and variants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InfeasibleError, InputError
from ..machine.actuator import Actuator
from ..simulation import Scenario
from ..tuning import tune_fixed
from .plants import plants_of
from .report import ValidationReport, validate
from .scenarios import library, step_scenarios, tracking_scenarios

if TYPE_CHECKING:
    from ..schedule.schedule import GainSchedule


@dataclass(frozen=True)
class Comparison:
    """The IAE of one schedule over that of the baseline, over all cases (scenario and variant) that
    both brought to their end."""

    name: str
    baseline: str
    mean: float
    """geometric mean"""
    best: float
    best_case: str
    worst: float
    worst_case: str
    cases: int
    """cases that count"""
    failed: int
    """cases that this schedule failed"""
    baseline_failed: int
    """cases that the baseline failed"""

    def __str__(self) -> str:
        text = (
            f"{self.name} / {self.baseline}: IAE x {self.mean:.3f} ({self.best:.3f} at best:"
            f" {self.best_case}; "
        )
        failed = f"{self.failed} failed, of the baseline {self.baseline_failed}"
        return text + f"{self.worst:.3f} at worst: {self.worst_case}; {self.cases} cases, {failed})"


def rivals(schedule: GainSchedule) -> dict[str, GainSchedule]:
    """`schedule` after what it must beat, for `compare`: `proportional_rivals`, "fixed", one
    regulator of the schedule's own structure and feed-forward, and "scheduled".

    All are tuned to the schedule's specification on all of its plants and design points. Raises
    InfeasibleError where one of them meets the limits nowhere.
    """
    fixed = fixed_rival(schedule, schedule.structure)
    return {
        **proportional_rivals(schedule),
        "fixed": replace(fixed, feed_forward=schedule.feed_forward),
        "scheduled": schedule,
    }


def proportional_rivals(schedule: GainSchedule) -> dict[str, GainSchedule]:
    """ "P", a bare proportional regulator to the specification of `schedule`, and "P +
    feed-forward". Raises InfeasibleError."""
    proportional = fixed_rival(schedule, "p")
    return {
        "P": replace(proportional, feed_forward=False),
        "P + feed-forward": replace(proportional, feed_forward=True),
    }


def fixed_rival(schedule: GainSchedule, structure: str) -> GainSchedule:
    """One regulator of `structure` to the specification of `schedule`, at all of its design points.
    Raises InfeasibleError."""
    points = schedule.machine, schedule.design_x, schedule.design_y
    return tune_fixed(
        *points, loop=schedule.loop, structure=structure, specification=schedule.specification
    )


def compare(
    actuator: Actuator,
    schedules: Mapping[str, GainSchedule],
    *,
    scenarios: Sequence[Scenario] | None = None,
    variants: str | Mapping[str, Actuator] = "nominal",
) -> tuple[Comparison, ...]:
    """Every schedule against the first one of `schedules`, which are named by their keys.

    `scenarios` default to the whole `library`; `variants` as in `validate`, where "design" stands
    for the plants of the first schedule. Raises InputError as `compare_reports` does.
    """
    _require_two(schedules)
    first = next(iter(schedules.values()))
    if scenarios is None:
        scenarios = library(actuator, first.loop, Ts=first.Ts)
    tried: dict[str, Any] = {
        "scenarios": scenarios,
        "variants": plants_of(actuator, first, variants),
        "requirements": (),
    }
    return compare_reports(
        {name: validate(actuator, schedule, **tried) for name, schedule in schedules.items()}
    )


def compare_reports(reports: Mapping[str, ValidationReport]) -> tuple[Comparison, ...]:
    """Every report against the first one; cases are the same where scenario and variant have the
    same names.

    Raises InputError for fewer than two reports, and where no case was brought to its end by one
    and by the baseline.
    """
    _require_two(reports)
    runs = {
        name: {f"{run.scenario.name}; {run.variant}": run.metrics for run in report.runs}
        for name, report in reports.items()
    }
    baseline, *others = runs
    return tuple(_against(baseline, runs[baseline], name, runs[name]) for name in others)


@dataclass(frozen=True)
class Standing:
    """One schedule against the baseline, on the first variant (the nominal plant) and on that where
    its mean ratio is largest."""

    nominal: Comparison
    worst: Comparison
    worst_variant: str


def standings(reports: Mapping[str, ValidationReport]) -> dict[str, Standing]:
    """By name, every report against the first one, variant by variant. Raises InputError as
    `compare_reports` does."""
    labels = list(dict.fromkeys(run.variant for report in reports.values() for run in report.runs))
    each = {
        label: compare_reports({name: _part(report, label) for name, report in reports.items()})
        for label in labels
    }
    found = {}
    for k, name in enumerate(list(reports)[1:]):
        means = {label: each[label][k].mean for label in labels}
        worst = max(means, key=means.__getitem__)
        found[name] = Standing(each[labels[0]][k], each[worst][k], worst)
    return found


def against_rivals(schedule: GainSchedule, fixed: GainSchedule) -> dict[str, Standing]:
    """How `schedule`, and a bare P and a P with feed-forward where a P can meet the limits, stand
    against `fixed`: steps, ramps, sines and loads on all plants of the design of `schedule`."""
    schedules = {"fixed": fixed, "scheduled": schedule}
    with suppress(InfeasibleError):
        schedules |= proportional_rivals(schedule)
    machine, common = schedule.machine, {"Ts": schedule.Ts}
    scenarios = [
        *step_scenarios(machine, schedule.loop, **common),
        *tracking_scenarios(machine, schedule.loop, **common),
    ]
    asked: dict[str, Any] = {
        "scenarios": scenarios,
        "variants": plants_of(machine, schedule, "design"),
        "requirements": (),
    }
    return standings({name: validate(machine, each, **asked) for name, each in schedules.items()})


def _part(report: ValidationReport, variant: str) -> ValidationReport:
    return ValidationReport(tuple(run for run in report.runs if run.variant == variant), ())


def _require_two(named: Mapping) -> None:
    if len(named) < 2:
        raise InputError(
            f"{len(named)} to compare; give at least two: the baseline first, then those to compare"
            " with it."
        )


def _against(baseline: str, reference: dict, name: str, found: dict) -> Comparison:
    shared = found.keys() & reference.keys()
    cases = [
        case
        for case in found
        if case in shared and found[case] and reference[case] and reference[case].iae > 0.0
    ]
    if not cases:
        raise InputError(
            f"no case was brought to its end by both {name!r} and {baseline!r}; there is nothing to"
            " compare."
        )
    ratios = np.array([found[case].iae / reference[case].iae for case in cases])
    best, worst = int(np.argmin(ratios)), int(np.argmax(ratios))
    mean = float(np.exp(np.log(np.maximum(ratios, np.finfo(float).tiny)).mean()))
    extremes = (float(ratios[best]), cases[best], float(ratios[worst]), cases[worst])
    failed, baseline_failed = (
        sum(runs[case] is None for case in shared) for runs in (found, reference)
    )
    return Comparison(name, baseline, mean, *extremes, len(cases), failed, baseline_failed)
