"""Scenario library: what a velocity or position loop of a given cylinder should be able to do."""

from __future__ import annotations

import math
from numbers import Real
from typing import NamedTuple

import numpy as np

from ..digits import apart
from ..errors import InputError
from ..loop.quantity import POSITION, VELOCITY, controlled_quantity
from ..machine.actuator import Actuator
from ..model.operating_point import stall_force
from ..simulation.scenario import Scenario
from ..simulation.trajectory import State
from .scale import Scale, scale_of

_POSITIONS = (0.15, 0.5, 0.85)
_BEFORE = 0.05
_MOST_SAMPLES = 10_000_000


class _Change(NamedTuple):
    """A new reference from a time on."""

    time: float
    value: float


def _piecewise(
    Ts: float, duration: float, first: float, changes: tuple[_Change, ...]
) -> np.ndarray:
    t = Ts * np.arange(max(2, round(duration / Ts)))
    reference = np.full(t.size, first)
    for change in changes:
        reference[t >= change.time - 0.5 * Ts] = change.value
    return reference


def step_scenarios(actuator: Actuator, loop: str, *, Ts: float = 1e-3) -> tuple[Scenario, ...]:
    """Steps at three positions in both directions, one far beyond the valve's range each way, and a
    reversal.

    Velocity: a third of full speed (less where the stroke is too short for it to settle); the
    saturated one asks for one and a half times full speed over 0.3 of the stroke, then for 0.3 of
    it. Position: 2 % of the stroke; the saturated one half of it.
    """
    scale = _scale(actuator, loop, Ts)
    make = _velocity_steps if controlled_quantity(loop).is_speed else _position_steps
    return tuple(make(actuator, scale, Ts))


def tracking_scenarios(actuator: Actuator, loop: str, *, Ts: float = 1e-3) -> tuple[Scenario, ...]:
    """References to follow and loads to reject, all of kind "tracking": ramps both ways, sine,
    sweep, load steps both ways, and ramps that start from rest at low and at high pressures.

    Amplitudes: a sixth of the lower full speed (velocity), 2 % of the stroke (position); the sine
    so slow, and the sweep up to a frequency so low, that its speed stays below half of full speed
    and its period above ten time constants of the machine. Load steps: a tenth of the smaller stall
    force. Position scenarios carry the speed reference of their feed-forward.
    """
    scale, quantity = _scale(actuator, loop, Ts), controlled_quantity(loop)
    speed, amplitude = min(scale.extend_speed, scale.retract_speed), 0.02 * actuator.stroke
    fastest = 1.0 / (10.0 * scale.time_constant)
    slow = 0.25 * speed / (2.0 * np.pi * amplitude)
    f = fastest if quantity.is_speed else min(fastest, slow)
    t = Ts * np.arange(round(max(2.0 / f, 3.0 * scale.settling) / Ts))
    middle, phase = 0.5 * actuator.stroke, 2.0 * np.pi * f * t
    sweep = np.pi * f * t**2 / t[-1]
    # each shape: the quantity as a fraction of its amplitude, and its derivative in 1/s
    rise, fall = (
        (t / t[-1], np.full(t.size, 1.0 / t[-1])),
        (-t / t[-1], np.full(t.size, -1.0 / t[-1])),
    )
    sine = np.sin(phase), 2.0 * np.pi * f * np.cos(phase)
    swept = np.sin(sweep), 2.0 * np.pi * f * t / t[-1] * np.cos(sweep)
    hold = np.zeros(t.size), np.zeros(t.size)
    force = 0.1 * float(np.abs(stall_force(actuator, np.array([1.0, -1.0]))).min())
    load = np.where(t < 0.2 * t[-1], 0.0, force)
    low, high = _balanced_rest(actuator, middle)

    def asked(name, shape, **changes):
        value, rate = shape
        if quantity.is_speed:
            signals = {"reference": speed / 6.0 * value}
        else:
            signals = {"reference": middle + amplitude * value, "v_ref": amplitude * rate}
        return Scenario(name=name, loop=loop, Ts=Ts, y=middle, **signals, **changes)

    return (
        asked("rising ramp", rise),
        asked("falling ramp", fall),
        asked(f"sine of {f:.3g} Hz", sine),
        asked(f"sweep to {f:.3g} Hz", swept),
        asked(f"load step of {force:+.3g} N", hold, load_force=load),
        asked(f"load step of {-force:+.3g} N", hold, load_force=-load),
        asked("rising ramp from low pressures", rise, initial=low),
        asked("falling ramp from high pressures", fall, initial=high),
    )


