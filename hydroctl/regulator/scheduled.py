"""`ScheduledRegulator`: gains over valve opening and position and the constants of the law,
whatever the machine.

The tables are bilinear between nodes and clipped outside. They never interpolate across x = 0: x >=
0 uses the nodes with x > 0, x < 0 those with x < 0. The scheduling signals are the previous
saturated x and the measured y.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np

from .compensation import Compensation
from .lookup import interpolation
from .structures import Regulators


@dataclass(frozen=True, eq=False, kw_only=True)
class ScheduledRegulator:
    """What the law runs on; `prepared.regulator_of` turns it into the numbers that the law
    reads."""

    measured: Literal["v", "y"]
    """what is controlled: the speed or the position"""
    structure: str
    x: np.ndarray
    """(nx,) nodes of the valve opening, ascending, none zero"""
    y: np.ndarray
    """(ny,) nodes of the position in m, ascending"""
    kp: np.ndarray
    """(nx, ny), x per unit of what is controlled, m/s or m"""
    ki: np.ndarray
    """(nx, ny), as kp per s"""
    kd: np.ndarray
    """(nx, ny), as kp times s"""
    notch_frequency: np.ndarray
    """(nx, ny), rad/s"""
    Ts: float
    """sample time in s"""
    delay_samples: float
    """delay from measurement to valve command in samples"""
    Tf: float
    """derivative filter time in s"""
    Tm: float
    """time of the filter of the measurement in s; 0: none"""
    Tt: float
    """time constant of the anti-windup in s"""
    b: float
    """set-point weight of kp"""
    c: float
    """set-point weight of kd: 1 for a derivative on the error, 0 on the measurement"""
    zz: float
    """damping of the notch's zeros; equal to zp where there is no notch"""
    zp: float
    """damping of the notch's poles"""
    sections: tuple[tuple[float, float], ...]
    """(zero, pole) of each lead-lag section, as multiples of the notch frequency"""
    feed_forward: bool
    """whether x_ff = v_ref / speed_gain + speed_offset is added for a moving reference"""
    speed_gain_extend: float
    """dv/dx in m/s for v_ref > 0"""
    speed_gain_retract: float
    """dv/dx in m/s for v_ref < 0"""
    speed_offset_extend: float
    """x at which extending starts (leakage)"""
    speed_offset_retract: float
    """x at which retracting starts (leakage)"""
    compensation: Compensation | None
    """what the compensation of the pressures needs; None: none"""
    inverse_depth: float
    """the part of the opening that the inverse of the dead band jumps over; 0: no inverse"""
    inverse_width: float
    """the opening over which it does so"""

    @property
    def regulators(self) -> Regulators:
        """The regulators at the nodes, shape (nx, ny)."""
        return self._regulators(self.kp, self.ki, self.kd, self.notch_frequency)

    def gains(self, x, y) -> Regulators:
        """The regulators that act at x and y (arrays broadcast): bilinear, clipped, sides of x
        apart."""
        index, weight = interpolation(self.x, self.y, x, y)
        tables = (self.kp, self.ki, self.kd, self.notch_frequency)
        values = ((np.ravel(table)[index] * weight).sum(axis=-1) for table in tables)
        return self._regulators(*values)

    def _regulators(self, kp, ki, kd, notch_frequency) -> Regulators:
        tables = (kp, ki, kd, notch_frequency)
        return Regulators(self.Ts, *tables, self.Tf, self.zz, self.zp, self.sections, self.Tm)
