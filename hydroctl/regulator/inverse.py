"""The inverse of the dead band: the opening that lets the dead band pass w, |w| <= 1, a smooth jump
by `inverse_depth` that is done at about `inverse_width`."""

from __future__ import annotations

import numpy as np

MEMORY: dict[str, str] = {}
SETTINGS = {
    "inverse_depth": "[1] opening that the inverse of the dead band jumps over; 0: no inverse",
    "inverse_width": "[1] opening within which it does",
}


def settings(scheduled) -> dict:
    """The values of SETTINGS."""
    return {
        "inverse_depth": float(scheduled.inverse_depth),
        "inverse_width": float(scheduled.inverse_width),
    }


def is_used(regulator) -> bool:
    """Whether a dead band is inverted."""
    return regulator.inverse_depth != 0.0


def step(w, regulator):
    """Inverse of the dead band: the opening that lets it pass w."""
    size = np.where(w < 0.0, -w, w)  # [1] |w|
    width = regulator.inverse_width
    return w + regulator.inverse_depth * w * ((1.0 + width) / (size + width) - 1.0)


def absent_step(w, regulator):
    """`step` without an inverse, to the last bit."""
    return w


def undone(x, regulator):
    """What the inverse of the dead band makes x of."""
    depth, width = regulator.inverse_depth, regulator.inverse_width
    gain = 1.0 - depth  # [1]
    middle = gain * width + depth * (1.0 + width)  # [1]
    size = np.where(x < 0.0, -x, x)  # [1] |x|
    half = 0.5 * (middle - size)  # [1]
    passed = (np.sqrt(half * half + gain * size * width) - half) / gain  # [1] for |x|
    return np.where(depth == 0.0, x, np.where(x < 0.0, -passed, passed))
