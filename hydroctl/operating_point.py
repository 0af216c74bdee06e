"""Operating points: the pressures and the speed at which the plant rests in dz/dt = 0 for a constant opening x.

They do not depend on y, because the volumes only multiply dp/dt: the equations are solved over x and load, then broadcast
along y.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cache

import numpy as np

from . import equilibrium, plant
from .actuator import Actuator
from .errors import InputError, OperatingPointError

_FEW = 8
"""Number of openings that plain Python solves sooner than numba is loaded"""


@dataclass(frozen=True, eq=False)
class OperatingPoints:
    """Equilibria over the broadcast shape of x, y and load_force. A point that is not `feasible` says why in `reason`."""

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
        """True where a chamber passes the actuator's `pressure_rating`; nowhere where none is stated."""
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
        x, y, load = float(self.x[index]), float(self.y[index]), float(self.load_force[index])
        return f"No operating point at x={x:g}, y={y:g} m: " + _REASONS[int(self._fault[index])].format(
            x=x,
            y=y,
            load=load,
            stall=float(stall_force(self.actuator, x)),
            left=abs(_force_left(self.actuator, x, load)),
            p_a=float(self.p_a[index]),
            p_b=float(self.p_b[index]),
            v=float(self.v[index]),
            machine=self.actuator,
        )


# in the order of the faults in `equilibrium`
_REASONS = (
    "",
    "x must be between -1 and 1.",
    "y must be within the stroke, 0 to {machine.stroke:g} m.",
    "|x| is within the dead band of {machine.dead_band:g}, so the valve is closed. Take a larger |x|.",
    "the valve is closed, so leakage settles the pressures and the flow has no derivative there (at zero leakage every pair of "
    "pressures that holds the load is at rest). Take |x| >= 1e-4 with the sign of the side you need.",
    "the load of {load:g} N is at or beyond the stall force of {stall:g} N in this direction. Lower the load or raise "
    "supply_pressure.",
    "the piston is stuck: the {left:g} N that pressure and a load of {load:g} N leave at rest do not exceed breakaway_friction "
    "= {machine.breakaway_friction:g} N. Lower the load or raise supply_pressure.",
    "Newton's method did not converge. Check that the parameters are physical.",
    "a chamber would fall below tank pressure (p_a = {p_a:.4g} Pa, p_b = {p_b:.4g} Pa, tank {machine.tank_pressure:.4g} Pa): the "
    "load drives the piston and the fluid cavitates. Lower the load or the opening.",
    "fluid would flow back through an open edge (p_a = {p_a:.4g} Pa, p_b = {p_b:.4g} Pa, supply {machine.supply_pressure:.4g} Pa, "
    "tank {machine.tank_pressure:.4g} Pa): leakage under the load outweighs the valve. Lower the load or take a larger |x|.",
    "the speed of {v:.3g} m/s is below twice creep_speed = {machine.creep_speed:g} m/s, where the law of dry friction stands for "
    "rest. Take a larger |x| or lower creep_speed.",
)


def stall_force(actuator: Actuator, x) -> np.ndarray:
    """The load in N (positive against extension) that just stops the piston on each side of x; no leakage, no dry friction."""
    retracting, extending = equilibrium.stall_forces(plant.parameters(actuator))
    return np.where(np.signbit(np.asarray(x, float)), retracting, extending)


def find_operating_points(actuator: Actuator, x, y, *, load_force=0.0) -> OperatingPoints:
    """Equilibria at valve openings x in [-1, 1] and positions y in m; arrays broadcast (`x[:, None], y` makes a grid).

    `load_force` in N is added to `actuator.constant_load`. x = 0.0 and x = -0.0 are the two one-sided limits at zero leakage; they
    are flagged, because no derivative exists there. Values at a flagged point are those of the equations with signed flows; a
    piston that dry friction holds is flagged and at rest.
    Raises InputError for input that is not finite, OperatingPointError for a scalar call without a usable point.
    """
    x, y, load = (_finite(name, value) for name, value in (("x", x), ("y", y), ("load_force", load_force)))
    load = load + actuator.constant_load
    try:
        shape = np.broadcast_shapes(x.shape, y.shape, load.shape)
    except ValueError:
        raise InputError(f"x {x.shape}, y {y.shape} and load_force {load.shape} do not broadcast; use x[:, None] with y.") from None
    along = np.broadcast_shapes(x.shape, load.shape)
    openings, loads = (np.ascontiguousarray(np.broadcast_to(value, along)).ravel() for value in (x, load))
    found, fault = _solved(plant.parameters(actuator), openings, loads)
    fault = fault.reshape(along)
    outside = (y < 0.0) | (y > actuator.stroke)
    if outside.any():
        fault = np.where(outside & (fault != equilibrium.OPENING), equilibrium.STROKE, fault)
    found = found.reshape(4, *(1,) * (len(shape) - len(along)), *along)
    x, y, load, fault = (np.broadcast_to(value, shape) for value in (x, y, load, fault))
    points = OperatingPoints(actuator, x, y, load, *np.broadcast_to(found, (4, *shape)), fault)
    if shape == () and fault:
        raise OperatingPointError(points.reason[()])
    return points


def _solved(p: plant.Parameters, openings: np.ndarray, loads: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """What `equilibrium.solve_all` fills in. Numbers may overflow at points that are then flagged."""
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
    from .compiling import compiled

    return compiled(equilibrium, "points", plant=compiled(plant, "points"))


def _finite(name: str, value) -> np.ndarray:
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{name} = {value!r} is not a number or an array of numbers.") from None
    if not np.isfinite(array).all():
        raise InputError(f"{name} holds a value that is not finite; remove it.")
    return array


def _force_left(actuator: Actuator, x: float, load: float) -> float:
    """What pressure and load leave to overcome dry friction, in N in the direction of extension, with the piston at rest."""
    p = plant.parameters(actuator)
    with np.errstate(all="ignore"):
        return float(equilibrium.force_at_rest(p, plant.effective_opening(x, p)) - load)
