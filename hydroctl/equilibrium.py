"""The equations of an operating point, solved for arrays of openings and loads.

In terms of the speed w in the direction that x asks for and the leakage flow q, with d the chamber that x connects to the
supply, r the other one, k = c |x| and u|u| the signed square,

    p_d = p_s - ((A_d w + q)/k_d)^2       p_r = p_t + ((A_r w + q)/k_r)^2        (signed squares)
    A_d p_d - A_r p_r - F_f(w) - F_d = 0           q = Kv (p_d - p_r)

With F_f = B w this is the gradient of a strictly convex function of (w, q): one solution, found by Newton's method from the
closed form at zero leakage, a quadratic in w. For x > 0, F = 0, p_t = 0 that closed form is the paper's (p_1n, p_2n, v_n); for
x < 0 the paper's does not hold, and the chambers change places.

Dry friction f enters as a load: w(f) falls with f, so f = dry friction at w(f) is bracketed by 0 and the breakaway friction.
Without leakage the solution is the only one whenever the force left at rest exceeds breakaway friction, also where friction falls
with speed: at every solution the throttled force falls faster.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .plant import Parameters, friction_force, friction_slope

_NEWTON_STEPS = 80
_BRACKET_STEPS = 60


class _Circuit(NamedTuple):
    """The machine seen from its direction of travel; `leakage` and the frictions vanish in the limit x = 0."""

    sign: np.ndarray
    area_d: np.ndarray
    area_r: np.ndarray
    valve_d: np.ndarray
    valve_r: np.ndarray
    supply: float
    tank: float
    leakage: np.ndarray
    viscous: np.ndarray
    moves: np.ndarray

    def pressures(self, w, q):
        """(p_d, p_r) and the magnitudes |u_d|, |u_r| of the flows over k."""
        u_d, u_r = (self.area_d * w + q) / self.valve_d, (self.area_r * w + q) / self.valve_r
        abs_d, abs_r = np.abs(u_d), np.abs(u_r)
        return self.supply - u_d * abs_d, self.tank + u_r * abs_r, abs_d, abs_r

    def by_chamber(self, d, r):
        """(a, b) from (d, r)."""
        extends = self.sign > 0.0
        return np.where(extends, d, r), np.where(extends, r, d)


def solve(p: Parameters, x, load):
    """(p_a, p_b, v) in Pa, Pa, m/s over the broadcast shape of the effective opening x and the load in N.

    x = 0.0 and x = -0.0 are the two one-sided limits at zero leakage, where v and friction are zero.
    """
    circuit = _circuit(p, x)
    load = circuit.sign * load
    w, q = _viscous(circuit, load)
    if p.breakaway_friction > 0.0:
        w, q = _with_dry_friction(circuit, p, load, w)
    p_d, p_r, *_ = circuit.pressures(w, q)
    return *circuit.by_chamber(p_d, p_r), np.where(circuit.moves, circuit.sign * w, 0.0)


def force_at_rest(p: Parameters, x) -> np.ndarray:
    """area_a p_a - area_b p_b in N with the piston held at rest: its pressure drop D solves D = p_s - p_t - kappa D^2."""
    circuit = _circuit(p, x)
    drop = p.supply_pressure - p.tank_pressure
    kappa = circuit.leakage**2 * (circuit.valve_d**-2 + circuit.valve_r**-2)
    q = circuit.leakage * 2.0 * drop / (1.0 + np.sqrt(1.0 + 4.0 * kappa * drop))
    p_d, p_r, *_ = circuit.pressures(0.0, q)
    return circuit.sign * (circuit.area_d * p_d - circuit.area_r * p_r)


def _circuit(p: Parameters, x) -> _Circuit:
    extends = ~np.signbit(x)
    moves = x != 0.0
    opening = np.where(moves, np.abs(x), 1.0)
    return _Circuit(
        sign=np.where(extends, 1.0, -1.0),
        area_d=np.where(extends, p.area_a, p.area_b),
        area_r=np.where(extends, p.area_b, p.area_a),
        valve_d=np.where(extends, p.flow_coefficient_a, p.flow_coefficient_b) * opening,
        valve_r=np.where(extends, p.flow_coefficient_b, p.flow_coefficient_a) * opening,
        supply=p.supply_pressure,
        tank=p.tank_pressure,
        leakage=np.where(moves, p.leakage, 0.0),
        viscous=np.where(moves, p.viscous_friction, 0.0),
        moves=moves,
    )


def _viscous(circuit: _Circuit, load):
    """(w, q) with F_f = B w: the closed form, then Newton's method where the fluid leaks."""
    drive = circuit.area_d * circuit.supply - circuit.area_r * circuit.tank - load
    throttle = circuit.area_d**3 / circuit.valve_d**2 + circuit.area_r**3 / circuit.valve_r**2
    w = 2.0 * drive / (circuit.viscous + np.sqrt(circuit.viscous**2 + 4.0 * throttle * np.abs(drive)))
    if not circuit.leakage.any():
        return w, np.zeros_like(w)
    p_d, p_r, *_ = circuit.pressures(w, 0.0)
    return _newton(circuit, load, w, circuit.leakage * (p_d - p_r), lambda w: (circuit.viscous * w, circuit.viscous))


