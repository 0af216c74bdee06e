"""The plant as one vector field on z = (p_a, p_b, v, y, spool, spool_rate): what the Runge-Kutta methods step along."""

from __future__ import annotations

from .. import plant


def slope(z, command, load, p):
    """dz/dt for the valve command and the load in N. An ideal valve's spool stands still: `told` puts it at the command."""
    dp_a, dp_b, dv = plant.rates(z[0], z[1], z[2], z[3], plant.effective_opening(z[4], p), load, p)
    speed, acceleration = plant.valve_rates(z[4], z[5], command, p)
    return dp_a, dp_b, dv, z[2], speed, acceleration


def told(z, command, p):
    """z at the instant at which the valve gets a new command: the spool of an ideal valve jumps to it."""
    spool = command if p.valve_natural_frequency == 0.0 else z[4]
    return z[0], z[1], z[2], z[3], spool, z[5]


def plus(z, w, k):
    """z + w k"""
    return z[0] + w * k[0], z[1] + w * k[1], z[2] + w * k[2], z[3] + w * k[3], z[4] + w * k[4], z[5] + w * k[5]
