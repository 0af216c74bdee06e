"""Test vectors: inputs of the regulator law and what it answers, for readers of a schedule who do
not run Python.

They come in short runs. The first ones follow a fixed low-discrepancy sequence, scaled to the
schedule: from rest; bumpless starts over the whole range of x and y; a run in saturation; a broken
sensor. Then the tables are touched, four nodes at a time, or one where they differ much: a start
there, with an error that the integral adds up and, a sample later, a step of the measurement that
every gain answers. Inputs are numbers of single precision, so that a port in float reads what a
port in double reads. Answers are rounded, so that the last bits of a computer's tangent do not
change the file.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import product
from math import inf, isfinite, nan
from typing import NamedTuple

import numpy as np

from ..digits import apart
from ..errors import InputError
from . import law
from .gains import gains_at
from .prepared import regulator_of
from .scheduled import ScheduledRegulator

TOLERANCE = 1e-9
"""by how much x may differ from a vector's, and a gain relatively"""
_RUN = 5
_STARTS = (
    (None, 0.35),
    (0.3, 0.1),
    (-0.4, 0.9),
    (0.05, 0.6),
    (-0.02, 0.25),
    (0.9, 1.1),
    (-0.95, -0.1),
    (0.004, 0.45),
)
"""(x of the bumpless start, part of the way along y) of each run; the first is from rest"""
_SATURATED_RUN, _BROKEN_SAMPLE = 3, 22
_GOLDEN = 0.6180339887498949
_CHANGE, _GAINED, _MOST_HELD = 0.2, 0.05, 0.5
"""of x: by how much a touch of the tables changes it, by how much the integral does so in a sample,
the most that kp adds to it"""
_MOST_START = 0.98
_UNREAD_PRESSURE = 1e7
"""Pa; about it lie the pressures of a schedule without compensation, whose law must not read
them"""
_MUCH = 4.0
"""the ratio of gains at the corners of a cell from which on its middle does not show them all"""


class Vector(NamedTuple):
    """One sample of the law. A sensor that gives no finite number is nan here and null in a
    file."""

    start: float | None
    """x at which the law is started just before this sample, with its inputs; None: it goes on
    (first sample: from rest)"""
    inputs: tuple[float, ...]
    """reference, v_ref, p_a, p_b, v, y"""
    gains: tuple[float, ...] | None
    """kp, ki, kd, notch frequency (0 where the law has no use for it); None where an input is not
    finite"""
    x: float


def vectors_of(scheduled: ScheduledRegulator) -> list[Vector]:
    """The vectors of `scheduled`. Raises InputError where the law could not run on it."""
    regulator = law_of(scheduled)
    memory, vectors = law.AT_REST, []
    for run in (*_general_runs(scheduled, regulator), *_table_runs(scheduled, regulator)):
        for k, inputs in enumerate(run.inputs):
            vector, memory = answer(run.start if k == 0 else None, inputs, memory, regulator)
            vectors.append(vector)
    return vectors


def answer(
    start: float | None, inputs: tuple[float, ...], memory: law.Memory, regulator: law.Regulator
):
    """(the vector of one sample from `memory`, the memory after it)."""
    reference, v_ref, *measured = inputs
    if start is not None:
        memory = law.start(start, reference, v_ref, tuple(measured), regulator)
    broken = not all(map(isfinite, inputs))
    gains = None if broken else tuple(map(_rounded, gains_at(memory.x, measured[3], regulator)))
    memory = law.sample(reference, v_ref, tuple(measured), memory, regulator)
    return Vector(start, inputs, gains, _rounded(memory.x)), memory


def law_of(scheduled: ScheduledRegulator) -> law.Regulator:
    """The law alone, without the loop's delay: that may be a fraction of a sample, which only a
    simulation cannot do."""
    return regulator_of(replace(scheduled, delay_samples=0.0))


def require_answers(scheduled: ScheduledRegulator, vectors: list[Vector]) -> None:
    """InputError with the first vector that the law of `scheduled` does not reproduce."""
    regulator, memory = law_of(scheduled), law.AT_REST
    for k, given in enumerate(vectors):
        found, memory = answer(given.start, given.inputs, memory, regulator)
        same_gains = found.gains is None and given.gains is None
        if found.gains is not None and given.gains is not None:
            same_gains = np.allclose(found.gains, given.gains, rtol=TOLERANCE, atol=0.0)
        if not same_gains or abs(found.x - given.x) > TOLERANCE:
            stated, answered = apart(given.x, found.x)
            raise InputError(
                f"test_vectors.{k} gives x = {stated} with gains {given.gains}, but this schedule's"
                f" law gives x = {answered} with gains {found.gains}; write the file anew with this"
                " hydroctl."
            )


class _Run(NamedTuple):
    start: float | None
    inputs: list[tuple[float, ...]]


