"""`compare`: several schedules for one machine, side by side on the same scenarios and variants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Literal

import numpy as np

from ..actuator import Actuator
from ..errors import InputError
from ..simulation import Scenario
from .report import validate

if TYPE_CHECKING:
    from ..schedule import GainSchedule


@dataclass(frozen=True)
class Comparison:
    """The IAE of one schedule over that of the baseline, over all cases (scenario and variant) that both brought to their end."""

    name: str
    baseline: str
    mean: float
    """geometric mean"""
    best: float
    best_case: str
    worst: float
    worst_case: str
    failed: int
    """cases that this schedule failed"""

    def __str__(self) -> str:
        text = f"{self.name} / {self.baseline}: IAE x {self.mean:.3f} ({self.best:.3f} at best: {self.best_case}; "
        return text + f"{self.worst:.3f} at worst: {self.worst_case}; {self.failed} failed)"


def compare(
    actuator: Actuator,
    schedules: Mapping[str, GainSchedule],
    *,
    scenarios: Sequence[Scenario] | None = None,
    variants: Literal["nominal", "corners"] = "nominal",
) -> tuple[Comparison, ...]:
    """Every schedule against the first one of `schedules`, which are named by their keys; arguments else as in `validate`.

    Raises InputError for fewer than two schedules, and where no case was brought to its end by a schedule and the baseline.
    """
    if len(schedules) < 2:
        raise InputError("schedules holds fewer than two; give the baseline first, then those to compare with it.")
    runs = {}
    for name, schedule in schedules.items():
        report = validate(actuator, schedule, scenarios=scenarios, variants=variants, requirements=())
        runs[name] = {f"{run.scenario.name}; {run.variant}": run.metrics for run in report.runs}
    baseline, *others = runs
    return tuple(_against(baseline, runs[baseline], name, runs[name]) for name in others)


def _against(baseline: str, reference: dict, name: str, found: dict) -> Comparison:
    cases = [case for case in found if found[case] is not None and reference[case] is not None and reference[case].iae > 0.0]
    if not cases:
        raise InputError(f"no case was brought to its end by both {name!r} and {baseline!r}; there is nothing to compare.")
    ratios = np.array([found[case].iae / reference[case].iae for case in cases])
    best, worst = int(np.argmin(ratios)), int(np.argmax(ratios))
    mean = float(np.exp(np.log(np.maximum(ratios, np.finfo(float).tiny)).mean()))
    extremes = (float(ratios[best]), cases[best], float(ratios[worst]), cases[worst])
    return Comparison(name, baseline, mean, *extremes, sum(metrics is None for metrics in found.values()))
