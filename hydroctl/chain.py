"""The whole chain: from an actuator to a gain schedule with proof, in the order of the stages."""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np

from .errors import InputError
from .files import make_directory, write_file
from .loop.quantity import LoopName
from .machine.actuator import Actuator
from .model.linearization import LinearFamily, linearize
from .model.operating_point import OperatingPoints, find_operating_points
from .proof.prove import prove, proven
from .quasi_linear.model import QuasiLinearModel
from .quasi_linear.reduction import SecondOrderFamily, reduce_order
from .quasi_linear.surfaces import PoorFitWarning, fit_surfaces
from .report.summary import summarize, to_dict
from .schedule.proof import Proof
from .schedule.schedule import GainSchedule
from .schedule.verdict import Verdict
from .specification import Specification
from .tuning import default_points, tune, tune_fixed
from .validation import Standing, ValidationReport, against_rivals, validate

Result = TypeVar("Result")
STAGES = (
    "operating points",
    "linearization",
    "reduction",
    "surfaces",
    "tuning",
    "fixed regulator",
    "validation",
    "proof",
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
    asked = (loop, structure, Specification() if specification is None else specification)
    stage = _Stopwatch(on_stage)
    x, y = default_points(actuator)
    openings = _with_openings_between(actuator, x)
    points = stage("operating points", find_operating_points, actuator, openings[:, None], y)
    family = stage("linearization", linearize, actuator, points)
    reduced = stage("reduction", reduce_order, family)
    model, poor_fits = stage("surfaces", _surfaces, reduced)
    schedule = stage("tuning", _tuned, tune, actuator, x, y, *asked)
    fixed = stage("fixed regulator", _tuned, tune_fixed, actuator, x, y, *asked)
    validation = stage("validation", validate, actuator, schedule)
    proof = stage("proof", lambda: prove(schedule, validation=validation))
    fixed_validation = stage("validation of the fixed regulator", validate, actuator, fixed)
    comparison = stage("comparison", against_rivals, schedule, fixed)
    return Design(
        actuator=actuator,
        points=points,
        family=family,
        reduced=reduced,
        model=model,
        remarks=(*proof.remarks, *poor_fits),
        schedule=proven(schedule, proof),
        fixed=fixed,
        proof=proof,
        validation=validation,
        fixed_validation=fixed_validation,
        comparison=comparison,
        seconds=stage.seconds,
    )


@dataclass(frozen=True, eq=False, kw_only=True)
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
    """with `proof`"""
    fixed: GainSchedule
    """one regulator for all points and variants, for comparison"""
    proof: Proof
    """what was shown of the schedule, and what was not"""
    validation: ValidationReport
    fixed_validation: ValidationReport
    comparison: dict[str, Standing]
    """"scheduled", and "P" and "P + feed-forward" where a P can meet the limits: their IAE over
    that of the fixed regulator"""
    seconds: dict[str, float]
    """time that each stage took"""

    @property
    def margin_verdicts(self) -> tuple[Verdict, ...]:
        """The verdicts on the linear loops, hidden coupling included."""
        return self.proof.linear

    @property
    def passed(self) -> bool:
        """True where every requirement on margins and on the nonlinear plant is met."""
        return self.proof.passed

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
        first = {
            run.scenario.kind: (run.scenario, run.trajectory)
            for run in reversed(self.validation.runs)
            if run.trajectory is not None and run.scenario.kind in ("step", "saturated")
        }
        return [
            self.schedule.save(directory / "schedule.json"),
            write_file(directory / "margins.csv", self.schedule.margins.to_csv().encode()),
            write_file(directory / "summary.txt", (self.summary() + "\n").encode()),
            write_report(
                directory / "report.html",
                self.schedule,
                self.validation,
                beside={"fixed": self.fixed},
                comparison=self.comparison,
                remarks=self.remarks,
            ),
            *save_figures(
                design_figures(self.family, self.schedule, first.values()),
                directory,
                formats=("svg",),
            ),
        ]


def _surfaces(reduced: SecondOrderFamily) -> tuple[QuasiLinearModel | None, tuple[str, ...]]:
    model: QuasiLinearModel | None = None
    remarks: tuple[str, ...] = ()
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", PoorFitWarning)
        try:
            model = fit_surfaces(reduced)
        except InputError as error:
            remarks = error.faults
    return model, (*remarks, *(str(warning.message) for warning in caught))


def _with_openings_between(actuator: Actuator, x: np.ndarray) -> np.ndarray:
    """The points x and openings of both signs between them, beyond the dead band."""
    between = actuator.dead_band + _BETWEEN * (1.0 - actuator.dead_band)
    return np.unique(np.concatenate([x, -between, between]))


def _tuned(
    tuner: Callable[..., GainSchedule],
    actuator: Actuator,
    x: np.ndarray,
    y: np.ndarray,
    loop: LoopName,
    structure: str,
    specification: Specification,
) -> GainSchedule:
    return tuner(actuator, x, y, loop=loop, structure=structure, specification=specification)


class _Stopwatch:
    """Runs the stages, tells of each as it begins, and takes its time in s."""

    def __init__(self, on_stage: Callable[[str], None] | None):
        self.on_stage = on_stage
        self.seconds: dict[str, float] = {}

    def __call__(self, name: str, work: Callable[..., Result], *given: object) -> Result:
        if self.on_stage is not None:
            self.on_stage(name)
        start = time.perf_counter()
        result = work(*given)
        self.seconds[name] = time.perf_counter() - start
        return result
