"""Equation (1) of the source paper: flows, rates of change and the analytic Jacobian, as array
functions.

State z = (p_a, p_b, v) at a frozen position y for linearization, (p_a, p_b, v, y) for simulation;
input x in [-1, 1].

    V_a = volume_a + area_a y                          V_b = volume_b - area_b y
    V_a/Ec dp_a/dt = Q_a - area_a v - Kv (p_a - p_b)
    V_b/Ec dp_b/dt = Q_b + area_b v + Kv (p_a - p_b)
    m dv/dt = area_a p_a - area_b p_b - F_f(v) + F_e(y, v) - F        dy/dt = v
    x >= 0:  Q_a = c_a x r(p_s - p_a)    Q_b = -c_b x r(p_b - p_t)
    x <  0:  Q_a = c_a x r(p_a - p_t)    Q_b = -c_b x r(p_s - p_b)

r(dp) = sign(dp) sqrt|dp|. The paper writes sqrt|dp|, with which the flow keeps its direction when
the pressure drop reverses; the two agree wherever p_t <= p <= p_s. The load F is
`Actuator.constant_load` and what a motion adds to it. With tank pressure p_t = 0, load F = 0, c_a =
c_b, friction F_f = B v and no end stops, F_e = 0, this is the paper's model; every further effect
vanishes exactly with its parameter.

In these equations x is the opening that the fluid sees: `effective_opening` of the spool, which an
ideal valve holds at the command and a real one moves by `valve_rates`.

Every function takes floats or arrays that broadcast; they also compile as they stand with numba, so
that the simulation kernels integrate these very lines.
"""

from __future__ import annotations

from functools import lru_cache
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..machine.actuator import Actuator

if TYPE_CHECKING:
    import control


class Parameters(NamedTuple):
    """What the equations need of an `Actuator`, in SI: floats, or arrays that broadcast. An effect
    that is absent has the value that makes it vanish: 0, but 1 for `valve_damping` and
    `stribeck_speed`, and an infinite `valve_rate_limit`. A `valve_natural_frequency` of 0 means an
    ideal valve: the spool is the command, and `valve_rates` is not to be used.
    """

    area_a: float
    area_b: float
    volume_a: float
    volume_b: float
    bulk_modulus: float
    leakage: float
    flow_coefficient_a: float
    flow_coefficient_b: float
    supply_pressure: float
    tank_pressure: float
    inverse_mass: float
    """1/kg: a product costs less than a division"""
    viscous_friction: float
    coulomb_friction: float
    breakaway_friction: float
    stribeck_speed: float
    creep_speed: float
    stroke: float
    end_stop_stiffness: float
    end_stop_damping: float
    valve_natural_frequency: float
    valve_damping: float
    valve_rate_limit: float
    dead_band: float


_ABSENT = {
    "stribeck_speed": 1.0,
    "valve_natural_frequency": 0.0,
    "valve_damping": 1.0,
    "valve_rate_limit": np.inf,
}


@lru_cache(maxsize=256)
def parameters(actuator: Actuator) -> Parameters:
    """The plant's parameters of `actuator`."""
    derived = {"flow_coefficient_a": actuator.flow_coefficient, "inverse_mass": 1.0 / actuator.mass}
    given = actuator.parameters() | derived
    return Parameters(
        *(_ABSENT[name] if (value := given[name]) is None else value for name in Parameters._fields)
    )


def signed_root(dp):
    """sign(dp) sqrt|dp|. Written so that a complex step through dp gives the derivative."""
    sign = np.where(np.real(dp) < 0.0, -1.0, 1.0)
    return sign * np.sqrt(sign * dp)


def pressure_drops(p_a, p_b, x, p: Parameters):
    """(dp_a, dp_b) in Pa over the open edges, positive where the fluid flows the way that x
    asks."""
    extend = np.real(x) >= 0.0
    dp_a = np.where(extend, p.supply_pressure - p_a, p_a - p.tank_pressure)
    dp_b = np.where(extend, p_b - p.tank_pressure, p.supply_pressure - p_b)
    return dp_a, dp_b


def flow_gains(p_a, p_b, x, p: Parameters):
    """(dQ_a/dx, dQ_b/dx) in m^3/s: the flows into chambers a and b per unit of valve opening."""
    dp_a, dp_b = pressure_drops(p_a, p_b, x, p)
    return p.flow_coefficient_a * signed_root(dp_a), -p.flow_coefficient_b * signed_root(dp_b)


