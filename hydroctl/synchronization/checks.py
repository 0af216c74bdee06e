"""What must be true of a group before anything is computed."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..digits import apart
from ..loop.quantity import POSITION
from ..machine.actuator import Actuator

if TYPE_CHECKING:
    from ..schedule.schedule import GainSchedule
    from .profile import MotionProfile

MOST_CYLINDERS = 16


def group_faults(actuators: Sequence[Actuator], schedules: Sequence[GainSchedule]) -> list[str]:
    """What keeps these cylinders from being one group."""
    count = len(actuators)
    faults = []
    if count == 0:
        faults.append(f"actuators is empty; give 2 to {MOST_CYLINDERS} cylinders.")
    elif count == 1:
        faults.append(
            "one cylinder has none to follow; give at least 2, or use simulate_closed_loop."
        )
    elif count > MOST_CYLINDERS:
        faults.append(f"{count} cylinders are too many; give at most {MOST_CYLINDERS}.")
    if len(schedules) != count:
        faults.append(
            f"{len(schedules)} schedules for {count} cylinders; give one for each, in their order."
        )
    for i, schedule in enumerate(schedules):
        if schedule.quantity is not POSITION:
            faults.append(
                f'schedule {i + 1} is for the {schedule.loop} loop; tune it with loop="position".'
            )
    if len(times := {schedule.Ts for schedule in schedules}) > 1:
        faults.append(
            f"the schedules are sampled every {_listed(times)} s; tune all for one sample time."
        )
    if len(strokes := {actuator.stroke for actuator in actuators}) > 1:
        faults.append(f"the strokes are {_listed(strokes)} m; give all cylinders one stroke.")
    return faults


def profile_faults(
    actuators: Sequence[Actuator], schedules: Sequence[GainSchedule], profile: MotionProfile
) -> list[str]:
    """What keeps the group from making this motion."""
    faults = []
    times = {schedule.Ts for schedule in schedules} - {profile.Ts}
    if times:
        own, *others = apart(profile.Ts, *sorted(times))
        faults.append(
            f"the reference is sampled every {own} s, schedules every {', '.join(others)} s; give"
            " both one time."
        )
    low, high = float(profile.position.min()), float(profile.position.max())
    for i, actuator in enumerate(actuators):
        if low < 0.0 or high > actuator.stroke:
            first, last, none, stroke = apart(low, high, 0.0, actuator.stroke)
            faults.append(
                f"the reference runs from {first} to {last} m, cylinder {i + 1} from {none} to"
                f" {stroke} m; keep within it."
            )
    return faults


def _listed(values) -> str:
    return ", ".join(apart(*sorted(values)))
