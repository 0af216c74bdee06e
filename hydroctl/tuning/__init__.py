"""From an actuator and a specification to a gain schedule."""

from .fast import FastTuning, tune_fast
from .search import SearchedTuning, tune_search
from .synthesis import tune, tune_fixed
from .task import default_points

__all__ = ["FastTuning", "SearchedTuning", "default_points", "tune", "tune_fast", "tune_fixed", "tune_search"]
