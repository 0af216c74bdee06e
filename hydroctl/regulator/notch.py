"""The notch (s^2 + 2 zz wn s + wn^2)/(s^2 + 2 zp wn s + wn^2), Tustin's, prewarped at wn, in the
transposed direct form II; with zz = zp it passes u on unchanged. w = tan(wn Ts/2), wn Ts < pi."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np

MEMORY = {"notch_1": "[1] first state of the notch", "notch_2": "[1] second state of the notch"}
SETTINGS = {
    "zz": "[1] damping of the notch's zeros",
    "zp": "[1] damping of the notch's poles",
}


def settings(scheduled) -> dict:
    """The values of SETTINGS."""
    return {"zz": float(scheduled.zz), "zp": float(scheduled.zp)}


def is_used(regulator) -> bool:
    """Whether there is a notch."""
    return regulator.zz != regulator.zp


def coefficients(w, zz, zp):
    """(b0, b1, b2, a2) for w = tan(wn Ts/2); a1 = b1."""
    square = w * w  # [1]
    scale = 1.0 / (1.0 + 2.0 * zp * w + square)  # [1]
    b0 = (1.0 + 2.0 * zz * w + square) * scale  # [1]
    b1 = 2.0 * (square - 1.0) * scale  # [1] a1, too
    b2 = (1.0 - 2.0 * zz * w + square) * scale  # [1]
    a2 = (1.0 - 2.0 * zp * w + square) * scale  # [1]
    return b0, b1, b2, a2


def step(u, w, memory, regulator):
    """Notch (s^2 + 2 zz wn s + wn^2)/(s^2 + 2 zp wn s + wn^2), Tustin prewarped at wn."""
    b0, b1, b2, a2 = coefficients(w, regulator.zz, regulator.zp)
    absent = regulator.zz == regulator.zp
    notched = np.where(absent, u, b0 * u + memory.notch_1)  # [1]
    notch_1 = np.where(absent, 0.0, b1 * u - b1 * notched + memory.notch_2)  # [1]
    notch_2 = np.where(absent, 0.0, b2 * u - a2 * notched)  # [1]
    return notched, notch_1, notch_2


def absent_step(u, w, memory, regulator):
    """`step` without a notch, to the last bit."""
    return u, 0.0, 0.0


def rest(u, w, regulator):
    """Notch after u has stood for long: both states."""
    _, _, b2, a2 = coefficients(w, regulator.zz, regulator.zp)
    return np.where(regulator.zz == regulator.zp, 0.0, (b2 - a2) * u)


def blocks(w, regulator) -> list:
    """(step of an input and the states, how many states) as a linear block."""

    def block(u, states):
        memory = SimpleNamespace(notch_1=states[0], notch_2=states[1])
        notched, *new = step(u, w, memory, regulator)
        return notched, new

    return [(block, 2)] if is_used(regulator) else []
