"""The plant as one vector field on z = (p_a, p_b, v, y, spool, spool_rate): what the Runge-Kutta
methods step along, and where it bends.
"""

from __future__ import annotations

import numpy as np

from ...model import plant

_SHARP = 0.1
"""How much of itself a pressure drop or a creeping speed may change in a fixed step"""


def slope(z, command, load, p):
    """dz/dt for the valve command and the load in N. An ideal valve's spool stands still: `told`
    puts it at the command."""
    dp_a, dp_b, dv = plant.rates(z[0], z[1], z[2], z[3], plant.effective_opening(z[4], p), load, p)
    speed, acceleration = plant.valve_rates(z[4], z[5], command, p)
    return dp_a, dp_b, dv, z[2], speed, acceleration


def told(z, command, p):
    """z at the instant at which the valve gets a new command: the spool of an ideal valve jumps to
    it."""
    spool = command if p.valve_natural_frequency == 0.0 else z[4]
    return z[0], z[1], z[2], z[3], spool, z[5]


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


def sizes(p):
    """The range of each state: supply pressure, speed of the free piston at full opening, stroke,
    full opening and its rate."""
    speed = p.flow_coefficient_a * np.sqrt(p.supply_pressure) / np.minimum(p.area_a, p.area_b)
    rate = np.where(p.valve_natural_frequency == 0.0, 1.0, p.valve_natural_frequency)
    return p.supply_pressure, p.supply_pressure, speed, p.stroke, 1.0, rate


def bends(z, new, command, p):
    """Whether the slope of the field bends between z and new, the ends of one step, more sharply
    than a fixed step can follow."""
    return drops_turn(z, new, p) | effects_bend(z, new, command, p)


def drops_turn(z, new, p):
    """Whether a pressure drop over an open edge nearly vanishes, or changes much: the bend of the
    root."""
    drop_a, drop_b = plant.pressure_drops(z[0], z[1], z[4], p)
    new_a, new_b = plant.pressure_drops(new[0], new[1], z[4], p)
    return _turns(drop_a, new_a, 0.0) | _turns(drop_b, new_b, 0.0)


def effects_bend(z, new, command, p):
    """Whether the spool passes 0, the dead band or its ends or meets its rate limit, the piston
    touches a stop, or dry friction turns over.
    """
    asked, asks = (
        plant.wanted_spool_rate(z[4], command, p),
        plant.wanted_spool_rate(new[4], command, p),
    )
    valve = (
        _passes(z[4], new[4], 0.0)
        | _passes(np.abs(z[4]), np.abs(new[4]), p.dead_band)
        | _passes(np.abs(z[4]), np.abs(new[4]), 1.0)
        | _passes(np.abs(asked), np.abs(asks), p.valve_rate_limit)
    )
    stops = (p.end_stop_stiffness > 0.0) & (
        (np.minimum(z[3], new[3]) < 0.0) | (np.maximum(z[3], new[3]) > p.stroke)
    )
    return valve | stops | ((p.breakaway_friction > 0.0) & _turns(z[2], new[2], p.creep_speed))


def _passes(one, other, level):
    return (one - level) * (other - level) < 0.0


def _turns(one, other, width):
    """Whether a quantity changes by more than a part of its distance from 0, where that is more
    than `width`."""
    nearest = np.where(one * other < 0.0, 0.0, np.minimum(np.abs(one), np.abs(other)))
    return np.abs(other - one) > _SHARP * np.sqrt(nearest * nearest + width * width)
