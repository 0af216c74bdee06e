"""A `ScheduledRegulator` in the form that the regulator law reads."""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from .law import STRUCTURES, Regulator
from .scheduled import ScheduledRegulator


def regulator_of(scheduled: ScheduledRegulator) -> Regulator:
    """The tables and constants of `scheduled`. Raises InputError where the law could not run on
    them."""
    s = scheduled
    x, y = np.array(s.x, dtype=float), np.array(s.y, dtype=float)
    shaped = s.zz != s.zp or bool(s.sections)
    tables = (s.kp, s.ki, s.kd, s.notch_frequency if shaped else np.zeros_like(s.notch_frequency))
    table = np.ascontiguousarray(
        np.stack([np.array(values, dtype=float) for values in tables], axis=-1)
    )
    if faults := _faults(s, x, y, table, shaped):
        raise InputError(faults)
    sides = (x[x < 0.0] if (x < 0.0).any() else x, x[x > 0.0] if (x > 0.0).any() else x)
    return Regulator(
        x=x,
        x_slope=_slopes(x),
        y=y,
        y_slope=_slopes(y),
        table=table,
        limits=np.array([[side[0], side[-1]] for side in sides]),
        position=s.measured == "y",
        Ts=float(s.Ts),
        shaped=shaped,
        delay_samples=int(s.delay_samples),
        delay_fraction=float(s.delay_samples % 1.0),
        **{
            name: value for structure in STRUCTURES for name, value in structure.settings(s).items()
        },
    )


def _faults(
    s: ScheduledRegulator, x: np.ndarray, y: np.ndarray, table: np.ndarray, shaped: bool
) -> list[str]:
    faults = []
    if (np.diff(x) <= 0.0).any() or (np.diff(y) <= 0.0).any() or (x == 0.0).any():
        faults.append("the schedule's nodes x and y must ascend, and no node of x may be 0.")
    if not np.isfinite(table).all():
        faults.append("the schedule holds a gain that is not finite.")
    if shaped and not ((table[..., 3] > 0.0) & (table[..., 3] * s.Ts < np.pi)).all():
        faults.append(
            f"a notch frequency is not between 0 and the Nyquist frequency {np.pi / s.Ts:g} rad/s."
        )
    if not 0.0 <= s.delay_samples < np.inf:
        faults.append(
            f"delay_samples = {s.delay_samples:g} must be a finite number of samples, 0 or more."
        )
    return faults


def _slopes(nodes: np.ndarray) -> np.ndarray:
    return np.append(1.0 / np.diff(nodes), 0.0)
