"""By how much the law in single precision may differ from that in double.

The law itself runs here on numbers that carry, beside their value, the effect on it of every
rounding so far, to first order: of the constants and tables as written, of the inputs, of each
operation. What the roundings of a sample do to the memory is then followed through later samples by
the law's own derivatives. Each rounding counts as the largest possible and all as of the worst
signs: what is seen is commonly a hundredth of that.
"""

from __future__ import annotations

from types import FunctionType, SimpleNamespace
from typing import NamedTuple

import numpy as np

from ..regulator import feed_forward, gains, law
from ..regulator.vectors import Vector
from .contents import Contents

UNIT = 2.0**-24
"""the largest relative error of a number that is rounded to single precision"""
_STATES = law.Memory._fields[:-1]
_X = _STATES.index("x")
_ROUNDINGS = 400
"""room for the roundings of one sample"""
_INSIDE = 0.999
"""of the node's command: where the law is tried, because beyond the limits no rounding shows"""
_SETTLED = 1e-4
_SLOPES = {
    np.add: lambda a, b, result: (1.0, 1.0),
    np.subtract: lambda a, b, result: (1.0, -1.0),
    np.multiply: lambda a, b, result: (b, a),
    np.divide: lambda a, b, result: (1.0 / b, -result / b),
    np.negative: lambda a, result: (-1.0,),
    np.sqrt: lambda a, result: (0.5 / result,),
    np.tan: lambda a, result: (1.0 + result * result,),
}
SAMPLES = 10_000
"""for which a file states the difference"""
_TANGENT = 2.0
"""error of a tangent, in those of a rounding"""


class _Roundings:
    """The roundings of one sample at n points, counted. Rows of effects: those of the memory, then
    those of the roundings."""

    def __init__(self, points: int):
        self.shape, self.count = (len(_STATES) + _ROUNDINGS, points), len(_STATES)

    def rounded(self, value, error=None, effects=0.0) -> _Number:
        """A number with one more rounding, by at most `error` (default: that of single
        precision)."""
        value, effects = np.broadcast_to(value, self.shape[1:]), effects + np.zeros(self.shape)
        effects[self.count] += UNIT * np.abs(value) if error is None else error
        self.count += 1
        return _Number(value, effects, self)

    def remembered(self, memory: law.Memory) -> law.Memory:
        """The memory as numbers, each with its own effect alone."""
        numbers = []
        for place, value in enumerate(memory[:-1]):
            effects = np.zeros(self.shape)
            effects[place] = 1.0
            numbers.append(_Number(np.broadcast_to(value, self.shape[1:]), effects, self))
        return law.Memory(*numbers, memory.running)

    def written(self, value):
        """Constants as they stand in an exported file."""
        if isinstance(value, tuple):
            parts = map(self.written, value)
            return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
        is_exact = not isinstance(value, float) or value == np.float32(value)
        return value if is_exact else self.rounded(value)


class _Number(np.lib.mixins.NDArrayOperatorsMixin):
    """Values (n,) with the effects on them."""

    def __init__(self, value: np.ndarray, effects: np.ndarray, roundings: _Roundings):
        self.value, self.effects, self.roundings = value, effects, roundings

    def __array_ufunc__(self, ufunc, method, *inputs):
        values = [_value(given) for given in inputs]
        result = ufunc(*values)
        if ufunc not in _SLOPES:
            return result
        pairs = zip(_SLOPES[ufunc](*values, result), inputs, strict=True)
        effects = sum(slope * given.effects for slope, given in pairs if isinstance(given, _Number))
        if _is_exact(ufunc, inputs):
            return _Number(result, effects, self.roundings)
        error = (_TANGENT if ufunc is np.tan else 1.0) * UNIT * np.abs(result)
        return self.roundings.rounded(result, error, effects)

    def __array_function__(self, function, types, arguments, keywords):
        if function is not np.where:
            return NotImplemented
        condition, *choices = arguments
        value = np.where(condition, *map(_value, choices))
        return _Number(value, np.where(condition, *map(_effects, choices)), self.roundings)


def _value(number):
    return number.value if isinstance(number, _Number) else number


def _effects(number):
    return number.effects if isinstance(number, _Number) else 0.0


def _is_exact(ufunc, inputs) -> bool:
    """Whether nothing is rounded: a change of sign; a product with 0 or a power of two; a sum with
    0."""
    if ufunc is np.negative:
        return True
    plain = [given for given in inputs if not isinstance(given, _Number)]
    if ufunc is np.multiply:
        return any((np.abs(np.frexp(value)[0]) % 0.5 == 0.0).all() for value in plain)
    return ufunc in (np.add, np.subtract) and any(
        (np.asarray(value) == 0.0).all() for value in plain
    )


