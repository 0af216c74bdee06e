"""Test vectors: inputs of the regulator law and what it answers, for readers of a schedule who do not run Python.

The inputs are made of a fixed low-discrepancy sequence, scaled to the schedule, in short runs: from rest; bumpless starts over
the whole range of x and y; a run in saturation; a broken sensor. Everything is rounded, so that the last bits of a computer's
tangent do not change the file.
"""

from __future__ import annotations

from dataclasses import replace
from math import isfinite, nan
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .digits import apart
from .errors import InputError
from .simulation import law
from .simulation.regulator import regulator_of

if TYPE_CHECKING:
    from .schedule import GainSchedule

TOLERANCE = 1e-9
"""by how much x may differ from a vector's, and a gain relatively"""
_RUN = 5
_STARTS = ((None, 0.35), (0.3, 0.1), (-0.4, 0.9), (0.05, 0.6), (-0.02, 0.25), (0.9, 1.1), (-0.95, -0.1), (0.004, 0.45))
"""(x of the bumpless start, part of the way along y) of each run; the first is from rest"""
_SATURATED_RUN, _BROKEN_SAMPLE = 3, 22
_GOLDEN = 0.6180339887498949


class Vector(NamedTuple):
    """One sample of the law. A sensor that gives no finite number is nan here and null in a file."""

    start: float | None
    """x at which the law is started just before this sample, with its inputs; None: it goes on (first sample: from rest)"""
    inputs: tuple[float, ...]
    """reference, v_ref, p_a, p_b, v, y"""
    gains: tuple[float, ...] | None
    """kp, ki, kd, notch frequency (0 where the law has no use for it); None where an input is not finite"""
    x: float


def vectors_of(schedule: GainSchedule) -> list[Vector]:
    """The vectors of `schedule`. Raises InputError where the law could not run on it."""
    regulator = law_of(schedule)
    memory, vectors = law.AT_REST, []
    for k, inputs in enumerate(_inputs(schedule, regulator)):
        start = _STARTS[k // _RUN][0] if k % _RUN == 0 else None
        vector, memory = answer(start, inputs, memory, regulator)
        vectors.append(vector)
    return vectors


def answer(start: float | None, inputs: tuple[float, ...], memory: law.Memory, regulator: law.Regulator):
    """(the vector of one sample from `memory`, the memory after it)."""
    reference, v_ref, *measured = inputs
    if start is not None:
        memory = law.start(start, reference, v_ref, tuple(measured), regulator)
    broken = not all(map(isfinite, inputs))
    gains = None if broken else tuple(map(_rounded, law.gains_at(memory.x, measured[3], regulator)))
    memory = law.sample(reference, v_ref, tuple(measured), memory, regulator)
    return Vector(start, inputs, gains, _rounded(memory.x)), memory


def law_of(schedule: GainSchedule) -> law.Regulator:
    """The law alone, without the loop's delay: that may be a fraction of a sample, which only a simulation cannot do."""
    return regulator_of(replace(schedule, specification=replace(schedule.specification, delay_samples=0.0)))


def require_answers(schedule: GainSchedule, vectors: list[Vector]) -> None:
    """InputError with the first vector that the law of `schedule` does not reproduce."""
    regulator, memory = law_of(schedule), law.AT_REST
    for k, given in enumerate(vectors):
        found, memory = answer(given.start, given.inputs, memory, regulator)
        same_gains = (found.gains is None) == (given.gains is None)
        if same_gains and found.gains is not None:
            same_gains = np.allclose(found.gains, given.gains, rtol=TOLERANCE, atol=0.0)
        if not same_gains or abs(found.x - given.x) > TOLERANCE:
            stated, answered = apart(given.x, found.x)
            raise InputError(
                f"test_vectors.{k} gives x = {stated} with gains {given.gains}, but this schedule's law gives "
                f"x = {answered} with gains {found.gains}; write the file anew with this hydroctl."
            )


def _inputs(schedule: GainSchedule, regulator: law.Regulator):
    loudest = schedule.kp + schedule.kd / (schedule.Tf + schedule.Ts)
    small = 0.1 / float(np.max(np.abs(loudest))) if np.any(loudest) else 1.0
    speed = 0.3 * min(schedule.speed_gain_extend, schedule.speed_gain_retract)
    supply = schedule.actuator.supply_pressure
    first, length = float(schedule.y[0]), float(schedule.y[-1] - schedule.y[0]) or 0.1
    for k in range(_RUN * len(_STARTS)):
        run, position = k // _RUN, first + length * _STARTS[k // _RUN][1]
        spread = [2.0 * (((k + 1) * _GOLDEN * m) % 1.0) - 1.0 for m in (1, 2, 3, 5, 7)]
        error = small * spread[0] * (40.0 if run == _SATURATED_RUN else 1.0)
        y = position + speed * schedule.Ts * spread[1]
        v = speed * (-1.0) ** run + small * spread[1]
        v_ref = speed * spread[2] if k % 3 else 0.0
        reference = (y if regulator.position else v) + error
        p_a, p_b = (supply * (0.5 + 0.3 * part) for part in spread[3:])
        *others, y = (float(f"{value:.6g}") for value in (reference, v_ref, p_a, p_b, v, y))
        yield *others, nan if k == _BROKEN_SAMPLE else y


def _rounded(value) -> float:
    return float(f"{float(value):.12g}")
