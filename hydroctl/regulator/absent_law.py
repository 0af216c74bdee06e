"""What functions of the regulator law come to, to the last bit, for a schedule that does not use
them.

Compiled code for such schedules uses these lines in place of those of `law`, whose roots and
divisions would take much of its time.
"""

from __future__ import annotations


def filtered(measured, memory, regulator):
    """No filter of the measurement."""
    return measured


def lead_lag(u, wn, memory, regulator):
    """No lead-lag section."""
    return u, 0.0, 0.0


def pressure_ratio(opening, y, p_a, p_b, regulator):
    """No compensation of the pressures."""
    return 1.0


def inverse(w, regulator):
    """No inverse of the dead band."""
    return w


def notch(u, wn, memory, regulator):
    """No notch."""
    return u, 0.0, 0.0
