"""Schedules and independent reference routes for the tests of simulation and validation."""

from __future__ import annotations

import math
from dataclasses import fields
from types import SimpleNamespace

import numpy as np
from machines import total_load
from scipy.integrate import solve_ivp
from scipy.interpolate import RegularGridInterpolator

from hydroctl import load_actuator
from hydroctl.loop.quantity import controlled_quantity
from hydroctl.model import plant
from hydroctl.regulator.scheduled import ScheduledRegulator
from hydroctl.schedule.schedule import compensation_of
from hydroctl.simulation.kernels.builds import ALL_COMPONENTS, motion_build


def schedule(loop="velocity", **changes):
    """PI + notch on the reference actuator, different at every node. What `GainSchedule` offers to
    the regulator law."""
    x, y = np.array([-1.0, -0.1, 0.1, 1.0]), np.array([0.0, 0.2, 0.5])
    spread = 1.0 + 0.1 * np.arange(12).reshape(4, 3) / 12
    kp, ki = (1.0, 350.0) if loop == "velocity" else (45.0, 20.0)
    given = {
        "loop": loop,
        "quantity": controlled_quantity(loop),
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
        "sections": (),
        "Tm": 0.0,
        "b": 1.0,
        "c": 1.0,
        "dead_band_inverse": 0.0,
        "pressure_drops": None,
        "actuator": load_actuator("reference"),
    }
    given |= changes
    return SimpleNamespace(**given, regulator=_regulator(SimpleNamespace(**given)))


def _regulator(s):
    p = plant.parameters(s.actuator)
    own = {
        "measured": s.quantity.signal,
        "structure": "pi+notch",
        "compensation": None if s.pressure_drops is None else compensation_of(p, s.pressure_drops),
        "inverse_depth": s.dead_band_inverse * p.valve.dead_band,
        "inverse_width": p.valve.dead_band or 1.0,
    }
    shared = {field.name for field in fields(ScheduledRegulator)} - own.keys()
    return ScheduledRegulator(**{name: getattr(s, name) for name in shared}, **own)


class PlainRegulator:
    """The regulator law by other means: scipy's interpolation, filters from the s-plane by Tustin's
    substitution, branches."""

    def __init__(self, schedule):
        self.s = s = schedule
        self.sides = {}
        for sign in (-1.0, 1.0):
            rows = np.flatnonzero(s.x * sign > 0.0)
            tables = np.stack([s.kp, s.ki, s.kd, s.notch_frequency], axis=-1)[rows]
            self.sides[sign] = (s.x[rows], RegularGridInterpolator((s.x[rows], s.y), tables))
        self.x = 0.0
        self.rest()

    def rest(self):
        """Forget everything but the gains."""
        self.integral = self.derivative = self.x = 0.0
        self.measured = self.last = None
        self.notch_states, self.section_states = [0.0, 0.0], [[0.0] for _ in self.s.sections]

    def gains(self, y):
        nodes, table = self.sides[-1.0 if self.x < 0.0 else 1.0]
        return table(
            [(min(max(self.x, nodes[0]), nodes[-1]), min(max(y, self.s.y[0]), self.s.y[-1]))]
        )[0]

    def filtered(self, u, wn):
        """u after sections and notch, in the transposed direct form II."""
        warp = wn / math.tan(wn * self.s.Ts / 2.0)
        for state, (zero, pole) in zip(self.section_states, self.s.sections, strict=True):
            b0, b1 = 1.0 + warp / (zero * wn), 1.0 - warp / (zero * wn)
            a0, a1 = 1.0 + warp / (pole * wn), 1.0 - warp / (pole * wn)
            out = b0 / a0 * u + state[0]
            state[0], u = (b1 * u - a1 * out) / a0, out
        if self.s.zz != self.s.zp:
            (b0, b1, b2), (a0, a1, a2) = (
                (
                    warp**2 + 2 * damping * wn * warp + wn**2,
                    2 * (wn**2 - warp**2),
                    warp**2 - 2 * damping * wn * warp + wn**2,
                )
                for damping in (self.s.zz, self.s.zp)
            )
            out, state = b0 / a0 * u + self.notch_states[0], self.notch_states
            state[0], state[1], u = (
                (b1 * u - a1 * out) / a0 + state[1],
                (b2 * u - a2 * out) / a0,
                out,
            )
        return u

    def ratio(self, opening, p_a, p_b, y):
        """The gain that the design counted on over the one at these pressures."""
        machine = self.s.actuator
        supply, tank = machine.supply_pressure, machine.tank_pressure
        drops = (supply - p_a, p_b - tank) if opening >= 0.0 else (p_a - tank, supply - p_b)
        wanted = self.s.pressure_drops[int(opening >= 0.0)]
        inside = min(max(y, 0.0), machine.stroke)
        per_root = (
            machine.area_a
            * machine.flow_coefficient
            / (machine.volume_a + machine.area_a * inside),
            machine.area_b
            * machine.flow_coefficient_b
            / (machine.volume_b - machine.area_b * inside),
        )
        q, q_ref = (
            sum(w * math.sqrt(max(d, 1.0)) for w, d in zip(per_root, pair, strict=True))
            for pair in (drops, wanted)
        )
        return min(max(q_ref / q, 0.4), 3.0)

    def forward(self, v_ref):
        s = self.s
        if not s.feed_forward or v_ref == 0.0:
            return 0.0
        if v_ref > 0.0:
            return v_ref / s.speed_gain_extend + s.speed_offset_extend
        return v_ref / s.speed_gain_retract + s.speed_offset_retract

    def command(self, reference, v_ref, p_a, p_b, v, y):
        s = self.s
        m = v if s.loop == "velocity" else y
        used = [reference, v_ref, y, m, *([p_a, p_b] if s.pressure_drops is not None else [])]
        if not all(map(math.isfinite, used)):
            self.rest()
            return 0.0
        kp, ki, kd, wn = self.gains(y)
        self.measured = (
            m if self.measured is None else (s.Tm * self.measured + s.Ts * m) / (s.Tm + s.Ts)
        )
        error, seen = reference - self.measured, s.c * reference - self.measured
        before = s.c * m - m if self.last is None else self.last
        self.derivative = (s.Tf * self.derivative + seen - before) / (s.Tf + s.Ts)
        self.last = seen
        opening = self.filtered(
            kp * (s.b * reference - self.measured) + self.integral + kd * self.derivative, wn
        )
        opening += self.forward(v_ref)
        ratio = 1.0 if s.pressure_drops is None else self.ratio(opening, p_a, p_b, y)
        limited = min(max(ratio * opening, -1.0), 1.0)
        self.integral += s.Ts * (ki * error + (limited / ratio - opening) / s.Tt)
        depth, width = s.dead_band_inverse * s.actuator.dead_band, s.actuator.dead_band
        self.x = (
            limited
            if depth == 0.0
            else (1.0 - depth) * limited + depth * (1.0 + width) * limited / (abs(limited) + width)
        )
        return self.x


