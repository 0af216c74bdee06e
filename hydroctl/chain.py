"""The whole chain: from an actuator to a gain schedule with proof, in the order of the stages."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from .errors import InputError
from .files import make_directory, write_file
from .loop.quantity import LoopName
from .machine.actuator import Actuator
from .model.linearization import LinearFamily, linearize
from .model.operating_point import OperatingPoints, find_operating_points
from .proof.remarks import machine_remarks
from .quasi_linear.model import QuasiLinearModel
from .quasi_linear.reduction import SecondOrderFamily, reduce_order
from .quasi_linear.surfaces import PoorFitWarning, fit_surfaces
from .report.summary import summarize, to_dict
from .schedule.schedule import GainSchedule
from .specification import Specification
from .tuning import default_points, tune, tune_fixed
from .validation import Standing, ValidationReport, Verdict, against_rivals, validate
from .validation.margin_verdicts import margin_verdicts, with_failures

STAGES = (
    "operating points",
    "linearization",
    "reduction",
    "surfaces",
    "tuning",
    "fixed regulator",
    "margins",
    "validation",
    "validation of the fixed regulator",
    "comparison",
)
_BETWEEN = np.array([0.1, 0.2, 0.4, 0.6, 0.8])


def design(
    actuator: Actuator,
    *,
    loop: LoopName = "velocity",
    structure: str = "pi",
    specification: Specification | None = None,
    on_stage: Callable[[str], None] | None = None,
) -> Design:
    """Operating points, linear families, second-order models and surfaces, gain schedule, fixed
    regulator, validation.

    The regulators are tuned on the third-order tangent models, whatever the error of the second
    order. `on_stage` is called with the name of each of the STAGES as it begins. Raises InputError
    for input that cannot be used, InfeasibleError where no regulator meets the specification.
    """
    specification = Specification() if specification is None else specification
    stage, seconds = _stopwatch(on_stage)
    x, y = default_points(actuator)
    between = actuator.dead_band + _BETWEEN * (1.0 - actuator.dead_band)
    openings = np.unique(np.concatenate([x, -between, between]))
    points = stage(
        "operating points", lambda: find_operating_points(actuator, openings[:, None], y)
    )
    family = stage("linearization", lambda: linearize(actuator, points))
    reduced = stage("reduction", lambda: reduce_order(family))
    model, poor_fits = stage("surfaces", lambda: _surfaces(reduced))
    remarks = (*machine_remarks(actuator, openings, y, specification), *poor_fits)
    common = {"loop": loop, "structure": structure, "specification": specification}
    schedule = stage("tuning", lambda: tune(actuator, x, y, **common))
    fixed = stage("fixed regulator", lambda: tune_fixed(actuator, x, y, **common))
    verdicts = stage("margins", lambda: margin_verdicts(schedule))
    validation = stage("validation", lambda: validate(actuator, schedule))
    fixed_validation = stage("validation of the fixed regulator", lambda: validate(actuator, fixed))
    comparison = stage("comparison", lambda: against_rivals(schedule, fixed))
    evidence = (verdicts, validation, fixed_validation, comparison)
    judged = with_failures(schedule, [*verdicts, *validation.verdicts])
    return Design(
        actuator, points, family, reduced, model, remarks, judged, fixed, *evidence, seconds
    )


@dataclass(frozen=True, eq=False)
class Design:
    """The results of every stage, and the verdicts on the schedule."""

    actuator: Actuator
    points: OperatingPoints
    family: LinearFamily
    """tangent models"""
    reduced: SecondOrderFamily
    model: QuasiLinearModel | None
    """None where too few points reduce to second order"""
    remarks: tuple[str, ...]
    """what the user should know of the machine and of the reduced model"""
    schedule: GainSchedule
    """with the requirements that it does not meet as its `failed_checks`"""
    fixed: GainSchedule
    """one regulator for all points and variants, for comparison"""
    margin_verdicts: tuple[Verdict, ...]
    validation: ValidationReport
    fixed_validation: ValidationReport
    comparison: dict[str, Standing]
    """"scheduled", and "P" and "P + feed-forward" where a P can meet the limits: their IAE over
    that of the fixed regulator"""
    seconds: dict[str, float]
    """time that each stage took"""

    @property
    def passed(self) -> bool:
        """True where every requirement on margins and on the nonlinear plant is met."""
        return all(verdict.passed for verdict in self.margin_verdicts) and self.validation.passed

    def summary(self) -> str:
        """The design in a screenful: verdicts first, then the worst points and the comparison with
        the fixed regulator."""
        return summarize(self)

    def to_dict(self) -> dict:
        """The same for programs."""
        return to_dict(self)

    def save(self, directory: str | Path) -> list[Path]:
        """Write schedule.json, margins.csv, summary.txt, report.html and the figures (SVG), among
        them one step and one saturated motion. Raises InputError where it cannot."""
        from .plotting import design_figures, save_figures
        from .report import write_report

        directory = make_directory(directory)
        finished = [run for run in reversed(self.validation.runs) if run.trajectory is not None]
        first = {
            run.scenario.kind: run for run in finished if run.scenario.kind in ("step", "saturated")
        }
        motions = [(run.scenario, run.trajectory) for run in first.values()]
        shown = {
            "beside": {"fixed": self.fixed},
            "comparison": self.comparison,
            "remarks": self.remarks,
        }
        return [
            self.schedule.save(directory / "schedule.json"),
            write_file(directory / "margins.csv", self.schedule.margins.to_csv().encode()),
            write_file(directory / "summary.txt", (self.summary() + "\n").encode()),
            write_report(directory / "report.html", self.schedule, self.validation, **shown),
            *save_figures(
                design_figures(self.family, self.schedule, motions), directory, formats=("svg",)
            ),
        ]


def _surfaces(reduced: SecondOrderFamily) -> tuple[QuasiLinearModel | None, tuple[str, ...]]:
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", PoorFitWarning)
        try:
            model, remarks = fit_surfaces(reduced), ()
        except InputError as error:
            model, remarks = None, error.faults
    return model, (*remarks, *(str(warning.message) for warning in caught))


def _stopwatch(on_stage: Callable[[str], None] | None) -> tuple[Callable, dict[str, float]]:
    seconds: dict[str, float] = {}

    def stage(name: str, work: Callable):
        if on_stage is not None:
            on_stage(name)
        start = time.perf_counter()
        result = work()
        seconds[name] = time.perf_counter() - start
        return result

    return stage, seconds