class Sample(NamedTuple):
    """A new memory, values (n,), and what the memory before it (n, 9, 9) and each rounding (n, 9,
    roundings) does to it."""

    memory: law.Memory
    by_memory: np.ndarray
    by_rounding: np.ndarray


def statement(contents: Contents) -> list[str]:
    """What the exported file says of it, in lines."""
    one, many = (_rounded_up(stated_bound(contents, samples)) for samples in (1, SAMPLES))
    return [
        (
            f"Single precision differs from double by at most {one} of full scale through the"
            " roundings"
        ),
        (
            f"of one sample, and {many} through those of {SAMPLES} without a start, all at their"
            " worst;"
        ),
        (
            "commonly by a hundredth of that. The inputs' own rounding, 6e-8 of their size, counts"
            " once:"
        ),
        "it acts like an error of the sensors.",
    ]


def stated_bound(contents: Contents, samples: int) -> float:
    """`bound` for references and measurements of the size of the stroke, or of the speed at full
    opening."""
    s, regulator = contents.schedule, contents.regulator
    extent = s.travel if regulator.position else max(s.speed_gain_extend, s.speed_gain_retract)
    return bound(regulator, samples, extent)


def _rounded_up(value: float) -> str:
    """Two digits, not below `value`."""
    exponent = np.floor(np.log10(value)) - 1.0
    return f"{np.ceil(value / 10.0**exponent) * 10.0**exponent:.1e}"


def bound(regulator: law.Regulator, samples: int, extent: float) -> float:
    """The largest difference of x after so many samples, at any node of the tables.

    It adds up what each sample does to a steady motion with the command of the node, when its
    roundings are those with the proportional part as large as the command, and against it. The
    reference and what is measured, in units of the loop, are at most of the size `extent`
    (position: y is the node's). The inputs' own rounding counts once: it acts like an error of the
    sensors.
    """
    x, y = (
        nodes.ravel() for nodes in np.meshgrid(_INSIDE * regulator.x, regulator.y, indexing="ij")
    )
    kp = gains.gains_at(x, y, regulator)[0]
    error = np.clip(-x / np.where(kp == 0.0, np.inf, kp), -extent, extent)
    measured = y if regulator.position else np.full(x.shape, extent)

    def sample(error, input_error):
        inputs = (
            measured + error,
            np.zeros(x.shape),
            *_design_pressures(x, regulator),
            measured,
            y,
        )
        return linear_sample(
            _started(x, inputs, regulator).memory, inputs, regulator, np.full(x.shape, input_error)
        )

    exact = sample(error, 0.0).by_rounding
    by_inputs = np.abs(sample(error, UNIT).by_rounding - exact)[:, _X].sum(axis=1)
    return float((_accumulated(sample(0.0, 0.0).by_memory, exact, samples) + by_inputs).max())


def tolerances(regulator: law.Regulator, vectors: list[Vector]) -> list[float]:
    """The largest difference of x from that of each vector, whose inputs are exact."""
    nothing = np.zeros((len(_STATES), 0))
    found, memory, effects = [], law.AT_REST, nothing
    for vector in vectors:
        inputs = tuple(np.array([value]) for value in vector.inputs)
        if vector.gains is None:
            memory, effects = law.AT_REST, nothing
        else:
            if vector.start is not None:
                started = _started(np.array([vector.start]), inputs, regulator)
                memory, effects = started.memory, started.by_rounding[0]
            one = linear_sample(memory, inputs, regulator, np.zeros(1))
            memory, effects = (
                one.memory,
                np.concatenate([one.by_memory[0] @ effects, one.by_rounding[0]], axis=1),
            )
        found.append(float(np.abs(effects[_X]).sum()) + UNIT)
    return found


def gain_tolerances(regulator: law.Regulator, vectors: list[Vector]) -> list[tuple[float, ...]]:
    """The largest differences of kp, ki, kd and wn that are looked up where a vector starts; 0 for
    the others."""
    found = []
    for vector in vectors:
        looked_up = (
            ()
            if vector.start is None
            else _look_up(np.array([vector.start]), np.array([vector.inputs[-1]]), regulator)
        )
        found.append(tuple(float(gain.error[0]) for gain in looked_up) or (0.0,) * 4)
    return found


def _accumulated(by_memory: np.ndarray, by_rounding: np.ndarray, samples: int) -> np.ndarray:
    """(n,) what the roundings of so many samples add up to in x."""
    weights = np.zeros((len(by_memory), 1, len(_STATES)))
    weights[..., _X] = 1.0
    total = np.zeros(len(by_memory))
    for k in range(samples):
        share = np.abs(weights @ by_rounding).sum(axis=(1, 2))
        total = total + share
        before, weights = weights, weights @ by_memory
        if (np.abs(weights - before) <= _SETTLED * np.abs(before).max()).all():
            return total + (samples - k - 1) * share
    return total


