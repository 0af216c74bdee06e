"""Equation (1) of the source paper: flows, rates of change and the analytic Jacobian, as array functions.

State z = (p_a, p_b, v) at a frozen position y for linearization, (p_a, p_b, v, y) for simulation; input x in [-1, 1].

    V_a = volume_a + area_a y                          V_b = volume_b - area_b y
    V_a/Ec dp_a/dt = Q_a - area_a v - Kv (p_a - p_b)
    V_b/Ec dp_b/dt = Q_b + area_b v + Kv (p_a - p_b)
    m dv/dt = area_a p_a - area_b p_b - B v - F        dy/dt = v
    x >= 0:  Q_a = c_a x r(p_s - p_a)    Q_b = -c_b x r(p_b - p_t)
    x <  0:  Q_a = c_a x r(p_a - p_t)    Q_b = -c_b x r(p_s - p_b)

r(dp) = sign(dp) sqrt|dp|. The paper writes sqrt|dp|, with which the flow keeps its direction when the pressure drop
reverses; the two agree wherever p_t <= p <= p_s. With tank pressure p_t = 0, load F = 0 and c_a = c_b this is the paper's model.

Every function takes floats or arrays that broadcast; they also compile as they stand with numba, so that the simulation
kernels integrate these very lines.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .actuator import Actuator


class Parameters(NamedTuple):
    """What the equations need of an `Actuator`, in SI: floats, or arrays that broadcast."""

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
    mass: float
    viscous_friction: float


def parameters(actuator: Actuator) -> Parameters:
    """The plant's parameters of `actuator`."""
    given = actuator.parameters() | {"flow_coefficient_a": actuator.flow_coefficient}
    return Parameters(*(given[name] for name in Parameters._fields))


def signed_root(dp):
    """sign(dp) sqrt|dp|. Written so that a complex step through dp gives the derivative."""
    sign = np.where(np.real(dp) < 0.0, -1.0, 1.0)
    return sign * np.sqrt(sign * dp)


def pressure_drops(p_a, p_b, x, p: Parameters):
    """(dp_a, dp_b) in Pa over the open edges, positive where the fluid flows the way that x asks."""
    extend = x >= 0.0
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
    """(Ec/V_a, Ec/V_b) in Pa/m^3 at position y."""
    return p.bulk_modulus / (p.volume_a + p.area_a * y), p.bulk_modulus / (p.volume_b - p.area_b * y)


def rates(p_a, p_b, v, y, x, load_force, p: Parameters):
    """(dp_a/dt, dp_b/dt, dv/dt) in Pa/s, Pa/s, m/s^2: equation (1). dy/dt is v."""
    gain_a, gain_b = flow_gains(p_a, p_b, x, p)
    stiff_a, stiff_b = stiffnesses(y, p)
    leak = p.leakage * (p_a - p_b)
    return (
        stiff_a * (gain_a * x - p.area_a * v - leak),
        stiff_b * (gain_b * x + p.area_b * v + leak),
        (p.area_a * p_a - p.area_b * p_b - p.viscous_friction * v - load_force) / p.mass,
    )


def jacobian(p_a, p_b, y, x, p: Parameters):
    """(A, b): A (..., 3, 3) = d(rates)/d(p_a, p_b, v) and b (..., 3, 1) = d(rates)/dx, exact, at frozen y."""
    gain_a, gain_b = flow_gains(p_a, p_b, x, p)
    drop_a, drop_b = pressure_gains(p_a, p_b, x, p)
    stiff_a, stiff_b = stiffnesses(y, p)
    shape = np.broadcast_shapes(np.shape(gain_a * stiff_a), np.shape(gain_b * stiff_b))
    a = np.empty((*shape, 3, 3))
    a[..., 0, 0] = -stiff_a * (drop_a + p.leakage)
    a[..., 0, 1] = stiff_a * p.leakage
    a[..., 0, 2] = -stiff_a * p.area_a
    a[..., 1, 0] = stiff_b * p.leakage
    a[..., 1, 1] = -stiff_b * (drop_b + p.leakage)
    a[..., 1, 2] = stiff_b * p.area_b
    a[..., 2, 0] = p.area_a / p.mass
    a[..., 2, 1] = -p.area_b / p.mass
    a[..., 2, 2] = -p.viscous_friction / p.mass
    b = np.zeros((*shape, 3, 1))
    b[..., 0, 0] = stiff_a * gain_a
    b[..., 1, 0] = stiff_b * gain_b
    return a, b
