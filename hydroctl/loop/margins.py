"""Margins of a loop L = C G: every crossing, not the first one, each refined on the exact response.

r --->(+)--- e --> C --> x --> G --+--> m          S = 1/(1 + L)     Ms = max |S|
      -^                           |               T = L/(1 + L)     Mt = max |T|
       +---------------------------+
"""

from __future__ import annotations

import math
from dataclasses import dataclass, fields, replace
from typing import Literal

import numpy as np

from ..regulator.linear import series
from ..regulator.structures import Regulators
from .sampled_plant import LOWEST_FREQUENCY, SampledFamily, about_modes, frequency_grid, merged

MARGIN_UNITS: dict[str, Literal["1", "rad", "s", "rad/s"]] = {
    "Ms": "1",
    "Mt": "1",
    "gain_margin": "1",
    "gain_reduction_margin": "1",
    "phase_margin": "rad",
    "delay_margin": "s",
    "crossover": "rad/s",
}
"""the margins that reports and files state"""
WORST_AT_MOST = ("Ms", "Mt", "gain_reduction_margin")
"""the margins that are worst where they are largest"""
_AT_REST = 1e-5
"""of the lowest frequency of `frequency_grid`, below which a mode is an integrator"""
_BELOW = 10
"""frequencies for each decade below it"""
_DIRECT = 1e-8
"""of it, which stands for frequency 0"""
_INFINITE = 1e9
"""|L| from which its phase is that of integrators and rounding"""
_REAL = 1e-9
"""relative imaginary part up to which L at the end of the frequencies is real"""
_RIVALS = 3
"""how many of the largest peaks on the grid are refined"""
_SAME = 1e-9
"""relative distance from which two frequencies of a grid are two"""
_PEAK_WIDTH = 1e-5
"""relative frequency to which a peak is found; its height is then known to about the square"""


@dataclass(frozen=True, eq=False)
class Loop:
    """The loops of a plant family with its regulators, over their common shape (...)."""

    plant: SampledFamily
    regulators: Regulators

    @property
    def shape(self) -> tuple[int, ...]:
        """The common shape."""
        return self.plant.shape

    def frequency_response(self, omega) -> np.ndarray:
        """(..., n) complex L at omega in rad/s."""
        return self.plant.frequency_response(omega) * self.regulators.frequency_response(omega)

    def take(self, indices) -> Loop:
        """The loops at flat `indices`, along one axis."""
        return Loop(self.plant.take(indices), self.regulators.reshape(-1)[indices])

    def poles(self) -> np.ndarray:
        """(..., N) complex poles of the sampled closed loop; stable where all lie inside the unit
        circle."""
        A_plant, B_plant, C_plant = self.plant.state_space()
        A, B, C, _ = series(
            self.regulators.state_space(), (A_plant, B_plant, C_plant, np.zeros((1, 1)))
        )
        return np.linalg.eigvals(A - B @ C)


@dataclass(frozen=True, eq=False)
class Margins:
    """Margins over the shape (...) of the loops; frequencies in rad/s, phases in rad. A margin
    without its crossing is infinite."""

    Ms: np.ndarray
    """largest |S|"""
    Mt: np.ndarray
    """largest |T|"""
    Ms_frequency: np.ndarray
    """where |S| is largest"""
    Mt_frequency: np.ndarray
    """where |T| is largest"""
    disk_margin: np.ndarray
    """1 / max |S - 1/2|: gain may change by (2 - d)/(2 + d) ... (2 + d)/(2 - d), phase by 2
    atan(d/2), at once"""
    gain_margin: np.ndarray
    """smallest factor above 1 that brings L to -1"""
    gain_reduction_margin: np.ndarray
    """largest factor below 1 that brings L to -1, of a loop that is only conditionally stable; 0:
    none does"""
    phase_margin: np.ndarray
    """smallest phase, of either sign, that brings L to -1"""
    delay_margin: np.ndarray
    """smallest further delay that brings L to -1, in s"""
    crossover: np.ndarray
    """highest frequency with |L| = 1; 0 where |L| stays below 1"""
    stable: np.ndarray
    """True where all poles of the sampled closed loop lie inside the unit circle"""
    gain_crossings: Crossings
    phase_crossings: Crossings


