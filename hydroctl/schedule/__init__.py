"""`GainSchedule`, what was shown of it, and its file."""

from .margins import ScheduleMargins, WorstPoint
from .proof import Proof
from .schedule import GainSchedule, check_coupling, check_margins, load_schedule

__all__ = [
    "GainSchedule",
    "Proof",
    "ScheduleMargins",
    "WorstPoint",
    "check_coupling",
    "check_margins",
    "load_schedule",
]
