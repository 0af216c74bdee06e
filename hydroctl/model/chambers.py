"""The chambers of the cylinder: volumes over the position, stiffness of the fluid, leakage.

V_a = volume_a + area_a y                          V_b = volume_b - area_b y
"""

from __future__ import annotations

from typing import NamedTuple


class Chambers(NamedTuple):
    """Pistons, dead volumes and fluid; SI."""

    area_a: float
    area_b: float
    volume_a: float
    """of chamber a and its line at y = 0"""
    volume_b: float
    """of chamber b and its line at y = 0"""
    bulk_modulus: float
    leakage: float
    """between the chambers, m^3/s/Pa"""


def volumes(y, chambers: Chambers):
    """(V_a, V_b) in m^3 at position y."""
    return chambers.volume_a + chambers.area_a * y, chambers.volume_b - chambers.area_b * y


def stiffnesses(y, chambers: Chambers):
    """(Ec/V_a, Ec/V_b) in Pa/m^3 at position y; by one division, because divisions and roots bound
    the speed of a simulation."""
    volume_a, volume_b = volumes(y, chambers)
    both = chambers.bulk_modulus / (volume_a * volume_b)
    return both * volume_b, both * volume_a


def leakage_flow(p_a, p_b, chambers: Chambers):
    """m^3/s from chamber a to chamber b."""
    return chambers.leakage * (p_a - p_b)


def with_bulk_modulus(chambers: Chambers, bulk_modulus):
    """The same chambers with another fluid, Pa."""
    return Chambers(
        chambers.area_a,
        chambers.area_b,
        chambers.volume_a,
        chambers.volume_b,
        bulk_modulus,
        chambers.leakage,
    )
