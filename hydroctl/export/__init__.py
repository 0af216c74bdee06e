"""Schedules, and couplings of several, in the forms that machines and other programs take."""

from .coupling import export_coupling
from .fmu import export_plant
from .schedules import FORMATS, export_schedule

__all__ = ["FORMATS", "export_coupling", "export_plant", "export_schedule"]
