"""Schedules and independent reference routes for the tests of simulation and validation."""

from __future__ import annotations

import math
from types import SimpleNamespace

import numpy as np
from scipy.integrate import solve_ivp
from scipy.interpolate import RegularGridInterpolator

from hydroctl import plant


def schedule(loop="velocity", **changes):
    """PI + notch on the reference actuator, different at every node. What `GainSchedule` offers to the regulator law."""
    x, y = np.array([-1.0, -0.1, 0.1, 1.0]), np.array([0.0, 0.2, 0.5])
    spread = 1.0 + 0.1 * np.arange(12).reshape(4, 3) / 12
    kp, ki = (1.0, 350.0) if loop == "velocity" else (45.0, 20.0)
    given = {
        "loop": loop,
        "x": x,
        "y": y,
        "kp": kp * spread,
        "ki": ki * spread,
        "kd": np.zeros((4, 3)),
        "notch_frequency": 540.0 * spread,
        "Tf": 5e-4,
        "zz": 0.2,
        "zp": 0.8,
        "Ts": 1e-3,
        "delay_samples": 1,
        "Tt": 0.02,
        "speed_gain_extend": 0.1516,
        "speed_gain_retract": 0.1408,
        "speed_offset_extend": 0.0006,
        "speed_offset_retract": -0.0006,
        "feed_forward": False,
    }
    return SimpleNamespace(**given | changes)


class PlainRegulator:
    """The regulator law by other means: scipy's interpolation, the notch from the s-plane by Tustin's substitution, branches."""

    def __init__(self, schedule):
        self.s = s = schedule
        self.sides = {}
        for sign in (-1.0, 1.0):
            rows = np.flatnonzero(s.x * sign > 0.0)
            tables = np.stack([s.kp, s.ki, s.kd, s.notch_frequency], axis=-1)[rows]
            self.sides[sign] = (s.x[rows], RegularGridInterpolator((s.x[rows], s.y), tables))
        self.integral = self.derivative = self.last_error = self.x = 0.0
        self.s1 = self.s2 = 0.0

    def gains(self, y):
        nodes, table = self.sides[-1.0 if self.x < 0.0 else 1.0]
        return table([(min(max(self.x, nodes[0]), nodes[-1]), min(max(y, self.s.y[0]), self.s.y[-1]))])[0]

    def command(self, reference, v_ref, v, y):
        s = self.s
        kp, ki, kd, wn = self.gains(y)
        error = reference - (v if s.loop == "velocity" else y)
        self.derivative = (s.Tf * self.derivative + error - self.last_error) / (s.Tf + s.Ts)
        self.last_error = error
        u = kp * error + self.integral + kd * self.derivative
        warp = wn / math.tan(wn * s.Ts / 2.0)
        numerator = (warp**2 + 2 * s.zz * wn * warp + wn**2, 2 * (wn**2 - warp**2), warp**2 - 2 * s.zz * wn * warp + wn**2)
        a0, a1, a2 = warp**2 + 2 * s.zp * wn * warp + wn**2, 2 * (wn**2 - warp**2), warp**2 - 2 * s.zp * wn * warp + wn**2
        b0, b1, b2 = (value / a0 for value in numerator)
        notched = b0 * u + self.s1
        self.s1 = b1 * u - a1 / a0 * notched + self.s2
        self.s2 = b2 * u - a2 / a0 * notched
        wanted = notched
        if s.feed_forward and v_ref > 0.0:
            wanted += v_ref / s.speed_gain_extend + s.speed_offset_extend
        if s.feed_forward and v_ref < 0.0:
            wanted += v_ref / s.speed_gain_retract + s.speed_offset_retract
        self.x = min(max(wanted, -1.0), 1.0)
        self.integral += s.Ts * (ki * error + (self.x - wanted) / s.Tt)
        return self.x


def accurate_hold(actuator, state, x, load, duration, times=None):
    """The plant's states for a constant opening by DOP853 at 1e-12; at the end, or at `times` (6, n)."""
    p = plant.parameters(actuator)

    ideal = actuator.valve_natural_frequency is None

    def slope(_, z):
        valve = (0.0, 0.0) if ideal else plant.valve_rates(z[4], z[5], x, p)
        opening = plant.effective_opening(x if ideal else z[4], p)
        return [*plant.rates(z[0], z[1], z[2], z[3], opening, load, p), z[2], *valve]

    atol = np.array([actuator.supply_pressure] * 2 + [1.0, actuator.stroke, 1.0, 1e3]) * 1e-13
    answer = solve_ivp(slope, (0.0, duration), state, method="DOP853", rtol=1e-12, atol=atol, t_eval=times)
    assert answer.success
    return answer.y if times is not None else answer.y[:, -1]


def accurate_closed_loop(actuator, schedule, scenario, start):
    """(6, n) states at the sample instants: `PlainRegulator` and DOP853 from sample to sample."""
    regulator, state, commands, states = PlainRegulator(schedule), np.array(start), [], []
    for k in range(scenario.reference.size):
        states.append(state)
        commands.append(regulator.command(scenario.reference[k], scenario.v_ref[k], state[2], state[3]))
        x = commands[k - schedule.delay_samples] if k >= schedule.delay_samples else 0.0
        state = accurate_hold(actuator, state, x, scenario.load_force[k] + actuator.load_force, scenario.Ts)
    return np.array(states).T