@dataclass(frozen=True, eq=False)
class Crossings:
    """All crossings of all loops, one row each."""

    index: np.ndarray
    """flat index of the loop"""
    omega: np.ndarray
    """rad/s"""
    response: np.ndarray
    """L there"""

    def select(self, wanted) -> Crossings:
        """Those whose response fulfils `wanted`."""
        keep = wanted(self.response)
        return Crossings(self.index[keep], self.omega[keep], self.response[keep])

    def phase_margins(self) -> np.ndarray:
        """The phase of -L in (-pi, pi]: what each gain crossing is away from -1."""
        return np.angle(-self.response)


def analyse(loop, omega=None) -> Margins:
    """Margins of every loop in `loop`: anything with `shape`, `frequency_response`, `take` and
    `poles` of `Loop`.

    `omega` (..., n) in rad/s must be dense enough to hold every crossing and resonance; by default
    `loop_grid`.
    """
    flat = _flat(loop)
    poles = flat.poles()
    omega = loop_grid(flat, poles) if omega is None else _rows(loop, omega)
    L = flat.frequency_response(omega)
    gains = _crossings(flat, omega, L, lambda value: np.abs(value) - 1.0)
    phases = _phase_crossings(flat, omega, L)
    found = _from_crossings(omega.shape[0], gains, phases)
    for name, function in (("Ms", _sensitivity), ("Mt", _complementary)):
        found[name], found[f"{name}_frequency"] = _peak(flat, omega, L, function)
        for crossings in (gains, phases):
            _raise_to(found[name], found[f"{name}_frequency"], crossings, function)
    found["disk_margin"] = (
        1.0 / _peak(flat, omega, L, lambda value: np.abs(1.0 / (1.0 + value) - 0.5))[0]
    )
    found["stable"] = np.abs(poles).max(axis=-1) < 1.0
    shaped = {name: values.reshape(loop.shape) for name, values in found.items()}
    return Margins(**shaped, gain_crossings=gains, phase_crossings=phases)


def _from_crossings(size: int, gains: Crossings, phases: Crossings) -> dict[str, np.ndarray]:
    """The margins (size,) that crossings define, by name."""
    factor, phase = 1.0 / np.abs(phases.response), gains.phase_margins()
    up, down = factor > 1.0, factor < 1.0
    lag = np.mod(phase, 2.0 * np.pi)
    return {
        "gain_margin": _least(size, phases.index[up], factor[up]),
        "gain_reduction_margin": np.maximum(-_least(size, phases.index[down], -factor[down]), 0.0),
        "phase_margin": _least(size, gains.index, np.abs(phase)),
        "delay_margin": _least(size, gains.index, lag / gains.omega),
        "crossover": np.maximum(-_least(size, gains.index, -gains.omega), 0.0),
    }


def _raise_to(peak, where, crossings: Crossings, function) -> None:
    """Raise the peaks, and move them, to those crossings at which `function` is larger: no margin
    may contradict another."""
    value = function(crossings.response)
    higher = np.nonzero(value > peak[crossings.index])[0]
    rising = higher[np.argsort(value[higher])]
    index = crossings.index[rising]
    peak[index], where[index] = value[rising], crossings.omega[rising]


def peaks(loop, functions, *, omega=None, floor: float = -np.inf):
    """(values, omega), each (..., f): the largest value over frequency of each of f functions of L,
    and where in rad/s.

    `omega` as in `analyse`. A peak whose value on that grid is below `floor` is taken from the
    grid.
    """
    flat = _flat(loop)
    omega = loop_grid(flat, flat.poles()) if omega is None else _rows(loop, omega)
    L = flat.frequency_response(omega)
    found = zip(*(_peak(flat, omega, L, function, floor) for function in functions), strict=True)
    return tuple(np.stack(parts, axis=-1).reshape(*loop.shape, -1) for parts in found)


def loop_grid(loop, poles: np.ndarray) -> np.ndarray:
    """(..., n) rad/s, ascending: those of `frequency_grid`, with those about the closed loop's own
    modes and down to a tenth of the slowest mode, open or closed; `poles` (..., m) are
    `loop.poles()`."""
    omega, Ts = frequency_grid(loop.plant), loop.plant.sample_time
    lowest = np.full((*poles.shape[:-1], 1), LOWEST_FREQUENCY * np.pi / Ts)
    modes = np.concatenate([loop.plant.eigenvalues, poles], axis=-1)
    speed = np.abs(np.log(np.where(modes == 0.0, 1.0, modes).astype(complex))) / Ts
    slowest = np.where(speed > _AT_REST * lowest, speed, np.inf).min(axis=-1, keepdims=True)
    depth = np.log10(np.maximum(lowest / (0.1 * slowest), 1.0))
    shares = np.linspace(0.0, 1.0, 1 + math.ceil(_BELOW * depth.max(initial=0.0)))
    return merged(
        omega, about_modes(poles, Ts), lowest * 10.0 ** (-depth * shares), _DIRECT * lowest
    )


