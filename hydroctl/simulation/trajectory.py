"""`State` and `Trajectory`: where a simulation starts and what it returns; `rest_state` is a start
in equilibrium."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..digits import apart
from ..errors import InputError, SimulationError
from ..machine.actuator import Actuator
from ..model.equilibrium import stall_forces
from ..model.plant import Parameters, parameters


class State(NamedTuple):
    """The plant's state: chamber pressures in Pa, speed in m/s, position in m; spool position (as
    x) and its rate in 1/s.

    An ideal valve's spool is where it is told to be, whatever it was.
    """

    p_a: float
    p_b: float
    v: float
    y: float
    spool: float = 0.0
    spool_rate: float = 0.0


def state_of(initial) -> State:
    """`initial` as a State; InputError where it is not six finite numbers, or four for an ideal
    valve."""
    try:
        start = State(*map(float, initial))
    except (TypeError, ValueError):
        start = None
    if start is None or not np.isfinite(start).all():
        raise InputError(
            f"initial = {initial!r} is not a State of finite numbers; give p_a, p_b in Pa, v in"
            " m/s, y in m, the spool as x."
        )
    return start


@dataclass(frozen=True, eq=False)
class Trajectory:
    """A simulated motion at the times t; every array is (n,), SI."""

    t: np.ndarray
    """s"""
    x: np.ndarray
    """the command that the valve was given, from t[k] until t[k+1] (later by the delay's fraction
    of a sample, if it has one)"""
    y: np.ndarray
    v: np.ndarray
    p_a: np.ndarray
    p_b: np.ndarray
    spool: np.ndarray
    """where the spool was; x itself for an ideal valve"""
    integrator: str
    """how it was integrated, for the reader"""
    final: State
    """where it ended (open loop: at t[-1]; closed loop: one sample later), from which another
    simulation can go on"""
    reference: np.ndarray | None = None
    """closed loop only: the reference of v or y"""
    command: np.ndarray | None = None
    """closed loop only: what the regulator put out at t[k], which the valve is told `delay_samples`
    later"""


def require_motion(actuator: Actuator, trajectory: Trajectory) -> Trajectory:
    """The trajectory itself; SimulationError where it holds no physical motion: numbers overflow or
    a chamber has no volume."""
    y, lowest, highest = (
        trajectory.y,
        -actuator.volume_a / actuator.area_a,
        actuator.volume_b / actuator.area_b,
    )
    if (
        np.isfinite(trajectory.final).all() and lowest < y.min() and y.max() < highest
    ):  # what is no number stays none to the end
        return trajectory
    with np.errstate(invalid="ignore", over="ignore"):
        sound = (
            np.isfinite(trajectory.v + trajectory.p_a + trajectory.p_b)
            & (lowest < y)
            & (y < highest)
        )
    lost = -1 if sound.all() else np.argmin(sound)
    raise SimulationError(
        f"The motion has no meaning from t = {trajectory.t[lost]:g} s on: the piston has used up a"
        f" chamber beyond its stroke of 0 to {actuator.stroke:g} m, or the loop is unstable."
        " Shorten the motion or lower the gains."
    )


def rest_state(actuator: Actuator, y: float | None = None, *, load_force: float = 0.0) -> State:
    """The piston at rest at y (m; default: mid-stroke) behind a closed valve, holding the load (N,
    added to the actuator's).

    Of all pairs of pressures that hold the load, the one midway between the limits x -> 0+ and x ->
    0- of slow motion without leakage, from which both directions start alike. Raises InputError
    where y is outside the stroke or the load cannot be held.
    """
    try:
        y, load = (
            actuator.stroke / 2.0 if y is None else float(y),
            actuator.constant_load + float(load_force),
        )
    except (TypeError, ValueError):
        raise InputError(
            f"y = {y!r} and load_force = {load_force!r} must be single numbers, in m and N."
        ) from None
    lowest, highest = stall_forces(parameters(actuator))
    faults = []
    if not 0.0 <= y <= actuator.stroke:
        given, stroke = apart(y, actuator.stroke)
        faults.append(f"y = {given} m is outside the stroke; give 0 to {stroke} m.")
    if not lowest < load < highest:
        given, pulling, pushing = apart(load, lowest, highest)
        faults.append(
            f"the load of {given} N cannot be held: the stall forces are {pulling} and {pushing} N."
            " Lower the load."
        )
    if faults:
        raise InputError(faults)
    p_a, p_b = rest_pressures(parameters(actuator), load)
    return State(float(p_a), float(p_b), 0.0, y)


def rest_pressures(p: Parameters, load):
    """(p_a, p_b) of `rest_state` in Pa for the whole load in N; arrays broadcast.

    In the limit x -> 0, with d the chamber at the supply and r the other, the flows A_d w = c_d |x|
    sqrt(p_s - p_d) and A_r w = c_r |x| sqrt(p_r - p_t) fix the ratio of the pressure drops, the
    balance A_a p_a - A_b p_b = F their size.
    """
    ratio = (
        p.chambers.area_a
        * p.valve.flow_coefficient_b
        / (p.chambers.area_b * p.valve.flow_coefficient_a)
    ) ** 2
    drop_b = (
        p.chambers.area_a * p.supply.supply_pressure
        - p.chambers.area_b * p.supply.tank_pressure
        - load
    ) / (p.chambers.area_a * ratio + p.chambers.area_b)
    drop_a = (
        p.chambers.area_b * p.supply.supply_pressure
        - p.chambers.area_a * p.supply.tank_pressure
        + load
    ) / (p.chambers.area_b / ratio + p.chambers.area_a)
    p_a = 0.5 * (p.supply.supply_pressure - ratio * drop_b + p.supply.tank_pressure + drop_a)
    return p_a, (p.chambers.area_a * p_a - load) / p.chambers.area_b
