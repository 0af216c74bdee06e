"""What functions of the plant come to, to the last bit, on a machine without dry friction, end
stops, dead band and valve lag.

Compiled code for such machines uses these lines in place of those of `plant` and `motion`, whose
roots and divisions would take most of its time.
"""

from __future__ import annotations


def friction_force(v, p):
    """Viscous friction alone."""
    return p.viscous_friction * v


def end_stop_force(y, v, p):
    """No stops."""
    return 0.0


def effective_opening(x, p):
    """No dead band."""
    return x


def valve_rates(spool, spool_rate, command, p):
    """An ideal valve's spool stands still between commands."""
    return 0.0, 0.0


def plus(z, w, k):
    """z + w k where the last two slopes are zero."""
    return z[0] + w * k[0], z[1] + w * k[1], z[2] + w * k[2], z[3] + w * k[3], z[4], z[5]


def effects_bend(z, new, command, p):
    """No effect bends the field: x is held within a sample."""
    return False
