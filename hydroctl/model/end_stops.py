"""The stops at the ends of the stroke."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class EndStops(NamedTuple):
    """Stops at y = 0 and at the stroke; a stiffness of 0 for none."""

    stroke: float
    end_stop_stiffness: float
    """N/m"""
    end_stop_damping: float
    """s/m"""


def is_used(stops: EndStops) -> bool:
    """Whether there are stops."""
    return stops.end_stop_stiffness != 0.0


def force(y, v, stops: EndStops):
    """F_e in N on the piston, positive in the direction of extension: k d max(0, 1 + lambda dd/dt)
    at depth d into a stop.

    The law of Hunt and Crossley (J. Applied Mechanics 42 (1975) 440), without the pull that it has
    on fast departure: continuous at contact, dissipative, never sticking. d is -y at the lower stop
    and y - stroke at the upper one.
    """
    lower, upper = np.maximum(-y, 0.0), np.maximum(y - stops.stroke, 0.0)
    push_up = lower * np.maximum(1.0 - stops.end_stop_damping * v, 0.0)
    push_down = upper * np.maximum(1.0 + stops.end_stop_damping * v, 0.0)
    return stops.end_stop_stiffness * (push_up - push_down)


def absent_force(y, v, stops):
    """No stops."""
    return 0.0


def bends(before, after, stops: EndStops):
    """Whether the piston touches a stop between two states of `motion`."""
    lowest, highest = np.minimum(before[3], after[3]), np.maximum(before[3], after[3])
    return (stops.end_stop_stiffness > 0.0) & ((lowest < 0.0) | (highest > stops.stroke))


def absent_bends(before, after, stops):
    """No stops."""
    return False
