"""Units of what a loop controls and of the gains, by loop."""

from __future__ import annotations

MEASURED_UNITS = {"velocity": "m/s", "position": "m"}
GAIN_UNITS = {
    "velocity": {"kp": "s/m", "ki": "1/m", "kd": "s^2/m", "notch_frequency": "rad/s"},
    "position": {"kp": "1/m", "ki": "1/(m*s)", "kd": "s/m", "notch_frequency": "rad/s"},
}
"""in the order of the schedule file"""
