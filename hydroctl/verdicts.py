"""Verdicts on the margins of a schedule: at the design points, and between them."""

from __future__ import annotations

import numpy as np

from .schedule import GainSchedule, WorstPoint
from .validation import Verdict

_AT_NODES = 1.005
"""what the tuner's frequency grid may leave above a limit"""
_BETWEEN = 0.02
"""what interpolated gains may add to Ms and Mt between the design points"""


def margin_verdicts(schedule: GainSchedule) -> tuple[Verdict, ...]:
    """Ms and Mt at the design points and between them, and the number of unstable loops, over all variants."""
    specification, margins = schedule.specification, schedule.margins
    verdicts = []
    for name, limit in (("Ms", specification.Ms), ("Mt", specification.Mt)):
        for where, mask, allowed, reason in (
            ("at the design points", margins.designed, limit * _AT_NODES, "the specification, and 0.5 % for the tuner's grid"),
            ("between them", ~margins.designed, limit + _BETWEEN, "the specification, and 0.02 for interpolated gains"),
        ):
            if mask.any():
                verdicts.append(_verdict(f"{name} {where} (specified {limit:g})", reason, margins.worst(name, where=mask), allowed))
    k, i, j = np.unravel_index(np.argmin(margins.margins.stable), margins.margins.stable.shape)
    place = f"x={margins.x[i]:g}, y={margins.y[j]:g} m" if margins.unstable else "all points"
    variant = margins.variants[k] if margins.unstable else "all variants"
    count = float(margins.unstable)
    verdicts.append(Verdict("unstable closed loops", "", "poles of the sampled loop", 0.0, count, count == 0.0, place, variant))
    return tuple(verdicts)


def _verdict(name: str, reason: str, worst: WorstPoint, limit: float) -> Verdict:
    place = f"x={worst.x:g}, y={worst.y:g} m"
    return Verdict(name, "", reason, limit, worst.value, bool(worst.value <= limit), place, worst.variant)
