"""The equations of an operating point, solved and judged for one opening and one load.

In terms of the speed w in the direction that x asks for and the leakage flow q, with d the chamber
that x connects to the supply, r the other one, k = c |x| and u|u| the signed square,

    p_d = p_s - ((A_d w + q)/k_d)^2       p_r = p_t + ((A_r w + q)/k_r)^2        (signed squares)
    A_d p_d - A_r p_r - F_f(w) - F_d = 0           q = Kv (p_d - p_r)

With F_f = B w this is the gradient of a strictly convex function of (w, q): one solution, found by
Newton's method from the closed form at zero leakage, a quadratic in w. For x > 0, F = 0, p_t = 0
that closed form is the paper's (p_1n, p_2n, v_n); for x < 0 the paper's does not hold, and the
chambers change places.

Dry friction is part of F_f(w). Where the force left at rest does not exceed breakaway friction the
piston is stuck: w = 0. Where it does, and without leakage, there is one solution, also where
friction falls with speed: at every solution the throttled force falls faster. Newton's method finds
it from the solution without dry friction.

Every function takes numbers, as Python or compiled; x is the effective opening, but for `judge` and
`solve_all`.
"""

from __future__ import annotations

from math import copysign, inf
from typing import NamedTuple

import numpy as np

from . import friction, supply, valve
from .plant import Parameters

OPENING, STROKE, OVERLAP, CLOSED, STALLED, STUCK, NOT_CONVERGED, CAVITATION, REVERSED, CREEPING = (
    range(1, 11)
)
"""What may be wrong with an operating point; 0 is nothing."""
_NEWTON_STEPS = 80
_RESIDUAL_LIMIT = 1e-9
_SLACK = 1e-9
"""of the supply pressure: as much of a pressure drop below zero is taken for rounding"""


class Circuit(NamedTuple):
    """The machine seen from its direction of travel; `leakage` and viscous friction vanish in the
    limit x = 0."""

    sign: float
    moves: bool
    area_d: float
    area_r: float
    valve_d: float
    valve_r: float
    supply: float
    tank: float
    leakage: float
    viscous: float


def circuit_of(p: Parameters, x):
    """The circuit that the opening x makes; that of x = 0.0 and of x = -0.0 are the one-sided
    limits."""
    sign, moves = copysign(1.0, x), x != 0.0
    k = abs(x) if moves else 1.0
    leakage, viscous = (p.chambers.leakage, p.friction.viscous_friction) if moves else (0.0, 0.0)
    rest = (p.supply.supply_pressure, p.supply.tank_pressure, leakage, viscous)
    if sign > 0.0:
        return Circuit(
            sign,
            moves,
            p.chambers.area_a,
            p.chambers.area_b,
            p.valve.flow_coefficient_a * k,
            p.valve.flow_coefficient_b * k,
            *rest,
        )
    return Circuit(
        sign,
        moves,
        p.chambers.area_b,
        p.chambers.area_a,
        p.valve.flow_coefficient_b * k,
        p.valve.flow_coefficient_a * k,
        *rest,
    )


def pressures(circuit: Circuit, w, q):
    """(p_d, p_r) and the magnitudes |u_d|, |u_r| of the flows over k."""
    u_d, u_r = (
        (circuit.area_d * w + q) / circuit.valve_d,
        (circuit.area_r * w + q) / circuit.valve_r,
    )
    return circuit.supply - u_d * abs(u_d), circuit.tank + u_r * abs(u_r), abs(u_d), abs(u_r)


def solve(p: Parameters, x, load):
    """(p_a, p_b, v) in Pa, Pa, m/s at the opening x and the load in N.

    At x = 0.0 and x = -0.0, the two one-sided limits at zero leakage, v and friction are zero. A
    stuck piston has v = 0 and the pressures that leakage leaves it at rest.
    """
    circuit = circuit_of(p, x)
    w, q = _without_dry_friction(circuit, p, circuit.sign * load)
    if p.friction.breakaway_friction > 0.0:
        w, q = _with_dry_friction(circuit, p, load, w, q)
    p_d, p_r, _, _ = pressures(circuit, w, q)
    v = circuit.sign * w if circuit.moves else 0.0
    return (p_d, p_r, v) if circuit.sign > 0.0 else (p_r, p_d, v)


def stall_forces(p: Parameters):
    """The loads in N, positive against extension, that just stop retraction and extension; no
    leakage, no dry friction."""
    p_s, p_t = p.supply.supply_pressure, p.supply.tank_pressure
    return (
        p.chambers.area_a * p_t - p.chambers.area_b * p_s,
        p.chambers.area_a * p_s - p.chambers.area_b * p_t,
    )


def force_at_rest(p: Parameters, x):
    """area_a p_a - area_b p_b in N with the piston held at rest at the opening x."""
    circuit = circuit_of(p, x)
    return _force_at_rest(circuit, _leakage_at_rest(circuit))


def _force_at_rest(circuit: Circuit, q):
    p_d, p_r, _, _ = pressures(circuit, 0.0, q)
    return circuit.sign * (circuit.area_d * p_d - circuit.area_r * p_r)


def _leakage_at_rest(circuit: Circuit):
    """q at w = 0: the drop D from chamber to chamber solves D = p_s - p_t - kappa D^2."""
    drop = circuit.supply - circuit.tank
    kappa = circuit.leakage**2 * (1.0 / circuit.valve_d**2 + 1.0 / circuit.valve_r**2)
    return circuit.leakage * 2.0 * drop / (1.0 + np.sqrt(1.0 + 4.0 * kappa * drop))


