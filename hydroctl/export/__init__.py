"""Schedules in the forms that machines and other programs take."""
