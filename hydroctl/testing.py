"""For your own pytest files: pin where poles lie and which margins a schedule keeps.

    def test_press():
        schedule = hydroctl.load_schedule("press.json")
        assert_margins(schedule, Ms=1.7, phase_margin=np.radians(55))
        assert_poles_in(schedule, Disk(1.0))

A failure names the worst point, its pole or margin, and how far off it is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .digits import EXACT, FEWEST, apart
from .loop.margins import WORST_AT_MOST, Loop
from .model.linearization import LinearFamily
from .schedule.schedule import GainSchedule

_LIMITS = (
    *WORST_AT_MOST,
    "disk_margin",
    "gain_margin",
    "phase_margin",
    "delay_margin",
    "crossover",
)


@dataclass(frozen=True)
class HalfPlane:
    """Re s < right (rad/s)."""

    right: float = 0.0

    def distance(self, poles: np.ndarray) -> np.ndarray:
        """How far each pole lies outside, in rad/s; not positive inside."""
        return poles.real - self.right


@dataclass(frozen=True)
class DampingCone:
    """Poles with at least this damping ratio, in the s-plane."""

    damping: float

    def distance(self, poles: np.ndarray) -> np.ndarray:
        """How much damping is missing; not positive inside."""
        size = np.abs(poles)
        return self.damping + np.where(
            size == 0.0, 0.0, poles.real / np.where(size == 0.0, 1.0, size)
        )


@dataclass(frozen=True)
class Disk:
    """|z - centre| < radius; `Disk(1.0)` is the region of stable sampled loops."""

    radius: float
    centre: complex = 0.0

    def distance(self, poles: np.ndarray) -> np.ndarray:
        """How far each pole lies outside; not positive inside."""
        return np.abs(poles - self.centre) - self.radius


def assert_poles_in(
    subject: LinearFamily | GainSchedule, region: HalfPlane | DampingCone | Disk
) -> None:
    """AssertionError unless all poles lie in `region`: of the plant, s-plane (a family, its
    feasible points), or of the sampled closed loops at the design points of every variant, z-plane
    (a schedule)."""
    poles, describe = _poles(subject)
    outside = region.distance(poles)
    worst = np.unravel_index(np.argmax(outside), outside.shape)
    if not outside[worst] <= 0.0:
        count = np.count_nonzero(outside.max(axis=-1) > 0.0)
        raise AssertionError(
            f"{count} of {outside[..., 0].size} points have poles outside {region}; worst at"
            f" {describe(worst[:-1])}: pole {_outside(region, poles[worst])}, off by"
            f" {outside[worst]:.3g}"
        )


def _outside(region: HalfPlane | DampingCone | Disk, pole: complex) -> str:
    """The pole in as many digits as put it outside in print, too."""
    texts = [f"{pole:.{count}g}" for count in range(FEWEST, EXACT + 1)]
    return next(
        (text for text in texts if region.distance(np.array(complex(text))) > 0.0), texts[-1]
    )


def _poles(subject):
    if isinstance(subject, GainSchedule):
        x, y = subject.design_x, subject.design_y
        labels, plants = subject.plants.labels, subject.sampled_plants(x, y)
        regulators = subject.gains(x[:, None], y).broadcast_to(plants.shape)
        return (
            Loop(plants, regulators).poles(),
            lambda i: f"x={x[i[1]]:g}, y={y[i[2]]:g} m, {labels[i[0]]}",
        )
    points = subject.points
    index = np.argwhere(points.feasible)
    return (
        subject.poles()[points.feasible],
        lambda i: f"x={points.x[*index[i]]:g}, y={points.y[*index[i]]:g} m",
    )


def assert_margins(schedule: GainSchedule, **limits: float) -> None:
    """AssertionError unless every margin holds at the design points, half-way between them, and on
    every variant.

    `Ms`, `Mt` and `gain_reduction_margin` (factor) are upper limits; `disk_margin`, `gain_margin`
    (factor), `phase_margin` (rad), `delay_margin` (s) and `crossover` (rad/s) lower ones. Unstable
    loops always fail.
    """
    if unknown := sorted(set(limits) - set(_LIMITS)):
        raise TypeError(f"unknown margin {', '.join(unknown)}; known: {', '.join(_LIMITS)}")
    faults = (
        [f"{schedule.margins.unstable} closed loops are unstable"]
        if schedule.margins.unstable
        else []
    )
    for name, limit in limits.items():
        worst = schedule.margins.worst(name)
        missing = worst.value - limit if name in WORST_AT_MOST else limit - worst.value
        if not missing <= 0.0:
            where = f"x={worst.x:g}, y={worst.y:g} m, {worst.variant}"
            reached, allowed = apart(worst.value, limit)
            faults.append(f"{name} is {reached} at {where}: limit {allowed}, off by {missing:.3g}")
    if faults:
        raise AssertionError("; ".join(faults))
