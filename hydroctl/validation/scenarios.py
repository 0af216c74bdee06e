"""Scenario library: what a velocity or position loop of a given cylinder should be able to do."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..actuator import Actuator
from ..errors import InputError, unknown_name
from ..linearization import linearize
from ..operating_point import find_operating_points
from ..simulation.scenario import LOOPS, Scenario

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
