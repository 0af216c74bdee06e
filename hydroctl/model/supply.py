"""The supply: the pressures that the valve connects the chambers to."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .bends import turns


class Supply(NamedTuple):
    """Constant pressures in Pa."""

    supply_pressure: float
    tank_pressure: float


def pressure_drops(p_a, p_b, x, supply: Supply):
    """(dp_a, dp_b) in Pa over the open edges, positive where the fluid flows the way that the
    opening x asks."""
    extend = np.real(x) >= 0.0
    dp_a = np.where(extend, supply.supply_pressure - p_a, p_a - supply.tank_pressure)
    dp_b = np.where(extend, p_b - supply.tank_pressure, supply.supply_pressure - p_b)
    return dp_a, dp_b


def bends(before, after, supply: Supply):
    """Whether a pressure drop over an open edge nearly vanishes, or changes much, between two
    states of `motion`: the bend of the root."""
    drop_a, drop_b = pressure_drops(before[0], before[1], before[4], supply)
    new_a, new_b = pressure_drops(after[0], after[1], before[4], supply)
    return turns(drop_a, new_a, 0.0) | turns(drop_b, new_b, 0.0)


def with_pressure(supply: Supply, supply_pressure):
    """The same supply at another pressure, Pa."""
    return Supply(supply_pressure, supply.tank_pressure)
