"""Schedules in the forms that machines and other programs take."""

from .fmu import export_plant
from .schedules import FORMATS, export_schedule

__all__ = ["FORMATS", "export_plant", "export_schedule"]
