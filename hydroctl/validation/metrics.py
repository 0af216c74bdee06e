"""Metrics of one closed-loop motion."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from ..machine.actuator import Actuator
from ..simulation.scenario import Scenario
from ..simulation.trajectory import Trajectory

BAND = 0.02
"""Half-width of the settling band, as a fraction of the step."""


@dataclass(frozen=True)
class Metrics:
    """What one motion achieved; e = reference - measured, in m/s or m.

    The first six concern the last change of the reference: the step goes from what was measured
    then to the last reference. They are NaN for a scenario of kind "tracking" and where there is no
    step.
    """

    rise_time: float
    """s from 10 to 90 % of the step"""
    settling_time: float
    """s after which it stays within 2 % of the step; infinite where it ends outside"""
    overshoot: float
    """by how much the reference is passed at most, as a fraction of the step"""
    passing: float
    """the same in m/s or m"""
    oscillation: float
    """peak to peak of e once the scenario should have settled (`settle_by`), as a fraction of the
    step"""
    steady_error: float
    """mean of e over the last tenth of the scenario, as a fraction of the step"""
    iae: float
    """integral of |e| over the whole scenario, in m or m s"""
    ise: float
    """integral of e^2, in m^2/s or m^2 s"""
    largest_error: float
    """max |e|, m/s or m"""
    peak_pressure: float
    """Pa, of both chambers"""
    lowest_pressure: float
    """Pa"""
    cavitation_time: float
    """s that a chamber spends below tank pressure"""
    total_variation: float
    """sum of |changes| of the command x"""
    saturation_time: float
    """s that the command spends at its limits"""
    beyond_stroke: float
    """m by which the piston passed an end of the stroke"""


def measure(actuator: Actuator, scenario: Scenario, trajectory: Trajectory) -> Metrics:
    """The metrics of `trajectory`, the motion of `actuator` in `scenario`."""
    Ts, y, command = scenario.Ts, trajectory.y, trajectory.command
    assert command is not None  # a closed loop has one
    measured = getattr(trajectory, scenario.quantity.signal)
    error = scenario.reference - measured
    lowest = np.minimum(trajectory.p_a, trajectory.p_b)
    slack = 1e-9 * actuator.supply_pressure
    return Metrics(
        **_step_metrics(scenario, measured),
        iae=float(np.abs(error).sum() * Ts),
        ise=float((error**2).sum() * Ts),
        largest_error=float(np.abs(error).max()),
        peak_pressure=float(np.maximum(trajectory.p_a, trajectory.p_b).max()),
        lowest_pressure=float(lowest.min()),
        cavitation_time=float(np.count_nonzero(lowest < actuator.tank_pressure - slack) * Ts),
        total_variation=float(np.abs(np.diff(command, prepend=0.0)).sum()),
        saturation_time=float(np.count_nonzero(np.abs(command) >= 1.0) * Ts),
        beyond_stroke=float(max(0.0, -y.min(), y.max() - actuator.stroke)),
    )


def last_step(scenario: Scenario) -> tuple[int, int, int]:
    """(first, late, steady): the samples of the last change of the reference, from where it should
    have settled, and of the last tenth of the scenario; all at the end for a scenario of kind
    "tracking".
    """
    n = scenario.reference.size
    if scenario.kind == "tracking":
        return n, n, n
    assert scenario.settle_by is not None  # a scenario has set it
    changes = np.flatnonzero(np.diff(scenario.reference)) + 1
    first = int(changes[-1]) if changes.size else 0
    late = min(n, first + math.ceil(scenario.settle_by / scenario.Ts))
    return first, late, max(first, n - max(1, n // 10))


def _step_metrics(scenario: Scenario, measured: np.ndarray) -> dict[str, float]:
    names = ("rise_time", "settling_time", "overshoot", "passing", "oscillation", "steady_error")
    first, late, steady = last_step(scenario)
    if first >= scenario.reference.size:
        return dict.fromkeys(names, math.nan)
    answer, target = measured[first:], scenario.reference[-1]
    step = target - answer[0]
    if step == 0.0:
        return dict.fromkeys(names, math.nan)
    progress = (answer - answer[0]) / step
    away = np.flatnonzero(np.abs(progress - 1.0) > BAND)
    settled_part = progress[late - first :]
    settled = away.size == 0 or away[-1] + 1 < progress.size
    values = (
        _first(progress >= 0.9, scenario.Ts) - _first(progress >= 0.1, scenario.Ts),
        (away[-1] + 1 if away.size else 0) * scenario.Ts if settled else math.inf,
        max(0.0, float(progress.max()) - 1.0),
        max(0.0, float(progress.max()) - 1.0) * abs(step),
        np.ptp(settled_part) if settled_part.size else math.nan,
        1.0 - progress[steady - first :].mean(),
    )
    return dict(zip(names, map(float, values), strict=True))


def _first(condition: np.ndarray, Ts: float) -> float:
    return float(np.argmax(condition)) * Ts if condition.any() else math.inf
