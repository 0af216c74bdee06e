"""What an engineer asks of a machine before any control: frequencies, forces, speeds, and maps of
them for plots."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..machine.actuator import Actuator
from .chambers import volumes
from .linearization import LinearFamily
from .operating_point import OperatingPoints, find_operating_points, stall_force
from .plant import parameters

_POSITIONS = 101


@dataclass(frozen=True, eq=False)
class Characteristics:
    """Quantities that follow from the parameters of `actuator`."""

    actuator: Actuator
    area_ratio: float
    """area_b / area_a"""
    y: np.ndarray
    """positions over the stroke, m"""
    natural_frequency: np.ndarray
    """of the oil column at `y`, rad/s"""
    lowest_frequency: float
    """the least natural frequency over the stroke, rad/s"""
    lowest_position: float
    """where it is, m"""
    stall_force_extending: float
    """load that just stops extension, N, positive against extension"""
    stall_force_retracting: float
    """load that just stops retraction, N (negative: it pulls)"""
    speed_extending: float
    """speed at x = 1 and the constant load, m/s; NaN where there is no operating point"""
    speed_retracting: float
    """speed at x = -1 and the constant load, m/s (negative); NaN where there is no operating
    point"""
    pressure_jump_a: float
    """p_a as x -> 0- less p_a as x -> 0+ without leakage, at the constant load, Pa"""
    pressure_jump_b: float
    """p_b as x -> 0- less p_b as x -> 0+ without leakage, at the constant load, Pa"""


def characterize(actuator: Actuator) -> Characteristics:
    """The characteristics of `actuator`."""
    y = np.linspace(0.0, actuator.stroke, _POSITIONS)
    lowest = softest_position(actuator)
    extending, retracting = stall_force(actuator, [1.0, -1.0])
    moving = find_operating_points(actuator, [1.0, -1.0], lowest)
    reversal = find_operating_points(actuator, [0.0, -0.0], lowest)
    speeds = np.where(moving.feasible, moving.v, np.nan)
    return Characteristics(
        actuator=actuator,
        area_ratio=actuator.area_b / actuator.area_a,
        y=y,
        natural_frequency=oil_column_frequency(actuator, y),
        lowest_frequency=float(oil_column_frequency(actuator, lowest)),
        lowest_position=lowest,
        stall_force_extending=float(extending),
        stall_force_retracting=float(retracting),
        speed_extending=float(speeds[0]),
        speed_retracting=float(speeds[1]),
        pressure_jump_a=float(reversal.p_a[1] - reversal.p_a[0]),
        pressure_jump_b=float(reversal.p_b[1] - reversal.p_b[0]),
    )


def oil_column_frequency(actuator: Actuator, y) -> np.ndarray:
    """Natural frequency in rad/s of the mass on both oil columns at y, valve closed: sqrt(Ec/m
    (A_a^2/V_a + A_b^2/V_b))."""
    y = np.asarray(y, dtype=float)
    volume_a, volume_b = volumes(y, parameters(actuator).chambers)
    return np.sqrt(
        actuator.bulk_modulus
        / actuator.mass
        * (actuator.area_a**2 / volume_a + actuator.area_b**2 / volume_b)
    )


def softest_position(actuator: Actuator) -> float:
    """The position in m at which `oil_column_frequency` is least: V_a/A_a^1.5 = V_b/A_b^1.5, held
    within the stroke."""
    root_a, root_b = actuator.area_a**0.5, actuator.area_b**0.5
    y = (actuator.volume_b / root_b**3 - actuator.volume_a / root_a**3) / (
        1.0 / root_a + 1.0 / root_b
    )
    return min(max(y, 0.0), actuator.stroke)


def equilibrium_map(actuator: Actuator, x, load_forces) -> OperatingPoints:
    """Operating points over (loads, openings), shape (n, m), at mid stroke: v(x) and the pressures,
    one row for each load in N."""
    loads = np.asarray(load_forces, dtype=float).reshape(-1, 1)
    return find_operating_points(
        actuator, np.asarray(x, dtype=float).reshape(-1), actuator.stroke / 2.0, load_force=loads
    )


def resonance(family: LinearFamily) -> tuple[np.ndarray, np.ndarray]:
    """(natural frequency in rad/s, damping ratio) of the second and third pole over the grid of
    `family`.

    For a complex pair these are |s| and -Re s/|s|; for two real poles sqrt(s2 s3) and -(s2 + s3)/(2
    sqrt(s2 s3)).
    """
    _, s2, s3 = np.moveaxis(family.poles(), -1, 0)
    frequency = np.sqrt((s2 * s3).real)
    return frequency, -(s2 + s3).real / (2.0 * frequency)
