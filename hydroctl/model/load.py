"""The load: the mass that the cylinder moves. Forces on it are given over time."""

from __future__ import annotations

from typing import NamedTuple


class Load(NamedTuple):
    """A rigid mass."""

    inverse_mass: float
    """1/kg: a product costs less than a division"""


def acceleration(force, load: Load):
    """m/s^2 under the sum of all forces in N."""
    return force * load.inverse_mass
