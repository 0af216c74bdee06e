"""The valve's edges: flow over pressure drop, and the opening that the fluid sees.

    x >= 0:  Q_a = c_a x r(p_s - p_a)    Q_b = -c_b x r(p_b - p_t)
    x <  0:  Q_a = c_a x r(p_a - p_t)    Q_b = -c_b x r(p_s - p_b)

r(dp) = sign(dp) sqrt|dp|. The paper writes sqrt|dp|, with which the flow keeps its direction when
the pressure drop reverses; the two agree wherever p_t <= p <= p_s.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .supply import Supply, pressure_drops


class Valve(NamedTuple):
    """Edges a and b, and an overlap of both."""

    flow_coefficient_a: float
    """m^3/s per root of Pa at full opening"""
    flow_coefficient_b: float
    dead_band: float
    """the part of the spool's way in which no edge opens"""


def signed_root(dp):
    """sign(dp) sqrt|dp|. Written so that a complex step through dp gives the derivative."""
    sign = np.where(np.real(dp) < 0.0, -1.0, 1.0)
    return sign * np.sqrt(sign * dp)


def flow_gains(p_a, p_b, x, valve: Valve, supply: Supply):
    """(dQ_a/dx, dQ_b/dx) in m^3/s: the flows into chambers a and b per unit of opening."""
    dp_a, dp_b = pressure_drops(p_a, p_b, x, supply)
    return valve.flow_coefficient_a * signed_root(dp_a), -valve.flow_coefficient_b * signed_root(
        dp_b
    )


def pressure_gains(p_a, p_b, x, valve: Valve, supply: Supply):
    """(-dQ_a/dp_a, -dQ_b/dp_b) in m^3/s/Pa, both >= 0; infinite where a pressure drop vanishes."""
    dp_a, dp_b = pressure_drops(p_a, p_b, x, supply)
    opening = np.abs(x)
    return (
        valve.flow_coefficient_a * opening / (2.0 * np.sqrt(np.abs(dp_a))),
        valve.flow_coefficient_b * opening / (2.0 * np.sqrt(np.abs(dp_b))),
    )


def is_used(valve: Valve) -> bool:
    """Whether there is a dead band."""
    return valve.dead_band != 0.0


def effective_opening(spool, valve: Valve):
    """The opening that the fluid sees at a spool position: 0 within the dead band, then linear to 1
    at |spool| = 1 and beyond."""
    opening = (np.abs(spool) - valve.dead_band) / (1.0 - valve.dead_band)
    return np.copysign(np.minimum(np.maximum(opening, 0.0), 1.0), spool)


def absent_effective_opening(spool, valve):
    """Without a dead band, of a spool within its ends."""
    return spool


def opening_slope(spool, valve: Valve):
    """Derivative of `effective_opening` for |spool| <= 1: 0 within the dead band, else 1/(1 -
    dead_band)."""
    return np.where(np.abs(spool) > valve.dead_band, 1.0 / (1.0 - valve.dead_band), 0.0)
