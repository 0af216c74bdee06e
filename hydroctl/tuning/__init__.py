"""From an actuator and a specification to a gain schedule."""

from .synthesis import default_points, tune, tune_fixed

__all__ = ["default_points", "tune", "tune_fixed"]
