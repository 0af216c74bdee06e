"""Operating points: the pressures and the speed at which the plant rests in dz/dt = 0 for a constant opening x.

They do not depend on y, because the volumes only multiply dp/dt: the equations are solved over x and load, then broadcast
along y.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import equilibrium, plant
from .actuator import Actuator
from .errors import InputError, OperatingPointError

_RESIDUAL_LIMIT = 1e-9


@dataclass(frozen=True, eq=False)
class OperatingPoints:
    """Equilibria over the broadcast shape of x, y and load_force. A point that is not `feasible` says why in `reason`."""

    actuator: Actuator
    x: np.ndarray
    """valve opening, in [-1, 1]"""
    y: np.ndarray
    """position, m"""
    load_force: np.ndarray
    """the whole constant load, positive against extension, N"""
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
            left=abs(float(_force_left(self.actuator, x, load))),
            p_a=float(self.p_a[index]),
            p_b=float(self.p_b[index]),
            v=float(self.v[index]),
            machine=self.actuator,
        )


_REASONS = (
    "",
    "x must be between -1 and 1.",
    "y must be within the stroke, 0 to {machine.stroke:g} m.",
    "|x| is within the dead band of {machine.dead_band:g}, so the valve is closed. Take a larger |x|.",
    "the valve is closed, so leakage settles the pressures and the flow has no derivative there (at zero leakage every pair of "
    "pressures that holds the load is at rest). Take |x| >= 1e-4 with the sign of the side you need.",
    "load_force = {load:g} N is at or beyond the stall force of {stall:g} N in this direction. Lower the load or raise "
    "supply_pressure.",
    "the piston is stuck: the {left:g} N that pressure and load_force = {load:g} N leave at rest do not exceed breakaway_friction "
    "= {machine.breakaway_friction:g} N. Lower the load or raise supply_pressure.",
    "Newton's method did not converge. Check that the parameters are physical.",
    "a chamber would fall below tank pressure (p_a = {p_a:.4g} Pa, p_b = {p_b:.4g} Pa, tank {machine.tank_pressure:.4g} Pa): the "
    "load drives the piston and the fluid cavitates. Lower the load or the opening.",
    "a chamber would rise above supply pressure (p_a = {p_a:.4g} Pa, p_b = {p_b:.4g} Pa, supply {machine.supply_pressure:.4g} Pa). "
    "Lower the load.",
    "the speed of {v:.3g} m/s is below twice creep_speed = {machine.creep_speed:g} m/s, where the law of dry friction stands for "
    "rest. Take a larger |x| or lower creep_speed.",
)
_OPENING, _STROKE, _OVERLAP, _CLOSED, _STALLED, _STUCK, _NOT_CONVERGED, _CAVITATION, _ABOVE_SUPPLY, _CREEPING = range(1, 11)


def stall_force(actuator: Actuator, x) -> np.ndarray:
    """The load in N (positive against extension) that just stops the piston on each side of x; no leakage, no dry friction."""
    p_s, p_t = actuator.supply_pressure, actuator.tank_pressure
    extending = actuator.area_a * p_s - actuator.area_b * p_t
    retracting = actuator.area_a * p_t - actuator.area_b * p_s
    return np.where(np.signbit(np.asarray(x, float)), retracting, extending)


def find_operating_points(actuator: Actuator, x, y, *, load_force=0.0) -> OperatingPoints:
    """Equilibria at valve openings x in [-1, 1] and positions y in m; arrays broadcast (`x[:, None], y` makes a grid).

    `load_force` in N is added to `actuator.load_force`. x = 0.0 and x = -0.0 are the two one-sided limits at zero leakage; they
    are flagged, because no derivative exists there. Values at a flagged point are those of the equations with signed flows; a
    piston that dry friction holds is flagged and at rest.
    Raises InputError for input that is not finite, OperatingPointError for a scalar call without a usable point.
    """
    x, y, load = (_finite(name, value) for name, value in (("x", x), ("y", y), ("load_force", load_force)))
    load = load + actuator.load_force
    try:
        shape = np.broadcast_shapes(x.shape, y.shape, load.shape)
    except ValueError:
        raise InputError(f"x {x.shape}, y {y.shape} and load_force {load.shape} do not broadcast; use x[:, None] with y.") from None
    p = plant.parameters(actuator)
    opening = plant.effective_opening(x, p)
    p_a, p_b, v = equilibrium.solve(p, opening, load)
    residual = _residual(p, opening, p_a, p_b, v, load)
    fault = _faults(actuator, x, y, load, p_a, p_b, v, residual)
    found = np.array((p_a, p_b, v, residual))
    found = found.reshape(4, *(1,) * (len(shape) - p_a.ndim), *p_a.shape)
    x, y, load, fault = (np.broadcast_to(value, shape) for value in (x, y, load, fault))
    points = OperatingPoints(actuator, x, y, load, *np.broadcast_to(found, (4, *shape)), fault)
    if shape == () and fault:
        raise OperatingPointError(points.reason[()])
    return points


def _finite(name: str, value) -> np.ndarray:
    try:
        array = np.asarray(value, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{name} = {value!r} is not a number or an array of numbers.") from None
    if not np.isfinite(array).all():
        raise InputError(f"{name} holds a value that is not finite; remove it.")
    return array


def _force_left(actuator: Actuator, x, load) -> np.ndarray:
    """What pressure and load leave to overcome dry friction, in N in the direction of extension, with the piston at rest."""
    p = plant.parameters(actuator)
    return equilibrium.force_at_rest(p, plant.effective_opening(x, p)) - load


def _residual(p: plant.Parameters, opening, p_a, p_b, v, load) -> np.ndarray:
    """Largest of the three equations' sums, each over its largest term."""
    gain_a, gain_b = plant.flow_gains(p_a, p_b, opening, p)
    leak = p.leakage * (p_a - p_b)
    balances = np.array(
        (
            (gain_a * opening, -p.area_a * v, -leak),
            (gain_b * opening, p.area_b * v, leak),
            (p.area_a * p_a - load, -p.area_b * p_b, -plant.friction_force(v, p)),
        )
    )
    largest = np.abs(balances).max(axis=1)
    return (np.abs(balances.sum(axis=1)) / np.where(largest == 0.0, 1.0, largest)).max(axis=0)


