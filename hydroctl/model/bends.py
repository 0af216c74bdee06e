"""Where a quantity changes more sharply than a fixed step can follow."""

from __future__ import annotations

import numpy as np

_SHARP = 0.1
"""How much of itself a pressure drop or a creeping speed may change in a fixed step"""


def passes(one, other, level):
    """Whether `level` lies between two values."""
    return (one - level) * (other - level) < 0.0


def turns(one, other, width):
    """Whether a quantity changes by more than a part of its distance from 0, where that is more
    than `width`."""
    nearest = np.where(one * other < 0.0, 0.0, np.minimum(np.abs(one), np.abs(other)))
    return np.abs(other - one) > _SHARP * np.sqrt(nearest * nearest + width * width)