def contact_scenarios(actuator: Actuator, loop: str, *, Ts: float = 1e-3) -> tuple[Scenario, ...]:
    """Into either end stop, against it until the command has saturated, and away again; kind
    "saturated".

    Velocity: a step as in `step_scenarios` from 3 % of the stroke before the stop, then back at the
    same speed. Position: 1 % of the stroke beyond the stop is asked, then 3 % inside. None for a
    machine without end stops: its pistons would run through.
    """
    scale = _scale(actuator, loop, Ts)
    if actuator.end_stop_stiffness == 0.0:
        return ()
    make = _velocity_contact if controlled_quantity(loop).is_speed else _position_contact
    return tuple(make(actuator, scale, Ts, direction) for direction in (1.0, -1.0))


def library(actuator: Actuator, loop: str, *, Ts: float = 1e-3) -> tuple[Scenario, ...]:
    """All of them: `step_scenarios`, `tracking_scenarios` and `contact_scenarios`."""
    return tuple(
        scenario
        for make in (step_scenarios, tracking_scenarios, contact_scenarios)
        for scenario in make(actuator, loop, Ts=Ts)
    )


def _scale(actuator: Actuator, loop: str, Ts: float) -> Scale:
    """`scale_of`, after a check that Ts can sample motions of the machine."""
    scale = scale_of(actuator, loop)
    longest = scale.settling / 20.0
    if not isinstance(Ts, Real) or isinstance(Ts, bool) or not 0.0 < Ts <= longest:
        _, limit = apart(Ts, longest) if isinstance(Ts, Real) else apart(longest, longest)
        raise InputError(
            f"Ts = {Ts!r} must be a sample time between 0 and {limit} s, a twentieth of the time in"
            " which the machine settles."
        )
    slowest = actuator.stroke / min(scale.extend_speed, scale.retract_speed)
    if (slowest + 5.0 * scale.settling) / Ts > _MOST_SAMPLES:
        raise InputError(
            f"Ts = {Ts:g} s would make scenarios of more than {_MOST_SAMPLES:g} samples; take a"
            " longer one."
        )
    return scale


def _balanced_rest(actuator: Actuator, y: float) -> tuple[State, State]:
    """Rest at y with pressures that hold the load: 10 and 90 % of the way from the lowest pair to
    the highest."""
    a = actuator
    p_t, p_s = a.tank_pressure, a.supply_pressure
    lowest = max(p_t, (a.area_b * p_t + a.constant_load) / a.area_a)
    highest = min(p_s, (a.area_b * p_s + a.constant_load) / a.area_a)
    p_a = [lowest + part * (highest - lowest) for part in (0.1, 0.9)]
    low, high = (State(p, (a.area_a * p - a.constant_load) / a.area_b, 0.0, y) for p in p_a)
    return low, high


