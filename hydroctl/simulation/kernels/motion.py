"""The plant as one vector field on z = (p_a, p_b, v, y, spool, spool_rate): what the Runge-Kutta
methods step along, and where it bends.
"""

from __future__ import annotations

import numpy as np

from ...model import end_stops, friction, plant, spool, supply, valve


def slope(z, command, load, p):
    """dz/dt for the valve command and the load in N. An ideal valve's spool stands still:
    `commanded` puts it at the command."""
    opening = valve.effective_opening(z[4], p.valve)
    dp_a, dp_b, dv = plant.rates(z[0], z[1], z[2], z[3], opening, load, p)
    speed, acceleration = spool.rates(z[4], z[5], command, p.spool)
    return dp_a, dp_b, dv, z[2], speed, acceleration


def commanded(z, command, p):
    """z at the instant at which the valve gets a new command."""
    return z[0], z[1], z[2], z[3], spool.commanded(z[4], command, p.spool), z[5]


def plus(z, w, k):
    """z + w k"""
    return (
        z[0] + w * k[0],
        z[1] + w * k[1],
        z[2] + w * k[2],
        z[3] + w * k[3],
        z[4] + w * k[4],
        z[5] + w * k[5],
    )


def plus_of_an_ideal_valve(z, w, k):
    """z + w k where the last two slopes are zero."""
    return z[0] + w * k[0], z[1] + w * k[1], z[2] + w * k[2], z[3] + w * k[3], z[4], z[5]


def sizes(p):
    """The range of each state: supply pressure, speed of the free piston at full opening, stroke,
    full opening and its rate."""
    pressure, frequency = p.supply.supply_pressure, p.spool.valve_natural_frequency
    smaller = np.minimum(p.chambers.area_a, p.chambers.area_b)
    speed = p.valve.flow_coefficient_a * np.sqrt(pressure) / smaller
    rate = np.where(frequency == 0.0, 1.0, frequency)
    return pressure, pressure, speed, p.end_stops.stroke, 1.0, rate


def bends(z, new, command, p):
    """Whether the slope of the field bends between z and new, the ends of one step, more sharply
    than a fixed step can follow."""
    return (
        supply.bends(z, new, p.supply)
        | spool.bends(z, new, command, p.spool, p.valve.dead_band)
        | end_stops.bends(z, new, p.end_stops)
        | friction.bends(z, new, p.friction)
    )
