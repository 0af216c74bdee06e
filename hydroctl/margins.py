"""Margins of a loop L = C G: every crossing, not the first one, each refined on the exact response.

r --->(+)--- e --> C --> x --> G --+--> m          S = 1/(1 + L)     Ms = max |S|
      -^                           |               T = L/(1 + L)     Mt = max |T|
       +---------------------------+
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from .frequency import SampledFamily, frequency_grid
from .regulators import Regulators, series

MARGIN_UNITS = {"Ms": "1", "Mt": "1", "gain_margin": "1", "phase_margin": "rad", "delay_margin": "s", "crossover": "rad/s"}
"""the margins that reports and files state"""
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
        """(..., N) complex poles of the sampled closed loop; stable where all lie inside the unit circle."""
        A_plant, B_plant, C_plant = self.plant.state_space()
        A, B, C, _ = series(self.regulators.state_space(), (A_plant, B_plant, C_plant, np.zeros((1, 1))))
        return np.linalg.eigvals(A - B @ C)


@dataclass(frozen=True, eq=False)
class Margins:
    """Margins over the shape (...) of the loops; frequencies in rad/s, phases in rad. A margin without its crossing is infinite."""

    Ms: np.ndarray
    """largest |S|"""
    Mt: np.ndarray
    """largest |T|"""
    Ms_frequency: np.ndarray
    """where |S| is largest"""
    Mt_frequency: np.ndarray
    """where |T| is largest"""
    disk_margin: np.ndarray
    """1 / max |S - 1/2|: gain may change by (2 - d)/(2 + d) ... (2 + d)/(2 - d), phase by 2 atan(d/2), at once"""
    gain_margin: np.ndarray
    """smallest factor above 1 that brings L to -1"""
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
    """Margins of every loop in `loop`: anything with `shape`, `frequency_response`, `take` and `poles` of `Loop`.

    `omega` (..., n) in rad/s must be dense enough to hold every crossing and resonance; by default `frequency_grid`.
    """
    flat, omega = _flat(loop, omega)
    L = flat.frequency_response(omega)
    gains = _crossings(flat, omega, L, lambda value: np.abs(value) - 1.0)
    phases = _crossings(flat, omega, L, np.imag).select(lambda response: response.real < 0.0)
    size = omega.shape[0]
    factor = 1.0 / np.abs(phases.response)
    phase = gains.phase_margins()
    lag = np.mod(phase, 2.0 * np.pi)
    worst = {
        "gain_margin": _least(size, phases.index[factor > 1.0], factor[factor > 1.0]),
        "phase_margin": _least(size, gains.index, np.abs(phase)),
        "delay_margin": _least(size, gains.index, lag / gains.omega),
        "crossover": np.maximum(-_least(size, gains.index, -gains.omega), 0.0),
    }
    (Ms, Ms_frequency), (Mt, Mt_frequency) = (_peak(flat, omega, L, function) for function in (_sensitivity, _complementary))
    disk, _ = _peak(flat, omega, L, lambda value: np.abs(1.0 / (1.0 + value) - 0.5))
    peaks = {"Ms": Ms, "Ms_frequency": Ms_frequency, "Mt": Mt, "Mt_frequency": Mt_frequency, "disk_margin": 1.0 / disk}
    stable = np.abs(flat.poles()).max(axis=-1) < 1.0
    shaped = {name: values.reshape(loop.shape) for name, values in (worst | peaks | {"stable": stable}).items()}
    return Margins(**shaped, gain_crossings=gains, phase_crossings=phases)


def peaks(loop, functions, *, omega=None, floor: float = -np.inf):
    """(values, omega), each (..., f): the largest value over frequency of each of f functions of L, and where in rad/s.

    `omega` as in `analyse`. A peak whose value on that grid is below `floor` is taken from the grid.
    """
    flat, omega = _flat(loop, omega)
    L = flat.frequency_response(omega)
    found = zip(*(_peak(flat, omega, L, function, floor) for function in functions), strict=True)
    return tuple(np.stack(parts, axis=-1).reshape(*loop.shape, -1) for parts in found)


def _flat(loop, omega):
    """The loops along one axis, with a row of frequencies each."""
    omega = frequency_grid(loop.plant) if omega is None else omega
    omega = np.broadcast_to(omega, (*loop.shape, np.shape(omega)[-1])).reshape(-1, np.shape(omega)[-1])
    return loop.take(np.arange(omega.shape[0])), omega


def _sensitivity(L):
    return 1.0 / np.abs(1.0 + L)


def _complementary(L):
    return np.abs(L / (1.0 + L))


def _least(size: int, index, values) -> np.ndarray:
    least = np.full(size, np.inf)
    np.minimum.at(least, index, values)
    return least


def _crossings(loop, omega, L, function) -> Crossings:
    """All roots of function(L) that change its sign on the grid `omega`."""
    from scipy.optimize import elementwise

    sign = np.signbit(function(L))
    row, column = np.nonzero(sign[:, :-1] != sign[:, 1:])
    if row.size == 0:
        return Crossings(row, np.zeros(0), np.zeros(0, complex))

    def at(frequency, index):
        return loop.take(index.astype(int)).frequency_response(frequency[:, None])[:, 0]

    bracket = (omega[row, column], omega[row, column + 1])
    found = elementwise.find_root(lambda w, index: function(at(w, index)), bracket, args=(row.astype(float),))
    return Crossings(row, found.x, at(found.x, row))


def _peak(loop, omega, L, function, floor=-np.inf):
    """(maximum of function(L) over frequency, where), refined between the grid points next to the largest value."""
    from scipy.optimize import elementwise

    values = function(L)
    top = np.argmax(values, axis=-1)
    every = np.arange(len(top))
    peak, where = values[every, top], omega[every, top]
    row = np.nonzero((where > omega[:, 0]) & (where < omega[:, -1]) & (peak > floor))[0]
    if row.size:
        some, grid, centre = loop.take(row), omega[row], where[row]
        below = np.where(grid < centre[:, None], grid, -np.inf).max(axis=1)
        above = np.where(grid > centre[:, None], grid, np.inf).min(axis=1)

        def negative(w, index):
            return -function(some.take(index.astype(int)).frequency_response(w[:, None])[:, 0])

        local = np.arange(row.size, dtype=float)
        found = elementwise.find_minimum(negative, (below, centre, above), args=(local,), tolerances={"xrtol": _PEAK_WIDTH})
        better = -found.f_x > peak[row]
        peak[row[better]], where[row[better]] = -found.f_x[better], found.x[better]
    return peak, where