def pressure_gains(p_a, p_b, x, p: Parameters):
    """(-dQ_a/dp_a, -dQ_b/dp_b) in m^3/s/Pa, both >= 0; infinite where a pressure drop vanishes."""
    dp_a, dp_b = pressure_drops(p_a, p_b, x, p)
    opening = np.abs(x)
    return (
        p.flow_coefficient_a * opening / (2.0 * np.sqrt(np.abs(dp_a))),
        p.flow_coefficient_b * opening / (2.0 * np.sqrt(np.abs(dp_b))),
    )


def stiffnesses(y, p: Parameters):
    """(Ec/V_a, Ec/V_b) in Pa/m^3 at position y; by one division, because divisions and roots bound
    the speed of a simulation."""
    volume_a, volume_b = p.volume_a + p.area_a * y, p.volume_b - p.area_b * y
    both = p.bulk_modulus / (volume_a * volume_b)
    return both * volume_b, both * volume_a


def friction_force(v, p: Parameters):
    """F_f(v) in N, against the motion: viscous friction B v and `dry_friction`."""
    return p.viscous_friction * v + dry_friction(v, p)


def dry_friction(v, p: Parameters):
    """(F_c + (F_s - F_c)/(1 + (v/v_s)^2)) v/sqrt(v^2 + v_c^2) in N, against the motion.

    Coulomb friction F_c, and breakaway friction F_s that falls half way to F_c at the Stribeck
    speed v_s (the Lorentzian form, e.g. Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica
    30 (1994) 1083). The last factor makes the sign of v smooth: a piston held by dry friction under
    a force F < F_s creeps at about v_c F/sqrt(F_s^2 - F^2), that is 0.58 v_c at half of F_s. The
    largest dry force stays below F_s by up to 1.4 v_c/v_s of it. Both quotients stand over one
    denominator, because divisions and roots bound the speed of a simulation.
    """
    square, knee = v * v, p.stribeck_speed**2
    dry = p.coulomb_friction * (knee + square) + (p.breakaway_friction - p.coulomb_friction) * knee
    return dry * v / ((knee + square) * np.sqrt(square + p.creep_speed**2))


def friction_slope(v, p: Parameters):
    """dF_f/dv in N*s/m; negative where breakaway friction falls faster than viscous friction
    rises."""
    return p.viscous_friction + dry_friction_slope(v, p)


def dry_friction_slope(v, p: Parameters):
    """Derivative of `dry_friction` in N*s/m."""
    ratio = v / p.stribeck_speed
    excess = (p.breakaway_friction - p.coulomb_friction) / (1.0 + ratio**2)
    root = np.sqrt(v * v + p.creep_speed**2)
    falling = -2.0 * excess * ratio / (1.0 + ratio**2) / p.stribeck_speed
    return falling * v / root + (p.coulomb_friction + excess) * p.creep_speed**2 / root**3


def end_stop_force(y, v, p: Parameters):
    """F_e in N on the piston, positive in the direction of extension: k d max(0, 1 + lambda dd/dt)
    at depth d into a stop.

    The law of Hunt and Crossley (J. Applied Mechanics 42 (1975) 440), without the pull that it has
    on fast departure: continuous at contact, dissipative, never sticking. d is -y at the lower stop
    and y - stroke at the upper one.
    """
    lower, upper = np.maximum(-y, 0.0), np.maximum(y - p.stroke, 0.0)
    push_up = lower * np.maximum(1.0 - p.end_stop_damping * v, 0.0)
    push_down = upper * np.maximum(1.0 + p.end_stop_damping * v, 0.0)
    return p.end_stop_stiffness * (push_up - push_down)


def effective_opening(x, p: Parameters):
    """The opening that the fluid sees at spool position x: 0 within the dead band, then linear to 1
    at |x| = 1 and beyond."""
    opening = (np.abs(x) - p.dead_band) / (1.0 - p.dead_band)
    return np.copysign(np.minimum(np.maximum(opening, 0.0), 1.0), x)


def opening_slope(x, p: Parameters):
    """Derivative of `effective_opening` with respect to x for |x| <= 1: 0 within the dead band,
    else 1/(1 - dead_band)."""
    return np.where(np.abs(x) > p.dead_band, 1.0 / (1.0 - p.dead_band), 0.0)


def valve_rates(spool, spool_rate, command, p: Parameters):
    """(d spool/dt, d spool_rate/dt) in 1/s, 1/s^2 of the second-order lag w^2/(s^2 + 2 zeta w s +
    w^2) from command to spool.

    The command saturates at +-1. The lag is built as a speed loop, wanted speed w/(2 zeta) (command
    - spool) and speed lag 1/(2 zeta w), so that the rate limit acts on the wanted speed, as a
    saturating pilot stage does: the spool speed never exceeds it, and without a limit the lag is
    exact.
    """
    wanted = wanted_spool_rate(spool, command, p)
    limited = np.minimum(np.maximum(wanted, -p.valve_rate_limit), p.valve_rate_limit)
    return spool_rate, 2.0 * p.valve_damping * p.valve_natural_frequency * (limited - spool_rate)