def _general_runs(scheduled: ScheduledRegulator, regulator: law.Regulator):
    loudest = scheduled.kp + scheduled.kd / (scheduled.Tf + scheduled.Ts)
    small = 0.1 / float(np.max(np.abs(loudest))) if np.any(loudest) else 1.0
    speed = _speed(scheduled)
    supply = regulator.compensation.supply_pressure if regulator.compensated else _UNREAD_PRESSURE
    first, length = float(scheduled.y[0]), float(scheduled.y[-1] - scheduled.y[0]) or 0.1
    for run, (start, part_of_y) in enumerate(_STARTS):
        rows, position = [], first + length * part_of_y
        for k in range(run * _RUN, (run + 1) * _RUN):
            spread = [2.0 * (((k + 1) * _GOLDEN * m) % 1.0) - 1.0 for m in (1, 2, 3, 5, 7)]
            error = small * spread[0] * (40.0 if run == _SATURATED_RUN else 1.0)
            y = position + speed * scheduled.Ts * spread[1]
            v = speed * (-1.0) ** run + small * spread[1]
            v_ref = speed * spread[2] if k % 3 else 0.0
            reference = (y if regulator.position else v) + error
            p_a, p_b = (supply * (0.5 + 0.3 * part) for part in spread[3:])
            rows.append((reference, v_ref, p_a, p_b, v, nan if k == _BROKEN_SAMPLE else y))
        yield _single(start, rows)


def _table_runs(scheduled: ScheduledRegulator, regulator: law.Regulator):
    """Each touches one or four nodes of every table."""
    loudest = np.abs(scheduled.regulators.state_space()[3]).max()
    for x, y in _touched(regulator):
        kp, ki, *_ = (abs(float(gain)) for gain in gains_at(x, y, regulator))
        direct = np.abs(scheduled.gains(x, y).state_space()[3]).item()
        step = _CHANGE / max(direct, _CHANGE * loudest) if loudest else 0.0
        inward = -1.0 if x > 0.0 else 1.0
        if regulator.integrates:
            error = inward * min(
                _GAINED / (scheduled.Ts * ki) if ki else inf, _MOST_HELD / kp if kp else inf
            )
        else:
            error = x / kp if kp else 0.0
        yield _single(x, _touch(scheduled, regulator, x, y, error, inward * step))


def _touched(regulator: law.Regulator):
    """(x, y) that touch all nodes: middles of cells, and the nodes themselves of a cell whose gains
    differ much.

    Commands stay inside the limits, where a rounding could hide.
    """
    negative = regulator.x < 0.0
    rows = [
        pair
        for side in (np.flatnonzero(negative), np.flatnonzero(~negative))
        for pair in _pairs(side)
    ]
    for i in rows:
        for j in _pairs(np.arange(regulator.y.size)):
            gains = np.abs(regulator.table[np.ix_(i, j)]).reshape(-1, 4)
            differ = (gains.max(axis=0) > _MUCH * gains.min(axis=0)).any()
            x, y = (
                (regulator.x[i], regulator.y[j])
                if differ
                else (regulator.x[i].mean(), regulator.y[j].mean())
            )
            for opening, position in product(
                np.clip(np.atleast_1d(x), -_MOST_START, _MOST_START), np.atleast_1d(y)
            ):
                yield float(opening), float(position)


def _pairs(places: np.ndarray) -> list[np.ndarray]:
    """Neighbours that together are all places; a single place alone, and the last but one twice
    where their number is odd."""
    if places.size % 2 and places.size > 1:
        return [*_pairs(places[:-1]), places[-2:]]
    return [places[k : k + 2] for k in range(0, places.size, 2)]


def _touch(
    scheduled: ScheduledRegulator,
    regulator: law.Regulator,
    x: float,
    y: float,
    error: float,
    step: float,
):
    """Three samples: a start with `error`, the measurement falls by `step`, it rises by half of
    that."""
    p_a, p_b = _design_pressures(x, regulator) if regulator.compensated else (_UNREAD_PRESSURE,) * 2
    v = x * _speed(scheduled)
    reference = (y if regulator.position else v) + error
    for fallen in (0.0, step, 0.5 * step):
        moved = (v, y - fallen) if regulator.position else (v - fallen, y)
        yield (reference, 0.0, p_a, p_b, *moved)


def _design_pressures(x: float, regulator: law.Regulator) -> tuple[float, float]:
    """(p_a, p_b) at which the design's pressure drops stand over the edges that x opens."""
    k = regulator.compensation
    if x > 0.0:
        return k.supply_pressure - k.extend_drop_a, k.tank_pressure + k.extend_drop_b
    return k.tank_pressure + k.retract_drop_a, k.supply_pressure - k.retract_drop_b


def _speed(scheduled: ScheduledRegulator) -> float:
    return 0.3 * min(scheduled.speed_gain_extend, scheduled.speed_gain_retract)


def _single(start: float | None, rows) -> _Run:
    """A run of numbers of single precision."""
    exact = [tuple(float(np.float32(value)) for value in row) for row in rows]
    return _Run(None if start is None else float(np.float32(start)), exact)


def _rounded(value) -> float:
    return float(f"{float(value):.12g}")
