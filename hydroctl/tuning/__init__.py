"""From an actuator and a specification to a gain schedule."""

from .fast import FastTuning, tune_fast
from .search import SearchedSettings, search_settings
from .synthesis import tune, tune_fixed
from .task import default_points

__all__ = [
    "FastTuning",
    "SearchedSettings",
    "default_points",
    "search_settings",
    "tune",
    "tune_fast",
    "tune_fixed",
]
