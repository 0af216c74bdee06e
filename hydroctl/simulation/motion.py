"""The plant as one vector field on z = (p_a, p_b, v, y), compiled: what the Runge-Kutta methods step along."""

from __future__ import annotations

from .compiled import kernel, plant


@kernel()
def slope(z, x, load, p):
    """dz/dt at the opening x and the load in N."""
    dp_a, dp_b, dv = plant.rates(z[0], z[1], z[2], z[3], x, load, p)
    return dp_a, dp_b, dv, z[2]


@kernel()
def plus(z, w, k):
    """z + w k"""
    return z[0] + w * k[0], z[1] + w * k[1], z[2] + w * k[2], z[3] + w * k[3]