def _velocity_steps(actuator: Actuator, scale: Scale, Ts: float):
    stroke, duration = actuator.stroke, _BEFORE + 1.5 * scale.settling

    def asked(name, kind, y, duration, *changes):
        reference = _piecewise(Ts, duration, 0.0, changes)
        return Scenario(
            name=name,
            kind=kind,
            loop=VELOCITY.loop,
            Ts=Ts,
            reference=reference,
            y=y,
            settle_by=scale.settling,
        )

    def within_stroke(speed):
        return _within_stroke(speed, stroke, duration)

    for fraction in _POSITIONS:
        for direction in (1.0, -1.0):
            speed = within_stroke(scale.speed(direction) / 3.0)
            y = fraction * stroke - 0.5 * speed * (duration - _BEFORE)
            yield asked(
                f"step to {speed:.3g} m/s at y = {fraction * stroke:.3g} m",
                "step",
                y,
                duration,
                _Change(_BEFORE, speed),
            )
    for direction in (1.0, -1.0):
        full = scale.speed(direction)
        until = _BEFORE + 0.3 * stroke / abs(full)
        y = (0.5 - 0.3 * direction) * stroke
        slow = 0.3 * within_stroke(full)
        changes = _Change(_BEFORE, 1.5 * full), _Change(until, slow)
        yield asked(
            f"{1.5 * full:.3g} m/s asked, then {slow:.3g} m/s",
            "saturated",
            y,
            until + 1.5 * scale.settling,
            *changes,
        )
    speed = within_stroke(scale.step)
    changes = _Change(_BEFORE, speed), _Change(duration, -speed)
    name = f"reversal from {speed:.3g} to {-speed:.3g} m/s"
    yield asked(name, "reversal", 0.5 * stroke, duration + 1.5 * scale.settling, *changes)


def _within_stroke(speed: float, stroke: float, duration: float) -> float:
    """`speed`, or less where it would take the piston further than a fifth of the stroke."""
    return math.copysign(min(abs(speed), 0.2 * stroke / duration), speed)


def _velocity_contact(actuator: Actuator, scale: Scale, Ts: float, direction: float) -> Scenario:
    stroke = actuator.stroke
    speed = _within_stroke(scale.speed(direction) / 3.0, stroke, _BEFORE + 1.5 * scale.settling)
    y = (0.97 if direction > 0.0 else 0.03) * stroke
    back = _BEFORE + 0.03 * stroke / abs(speed) + scale.settling
    changes = _Change(_BEFORE, speed), _Change(back, -speed)
    reference = _piecewise(Ts, back + 1.5 * scale.settling, 0.0, changes)
    name = f"into the end stop at y = {stroke if direction > 0.0 else 0.0:g} m and back"
    return Scenario(
        name=name,
        kind="saturated",
        loop=VELOCITY.loop,
        Ts=Ts,
        reference=reference,
        y=y,
        settle_by=scale.settling,
    )


def _position_contact(actuator: Actuator, scale: Scale, Ts: float, direction: float) -> Scenario:
    stroke = actuator.stroke
    end = stroke if direction > 0.0 else 0.0
    travel = 0.04 * stroke / min(scale.extend_speed, scale.retract_speed)
    back, settle_by = _BEFORE + travel + 2.0 * scale.settling, travel + scale.settling
    changes = (
        _Change(_BEFORE, end + 0.01 * direction * stroke),
        _Change(back, end - 0.03 * direction * stroke),
    )
    y = end - 0.02 * direction * stroke
    reference = _piecewise(Ts, back + settle_by + 0.5 * scale.settling, y, changes)
    name = f"into the end stop at y = {end:g} m and back"
    return Scenario(
        name=name,
        kind="saturated",
        loop=POSITION.loop,
        Ts=Ts,
        reference=reference,
        y=y,
        settle_by=settle_by,
    )


def _position_steps(actuator: Actuator, scale: Scale, Ts: float):
    stroke = actuator.stroke

    def asked(name, kind, y, travel_time, *changes):
        settle_by = travel_time + scale.settling
        reference = _piecewise(Ts, changes[-1].time + settle_by + 0.5 * scale.settling, y, changes)
        return Scenario(
            name=name,
            kind=kind,
            loop=POSITION.loop,
            Ts=Ts,
            reference=reference,
            y=y,
            settle_by=settle_by,
        )

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
    yield asked(
        f"reversal from {1e3 * step:+.3g} to {-1e3 * step:+.3g} mm",
        "reversal",
        y,
        travel(-2.0 * step),
        *changes,
    )
