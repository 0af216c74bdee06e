"""The equations of an operating point, solved for arrays of openings and loads.

In terms of the speed w in the direction that x asks for and the leakage flow q, with d the chamber that x connects to the
supply, r the other one, k = c |x| and u|u| the signed square,

    p_d = p_s - ((A_d w + q)/k_d)^2       p_r = p_t + ((A_r w + q)/k_r)^2        (signed squares)
    A_d p_d - A_r p_r - F_f(w) - F_d = 0           q = Kv (p_d - p_r)

With F_f = B w this is the gradient of a strictly convex function of (w, q): one solution, found by Newton's method from the
closed form at zero leakage, a quadratic in w. For x > 0, F = 0, p_t = 0 that closed form is the paper's (p_1n, p_2n, v_n); for
x < 0 the paper's does not hold, and the chambers change places.

Dry friction is part of F_f(w). Where the force left at rest does not exceed breakaway friction the piston is stuck: w = 0. Where it
does, and without leakage, there is one solution, also where friction falls with speed: at every solution the throttled force falls
faster. Newton's method finds it from the solution without dry friction.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .plant import Parameters, friction_force, friction_slope

_NEWTON_STEPS = 80


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

    x = 0.0 and x = -0.0 are the two one-sided limits at zero leakage, where v and friction are zero. A stuck piston has v = 0 and
    the pressures that leakage leaves it at rest.
    """
    circuit = _circuit(p, x)
    w, q = _viscous(circuit, circuit.sign * load)
    if p.breakaway_friction > 0.0:
        w, q = _with_dry_friction(circuit, p, load, w, q)
    p_d, p_r, *_ = circuit.pressures(w, q)
    return *circuit.by_chamber(p_d, p_r), np.where(circuit.moves, circuit.sign * w, 0.0)


def force_at_rest(p: Parameters, x) -> np.ndarray:
    """area_a p_a - area_b p_b in N with the piston held at rest at the effective opening x."""
    circuit = _circuit(p, x)
    return _force_at_rest(circuit, _leakage_at_rest(circuit))


def _leakage_at_rest(circuit: _Circuit):
    """q at w = 0: the drop D from chamber to chamber solves D = p_s - p_t - kappa D^2."""
    drop = circuit.supply - circuit.tank
    kappa = circuit.leakage**2 * (circuit.valve_d**-2 + circuit.valve_r**-2)
    return circuit.leakage * 2.0 * drop / (1.0 + np.sqrt(1.0 + 4.0 * kappa * drop))


def _force_at_rest(circuit: _Circuit, q):
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
    resistance = circuit.viscous + np.sqrt(circuit.viscous**2 + 4.0 * throttle * np.abs(drive))
    w = 2.0 * drive / np.where(resistance == 0.0, 1.0, resistance)  # without viscous friction it vanishes at the stall force
    if not circuit.leakage.any():
        return w, np.zeros_like(w)
    p_d, p_r, *_ = circuit.pressures(w, 0.0)
    return _newton(circuit, load, w, circuit.leakage * (p_d - p_r), lambda w: (circuit.viscous * w, circuit.viscous))


def _newton(circuit: _Circuit, load, w, q, friction):
    """(w, q) from a start, with `friction(w)` the friction force and its slope."""
    area_d, area_r, leakage = circuit.area_d, circuit.area_r, circuit.leakage
    per_flow_d, per_flow_r = 2.0 / circuit.valve_d, 2.0 / circuit.valve_r
    per_speed_d, per_speed_r = area_d * per_flow_d, area_r * per_flow_r
    for step in range(_NEWTON_STEPS):
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
        # convergence is quadratic: after steps this small, which are never the first, the next would be below rounding
        if step > 1 and (np.abs(step_w) * area_d + np.abs(step_q) <= 1e-9 * (np.abs(w) * area_d + np.abs(q))).all():
            break
    return w, q


def _with_dry_friction(circuit: _Circuit, p: Parameters, load, w, q):
    """(w, q) with the whole friction law, from the (w, q) without dry friction; a stuck piston keeps to w = 0."""
    at_rest = _leakage_at_rest(circuit)
    stuck = np.abs(_force_at_rest(circuit, at_rest) - load) <= p.breakaway_friction
    slides = circuit.moves & ~stuck
    law = p._replace(  # where the piston is stuck, a law that Newton's method solves whatever the load
        viscous_friction=np.where(stuck, 1.0, circuit.viscous),
        coulomb_friction=np.where(slides, p.coulomb_friction, 0.0),
        breakaway_friction=np.where(slides, p.breakaway_friction, 0.0),
    )
    w, q = _newton(circuit, circuit.sign * load, w, q, lambda w: (friction_force(w, law), friction_slope(w, law)))
    return np.where(stuck, 0.0, w), np.where(stuck, at_rest, q)