def accurate_hold(actuator, state, x, load, duration, times=None):
    """The plant's states for a constant opening by DOP853 at 1e-12; at the end, or at `times` (6,
    n)."""
    p, slope = plant.parameters(actuator), motion_build(ALL_COMPONENTS).motion.slope
    state = np.array(state, dtype=float)
    if actuator.valve_natural_frequency is None:
        state[4] = x
    atol = np.array([actuator.supply_pressure] * 2 + [1.0, actuator.stroke, 1.0, 1e3]) * 1e-13
    span = (0.0, duration)
    answer = solve_ivp(
        lambda _, z: slope(tuple(z), x, load, p),
        span,
        state,
        method="DOP853",
        rtol=1e-12,
        atol=atol,
        t_eval=times,
    )
    assert answer.success
    return answer.y if times is not None else answer.y[:, -1]


def accurate_closed_loop(actuator, schedule, scenario, start):
    """(6, n) states at the sample instants: `PlainRegulator` and DOP853 from sample to sample."""
    regulator, state, states = PlainRegulator(schedule), np.array(start), []
    late, whole = math.modf(schedule.delay_samples)
    commands = [0.0] * (int(whole) + 1)
    for k in range(scenario.reference.size):
        states.append(state)
        seen = state[:4] if scenario.sensors is None else readings(scenario, k, state)
        commands.append(regulator.command(scenario.reference[k], scenario.v_ref[k], *seen))
        load = scenario.load_force[k] + total_load(actuator)
        for x, share in ((commands[k], late), (commands[k + 1], 1.0 - late)):
            if share > 0.0:
                state = accurate_hold(actuator, state, x, load, share * scenario.Ts)
    return np.array(states).T


def readings(scenario, k, state):
    """What the sensors of `scenario` show of `state` at sample k."""
    noise, resolution = scenario.sensors.signals(scenario.reference.size)
    noisy = state[:4] + noise[:, k]
    return [
        value if step == 0.0 else step * math.floor(value / step + 0.5)
        for value, step in zip(noisy, resolution, strict=True)
    ]