def _started(x: np.ndarray, inputs, regulator: law.Regulator) -> Sample:
    """A start at the commands x; nothing before it matters."""
    roundings = _Roundings(x.size)
    reference, v_ref, *measured = inputs
    written = roundings.written(regulator)
    scheduled = [
        roundings.rounded(found.value, found.error)
        for found in _look_up(x, measured[-1], regulator)
    ]
    command = _Number(x, np.zeros(roundings.shape), roundings)
    forward = feed_forward.step(v_ref, written)
    new = law.held(command, reference, forward, measured, scheduled, written)
    return _followed(new, roundings)


def linear_sample(
    memory: law.Memory, inputs, regulator: law.Regulator, input_error: np.ndarray
) -> Sample:
    """A sample of the law at n points; all arrays are (n,). `input_error`: the relative error of
    the inputs."""
    roundings = _Roundings(input_error.size)
    written, remembered = roundings.written(regulator), roundings.remembered(memory)
    reference, v_ref, *measured = (
        roundings.rounded(value, input_error * np.abs(value)) for value in inputs
    )
    scheduled = []
    for found in _look_up(remembered.x.value, measured[-1].value, regulator):
        effects = found.by_x * remembered.x.effects + found.by_y * measured[-1].effects
        scheduled.append(roundings.rounded(found.value, found.error, effects))
    forward = feed_forward.step(v_ref, written)
    return _followed(
        _regulate(regulator)(reference, forward, measured, scheduled, remembered, written),
        roundings,
    )


def _regulate(regulator: law.Regulator):
    """`law.regulate` without the effects that exported code leaves out."""
    absent = {
        structure.__name__.rpartition(".")[2]: SimpleNamespace(step=structure.absent_step)
        for structure in law.STRUCTURES
        if hasattr(structure, "absent_step") and not structure.is_used(regulator)
    }
    return FunctionType(law.regulate.__code__, vars(law) | absent)


def _followed(new: law.Memory, roundings: _Roundings) -> Sample:
    effects = np.stack(
        [np.broadcast_to(_effects(value), roundings.shape) for value in new[:-1]]
    ).transpose(2, 0, 1)
    values = law.Memory(
        *(np.broadcast_to(_value(value), roundings.shape[1:]) for value in new[:-1]), new.running
    )
    return Sample(
        values, effects[..., : len(_STATES)], effects[..., len(_STATES) : roundings.count]
    )


class _LookedUp(NamedTuple):
    value: np.ndarray
    error: np.ndarray
    by_x: np.ndarray
    by_y: np.ndarray


def _look_up(x: np.ndarray, y: np.ndarray, regulator: law.Regulator) -> list[_LookedUp]:
    """The four gains (n,) at x and y, the largest errors of their lookup, and their slopes.

    Rounded are the four entries, three operations along y twice and three along x, and the expected
    gain; the place in the cell, by its first node, the distance from that and its width.
    """
    x_c, y_c = gains.clipped_opening(x, regulator), gains.clipped_position(y, regulator)
    i, j = gains.interval(regulator.x, x_c), gains.interval(regulator.y, y_c)
    x_slope, y_slope = regulator.x_slope[i], regulator.y_slope[j]
    along_x, along_y = (x_c - regulator.x[i]) * x_slope, (y_c - regulator.y[j]) * y_slope
    x_error = UNIT * (np.abs(regulator.x[i]) * x_slope + 3.0)
    y_error = UNIT * (np.abs(regulator.y[j]) * y_slope + 3.0)
    found = []
    for column in range(4):
        a, b, c, d = gains.corners(regulator.table, i, j, column)
        by_x, by_y = c - a + along_y * (d - c - b + a), b - a + along_x * (d - c - b + a)
        largest = np.max(np.abs([a, b, c, d]), axis=0)
        error = 9.0 * UNIT * largest + x_error * np.abs(by_x) + y_error * np.abs(by_y)
        value = gains.bilinear((a, b, c, d), along_x, along_y)
        found.append(
            _LookedUp(
                value,
                error,
                np.where(x == x_c, by_x * x_slope, 0.0),
                np.where(y == y_c, by_y * y_slope, 0.0),
            )
        )
    return found


def _design_pressures(x: np.ndarray, regulator: law.Regulator) -> tuple[np.ndarray, np.ndarray]:
    """(p_a, p_b) at which the design's pressure drops stand over the edges that x opens."""
    k, extends = regulator.compensation, x > 0.0
    p_a = np.where(extends, k.supply_pressure - k.extend_drop_a, k.tank_pressure + k.retract_drop_a)
    return p_a, np.where(
        extends, k.tank_pressure + k.extend_drop_b, k.supply_pressure - k.retract_drop_b
    )
