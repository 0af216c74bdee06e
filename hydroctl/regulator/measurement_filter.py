"""The filter of the measurement, backward Euler: m_f = m + Tm/(Tm + Ts) (m_f - m), and m at a
start."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

MEMORY = {"filtered": "[{m}] the filtered measurement"}
SETTINGS = {"Tm": "[s] filter of the measurement; 0: none"}


def settings(scheduled) -> dict:
    """The values of SETTINGS."""
    return {"Tm": float(scheduled.Tm)}


def is_used(regulator) -> bool:
    """Whether there is a filter."""
    return regulator.Tm != 0.0


def step(measured, memory, regulator):
    """Filter of the measurement, backward Euler; it starts at the measurement."""
    keep = regulator.Tm / (regulator.Tm + regulator.Ts)  # [1]
    follows = measured + keep * (memory.filtered - measured)  # [{m}] after the first sample
    return np.where((memory.running == 0.0) | (regulator.Tm == 0.0), measured, follows)


def absent_step(measured, memory, regulator):
    """`step` without a filter, to the last bit."""
    return measured


def blocks(w, regulator) -> list:
    """(step of an input and the states, how many states) as a linear block."""

    def block(measured, states):
        filtered = step(measured, SimpleNamespace(filtered=states[0], running=1.0), regulator)
        return filtered, [filtered]

    return [(block, 1)] if is_used(regulator) else []