def _faults(actuator: Actuator, x, y, load, p_a, p_b, v, residual) -> np.ndarray:
    """Index into the reasons for every point; the first that holds. All but the stroke is told along x and load alone."""
    slack = 1e-9 * actuator.supply_pressure
    stall = stall_force(actuator, x)
    conditions = {
        _CLOSED: x == 0.0,
        _STALLED: np.where(np.signbit(x), load <= stall, load >= stall),
        _NOT_CONVERGED: ~(residual <= _RESIDUAL_LIMIT),
        _CAVITATION: np.minimum(p_a, p_b) < actuator.tank_pressure - slack,
        _ABOVE_SUPPLY: np.maximum(p_a, p_b) > actuator.supply_pressure + slack,
    }
    if actuator.breakaway_friction > 0.0:
        conditions[_STUCK] = np.abs(_force_left(actuator, x, load)) <= actuator.breakaway_friction
        conditions[_CREEPING] = np.abs(v) < 2.0 * actuator.creep_speed
    if actuator.dead_band > 0.0:
        conditions[_OVERLAP] = np.abs(x) <= actuator.dead_band
    fault = np.zeros(np.shape(residual), dtype=int)
    for kind in sorted(conditions, reverse=True):
        fault = np.where(conditions[kind], kind, fault)
    outside = (y < 0.0) | (y > actuator.stroke)
    if outside.any():
        fault = np.where(outside, _STROKE, fault)
    return np.where(np.abs(x) > 1.0, _OPENING, fault)
