"""Operating points: the pressures and the speed at which the plant rests in dz/dt = 0 for a constant opening x.

They do not depend on y, because the volumes only multiply dp/dt: the equations are solved over x and load, then broadcast
along y. In terms of the speed w in the direction that x asks for and the leakage flow q, with d the chamber that x connects
to the supply, r the other one and u|u| the signed square,

    p_d = p_s - ((A_d w + q)/(c_d |x|))^2       p_r = p_t + ((A_r w + q)/(c_r |x|))^2        (signed squares)
    A_d p_d - A_r p_r - B w - F_d = 0           q = Kv (p_d - p_r)

which is the gradient of a strictly convex function of (w, q): one solution, found by Newton's method from the closed form at
zero leakage. For x > 0, F = 0, p_t = 0 that closed form is the paper's (p_1n, p_2n, v_n); for x < 0 the paper's does not hold,
and the chambers change places.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import plant
from .actuator import Actuator
from .errors import InputError, OperatingPointError

_ITERATIONS = 80
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
            stroke=self.actuator.stroke,
            p_a=float(self.p_a[index]),
            p_b=float(self.p_b[index]),
            tank=self.actuator.tank_pressure,
            supply=self.actuator.supply_pressure,
        )


_REASONS = (
    "",
    "x must be between -1 and 1.",
    "y must be within the stroke, 0 to {stroke:g} m.",
    "the valve is closed, so leakage settles the pressures and the flow has no derivative there (at zero leakage every pair of "
    "pressures that holds the load is at rest). Take |x| >= 1e-4 with the sign of the side you need.",
    "load_force = {load:g} N is at or beyond the stall force of {stall:g} N in this direction. Lower the load or raise "
    "supply_pressure.",
    "a chamber would fall below tank pressure (p_a = {p_a:.4g} Pa, p_b = {p_b:.4g} Pa, tank {tank:.4g} Pa): the load drives the "
    "piston and the fluid cavitates. Lower the load or the opening.",
    "a chamber would rise above supply pressure (p_a = {p_a:.4g} Pa, p_b = {p_b:.4g} Pa, supply {supply:.4g} Pa). Lower the load.",
    "Newton's method did not converge. Check that the parameters are physical.",
)
_OPENING, _STROKE, _CLOSED, _STALLED, _CAVITATION, _ABOVE_SUPPLY, _NOT_CONVERGED = range(1, 8)


def stall_force(actuator: Actuator, x) -> np.ndarray:
    """The load in N (positive against extension) that just stops the piston, for x > 0 and for x < 0."""
    p_s, p_t = actuator.supply_pressure, actuator.tank_pressure
    extending = actuator.area_a * p_s - actuator.area_b * p_t
    retracting = actuator.area_a * p_t - actuator.area_b * p_s
    return np.where(_extends(np.asarray(x, float)), extending, retracting)


def find_operating_points(actuator: Actuator, x, y, *, load_force=0.0) -> OperatingPoints:
    """Equilibria at valve openings x in [-1, 1] and positions y in m; arrays broadcast (`x[:, None], y` makes a grid).

    `load_force` in N is added to `actuator.load_force`. x = 0.0 and x = -0.0 are the two one-sided limits at zero leakage; they
    are flagged, because no derivative exists there. Values at a flagged point are those of the equations with signed flows.
    Raises InputError for input that is not finite, OperatingPointError for a scalar call without a usable point.
    """
    x, y, load = (_finite(name, value) for name, value in (("x", x), ("y", y), ("load_force", load_force)))
    load = load + actuator.load_force
    try:
        shape = np.broadcast_shapes(x.shape, y.shape, load.shape)
    except ValueError:
        raise InputError(f"x {x.shape}, y {y.shape} and load_force {load.shape} do not broadcast; use x[:, None] with y.") from None
    p = plant.parameters(actuator)
    p_a, p_b, v = _solve(p, x, load)
    residual = _residual(p, x, p_a, p_b, v, load)
    fault = np.broadcast_to(_faults(actuator, x, y, load, p_a, p_b, residual), shape)
    x, y, load, p_a, p_b, v, residual = (np.broadcast_to(value, shape) for value in (x, y, load, p_a, p_b, v, residual))
    points = OperatingPoints(actuator, x, y, load, p_a, p_b, v, residual, fault)
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


def _extends(x: np.ndarray) -> np.ndarray:
    return ~np.signbit(x)


def _solve(p: plant.Parameters, x: np.ndarray, load: np.ndarray):
    """(p_a, p_b, v) over the broadcast shape of x and load; at x = 0 the one-sided limit at zero leakage."""
    extends = _extends(x)
    sign = np.where(extends, 1.0, -1.0)
    area_d, area_r = np.where(extends, p.area_a, p.area_b), np.where(extends, p.area_b, p.area_a)
    flow_d = np.where(extends, p.flow_coefficient_a, p.flow_coefficient_b)
    flow_r = np.where(extends, p.flow_coefficient_b, p.flow_coefficient_a)
    opening = np.where(x == 0.0, 1.0, np.abs(x))
    drive = area_d * p.supply_pressure - area_r * p.tank_pressure - sign * load
    throttle = area_d**3 / flow_d**2 + area_r**3 / flow_r**2

    friction = p.viscous_friction * np.abs(x)
    w = opening * 2.0 * drive / (friction + np.sqrt(friction**2 + 4.0 * throttle * np.abs(drive)))
    q = np.zeros_like(w)
    leakage = np.where(x == 0.0, 0.0, p.leakage)
    friction = np.where(x == 0.0, 0.0, p.viscous_friction)

    def pressures(w, q):
        u_d, u_r = (area_d * w + q) / (flow_d * opening), (area_r * w + q) / (flow_r * opening)
        return p.supply_pressure - u_d * np.abs(u_d), p.tank_pressure + u_r * np.abs(u_r), np.abs(u_d), np.abs(u_r)

    p_d, p_r, u_d, u_r = pressures(w, q)
    if p.leakage > 0.0:
        q = leakage * (p_d - p_r)
        for _ in range(_ITERATIONS):
            p_d, p_r, u_d, u_r = pressures(w, q)
            force = area_d * p_d - area_r * p_r - friction * w - sign * load
            leak = leakage * (p_d - p_r) - q
            slope_d, slope_r = 2.0 * u_d / (flow_d * opening), 2.0 * u_r / (flow_r * opening)
            force_w = -(slope_d * area_d**2 + slope_r * area_r**2 + friction)
            force_q = -(slope_d * area_d + slope_r * area_r)
            leak_q = -(leakage * (slope_d + slope_r) + 1.0)
            determinant = force_w * leak_q - leakage * force_q**2
            step_w = (leak_q * force - force_q * leak) / determinant
            step_q = (force_w * leak - leakage * force_q * force) / determinant
            w, q = w - step_w, q - step_q
            if np.all(np.abs(step_w) * area_d + np.abs(step_q) <= 1e-14 * (np.abs(area_d * w) + np.abs(q))):
                break
        p_d, p_r, *_ = pressures(w, q)
    v = np.where(x == 0.0, 0.0, sign * w)
    return np.where(extends, p_d, p_r), np.where(extends, p_r, p_d), v


def _residual(p: plant.Parameters, x, p_a, p_b, v, load) -> np.ndarray:
    """Largest of the three equations' sums, each over its largest term."""
    gain_a, gain_b = plant.flow_gains(p_a, p_b, x, p)
    leak = p.leakage * (p_a - p_b)
    balances = (
        (gain_a * x, -p.area_a * v, -leak),
        (gain_b * x, p.area_b * v, leak),
        (p.area_a * p_a, -p.area_b * p_b, -p.viscous_friction * v, -load),
    )
    worst = 0.0
    for terms in balances:
        largest = np.max(np.abs(np.broadcast_arrays(*terms)), axis=0)
        worst = np.maximum(worst, np.abs(sum(terms)) / np.where(largest == 0.0, 1.0, largest))
    return worst


def _faults(actuator: Actuator, x, y, load, p_a, p_b, residual) -> np.ndarray:
    """Index into the reasons for every point; the first that holds."""
    slack = 1e-9 * actuator.supply_pressure
    stall = stall_force(actuator, x)
    conditions = {
        _OPENING: np.abs(x) > 1.0,
        _STROKE: (y < 0.0) | (y > actuator.stroke),
        _CLOSED: x == 0.0,
        _STALLED: np.where(_extends(x), load >= stall, load <= stall),
        _CAVITATION: np.minimum(p_a, p_b) < actuator.tank_pressure - slack,
        _ABOVE_SUPPLY: np.maximum(p_a, p_b) > actuator.supply_pressure + slack,
        _NOT_CONVERGED: ~(residual <= _RESIDUAL_LIMIT),
    }
    return np.select(np.broadcast_arrays(*conditions.values()), list(conditions), default=0)
