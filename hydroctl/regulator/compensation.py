"""Compensation of the pressures: the ratio q_ref/q, clipped, undoes what the load does to the gain,
which is proportional to

    q = g_a sqrt(dp_a)/V_a + g_b sqrt(dp_b)/V_b

with the pressure drops dp over the open edges; q_ref is the design's.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from . import clipping

LEAST_RATIO, MOST_RATIO = 0.4, 3.0
LEAST_DROP = 1.0
"""Pa; keeps the root of a pressure drop real"""


class Compensation(NamedTuple):
    """What q needs: the flow per root of pressure drop at x = 1 times the area, volumes at y = 0,
    areas, pressures, and the design's own pressure drops for either direction."""

    flow_a: float
    flow_b: float
    volume_a: float
    volume_b: float
    area_a: float
    area_b: float
    stroke: float
    supply_pressure: float
    tank_pressure: float
    extend_drop_a: float
    extend_drop_b: float
    retract_drop_a: float
    retract_drop_b: float


MEMORY: dict[str, str] = {}
SETTINGS = {"compensated": "whether the pressures are compensated", "compensation": "see below"}
MACHINE = {
    "flow_a": "[m^5/s/Pa^0.5] flow coefficient times area, side a",
    "flow_b": "[m^5/s/Pa^0.5] flow coefficient times area, side b",
    "volume_a": "[m^3] side a at y = 0",
    "volume_b": "[m^3] side b at y = 0",
    "area_a": "[m^2] piston, side a",
    "area_b": "[m^2] piston, side b",
    "stroke": "[m] of the piston",
    "supply_pressure": "[Pa] of the pump",
    "tank_pressure": "[Pa] of the return line",
    "extend_drop_a": "[Pa] drop of the design over edge a, extending",
    "extend_drop_b": "[Pa] drop of the design over edge b, extending",
    "retract_drop_a": "[Pa] drop of the design over edge a, retracting",
    "retract_drop_b": "[Pa] drop of the design over edge b, retracting",
}
"""The settings of a `Compensation`."""
_UNUSED = Compensation(*[1.0] * len(Compensation._fields))._replace(area_a=0.0, area_b=0.0)


def settings(scheduled) -> dict:
    """The values of SETTINGS."""
    given = scheduled.compensation
    return {"compensated": given is not None, "compensation": _UNUSED if given is None else given}


def is_used(regulator) -> bool:
    """Whether the pressures are compensated."""
    return regulator.compensated


def step(opening, y, p_a, p_b, regulator):
    """What undoes the effect of the load on the gain: q_ref/q for the edges that the opening
    opens."""
    k = regulator.compensation
    is_extending = opening >= 0.0
    drop_a = np.where(
        is_extending, k.supply_pressure - p_a, p_a - k.tank_pressure
    )  # [Pa] open edge
    drop_b = np.where(is_extending, p_b - k.tank_pressure, k.supply_pressure - p_b)  # [Pa]
    root_a = np.sqrt(np.where(drop_a > LEAST_DROP, drop_a, LEAST_DROP))  # [Pa^0.5]
    root_b = np.sqrt(np.where(drop_b > LEAST_DROP, drop_b, LEAST_DROP))  # [Pa^0.5]
    design_root_a = np.sqrt(np.where(is_extending, k.extend_drop_a, k.retract_drop_a))  # [Pa^0.5]
    design_root_b = np.sqrt(np.where(is_extending, k.extend_drop_b, k.retract_drop_b))  # [Pa^0.5]
    y_inside = clipping.within(y, 0.0, k.stroke)  # [m]
    weight_a = k.flow_a / (k.volume_a + k.area_a * y_inside)  # [m^2/s/Pa^0.5]
    weight_b = k.flow_b / (k.volume_b - k.area_b * y_inside)  # [m^2/s/Pa^0.5]
    q_ref = weight_a * design_root_a + weight_b * design_root_b  # [m^2/s] of the design
    q = weight_a * root_a + weight_b * root_b  # [m^2/s] now
    ratio = clipping.within(q_ref / q, LEAST_RATIO, MOST_RATIO)  # [1]
    return np.where(regulator.compensated, ratio, 1.0)


def absent_step(opening, y, p_a, p_b, regulator):
    """`step` without compensation, to the last bit."""
    return 1.0
