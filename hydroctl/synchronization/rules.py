"""What a group does beside following: slow down for its weakest member, keep limits, stop together;
and what may fail."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from math import inf

import numpy as np

from ..errors import InputError, unknown_name
from ..machine.actuator import Actuator

FAILURES = ("sensor", "valve")


@dataclass(frozen=True, kw_only=True)
class RateOverride:
    """The common reference slows down for the cylinder that lags most: at `limit` it has come down
    to `least` of its speed.

    Without it a saturated cylinder falls behind and no coupling can help. Raises InputError, all
    faults at once.
    """

    free: float = 2e-4
    """m that a cylinder may lag without effect; above what it lags in normal motion"""
    limit: float = 1e-3
    """m of lag at which the rate is `least`; about what the cylinders may differ"""
    time_constant: float = 0.01
    """s, filter of the rate, which spares the feed-forward jumps"""
    least: float = 0.05
    """lowest rate; above 0, so that a cylinder that does not move at all is found by its lag"""

    def __post_init__(self):
        faults = []
        if not 0.0 <= self.free < self.limit < inf:
            faults.append(
                f"free = {self.free!r} m and limit = {self.limit!r} m must ascend from 0."
            )
        if not 0.0 <= self.time_constant < inf:
            faults.append(f"time_constant = {self.time_constant!r} must be at least 0 s.")
        if not 0.0 < self.least < 1.0:
            faults.append(f"least = {self.least!r} must lie between 0 and 1.")
        if faults:
            raise InputError(faults)

    @property
    def span(self) -> float:
        """m of lag that would take the rate from 1 to 0."""
        return (self.limit - self.free) / (1.0 - self.least)


@dataclass(frozen=True, kw_only=True)
class MotionLimits:
    """What the common reference never asks for, however fast its profile is: it is slowed down in
    time."""

    speed: float | Sequence[float] = inf
    """m/s that a cylinder may be moved at: one number, or one for each; the lowest counts, because
    all move together"""
    flow: float = inf
    """m^3/s that the supply they share can give: (sum of the areas that drive) x speed"""

    def __post_init__(self):
        speeds = np.atleast_1d(np.asarray(self.speed, dtype=float))
        faults = []
        if speeds.ndim != 1 or not (speeds > 0.0).all():
            faults.append(
                f"speed = {self.speed!r} must be above 0 m/s, one number or one for each cylinder."
            )
        if not self.flow > 0.0:
            faults.append(f"flow = {self.flow!r} must be above 0 m^3/s.")
        if faults:
            raise InputError(faults)

    def ceiling(self, speed: np.ndarray, actuators: Sequence[Actuator]) -> np.ndarray:
        """(n,) highest rate at which a path of this speed (n,) keeps both limits; at most 1."""
        areas = np.where(
            speed > 0.0, sum(a.area_a for a in actuators), sum(a.area_b for a in actuators)
        )
        allowed = np.minimum(np.min(self.speed), self.flow / areas)
        with np.errstate(divide="ignore"):
            return np.minimum(1.0, allowed / np.abs(speed))


@dataclass(frozen=True, kw_only=True)
class StopStrategy:
    """When the group stops, and how: once a position is not known or further than `largest_lag`
    from the common reference.

    All then follow a reference that is decelerated evenly to rest over `distance`; a cylinder whose
    valve is stuck is shut off.
    """

    distance: float = 2e-3
    """m over which the reference runs out"""
    largest_lag: float = 5e-3
    """m"""

    def __post_init__(self):
        values = {"distance": self.distance, "largest_lag": self.largest_lag}
        if faults := [
            f"{name} = {value!r} must be above 0 m."
            for name, value in values.items()
            if not 0.0 < value < inf
        ]:
            raise InputError(faults)


@dataclass(frozen=True, kw_only=True)
class Failure:
    """What fails in a test of the stop strategy."""

    cylinder: int
    """which one, from 0"""
    time: float
    """s from which on"""
    kind: str = "sensor"
    """"sensor": its position is not known; "valve": the valve stays as it was told last"""

    def __post_init__(self):
        faults = [] if 0.0 <= self.time < inf else [f"time = {self.time!r} must be at least 0 s."]
        faults += [] if self.kind in FAILURES else [unknown_name("kind", self.kind, FAILURES)]
        if faults:
            raise InputError(faults)
