"""`GainSchedule`, its margins and its file."""

from .margins import ScheduleMargins, WorstPoint
from .schedule import GainSchedule, check_coupling, check_margins, load_schedule

__all__ = [
    "GainSchedule",
    "ScheduleMargins",
    "WorstPoint",
    "check_coupling",
    "check_margins",
    "load_schedule",
]
