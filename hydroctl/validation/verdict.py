"""Requirements, and the verdict on each: what was asked, what was achieved, where it was worst."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass

import numpy as np

from ..loop.quantity import controlled_quantity
from ..machine.actuator import Actuator
from ..schedule.verdict import Verdict
from ..simulation.scenario import Scenario
from .metrics import BAND, Metrics
from .scale import Scale


@dataclass(frozen=True)
class Requirement:
    """`achieved` of a motion must not exceed `limit`, in every scenario whose kind is in
    `kinds`."""

    name: str
    unit: str
    """as shown; SI"""
    reason: str
    """where the limit comes from"""
    kinds: tuple[str, ...]
    achieved: Callable[[Metrics], float]
    limit: Callable[[Scenario, Actuator], float]
    """infinite where the machine states none: what was achieved is then a remark"""


_ALL = ("step", "saturated", "reversal", "tracking")
_SETTLES = ("step", "saturated", "reversal")


def default_requirements(scale: Scale, loop: str, *, Mt: float = 1.3) -> tuple[Requirement, ...]:
    """Requirements that follow from the machine (its time constant, pressures and stroke) and the
    design's Mt."""
    times = scale.settling / scale.time_constant
    return (
        Requirement(
            "settling time",
            "s",
            f"{times:g} time constants 1/(2 zeta omega_n) ({scale.time_constant:.3g} s each), after"
            " the way at full opening",
            _SETTLES,
            lambda m: m.settling_time,
            _settle_by,
        ),
        Requirement(
            "overshoot of a step",
            "",
            "Mt - 1 of the design",
            ("step",),
            lambda m: m.overshoot,
            lambda *_: Mt - 1.0,
        ),
        Requirement(
            "overshoot after saturation",
            controlled_quantity(loop).unit,
            "what a step within the valve's range may overshoot: the integral must not have"
            " wound up",
            ("saturated",),
            lambda m: m.passing,
            lambda *_: (Mt - 1.0) * scale.step,
        ),
        Requirement(
            "residual oscillation",
            "",
            "half the settling band",
            _SETTLES,
            lambda m: m.oscillation,
            lambda *_: 0.5 * BAND,
        ),
        Requirement(
            "steady error",
            "",
            "half the settling band",
            _SETTLES,
            lambda m: abs(m.steady_error),
            lambda *_: 0.5 * BAND,
        ),
        Requirement(
            "peak pressure",
            "Pa",
            "pressure_rating",
            _ALL,
            lambda m: m.peak_pressure,
            lambda _, plant: np.inf if plant.pressure_rating is None else plant.pressure_rating,
        ),
        Requirement(
            "cavitation time",
            "s",
            "no chamber may cavitate",
            _ALL,
            lambda m: m.cavitation_time,
            lambda *_: 0.0,
        ),
        Requirement(
            "overtravel",
            "m",
            "1 % of the stroke, for the give of the end stops",
            _ALL,
            lambda m: m.beyond_stroke,
            lambda _, plant: 0.01 * plant.stroke,
        ),
    )


def _settle_by(scenario: Scenario, _) -> float:
    assert scenario.settle_by is not None  # a scenario has set it
    return scenario.settle_by


def worst_of(achieved: np.ndarray, limit: np.ndarray) -> int:
    """Which of the cases passes its limit by most: infinitely where there is nothing to judge
    (NaN).

    Of cases that are equal in that, as all are without a limit, the one that achieved most.
    """
    excess = np.where(np.isnan(achieved), np.inf, np.subtract(achieved, limit))
    return int(np.lexsort((np.nan_to_num(-achieved, nan=np.inf), -excess))[0])


def judge(requirements: Iterable[Requirement], runs) -> tuple[Verdict, ...]:
    """A verdict for each requirement that some run is subject to, and one for the runs that did not
    reach their end.

    A run has `.scenario`, `.variant`, `.actuator`, `.metrics` and `.reason`. A requirement whose
    metric a run does not have (NaN: there is no step, or it ends before it should have settled) is
    not met.
    """
    ended = [run for run in runs if not run.reason]
    verdicts = []
    for requirement in requirements:
        subject = [run for run in ended if run.scenario.kind in requirement.kinds]
        if subject:
            found = [
                (requirement.achieved(run.metrics), requirement.limit(run.scenario, run.actuator))
                for run in subject
            ]
            worst = worst_of(*np.array(found).T)
            (achieved, limit), run = found[worst], subject[worst]
            common = (
                requirement.name,
                requirement.unit,
                requirement.reason,
                limit,
                achieved,
                achieved <= limit,
            )
            verdicts.append(Verdict(*common, run.scenario.name, run.variant))
    failed = [run for run in runs if run.reason]
    worst = (failed or runs)[0]
    reason = worst.reason or "every simulation must reach its end"
    count = float(len(failed))
    return (
        Verdict(
            "simulations that failed",
            "",
            reason,
            0.0,
            count,
            not failed,
            worst.scenario.name,
            worst.variant,
        ),
        *verdicts,
    )
