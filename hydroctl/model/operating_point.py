"""Operating points: the pressures and the speed at which the plant rests in dz/dt = 0 for a
constant opening x.

They do not depend on y, because the volumes only multiply dp/dt: the equations are solved over x
and load, then broadcast along y.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cache

import numpy as np

from ..digits import apart
from ..errors import InputError, OperatingPointError
from ..machine.actuator import Actuator
from . import equilibrium, plant, valve

_FEW = 8
"""Number of openings that plain Python solves sooner than numba is loaded"""


@dataclass(frozen=True, eq=False)
class OperatingPoints:
    """Equilibria over the broadcast shape of x, y and load_force. A point that is not `feasible`
    says why in `reason`."""

    actuator: Actuator
    x: np.ndarray
    """valve opening, in [-1, 1]"""
    y: np.ndarray
    """position, m"""
    load_force: np.ndarray
    """the whole constant load, weight included, positive against extension, N"""
    p_a: np.ndarray
    """pressure in the cap-side chamber, Pa"""
    p_b: np.ndarray
    """pressure in the rod-side chamber, Pa"""
    v: np.ndarray
    """speed, positive when extending, m/s"""
    residual: np.ndarray
    """largest relative residual of the three equations"""
    _fault: np.ndarray
    """index into the reasons, 0 where the point is feasible"""

    @property
    def shape(self) -> tuple[int, ...]:
        """The broadcast shape of x, y and load_force."""
        return self._fault.shape

    @property
    def feasible(self) -> np.ndarray:
        """True where the point can be linearized and used."""
        return self._fault == 0

    @property
    def above_rating(self) -> np.ndarray:
        """True where a chamber passes the actuator's `pressure_rating`; nowhere where none is
        stated."""
        rating = np.inf if self.actuator.pressure_rating is None else self.actuator.pressure_rating
        return np.maximum(self.p_a, self.p_b) > rating

    @property
    def reason(self) -> np.ndarray:
        """Texts: empty where the point is feasible, else what is wrong and the way out."""
        texts = np.full(self.shape, "", dtype=object)
        for index in np.ndindex(self.shape):
            if self._fault[index]:
                texts[index] = self._sentence(index)
        return texts

    def _sentence(self, index) -> str:
        machine = self.actuator
        x, y, load = float(self.x[index]), float(self.y[index]), float(self.load_force[index])
        opening, dead_band, *_ = apart(x, math.copysign(machine.dead_band, x), -1.0, 1.0)
        position, _, stroke = apart(y, 0.0, machine.stroke)
        force, stall = apart(load, float(stall_force(machine, x)))
        assert machine.breakaway_friction is not None  # it follows coulomb_friction
        left, breakaway = apart(abs(_force_left(machine, x, load)), machine.breakaway_friction)
        pressures = (
            float(self.p_a[index]),
            float(self.p_b[index]),
            machine.tank_pressure,
            machine.supply_pressure,
        )
        p_a, p_b, tank, supply = apart(*pressures, digits=4)
        speed, rest = apart(abs(float(self.v[index])), 2.0 * machine.creep_speed, digits=3)
        return f"No operating point at x={opening}, y={position} m: " + _REASONS[
            int(self._fault[index])
        ].format(
            dead_band=dead_band.removeprefix("-"),
            stroke=stroke,
            load=force,
            stall=stall,
            left=left,
            breakaway=breakaway,
            p_a=p_a,
            p_b=p_b,
            tank=tank,
            supply=supply,
            speed=speed,
            rest=rest,
        )


# in the order of the faults in `equilibrium`
_REASONS = (
    "",
    "x must be between -1 and 1.",
    "y must be within the stroke, 0 to {stroke} m.",
    "|x| is within the dead band of {dead_band}, so the valve is closed. Take a larger |x|.",
    (
        "the valve is closed, so leakage settles the pressures and the flow has no derivative there"
        " (at zero leakage every pair of pressures that holds the load is at rest). Take |x| >="
        " 1e-4 with the sign of the side you need."
    ),
    (
        "the load of {load} N is at or beyond the stall force of {stall} N in this direction. Lower"
        " the load or raise supply_pressure."
    ),
    (
        "the piston is stuck: the {left} N that pressure and a load of {load} N leave at rest do"
        " not exceed breakaway_friction = {breakaway} N. Lower the load or raise supply_pressure."
    ),
    "Newton's method did not converge. Check that the parameters are physical.",
    (
        "a chamber would fall below tank pressure (p_a = {p_a} Pa, p_b = {p_b} Pa, tank {tank} Pa):"
        " the load drives the piston and the fluid cavitates. Lower the load or the opening."
    ),
    (
        "fluid would flow back through an open edge (p_a = {p_a} Pa, p_b = {p_b} Pa, supply"
        " {supply} Pa, tank {tank} Pa): leakage under the load outweighs the valve. Lower the load"
        " or take a larger |x|."
    ),
    (
        "the speed of {speed} m/s is below twice creep_speed, {rest} m/s, where the law of dry"
        " friction stands for rest. Take a larger |x| or lower creep_speed."
    ),
)


def stall_force(actuator: Actuator, x) -> np.ndarray:
    """The load in N (positive against extension) that just stops the piston on each side of x; no
    leakage, no dry friction."""
    retracting, extending = equilibrium.stall_forces(plant.parameters(actuator))
    return np.where(np.signbit(np.asarray(x, float)), retracting, extending)


def find_operating_points(actuator: Actuator, x, y, *, load_force=0.0) -> OperatingPoints:
    """Equilibria at valve openings x in [-1, 1] and positions y in m; arrays broadcast (`x[:,
    None], y` makes a grid).

    `load_force` in N is added to `actuator.constant_load`. x = 0.0 and x = -0.0 are the two
    one-sided limits at zero leakage; they are flagged, because no derivative exists there. Values
    at a flagged point are those of the equations with signed flows; a piston that dry friction
    holds is flagged and at rest. Raises InputError for input that is not finite,
    OperatingPointError for a scalar call without a usable point.
    """
    x, y, load = (
        _finite(name, value) for name, value in (("x", x), ("y", y), ("load_force", load_force))
    )
    load = load + actuator.constant_load
    try:
        shape = np.broadcast_shapes(x.shape, y.shape, load.shape)
    except ValueError:
        raise InputError(
            f"x {x.shape}, y {y.shape} and load_force {load.shape} do not broadcast; use x[:, None]"
            " with y."
        ) from None
    along = np.broadcast_shapes(x.shape, load.shape)
    openings, loads = (
        np.ascontiguousarray(np.broadcast_to(value, along)).ravel() for value in (x, load)
    )
    found, fault = _solved(plant.parameters(actuator), openings, loads)
    fault = fault.reshape(along)
    outside = (y < 0.0) | (y > actuator.stroke)
    if outside.any():
        fault = np.where(outside & (fault != equilibrium.OPENING), equilibrium.STROKE, fault)
    found = found.reshape(4, *(1,) * (len(shape) - len(along)), *along)
    x, y, load, fault = (np.broadcast_to(value, shape) for value in (x, y, load, fault))
    p_a, p_b, v, residual = np.broadcast_to(found, (4, *shape))
    points = OperatingPoints(actuator, x, y, load, p_a, p_b, v, residual, fault)
    if shape == () and fault:
        raise OperatingPointError(points.reason[()])
    return points


def _solved(
    p: plant.Parameters, openings: np.ndarray, loads: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """What `equilibrium.solve_all` fills in. Numbers may overflow at points that are then
    flagged."""
    found, fault = np.empty((4, openings.size)), np.empty(openings.size, dtype=int)
    if openings.size <= _FEW:
        try:
            with np.errstate(all="ignore"):
                equilibrium.solve_all(p, openings, loads, found, fault)
            return found, fault
        except ArithmeticError:  # Python's floats raise where compiled ones go on
            pass
    compiled_equilibrium().solve_all(p, openings, loads, found, fault)
    return found, fault


@cache
def compiled_equilibrium():
    """The module `equilibrium`, compiled."""
    from ..compilation.compiling import compiled_tree

    return compiled_tree(equilibrium, "points", __package__)


def _finite(name: str, value) -> np.ndarray:
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{name} = {value!r} is not a number or an array of numbers.") from None
    if not np.isfinite(array).all():
        raise InputError(f"{name} holds a value that is not finite; remove it.")
    return array


def _force_left(actuator: Actuator, x: float, load: float) -> float:
    """What pressure and load leave to overcome dry friction, in N in the direction of extension,
    with the piston at rest."""
    p = plant.parameters(actuator)
    with np.errstate(all="ignore"):
        return float(equilibrium.force_at_rest(p, valve.effective_opening(x, p.valve)) - load)
