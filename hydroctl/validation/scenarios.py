"""Scenario library: what a velocity or position loop of a given cylinder should be able to do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..actuator import Actuator
from ..errors import InputError, unknown_name
from ..frequency import LOOPS
from ..linearization import linearize
from ..operating_point import find_operating_points, stall_force
from ..simulation.scenario import Scenario
from ..simulation.trajectory import rest_state

_POSITIONS = (0.15, 0.5, 0.85)
_SETTLING = {"velocity": 40.0, "position": 80.0}
_BEFORE = 0.05


@dataclass(frozen=True)
class Scale:
    """The cylinder's own measures, by which scenarios and requirements are sized."""

    extend_speed: float
    """m/s at x = 1"""
    retract_speed: float
    """m/s at x = -1, positive"""
    time_constant: float
    """s: the longest over the stroke of 1/(2 zeta omega_n) and 2 zeta/omega_n of the hydraulic mode. Without a notch no loop
    reaches a crossover above 2 zeta omega_n."""
    settling: float
    """s: 40 (velocity) or 80 (position) of these time constants, in which a step must have settled"""
    step: float
    """m/s or m: the library's step within the valve's range, a third of the lower full speed or 2 % of the stroke"""

    def speed(self, direction: float) -> float:
        """Full speed, signed like `direction`, m/s."""
        return self.extend_speed if direction > 0.0 else -self.retract_speed


def scale_of(actuator: Actuator, loop: str) -> Scale:
    """The measures of `actuator`. Raises InputError where it cannot move both ways under its own load."""
    if loop not in LOOPS:
        raise InputError(unknown_name("loop", loop, LOOPS))
    points = find_operating_points(actuator, np.array([[-1.0], [1.0]]), np.linspace(0.0, actuator.stroke, 9))
    if not points.feasible.all():
        raise InputError(points.reason[~points.feasible][0])
    poles = linearize(actuator, points).poles()[..., 1:]
    damping = -poles.sum(axis=-1).real
    square = np.prod(poles, axis=-1).real
    time_constant = float(np.maximum(1.0 / damping, damping / square).max())
    extend, retract = float(points.v[1, 0]), -float(points.v[0, 0])
    step = min(extend, retract) / 3.0 if loop == "velocity" else 0.02 * actuator.stroke
    return Scale(extend, retract, time_constant, _SETTLING[loop] * time_constant, step)


class _Change(NamedTuple):
    """A new reference from a time on."""

    time: float
    value: float


def _piecewise(Ts: float, duration: float, first: float, changes: tuple[_Change, ...]) -> np.ndarray:
    t = Ts * np.arange(max(2, round(duration / Ts)))
    reference = np.full(t.size, first)
    for change in changes:
        reference[t >= change.time - 0.5 * Ts] = change.value
    return reference


def step_scenarios(actuator: Actuator, loop: str, *, Ts: float = 1e-3) -> tuple[Scenario, ...]:
    """Steps at three positions in both directions, one far beyond the valve's range each way, and a reversal.

    Velocity: a third of full speed (less where the stroke is too short for it to settle); the saturated one asks for one and a
    half times full speed over 0.3 of the stroke, then for 0.3 of it. Position: 2 % of the stroke; the saturated one half of it.
    """
    scale = scale_of(actuator, loop)
    make = _velocity_steps if loop == "velocity" else _position_steps
    return tuple(make(actuator, scale, Ts))