def _flat(loop):
    """The loops along one axis."""
    return loop.take(np.arange(math.prod(loop.shape)))


def _rows(loop, omega) -> np.ndarray:
    """A row of the frequencies `omega` for each of the loops along one axis."""
    return np.broadcast_to(omega, (*loop.shape, np.shape(omega)[-1])).reshape(
        -1, np.shape(omega)[-1]
    )


def _sensitivity(L):
    return 1.0 / np.abs(1.0 + L)


def _complementary(L):
    return np.abs(L / (1.0 + L))


def _least(size: int, index, values) -> np.ndarray:
    least = np.full(size, np.inf)
    np.minimum.at(least, index, values)
    return least


def _crossings(loop, omega, L, function) -> Crossings:
    """All roots of function(L) that change its sign on the grid `omega`.

    Where one of its frequencies is a root to within rounding, the sign there may not be found
    again: it is that one.
    """
    from scipy.optimize import elementwise

    sign = np.signbit(function(L))
    row, column = np.nonzero(sign[:, :-1] != sign[:, 1:])
    if row.size == 0:
        return Crossings(row, np.zeros(0), np.zeros(0, complex))

    def at(frequency, index):
        return loop.take(index.astype(int)).frequency_response(frequency[:, None])[:, 0]

    low, high = omega[row, column], omega[row, column + 1]
    found = elementwise.find_root(
        lambda w, index: function(at(w, index)), (low, high), args=(row.astype(float),)
    )
    at_low, at_high = (np.abs(function(L[row, k])) for k in (column, column + 1))
    root = np.where(np.isfinite(found.x), found.x, np.where(at_low <= at_high, low, high))
    return Crossings(row, root, at(root, row))


def _phase_crossings(loop, omega, L) -> Crossings:
    """Where L crosses the negative real axis, the Nyquist frequency included, at which every
    sampled L is real."""
    inside = _crossings(loop, omega[:, :-1], L[:, :-1], np.imag)
    last = L[:, -1]
    row = np.nonzero(np.abs(last.imag) <= _REAL * np.abs(last))[0]
    others = np.setdiff1d(np.arange(len(last)), row)
    beyond = _crossings(loop.take(others), omega[others, -2:], L[others, -2:], np.imag)
    parts = (
        inside,
        Crossings(row, omega[row, -1], last[row]),
        replace(beyond, index=others[beyond.index]),
    )
    joined = (np.concatenate([getattr(part, f.name) for part in parts]) for f in fields(Crossings))
    return Crossings(*joined).select(
        lambda response: (response.real < 0.0) & (np.abs(response) < _INFINITE)
    )


def _peak(loop, omega, L, function, floor=-np.inf):
    """(maximum of function(L) over frequency, where): the largest grid values that top their
    neighbours, each refined between these; those not above `floor` are taken from the grid."""
    from scipy.optimize import elementwise

    values = function(L)
    every = np.arange(len(values))
    top = np.argmax(values, axis=-1)
    peak, where = values[every, top], omega[every, top]
    inner = values[:, 1:-1]
    height = np.where(
        (inner >= values[:, :-2]) & (inner > values[:, 2:]) & (inner > floor), inner, -np.inf
    )
    rank = np.argpartition(-height, _RIVALS - 1, axis=-1)[:, :_RIVALS]
    row, rival = np.nonzero(np.take_along_axis(height, rank, axis=-1) > -np.inf)
    if row.size:
        some, centre = loop.take(row), omega[row, rank[row, rival] + 1]
        below = np.where(
            omega[row] < (1.0 - _SAME) * centre[:, None], omega[row], omega[row, :1]
        ).max(axis=1)
        above = np.where(
            omega[row] > (1.0 + _SAME) * centre[:, None], omega[row], omega[row, -1:]
        ).min(axis=1)

        def negative(w, index):
            return -function(some.take(index.astype(int)).frequency_response(w[:, None])[:, 0])

        local = np.arange(row.size, dtype=float)
        found = elementwise.find_minimum(
            negative, (below, centre, above), args=(local,), tolerances={"xrtol": _PEAK_WIDTH}
        )
        order = np.argsort(-found.f_x)
        better = order[-found.f_x[order] > peak[row[order]]]
        peak[row[better]], where[row[better]] = -found.f_x[better], found.x[better]
    return peak, where