def _without_dry_friction(circuit: Circuit, p: Parameters, load):
    """(w, q) with F_f = B w: the closed form, then Newton's method where the fluid leaks."""
    drive = circuit.area_d * circuit.supply - circuit.area_r * circuit.tank - load
    throttle = circuit.area_d**3 / circuit.valve_d**2 + circuit.area_r**3 / circuit.valve_r**2
    resistance = circuit.viscous + np.sqrt(circuit.viscous**2 + 4.0 * throttle * abs(drive))
    w = (
        2.0 * drive / resistance if resistance > 0.0 else 0.0
    )  # without viscous friction it vanishes at the stall force
    if circuit.leakage == 0.0:
        return w, 0.0
    p_d, p_r, _, _ = pressures(circuit, w, 0.0)
    return _newton(circuit, p, load, w, circuit.leakage * (p_d - p_r), False)


def _with_dry_friction(circuit: Circuit, p: Parameters, load, w, q):
    """(w, q) with the whole friction law, from the (w, q) without dry friction; a stuck piston
    keeps to w = 0."""
    at_rest = _leakage_at_rest(circuit)
    if abs(_force_at_rest(circuit, at_rest) - load) <= p.friction.breakaway_friction:
        return 0.0, at_rest
    return _newton(circuit, p, circuit.sign * load, w, q, True) if circuit.moves else (w, q)


def _newton(circuit: Circuit, p: Parameters, load, w, q, dry):
    """(w, q) from a start; `dry`: whether dry friction counts."""
    area_d, area_r, leakage = circuit.area_d, circuit.area_r, circuit.leakage
    for _ in range(_NEWTON_STEPS):
        p_d, p_r, u_d, u_r = pressures(circuit, w, q)
        resistance, slope = circuit.viscous * w, circuit.viscous
        if dry:
            resistance, slope = (
                resistance + friction.dry_force(w, p.friction),
                slope + friction.dry_slope(w, p.friction),
            )
        force = area_d * p_d - area_r * p_r - resistance - load
        leak = leakage * (p_d - p_r) - q
        fall_d, fall_r = 2.0 * u_d / circuit.valve_d, 2.0 * u_r / circuit.valve_r
        force_w = area_d**2 * fall_d + area_r**2 * fall_r + slope
        force_q = area_d * fall_d + area_r * fall_r
        leak_w, leak_q = leakage * force_q, leakage * (fall_d + fall_r) + 1.0
        determinant = force_w * leak_q - leak_w * force_q
        step_w = (leak_q * force - force_q * leak) / determinant
        step_q = (force_w * leak - leak_w * force) / determinant
        w, q = w + step_w, q + step_q
        # convergence is quadratic: after steps this small the next would be below rounding
        if abs(step_w) * area_d + abs(step_q) <= 1e-9 * (abs(area_d * w) + abs(q)):
            break
    return w, q


def residual(p: Parameters, x, p_a, p_b, v, load):
    """Largest of the three equations' sums, each over its largest term; infinite where it is not a
    number."""
    gain_a, gain_b = valve.flow_gains(p_a, p_b, x, p.valve, p.supply)
    leak = p.chambers.leakage * (p_a - p_b)
    in_a = _imbalance(gain_a * x, -p.chambers.area_a * v, -leak)
    in_b = _imbalance(gain_b * x, p.chambers.area_b * v, leak)
    of_force = _imbalance(
        p.chambers.area_a * p_a - load, -p.chambers.area_b * p_b, -friction.force(v, p.friction)
    )
    return max(in_a, in_b, of_force) if np.isfinite(in_a + in_b + of_force) else inf


def _imbalance(one, two, three):
    largest = max(abs(one), abs(two), abs(three))
    return abs(one + two + three) / largest if largest > 0.0 else abs(one + two + three)


def judge(p: Parameters, x, load, p_a, p_b, v, residual):
    """What is wrong with the point at the spool position x: the first fault that holds, or 0.

    A chamber above supply pressure is no fault: a weight on the outlet of a narrow edge raises it,
    and the fluid flows on to tank. It is one where fluid would flow back through an open edge,
    which takes leakage.
    """
    dry, slack = p.friction.breakaway_friction > 0.0, _SLACK * p.supply.supply_pressure
    if abs(x) > 1.0:
        return OPENING
    if p.valve.dead_band > 0.0 and abs(x) <= p.valve.dead_band:
        return OVERLAP
    if x == 0.0:
        return CLOSED
    retracting, extending = stall_forces(p)
    if (x > 0.0 and load >= extending) or (x < 0.0 and load <= retracting):
        return STALLED
    if (
        dry
        and abs(force_at_rest(p, valve.effective_opening(x, p.valve)) - load)
        <= p.friction.breakaway_friction
    ):
        return STUCK
    if not residual <= _RESIDUAL_LIMIT:
        return NOT_CONVERGED
    if min(p_a, p_b) < p.supply.tank_pressure - slack:
        return CAVITATION
    drop_a, drop_b = supply.pressure_drops(p_a, p_b, x, p.supply)
    if min(drop_a, drop_b) < -slack:
        return REVERSED
    if dry and abs(v) < 2.0 * p.friction.creep_speed:
        return CREEPING
    return 0


def solve_all(p: Parameters, x, load, found, fault):
    """Fill found (4, n), rows p_a, p_b, v, residual, and fault (n,) for spool positions x (n,) and
    loads (n,)."""
    for i in range(x.size):
        opening = copysign(valve.effective_opening(x[i], p.valve), x[i])  # -0.0 too
        p_a, p_b, v = solve(p, opening, load[i])
        found[0, i], found[1, i], found[2, i] = p_a, p_b, v
        found[3, i] = residual(p, opening, p_a, p_b, v, load[i])
        fault[i] = judge(p, x[i], load[i], p_a, p_b, v, found[3, i])
