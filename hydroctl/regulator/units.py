"""Units of what a loop controls and of the gains, by the measured signal."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

MEASURED_UNITS: Mapping[str, str] = MappingProxyType({"v": "m/s", "y": "m"})
GAIN_UNITS: Mapping[str, Mapping[str, str]] = MappingProxyType(
    {
        "v": MappingProxyType(
            {"kp": "s/m", "ki": "1/m", "kd": "s^2/m", "notch_frequency": "rad/s"}
        ),
        "y": MappingProxyType(
            {"kp": "1/m", "ki": "1/(m*s)", "kd": "s/m", "notch_frequency": "rad/s"}
        ),
    }
)
"""in the order of the schedule file"""
