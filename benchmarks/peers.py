"""The plant and a scheduled PID as a user of general-purpose libraries writes them: plain Python,
one scenario."""

from __future__ import annotations

import math
from bisect import bisect_right
from typing import NamedTuple

import numpy as np
from numba.extending import register_jitable

from hydroctl import Actuator, GainSchedule, Specification, load_actuator

compilable = register_jitable(error_model="numpy", fastmath={"contract"})
"""for functions that numba's compiled code may call too"""


class Plant(NamedTuple):
    """What the equations need of an actuator: floats, or arrays over scenarios."""

    area_a: float
    area_b: float
    volume_a: float
    volume_b: float
    bulk_modulus: float
    leakage: float
    flow_coefficient: float
    flow_coefficient_b: float
    supply_pressure: float
    tank_pressure: float
    mass: float
    viscous_friction: float
    constant_load: float


def plant_of(actuator: Actuator) -> Plant:
    """The plant of `actuator`."""
    return Plant(*(getattr(actuator, name) for name in Plant._fields))


@compilable
def either(condition, yes, no):
    """The choice for floats."""
    return yes if condition else no


@compilable
def signed_root(dp):
    """The signed root for floats."""
    return math.copysign(math.sqrt(abs(dp)), dp)


def numpy_root(dp):
    """The signed root for arrays of NumPy."""
    return np.copysign(np.sqrt(np.abs(dp)), dp)


def jax_root(dp):
    """The signed root for arrays of JAX."""
    import jax.numpy as jnp

    return jnp.sign(dp) * jnp.sqrt(jnp.abs(dp))


def casadi_root(dp):
    """The signed root for symbols of CasADi."""
    import casadi

    return casadi.sign(dp) * casadi.sqrt(casadi.fabs(dp))


@compilable
def slopes(p, z, x, where, root):
    """dz/dt, a tuple, of z = (p_a, p_b, v, y): floats, arrays or symbols, with the choice and the
    signed root that fit them."""
    p_a, p_b, v, y = z
    extend = x >= 0
    dp_a = where(extend, p.supply_pressure - p_a, p_a - p.tank_pressure)
    dp_b = where(extend, p_b - p.tank_pressure, p.supply_pressure - p_b)
    leak = p.leakage * (p_a - p_b)
    q_a, q_b = p.flow_coefficient * x * root(dp_a), p.flow_coefficient_b * x * root(dp_b)
    return (
        p.bulk_modulus / (p.volume_a + p.area_a * y) * (q_a - p.area_a * v - leak),
        p.bulk_modulus / (p.volume_b - p.area_b * y) * (p.area_b * v + leak - q_b),
        (p.area_a * p_a - p.area_b * p_b - p.viscous_friction * v - p.constant_load) / p.mass,
        v,
    )


@compilable
def runge_kutta_4(p, z, x, h, where, root):
    """z after one step of h."""
    k1 = slopes(p, z, x, where, root)
    k2 = slopes(p, moved(z, 0.5 * h, k1), x, where, root)
    k3 = slopes(p, moved(z, 0.5 * h, k2), x, where, root)
    k4 = slopes(p, moved(z, h, k3), x, where, root)
    return moved(moved(z, h / 6.0, k1), h / 3.0, moved(moved(k2, 1.0, k3), 0.5, k4))


@compilable
def moved(z, h, k):
    """z + h k."""
    return z[0] + h * k[0], z[1] + h * k[1], z[2] + h * k[2], z[3] + h * k[3]