def wanted_spool_rate(spool, command, p: Parameters):
    """The spool speed in 1/s that the valve's position loop asks for, before its limit."""
    return (
        p.valve_natural_frequency
        / (2.0 * p.valve_damping)
        * (np.minimum(np.maximum(command, -1.0), 1.0) - spool)
    )


def rates(p_a, p_b, v, y, x, load_force, p: Parameters):
    """(dp_a/dt, dp_b/dt, dv/dt) in Pa/s, Pa/s, m/s^2: equation (1) at the effective opening x.
    dy/dt is v."""
    gain_a, gain_b = flow_gains(p_a, p_b, x, p)
    stiff_a, stiff_b = stiffnesses(y, p)
    leak = p.leakage * (p_a - p_b)
    return (
        stiff_a * (gain_a * x - (p.area_a * v + leak)),
        stiff_b * (gain_b * x + (p.area_b * v + leak)),
        (
            p.area_a * p_a
            - p.area_b * p_b
            - friction_force(v, p)
            + end_stop_force(y, v, p)
            - load_force
        )
        * p.inverse_mass,
    )


def jacobian(p_a, p_b, v, y, x, p: Parameters):
    """(A, b): A (..., 3, 3) = d(rates)/d(p_a, p_b, v) and b (..., 3, 1) = d(rates)/dx, exact, at
    frozen y clear of the stops.

    Every entry lies contiguous in memory over the grid; arguments that are constant along an axis
    cost no more for its length.
    """
    gain_a, gain_b = flow_gains(p_a, p_b, x, p)
    drop_a, drop_b = pressure_gains(p_a, p_b, x, p)
    stiff_a, stiff_b = stiffnesses(y, p)
    slope = friction_slope(v, p)
    shape = np.broadcast(gain_a, gain_b, drop_a, drop_b, stiff_a, stiff_b, slope).shape
    a = np.empty((3, 3, *shape))
    np.multiply(-stiff_a, drop_a + p.leakage, out=a[0, 0, ...])
    a[0, 1] = stiff_a * p.leakage
    a[0, 2] = -stiff_a * p.area_a
    a[1, 0] = stiff_b * p.leakage
    np.multiply(-stiff_b, drop_b + p.leakage, out=a[1, 1, ...])
    a[1, 2] = stiff_b * p.area_b
    a[2, 0] = p.area_a * p.inverse_mass
    a[2, 1] = -p.area_b * p.inverse_mass
    a[2, 2] = -slope * p.inverse_mass
    b = np.zeros((3, 1, *shape))
    np.multiply(stiff_a, gain_a, out=b[0, 0, ...])
    np.multiply(stiff_b, gain_b, out=b[1, 0, ...])
    order = (*range(2, a.ndim), 0, 1)
    return a.transpose(order), b.transpose(order)


def as_nonlinear_system(
    actuator: Actuator, *, pressure_unit: float = 1e5
) -> control.NonlinearIOSystem:
    """The whole plant for python-control: inputs x (valve command) and load_force (N, added to
    `actuator.constant_load`); states p_a, p_b, v (m/s), y (m) and, for a valve that is not ideal,
    spool and spool_rate (1/s); outputs p_a, p_b, v, y.

    Pressures are in `pressure_unit` Pa, bar by default: `control.linearize` takes one step of 1e-6
    for all states, which is lost in the rounding of a pressure in Pa (entries of A off by per cent)
    and right for one in bar.
    """
    import control

    p = parameters(actuator)
    ideal = actuator.valve_natural_frequency is None

    def update(t, state, inputs, params):
        p_a, p_b, v, y, *valve = state
        spool = inputs[0] if ideal else valve[0]
        opening = effective_opening(spool, p)
        dp_a, dp_b, dv = rates(
            p_a * pressure_unit,
            p_b * pressure_unit,
            v,
            y,
            opening,
            actuator.constant_load + inputs[1],
            p,
        )
        moving = () if ideal else valve_rates(*valve, inputs[0], p)
        return np.array([dp_a / pressure_unit, dp_b / pressure_unit, dv, v, *moving])

    motion = ["p_a", "p_b", "v", "y"]
    return control.nlsys(
        update,
        lambda t, state, inputs, params: state[:4],
        states=motion if ideal else [*motion, "spool", "spool_rate"],
        inputs=["x", "load_force"],
        outputs=motion,
        name=actuator.name.replace(".", "_"),
    )
