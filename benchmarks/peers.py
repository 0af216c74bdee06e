"""The plant and a scheduled PID as a user of general-purpose libraries writes them: plain Python, one scenario."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np

from hydroctl import Actuator, load_actuator


def slope_function(a: Actuator, load: float = 0.0):
    """slope(z, x) -> list of dz/dt with z = (p_a, p_b, v, y), in scalar mathematics."""

    def slope(z, x):
        p_a, p_b, v, y = z
        dp_a, dp_b = (
            (a.supply_pressure - p_a, p_b - a.tank_pressure) if x >= 0 else (p_a - a.tank_pressure, a.supply_pressure - p_b)
        )
        q_a = a.flow_coefficient * x * math.copysign(math.sqrt(abs(dp_a)), dp_a)
        q_b = -a.flow_coefficient_b * x * math.copysign(math.sqrt(abs(dp_b)), dp_b)
        leak = a.leakage * (p_a - p_b)
        return [
            a.bulk_modulus / (a.volume_a + a.area_a * y) * (q_a - a.area_a * v - leak),
            a.bulk_modulus / (a.volume_b - a.area_b * y) * (q_b + a.area_b * v + leak),
            (a.area_a * p_a - a.area_b * p_b - a.viscous_friction * v - load) / a.mass,
            v,
        ]

    return slope


def casadi_slope(a: Actuator, z, x):
    """The same as CasADi expressions."""
    import casadi

    def signed_root(dp):
        return casadi.sign(dp) * casadi.sqrt(casadi.fabs(dp))

    p_a, p_b, v, y = z[0], z[1], z[2], z[3]
    dp_a = casadi.if_else(x >= 0, a.supply_pressure - p_a, p_a - a.tank_pressure)
    dp_b = casadi.if_else(x >= 0, p_b - a.tank_pressure, a.supply_pressure - p_b)
    leak = a.leakage * (p_a - p_b)
    return (
        a.bulk_modulus / (a.volume_a + a.area_a * y) * (a.flow_coefficient * x * signed_root(dp_a) - a.area_a * v - leak),
        a.bulk_modulus / (a.volume_b - a.area_b * y) * (-a.flow_coefficient_b * x * signed_root(dp_b) + a.area_b * v + leak),
        (a.area_a * p_a - a.area_b * p_b - a.viscous_friction * v - a.load_force) / a.mass,
        v,
    )


def scheduled_pid(Ts: float = 1e-3) -> SimpleNamespace:
    """A position PID for the reference machine on a 21 by 11 table, without notch; the attributes of `GainSchedule`."""
    nodes = np.linspace(0.05, 1.0, 11)
    x, y = np.concatenate([-nodes[1:][::-1], nodes]), np.linspace(0.0, 0.5, 11)
    spread = 1.0 + 0.2 * np.abs(x)[:, None] + 0.1 * y
    table = {"kp": 230.0 * spread, "ki": 3000.0 * spread, "kd": 0.1 * spread, "notch_frequency": 0.0 * spread}
    forward = {
        "speed_gain_extend": 0.1515,
        "speed_gain_retract": 0.1393,
        "speed_offset_extend": 6e-4,
        "speed_offset_retract": -6e-4,
    }
    forward |= {"b": 1.0, "c": 1.0, "Tm": 0.0, "sections": (), "dead_band_inverse": 0.0, "pressure_drops": None}
    constants = {
        "actuator": load_actuator("reference"),
        "Tf": 5e-4,
        "zz": 1.0,
        "zp": 1.0,
        "Ts": Ts,
        "delay_samples": 1,
        "Tt": 0.05,
        "feed_forward": True,
    }
    return SimpleNamespace(loop="position", x=x, y=y, **table, **forward, **constants)


class PlainPID:
    """The same law one sample at a time."""

    def __init__(self, schedule: SimpleNamespace):
        self.s = schedule
        self.integral = self.derivative = self.error = self.x = 0.0

    def _gain(self, table, y):
        s, nodes = self.s, self.s.x
        side = nodes[nodes < 0] if self.x < 0 else nodes[nodes > 0]
        x, y = min(max(self.x, side[0]), side[-1]), min(max(y, s.y[0]), s.y[-1])
        i = min(max(int(np.searchsorted(nodes, x, side="right")) - 1, 0), nodes.size - 2)
        j = min(max(int(np.searchsorted(s.y, y, side="right")) - 1, 0), s.y.size - 2)
        f, g = (x - nodes[i]) / (nodes[i + 1] - nodes[i]), (y - s.y[j]) / (s.y[j + 1] - s.y[j])
        low = table[i, j] + g * (table[i, j + 1] - table[i, j])
        return low + f * (table[i + 1, j] + g * (table[i + 1, j + 1] - table[i + 1, j]) - low)

    def command(self, reference: float, v_ref: float, y: float) -> float:
        """x for this sample."""
        s, error = self.s, reference - y
        kp, ki, kd = (self._gain(table, y) for table in (s.kp, s.ki, s.kd))
        self.derivative = (s.Tf * self.derivative + error - self.error) / (s.Tf + s.Ts)
        wanted = kp * error + self.integral + kd * self.derivative
        if v_ref:
            gain, offset = (
                (s.speed_gain_extend, s.speed_offset_extend) if v_ref > 0 else (s.speed_gain_retract, s.speed_offset_retract)
            )
            wanted += v_ref / gain + offset
        self.x, self.error = min(max(wanted, -1.0), 1.0), error
        self.integral += s.Ts * (ki * error + (self.x - wanted) / s.Tt)
        return self.x