def _newton(circuit: _Circuit, load, w, q, friction):
    """(w, q) from a start, with `friction(w)` the friction force and its slope."""
    area_d, area_r, leakage = circuit.area_d, circuit.area_r, circuit.leakage
    per_flow_d, per_flow_r = 2.0 / circuit.valve_d, 2.0 / circuit.valve_r
    per_speed_d, per_speed_r = area_d * per_flow_d, area_r * per_flow_r
    for _ in range(_NEWTON_STEPS):
        p_d, p_r, u_d, u_r = circuit.pressures(w, q)
        resistance, slope = friction(w)
        force = area_d * p_d - area_r * p_r - resistance - load
        leak = leakage * (p_d - p_r) - q
        fall_d, fall_r = u_d * per_speed_d, u_r * per_speed_r
        force_w = fall_d * area_d + fall_r * area_r + slope
        force_q = fall_d + fall_r
        leak_q = leakage * (u_d * per_flow_d + u_r * per_flow_r) + 1.0
        leak_w = leakage * force_q
        determinant = force_w * leak_q - leak_w * force_q
        step_w = (leak_q * force - force_q * leak) / determinant
        step_q = (force_w * leak - leak_w * force) / determinant
        w, q = w + step_w, q + step_q
        # convergence is quadratic: after steps this small the next would be below rounding
        if np.all(np.abs(step_w) * area_d + np.abs(step_q) <= 1e-9 * (np.abs(area_d * w) + np.abs(q))):
            break
    return w, q


def _with_dry_friction(circuit: _Circuit, p: Parameters, load, w):
    """(w, q) with the whole friction law, from the speed w without dry friction: regula falsi (Illinois), then Newton."""
    side = np.where(w < 0.0, -1.0, 1.0)
    dry = p._replace(viscous_friction=0.0)
    largest = np.where(circuit.moves, p.breakaway_friction, 0.0)

    def excess(f):
        w, q = _viscous(circuit, load + side * f)
        return np.where(circuit.moves, side * friction_force(w, dry), 0.0) - f, w, q

    low, high = np.zeros_like(w), np.broadcast_to(largest, w.shape)
    (above, *_), (under, w, q) = excess(low), excess(high)
    kept = np.zeros_like(w)
    for _ in range(_BRACKET_STEPS):
        spread = above - under
        f = np.where(spread > 0.0, (low * -under + high * above) / np.where(spread > 0.0, spread, 1.0), low)
        value, w, q = excess(f)
        if np.all(np.abs(value) <= 1e-13 * largest):
            break
        positive = value > 0.0
        under = np.where(positive, np.where(kept > 0.0, under / 2.0, under), value)
        above = np.where(positive, value, np.where(kept < 0.0, above / 2.0, above))
        low, high = np.where(positive, f, low), np.where(positive, high, f)
        kept = np.where(positive, 1.0, -1.0)
    whole = p._replace(
        viscous_friction=circuit.viscous, coulomb_friction=circuit.moves * p.coulomb_friction, breakaway_friction=largest
    )
    return _newton(circuit, load, w, q, lambda w: (friction_force(w, whole), friction_slope(w, whole)))
