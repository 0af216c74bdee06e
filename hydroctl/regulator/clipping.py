"""Limits of a number."""

from __future__ import annotations

import numpy as np


def within(value, lowest, highest):
    """`value`, held between `lowest` and `highest`."""
    raised = np.where(value < lowest, lowest, value)
    return np.where(raised > highest, highest, raised)
