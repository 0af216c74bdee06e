"""Feed-forward: v_ref/K + offset of the side of v_ref, 0 at rest."""

from __future__ import annotations

import numpy as np

MEMORY: dict[str, str] = {}
SETTINGS = {
    "extend_slope": "[s/m] feed-forward per speed for v_ref > 0",
    "extend_offset": "[1] opening at which extending begins",
    "retract_slope": "[s/m] feed-forward per speed for v_ref < 0",
    "retract_offset": "[1] opening at which retracting begins",
}


def settings(scheduled) -> dict:
    """The values of SETTINGS."""
    used = 1.0 if scheduled.feed_forward else 0.0
    return {
        "extend_slope": used / float(scheduled.speed_gain_extend),
        "extend_offset": used * float(scheduled.speed_offset_extend),
        "retract_slope": used / float(scheduled.speed_gain_retract),
        "retract_offset": used * float(scheduled.speed_offset_retract),
    }


def step(v_ref, regulator):
    """Feed-forward: the opening that gives the speed v_ref in steady state; 0 at rest."""
    slope = np.where(v_ref < 0.0, regulator.retract_slope, regulator.extend_slope)  # [s/m]
    offset = np.where(v_ref < 0.0, regulator.retract_offset, regulator.extend_offset)  # [1]
    return np.where(v_ref == 0.0, 0.0, v_ref * slope + offset)
