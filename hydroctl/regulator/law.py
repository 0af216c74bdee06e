"""The sampled regulator law, written once: what runs each sample in every simulation and what an
exported regulator must do. C, structured text, JavaScript and the formulas of a schedule file are
printed from these lines (`printing`), the linear regulator follows from them (`linear`).

At sample k, with the reference r, the measured quantity m (v for a velocity loop, y for a position
loop), the measured y and, for the compensation of the pressures, p_a and p_b:

    kp, ki, kd, wn   from the tables at (x[k-1], y)          gains
    m_f              filtered m                              measurement_filter
    u = kp (b r - m_f) + I + kd d                            pid
    o = notch(lead-lag(u)) + feed-forward(v_ref)             lead_lag, notch, feed_forward
    w = ratio o                                              compensation
    x = inverse(w limited to [-1, 1])                        inverse
    I += Ts (ki (r - m_f) + (w limited - w)/(ratio Tt))      pid

Each structure is the module named at its right: its step, what it remembers, its settings, and what
it comes to where a schedule does not use it (`absent_step`).

A start, m_f = m and g[k-1] = (c - 1) m, takes the reference before the first sample as equal to the
measurement. A fault is an input that is not finite (a broken sensor), or one so large that x or a
state would not be finite: then x = 0, and the next sound sample is a start. Every function takes
numbers, as Python or compiled; `regulate` is free of branches.

What is printed is taken from here: `# [unit] what it is` behind an assignment becomes the comment
of the printed statement, the first sentence of a docstring the heading of the printed lines.
"""

from __future__ import annotations

from collections import namedtuple
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

from . import (
    clipping,
    compensation,
    feed_forward,
    gains,
    inverse,
    lead_lag,
    measurement_filter,
    notch,
    pid,
)

STRUCTURES = (pid, lead_lag, notch, measurement_filter, feed_forward, compensation, inverse)
"""The modules of which the law is composed, beside the lookup of the gains."""
MEMORY: dict[str, str] = {
    name: text for structure in STRUCTURES for name, text in structure.MEMORY.items()
} | {
    "x": "[1] the last command",
    "running": "1 after a sample, 0 before the first and after a fault",
}
SETTINGS: dict[str, str] = {
    "x": "[1] nodes of the opening; below 0 the opening uses those below 0, else those above",
    "x_slope": "[1] 1/(distance to the next node), 0 at the last",
    "y": "[m] nodes of the position",
    "y_slope": "[1/m] 1/(distance to the next node), 0 at the last",
    "table": "(nx, ny, 4): kp, ki, kd, notch frequency",
    "limits": "[1] lowest and highest node that x[k-1] < 0 may use, then the same for x[k-1] >= 0",
    "position": "whether y is controlled, else v",
    "Ts": "[s] sample time",
    "shaped": "whether there is a notch or a section, so that wn is needed",
    "delay_samples": "whole samples from the measurement to the valve command",
    "delay_fraction": "the rest of that delay in samples, 0 <= delay_fraction < 1",
} | {name: text for structure in STRUCTURES for name, text in structure.SETTINGS.items()}
FLAGS = tuple(name for name, text in SETTINGS.items() if text.startswith("whether"))
"""The settings that are true or false."""
COUNTS = ("delay_samples",)
"""The settings that are whole numbers."""

if (
    TYPE_CHECKING
):  # a type checker reads no fields from the tables, and the kernels need a namedtuple
    Regulator: TypeAlias = Any
    Memory: TypeAlias = Any
else:
    Regulator = namedtuple("Regulator", SETTINGS, module=__name__)
    """A gain schedule as the law reads it: `SETTINGS`."""
    Memory = namedtuple("Memory", MEMORY, module=__name__)
    """What the law remembers from sample to sample: `MEMORY`."""
AT_REST = Memory(*[0.0] * len(MEMORY))
"""Before the first sample."""


