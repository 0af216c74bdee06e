"""From an actuator and a specification to a gain schedule."""

from .fast import FastTuning, tune_fast
from .synthesis import tune, tune_fixed
from .task import default_points

__all__ = ["FastTuning", "default_points", "tune", "tune_fast", "tune_fixed"]
