"""Schedules in the forms that machines and other programs take."""

from .schedules import FORMATS, export_schedule

__all__ = ["FORMATS", "export_schedule"]