def slope_function(a: Actuator, load: float = 0.0):
    """slope(z, x) -> list of dz/dt with z = (p_a, p_b, v, y), in the scalar mathematics of plain
    Python: for floats, not arrays."""
    (
        area_a,
        area_b,
        volume_a,
        volume_b,
        bulk,
        leakage,
        flow_a,
        flow_b,
        supply,
        tank,
        mass,
        viscous,
        _,
    ) = plant_of(a)

    def slope(z, x):
        p_a, p_b, v, y = z
        dp_a, dp_b = (supply - p_a, p_b - tank) if x >= 0 else (p_a - tank, supply - p_b)
        q_a = flow_a * x * math.copysign(math.sqrt(abs(dp_a)), dp_a)
        q_b = -flow_b * x * math.copysign(math.sqrt(abs(dp_b)), dp_b)
        leak = leakage * (p_a - p_b)
        return [
            bulk / (volume_a + area_a * y) * (q_a - area_a * v - leak),
            bulk / (volume_b - area_b * y) * (q_b + area_b * v + leak),
            (area_a * p_a - area_b * p_b - viscous * v - load) / mass,
            v,
        ]

    return slope


def scheduled_pid(Ts: float = 1e-3) -> GainSchedule:
    """A position PID for the reference machine on a 21 by 11 table, without notch."""
    nodes = np.linspace(0.05, 1.0, 11)
    x, y = np.concatenate([-nodes[1:][::-1], nodes]), np.linspace(0.0, 0.5, 11)
    spread = 1.0 + 0.2 * np.abs(x)[:, None] + 0.1 * y
    return GainSchedule(
        actuator=load_actuator("reference"),
        specification=Specification(sample_time=Ts, uncertainty="nominal"),
        loop="position",
        structure="pid",
        x=x,
        y=y,
        design_x=x,
        design_y=y,
        kp=230.0 * spread,
        ki=3000.0 * spread,
        kd=0.1 * spread,
        notch_frequency=0.0 * spread,
        zz=1.0,
        zp=1.0,
        Tt=0.05,
        feed_forward=True,
        speed_gain_extend=0.1515,
        speed_gain_retract=0.1393,
        speed_offset_extend=6e-4,
        speed_offset_retract=-6e-4,
    )


class PlainPID:
    """The same law one sample at a time."""

    def __init__(self, schedule: GainSchedule):
        self.s = schedule
        self.x_nodes, self.y_nodes = schedule.x.tolist(), schedule.y.tolist()
        self.tables = [table.tolist() for table in (schedule.kp, schedule.ki, schedule.kd)]
        self.below = sum(x < 0 for x in self.x_nodes)
        self.integral = self.derivative = self.error = self.x = 0.0

    def _gains(self, y):
        first, last = (0, self.below - 1) if self.x < 0 else (self.below, len(self.x_nodes) - 1)
        i, f = _place(self.x_nodes, self.x, first, last)
        j, g = _place(self.y_nodes, y, 0, len(self.y_nodes) - 1)
        for table in self.tables:
            lower, upper = table[i], table[i + 1]
            low, high = (
                lower[j] + g * (lower[j + 1] - lower[j]),
                upper[j] + g * (upper[j + 1] - upper[j]),
            )
            yield low + f * (high - low)

    def command(self, reference: float, v_ref: float, y: float) -> float:
        """x for this sample."""
        s, error = self.s, reference - y
        kp, ki, kd = self._gains(y)
        self.derivative = (s.Tf * self.derivative + error - self.error) / (s.Tf + s.Ts)
        wanted = kp * error + self.integral + kd * self.derivative
        if v_ref:
            gain, offset = (
                (s.speed_gain_extend, s.speed_offset_extend)
                if v_ref > 0
                else (s.speed_gain_retract, s.speed_offset_retract)
            )
            wanted += v_ref / gain + offset
        self.x, self.error = min(max(wanted, -1.0), 1.0), error
        self.integral += s.Ts * (ki * error + (self.x - wanted) / s.Tt)
        return self.x


def _place(nodes, value, first, last):
    """(index, fraction): where `value`, clipped to the nodes first ... last, lies between nodes."""
    value = min(max(value, nodes[first]), nodes[last])
    index = min(bisect_right(nodes, value), last) - 1
    return index, (value - nodes[index]) / (nodes[index + 1] - nodes[index])
