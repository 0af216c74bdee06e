"""`validate`: a schedule against requirements, on the nonlinear plant and its variants."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

from ..errors import InputError, SimulationError
from ..machine.actuator import Actuator
from ..schedule.verdict import Verdict
from ..simulation import Scenario, Trajectory, simulate_closed_loop
from .metrics import Metrics, measure
from .plants import plants_of, require_machine
from .scale import scale_of
from .scenarios import step_scenarios
from .verdict import Requirement, default_requirements, judge

if TYPE_CHECKING:
    from ..schedule.schedule import GainSchedule


@dataclass(frozen=True, eq=False)
class Run:
    """One scenario on one variant of the plant. A run that failed says why in `reason` and has
    neither motion nor metrics."""

    scenario: Scenario
    variant: str
    actuator: Actuator
    trajectory: Trajectory | None
    metrics: Metrics | None
    reason: str = ""


@dataclass(frozen=True, eq=False)
class ValidationReport:
    """All runs, and the verdict on every requirement."""

    runs: tuple[Run, ...]
    verdicts: tuple[Verdict, ...]

    @property
    def passed(self) -> bool:
        """True where every requirement is met."""
        return all(verdict.passed for verdict in self.verdicts)

    @property
    def metrics(self) -> dict[tuple[str, str], Metrics | None]:
        """Metrics by (variant, scenario name)."""
        return {(run.variant, run.scenario.name): run.metrics for run in self.runs}

    def summary(self) -> str:
        """A line for each requirement, and the outcome."""
        failed = sum(not verdict.passed for verdict in self.verdicts)
        variants = len({run.variant for run in self.runs})
        plants = "1 plant" if variants == 1 else f"{variants} plants"
        head = (
            f"{len(self.runs)} runs of the nonlinear model ({len(self.runs) // variants} scenarios,"
            f" {plants}): "
        )
        outcome = (
            "every requirement is met"
            if self.passed
            else f"{failed} of {len(self.verdicts)} requirements are not met"
        )
        return "\n".join([head + outcome, *(f"  {verdict}" for verdict in self.verdicts)])


def validate(
    actuator: Actuator,
    schedule: GainSchedule,
    *,
    scenarios: Sequence[Scenario] | None = None,
    variants: str | Mapping[str, Actuator] = "nominal",
    requirements: Sequence[Requirement] | None = None,
) -> ValidationReport:
    """Simulate every scenario on every variant of the nonlinear plant and judge the requirements.

    `scenarios` default to `step_scenarios`, `requirements` to `default_requirements` of the nominal
    machine and the Mt of the schedule's specification. `variants`: see `plants_of`. A run that
    fails is in the report with its reason; it raises nothing. Raises InputError for what is no
    Actuator, an unknown loop or variant, for scenarios that do not fit the schedule and for a plant
    that cannot hold its load at rest.
    """
    require_machine(actuator)
    if scenarios is None:
        scenarios = step_scenarios(actuator, schedule.loop, Ts=schedule.Ts)
    if not scenarios:
        raise InputError(
            "scenarios is empty; give at least one, or leave it out for the library's."
        )
    if requirements is None:
        requirements = default_requirements(
            scale_of(actuator, schedule.loop), schedule.loop, Mt=schedule.specification.Mt
        )
    plants = plants_of(actuator, schedule, variants)
    runs = tuple(
        _run(label, plant, schedule, scenario)
        for label, plant in plants.items()
        for scenario in scenarios
    )
    return ValidationReport(runs, judge(requirements, runs))


def _run(label: str, plant: Actuator, schedule: GainSchedule, scenario: Scenario) -> Run:
    try:
        trajectory = simulate_closed_loop(plant, schedule, scenario)
    except SimulationError as error:
        return Run(scenario, label, plant, None, None, str(error))
    except InputError as error:
        raise InputError(f"{label} plant: {fault}" for fault in error.faults) from None
    return Run(scenario, label, plant, trajectory, measure(plant, scenario, trajectory))
