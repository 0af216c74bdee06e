"""The terms that kp, ki and kd multiply, of the reference r and the filtered measurement m_f:

    kp (b r - m_f) + I + kd d

    d  = (Tf d + g - g[k-1])/(Tf + Ts),  g = c r - m_f       backward Euler
    I += Ts (ki (r - m_f) + excess/Tt)                       forward Euler, in units of x

c = 1 takes the derivative of the error, c = 0 that of m_f. `excess` is what the limit of the
command takes away (back-calculation). I stays 0 for a schedule whose ki is 0 everywhere, d for one
whose kd is.
"""

from __future__ import annotations

import numpy as np

MEMORY = {
    "integral": "[1] sum of the integral, in units of x",
    "derivative": "[{m}/s] filtered derivative",
    "last": "[{m}] what was differentiated in the last sample",
}
SETTINGS = {
    "Tf": "[s] filter of the derivative",
    "b": "[1] share of the reference that kp sees",
    "c": "[1] share of the reference that kd sees",
    "integrates": "whether any ki is not 0",
    "derives": "whether any kd is not 0",
    "tracking_rate": "[1/s] 1/Tt of the anti-windup",
}


def settings(scheduled) -> dict:
    """The values of SETTINGS."""
    integrates = bool(np.any(scheduled.ki))
    return {
        "Tf": float(scheduled.Tf),
        "b": float(scheduled.b),
        "c": float(scheduled.c),
        "integrates": integrates,
        "derives": bool(np.any(scheduled.kd)),
        "tracking_rate": 1.0 / float(scheduled.Tt) if integrates else 0.0,
    }


def proportional(reference, m_f, kp, regulator):
    """What kp adds to the opening."""
    return kp * (regulator.b * reference - m_f)


def seen(reference, m_f, regulator):
    """g, what is differentiated."""
    return regulator.c * reference - m_f


def differentiate(reference, m, m_f, memory, regulator):
    """Derivative, backward Euler.

    Returns (d, g).
    """
    g = seen(reference, m_f, regulator)  # [{m}] what is differentiated
    before = np.where(
        memory.running == 0.0, (regulator.c - 1.0) * m, memory.last
    )  # [{m}] g, a sample ago
    summed = regulator.Tf * memory.derivative + g - before  # [{m}]
    derivative = np.where(regulator.derives, summed / (regulator.Tf + regulator.Ts), 0.0)  # [{m}/s]
    last = np.where(regulator.derives, g, 0.0)
    return derivative, last


def combine(reference, m_f, derivative, kp, kd, memory, regulator):
    """kp (b r - m_f) + I + kd d"""
    return proportional(reference, m_f, kp, regulator) + memory.integral + kd * derivative


def integrate(error, excess, ki, memory, regulator):
    """Integral, forward Euler, in units of x; back-calculation from the limit."""
    gained = regulator.Ts * (ki * error + excess * regulator.tracking_rate)  # [1] in this sample
    return np.where(regulator.integrates, memory.integral + gained, 0.0)


def held(opening, reference, m, kp, regulator):
    """The integral that holds `opening`."""
    needed = opening - proportional(reference, m, kp, regulator)  # [1]
    return np.where(regulator.integrates, needed, 0.0)