def regulate(reference, forward, measured, scheduled, memory, regulator):
    """The new memory after one sample.

    forward: the feed-forward. measured = (p_a, p_b, v, y). scheduled = (kp, ki, kd, wn). The
    memory's x is the command.
    """
    kp, ki, kd, wn = scheduled
    p_a, p_b, v, y = measured
    m = np.where(regulator.position, y, v)
    filtered = measurement_filter.step(m, memory, regulator)  # [{m}] the filtered measurement
    derivative, last = pid.differentiate(reference, m, filtered, memory, regulator)
    u = pid.combine(reference, filtered, derivative, kp, kd, memory, regulator)  # [1]
    w = np.tan(0.5 * wn * regulator.Ts)  # [1] the notch frequency, prewarped
    led_1, section_1 = lead_lag.step(u, w, memory.section_1, regulator.sections[0])
    led_2, section_2 = lead_lag.step(led_1, w, memory.section_2, regulator.sections[1])
    notched, notch_1, notch_2 = notch.step(led_2, w, memory, regulator)
    opening = notched + forward  # [1]
    ratio = compensation.step(opening, y, p_a, p_b, regulator)  # [1]
    wanted = ratio * opening  # [1]
    limited = clipping.within(wanted, -1.0, 1.0)  # [1]
    x = inverse.step(limited, regulator)  # [1] the command
    excess = (limited - wanted) / ratio  # [1] what the limit takes away
    error = reference - filtered  # [{m}]
    integral = pid.integrate(error, excess, ki, memory, regulator)  # [1]
    return Memory(
        integral=integral,
        derivative=derivative,
        last=last,
        section_1=section_1,
        section_2=section_2,
        notch_1=notch_1,
        notch_2=notch_2,
        filtered=filtered,
        x=x,
        running=1.0,
    )


def inputs_read(regulator):
    """Names of the inputs that the law reads, in the order of (reference, v_ref, measured)."""
    speed = () if regulator.position else ("v",)
    return ("reference", "v_ref", *(("p_a", "p_b") if regulator.compensated else ()), *speed, "y")


def is_sound(reference, v_ref, measured, regulator):
    """Whether every input that the law reads is finite."""
    p_a, p_b, v, y = measured
    speed = np.isfinite(v) | regulator.position
    pressures = (np.isfinite(p_a) & np.isfinite(p_b)) | (not regulator.compensated)
    return np.isfinite(reference) & np.isfinite(v_ref) & np.isfinite(y) & speed & pressures


def is_finite(memory):
    """Whether the command and every state are finite."""
    finite = True
    for value in memory:
        finite &= np.isfinite(value)
    return finite


def sample(reference, v_ref, measured, memory, regulator):
    """The whole law for one sample: lookup at (memory's x, y), then `regulate`. Returns the new
    memory, AT_REST after a fault.

    measured = (p_a, p_b, v, y); of the pressures only a compensation reads, of v only a velocity
    loop.
    """
    if not is_sound(reference, v_ref, measured, regulator):
        return AT_REST
    scheduled = gains.gains_at(memory.x, measured[3], regulator)
    forward = feed_forward.step(v_ref, regulator)  # [1]
    new = regulate(reference, forward, measured, scheduled, memory, regulator)
    return new if is_finite(new) else AT_REST


def start(start_x, reference, v_ref, measured, regulator):
    """The memory from which the next sample, with these inputs, gives the command start_x: a
    bumpless start, or change of schedule.

    start_x is clipped to [-1, 1]. Filters stand in their steady state. Without an integral nothing
    can hold the command: its memory is 0, and the command jumps to what the law asks for. With an
    input that is not finite the law starts from rest. A state that is not finite is left for the
    next sample to find.
    """
    if not (is_sound(reference, v_ref, measured, regulator) and np.isfinite(start_x)):
        return AT_REST
    x = clipping.within(start_x, -1.0, 1.0)  # [1] the command to start from
    scheduled = gains.gains_at(x, measured[3], regulator)
    forward = feed_forward.step(v_ref, regulator)  # [1]
    return held(x, reference, forward, measured, scheduled, regulator)


def held(x, reference, forward, measured, scheduled, regulator):
    """The memory of `start` for |x| <= 1, free of branches; the arguments are those of
    `regulate`."""
    kp, _, _, wn = scheduled
    p_a, p_b, v, y = measured
    m = np.where(regulator.position, y, v)
    limited = inverse.undone(x, regulator)  # [1] the command before the inverse of the dead band
    opening = limited / compensation.step(limited, y, p_a, p_b, regulator)  # [1]
    integral = pid.held(opening - forward, reference, m, kp, regulator)  # [1]
    u = pid.proportional(reference, m, kp, regulator) + integral  # [1] before the filters
    w = np.tan(0.5 * wn * regulator.Ts)  # [1] the notch frequency, prewarped
    settled = notch.rest(u, w, regulator)  # [1]
    return Memory(
        integral=integral,
        derivative=0.0,
        last=np.where(regulator.derives, pid.seen(reference, m, regulator), 0.0),
        section_1=lead_lag.rest(u, w, regulator.sections[0]),
        section_2=lead_lag.rest(u, w, regulator.sections[1]),
        notch_1=settled,
        notch_2=settled,
        filtered=m,
        x=x,
        running=1.0,
    )
