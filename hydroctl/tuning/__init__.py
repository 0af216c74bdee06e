"""From an actuator and a specification to a gain schedule."""

from .fast import FastTuning, tune_fast
from .synthesis import default_points, tune, tune_fixed

__all__ = ["FastTuning", "default_points", "tune", "tune_fast", "tune_fixed"]
