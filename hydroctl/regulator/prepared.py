"""A `ScheduledRegulator` in the form that the regulator law reads."""

from __future__ import annotations

import numpy as np

from ..errors import InputError
from .law import Compensation, Regulator
from .scheduled import ScheduledRegulator

_UNUSED_SECTIONS = ((1.0, 1.0), (1.0, 1.0))
_UNUSED_COMPENSATION = Compensation(*[1.0] * len(Compensation._fields))._replace(
    area_a=0.0, area_b=0.0
)


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
    used = 1.0 if s.feed_forward else 0.0
    return Regulator(
        x=x,
        x_slope=_slopes(x),
        y=y,
        y_slope=_slopes(y),
        table=table,
        limits=np.array([[side[0], side[-1]] for side in sides]),
        position=s.measured == "y",
        Ts=float(s.Ts),
        Tf=float(s.Tf),
        Tm=float(s.Tm),
        b=float(s.b),
        c=float(s.c),
        zz=float(s.zz),
        zp=float(s.zp),
        sections=(*(tuple(map(float, section)) for section in s.sections), *_UNUSED_SECTIONS)[:2],
        integrates=bool(np.any(s.ki)),
        derives=bool(np.any(s.kd)),
        shaped=shaped,
        tracking_rate=1.0 / float(s.Tt) if np.any(s.ki) else 0.0,
        extend_slope=used / float(s.speed_gain_extend),
        extend_offset=used * float(s.speed_offset_extend),
        retract_slope=used / float(s.speed_gain_retract),
        retract_offset=used * float(s.speed_offset_retract),
        compensated=s.compensation is not None,
        compensation=_UNUSED_COMPENSATION if s.compensation is None else s.compensation,
        inverse_depth=float(s.inverse_depth),
        inverse_width=float(s.inverse_width),
        delay_samples=int(s.delay_samples),
        delay_fraction=float(s.delay_samples % 1.0),
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
