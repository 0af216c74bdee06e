"""A `GainSchedule` in the form that the regulator law reads."""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from .law import Regulator

if TYPE_CHECKING:
    from ..schedule import GainSchedule


def regulator_of(schedule: GainSchedule) -> Regulator:
    """The schedule's tables and constants. Raises InputError where the law could not run on them."""
    s = schedule
    x, y = np.array(s.x, dtype=float), np.array(s.y, dtype=float)
    tables = (s.kp, s.ki, s.kd, np.where(s.zz == s.zp, 0.0, s.notch_frequency))
    table = np.ascontiguousarray(np.stack([np.array(values, dtype=float) for values in tables], axis=-1))
    faults = []
    if (np.diff(x) <= 0.0).any() or (np.diff(y) <= 0.0).any() or (x == 0.0).any():
        faults.append("the schedule's nodes x and y must ascend, and no node of x may be 0.")
    if not np.isfinite(table).all():
        faults.append("the schedule holds a gain that is not finite.")
    if s.zz != s.zp and not ((table[..., 3] > 0.0) & (table[..., 3] * s.Ts < np.pi)).all():
        faults.append(f"a notch frequency is not between 0 and the Nyquist frequency {np.pi / s.Ts:g} rad/s.")
    if s.delay_samples < 0 or s.delay_samples != int(s.delay_samples):
        faults.append(f"delay_samples = {s.delay_samples:g}: the sampled loop runs with a whole number of samples, 0 or more.")
    if faults:
        raise InputError(faults)
    sides = (x[x < 0.0] if (x < 0.0).any() else x, x[x > 0.0] if (x > 0.0).any() else x)
    used = 1.0 if s.feed_forward else 0.0
    return Regulator(
        x=x,
        x_slope=_slopes(x),
        y=y,
        y_slope=_slopes(y),
        table=table,
        limits=np.array([[side[0], side[-1]] for side in sides]),
        position=s.loop == "position",
        Ts=float(s.Ts),
        Tf=float(s.Tf),
        zz=float(s.zz),
        zp=float(s.zp),
        tracking_rate=1.0 / float(s.Tt) if np.any(s.ki) else 0.0,
        extend_slope=used / float(s.speed_gain_extend),
        extend_offset=used * float(s.speed_offset_extend),
        retract_slope=used / float(s.speed_gain_retract),
        retract_offset=used * float(s.speed_offset_retract),
        delay_samples=int(s.delay_samples),
    )


def _slopes(nodes: np.ndarray) -> np.ndarray:
    return np.append(1.0 / np.diff(nodes), 0.0)