def tracking_scenarios(actuator: Actuator, loop: str, *, Ts: float = 1e-3) -> tuple[Scenario, ...]:
    """References to follow and loads to reject, all of kind "tracking": ramp, sine, sweep, load step, start from other pressures.

    Amplitudes: a sixth of the lower full speed (velocity), 2 % of the stroke (position); the sine so slow, and the sweep up to a
    frequency so low, that its speed stays below half of full speed and its period above ten time constants of the machine. Load
    steps: a tenth of the smaller stall force. Position scenarios carry the speed reference of their feed-forward.
    """
    scale = scale_of(actuator, loop)
    speed, amplitude = min(scale.extend_speed, scale.retract_speed), 0.02 * actuator.stroke
    fastest = 1.0 / (10.0 * scale.time_constant)
    f = min(fastest, 0.25 * speed / (2.0 * np.pi * amplitude) if loop == "position" else fastest)
    t = Ts * np.arange(round(max(2.0 / f, 3.0 * scale.settling) / Ts))
    middle, phase = 0.5 * actuator.stroke, 2.0 * np.pi * f * t
    sweep = np.pi * f * t**2 / t[-1]
    # each entry: the quantity as a fraction of its amplitude, and its derivative in 1/s
    shapes = {
        "ramp": (t / t[-1], np.full(t.size, 1.0 / t[-1])),
        f"sine of {f:.3g} Hz": (np.sin(phase), 2.0 * np.pi * f * np.cos(phase)),
        f"sweep to {f:.3g} Hz": (np.sin(sweep), 2.0 * np.pi * f * t / t[-1] * np.cos(sweep)),
        "hold": (np.zeros(t.size), np.zeros(t.size)),
    }
    stall = float(np.abs(stall_force(actuator, np.array([1.0, -1.0]))).min())
    rest = rest_state(actuator, middle)
    low = rest._replace(p_a=0.5 * rest.p_a, p_b=(0.5 * actuator.area_a * rest.p_a - actuator.load_force) / actuator.area_b)

    def asked(name, shape, **changes):
        value, rate = shapes[shape]
        signals = (
            {"reference": speed / 6.0 * value}
            if loop == "velocity"
            else {
                "reference": middle + amplitude * value,
                "v_ref": amplitude * rate,
            }
        )
        return Scenario(name=name, loop=loop, Ts=Ts, y=middle, **signals, **changes)

    following = [asked(name, name) for name in list(shapes)[:3]]
    load = np.where(t < 0.2 * t[-1], 0.0, 0.1 * stall)
    loads = [asked(f"load step of {sign * 0.1 * stall:+.3g} N", "hold", load_force=sign * load) for sign in (1.0, -1.0)]
    return (*following, *loads, asked("start at half the pressures", "hold", initial=low))


def _velocity_steps(actuator: Actuator, scale: Scale, Ts: float):
    stroke, duration = actuator.stroke, _BEFORE + 1.5 * scale.settling

    def asked(name, kind, y, duration, *changes):
        reference = _piecewise(Ts, duration, 0.0, changes)
        return Scenario(name=name, kind=kind, loop="velocity", Ts=Ts, reference=reference, y=y, settle_by=scale.settling)

    def within_stroke(speed):
        return np.sign(speed) * min(abs(speed), 0.2 * stroke / duration)

    for fraction in _POSITIONS:
        for direction in (1.0, -1.0):
            speed = within_stroke(scale.speed(direction) / 3.0)
            y = fraction * stroke - 0.5 * speed * (duration - _BEFORE)
            yield asked(f"step to {speed:.3g} m/s at y = {fraction * stroke:.3g} m", "step", y, duration, _Change(_BEFORE, speed))
    for direction in (1.0, -1.0):
        full = scale.speed(direction)
        until = _BEFORE + 0.3 * stroke / abs(full)
        y = (0.5 - 0.3 * direction) * stroke
        slow = 0.3 * within_stroke(full)
        changes = _Change(_BEFORE, 1.5 * full), _Change(until, slow)
        yield asked(f"{1.5 * full:.3g} m/s asked, then {slow:.3g} m/s", "saturated", y, until + 1.5 * scale.settling, *changes)
    speed = within_stroke(scale.step)
    changes = _Change(_BEFORE, speed), _Change(duration, -speed)
    name = f"reversal from {speed:.3g} to {-speed:.3g} m/s"
    yield asked(name, "reversal", 0.5 * stroke, duration + 1.5 * scale.settling, *changes)


def _position_steps(actuator: Actuator, scale: Scale, Ts: float):
    stroke = actuator.stroke

    def asked(name, kind, y, travel_time, *changes):
        settle_by = travel_time + scale.settling
        reference = _piecewise(Ts, changes[-1].time + settle_by + 0.5 * scale.settling, y, changes)
        return Scenario(name=name, kind=kind, loop="position", Ts=Ts, reference=reference, y=y, settle_by=settle_by)

    def travel(distance):
        return abs(distance) / abs(scale.speed(distance))

    for fraction in _POSITIONS:
        for step in (scale.step, -scale.step):
            y = fraction * stroke
            name = f"step of {1e3 * step:+.3g} mm at y = {y:.3g} m"
            yield asked(name, "step", y, travel(step), _Change(_BEFORE, y + step))
    for step in (0.5 * stroke, -0.5 * stroke):
        y = 0.5 * (stroke - step)
        name = f"step of {1e3 * step:+.3g} mm at full opening"
        yield asked(name, "saturated", y, travel(step), _Change(_BEFORE, y + step))
    step, y = scale.step, 0.5 * stroke
    changes = _Change(_BEFORE, y + step), _Change(_BEFORE + 0.25 * scale.settling, y - step)
    yield asked(f"reversal from {1e3 * step:+.3g} to {-1e3 * step:+.3g} mm", "reversal", y, travel(-2.0 * step), *changes)
