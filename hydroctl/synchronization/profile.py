"""`MotionProfile`: the motion that several cylinders are to make together; `s_curve` makes one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..machine.actuator import Actuator
from ..model.operating_point import find_operating_points, stall_force

_PEAK = 1.875
"""peak speed of `s_curve` over its mean speed"""


@dataclass(frozen=True, eq=False, kw_only=True)
class MotionProfile:
    """A position and its speed over n samples of Ts seconds. Raises InputError, all faults at
    once."""

    Ts: float
    """sample time in s"""
    position: np.ndarray
    """(n,) m"""
    speed: np.ndarray
    """(n,) m/s, for the feed-forward"""

    def __post_init__(self):
        faults = []
        if not 0.0 < self.Ts < np.inf:
            faults.append(f"Ts = {self.Ts!r} must be a sample time above 0 s.")
        position, speed = (
            np.ascontiguousarray(values, dtype=float) for values in (self.position, self.speed)
        )
        if position.ndim != 1 or position.size < 2:
            faults.append(
                f"position of shape {position.shape} must be one row of at least two samples."
            )
        if speed.shape != position.shape:
            faults.append(
                f"speed of shape {speed.shape} must have one value for each of the {position.size}"
                " positions."
            )
        for name, values in (("position", position), ("speed", speed)):
            if not np.isfinite(values).all():
                faults.append(f"{name} holds a value that is not finite; remove it.")
        if faults:
            raise InputError(faults)
        object.__setattr__(self, "position", position)
        object.__setattr__(self, "speed", speed)

    @property
    def t(self) -> np.ndarray:
        """(n,) the sample instants in s."""
        return self.Ts * np.arange(self.position.size)


def s_curve(
    start: float,
    end: float,
    duration: float,
    *,
    Ts: float = 1e-3,
    before: float = 0.1,
    after: float = 0.5,
) -> MotionProfile:
    """From rest at `start` to rest at `end` (m) in `duration` s, with `before` and `after` s at
    rest on either side.

    y = start + (end - start) (10 u^3 - 15 u^4 + 6 u^5), u = time/duration: the path of least jerk.
    Its speed peaks at 1.875 times the mean speed, its acceleration at 5.77 (end -
    start)/duration^2.
    """
    times = {"duration": duration, "Ts": Ts}
    faults = [
        f"{name} = {value!r} must be a time above 0 s."
        for name, value in times.items()
        if not 0.0 < value < np.inf
    ]
    rests = {"before": before, "after": after}
    faults += [
        f"{name} = {value!r} must be a time of at least 0 s."
        for name, value in rests.items()
        if not 0.0 <= value < np.inf
    ]
    faults += [
        f"{name} = {y!r} must be finite."
        for name, y in (("start", start), ("end", end))
        if not np.isfinite(y)
    ]
    if faults:
        raise InputError(faults)
    t = Ts * np.arange(round((before + duration + after) / Ts) + 1)
    u = np.clip((t - before) / duration, 0.0, 1.0)
    distance = end - start
    position = start + distance * u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
    return MotionProfile(
        Ts=Ts, position=position, speed=distance / duration * 30.0 * u**2 * (1.0 - u) ** 2
    )


def standard_motion(
    actuators: Sequence[Actuator], *, Ts: float = 1e-3
) -> tuple[MotionProfile, list[np.ndarray]]:
    """(profile, loads (N, n) in N) by the cylinders' own measures, for a first trial of a group.

    From 0.3 to 0.7 of the stroke with a peak of half the lowest full speed; midway the last
    cylinder's load steps by a tenth of what it can hold. Raises OperatingPointError where a
    cylinder cannot extend.
    """
    stroke = min(actuator.stroke for actuator in actuators)
    speed = min(
        float(find_operating_points(actuator, 1.0, 0.5 * stroke).v) for actuator in actuators
    )
    profile = s_curve(0.3 * stroke, 0.7 * stroke, _PEAK * 0.4 * stroke / (0.5 * speed), Ts=Ts)
    loads = [np.zeros(profile.t.size) for _ in actuators]
    loads[-1][profile.t.size // 2 :] = 0.1 * float(
        np.abs(stall_force(actuators[-1], np.array([-1.0, 1.0]))).min()
    )
    return profile, loads
