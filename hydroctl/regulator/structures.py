"""Regulator structures P, PI and PID, each with optional lead-lag sections and notch, as sums of
fixed sampled terms.

    e[k] --> kp + ki Ts/(z - 1) + kd (z - 1)/((Tf + Ts) z - Tf) --> sections --> notch --> x[k]

The integral is forward Euler, the derivative backward Euler. The sections (s/(z wn) + 1)/(s/(p wn)
+ 1), z < p a lead and z > p a lag, and the notch (s^2 + 2 zz wn s + wn^2)/(s^2 + 2 zp wn s + wn^2)
are Tustin's, prewarped at wn. A filter of the measurement, Ts z/((Tm + Ts) z - Tm), acts in the
loop as one more factor. All this fixed, the loop gain is linear in (kp, ki, kd), on which the tuner
rests.
"""

from __future__ import annotations

import operator
from dataclasses import dataclass, replace
from functools import reduce
from types import SimpleNamespace
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError, unknown_name
from .linear import (
    Block,
    Ratio,
    block_of,
    block_of_ratio,
    filters,
    parallel,
    ratio_of,
    series,
    term,
)

if TYPE_CHECKING:
    import control

GAINS = ("kp", "ki", "kd")
SECTIONS = {"": 0, "+lead": 1, "+lead-lag": 2}
"""How many sections the parts of a structure's name stand for."""
STRUCTURES: dict[str, tuple[str, ...]] = {
    f"{letters}{part}{notch}": tuple("k" + letter for letter in letters)
    for letters in ("p", "pi", "pid")
    for part in SECTIONS
    for notch in ("", "+notch")
}
"""The gains that each structure uses."""


def section_count(structure: str) -> int:
    """How many lead-lag sections `structure` has."""
    return max(count for part, count in SECTIONS.items() if part in structure)


def require_structure(name: str) -> None:
    """InputError unless `name` is a structure."""
    if name not in STRUCTURES:
        raise InputError(unknown_name("structure", name, STRUCTURES))


@dataclass(frozen=True, eq=False)
class Regulators:
    """Regulators over an array shape (...): kp, ki, kd and notch_frequency are arrays, the rest is
    common.

    Parallel form, gains in units of x per unit of the measured quantity (kp), per second (ki),
    times second (kd). zz = zp leaves the notch out. `regulators[index]` selects. The filter of the
    measurement counts as part of the regulator.
    """

    sample_time: float
    kp: np.ndarray
    ki: np.ndarray
    kd: np.ndarray
    notch_frequency: np.ndarray
    """wn in rad/s, of notch and sections"""
    Tf: float
    """derivative filter time in s"""
    zz: float
    """damping of the notch's zeros"""
    zp: float
    """damping of the notch's poles"""
    sections: tuple[tuple[float, float], ...] = ()
    """(z, p) of each lead-lag section, as multiples of wn"""
    Tm: float = 0.0
    """time of the filter of the measurement in s; 0: none"""

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of the gain arrays."""
        return np.shape(self.kp)

    def __getitem__(self, index) -> Regulators:
        return self._each(lambda array: array[index])

    def broadcast_to(self, shape: tuple[int, ...]) -> Regulators:
        """The same regulators repeated over `shape`."""
        return self._each(lambda array: np.broadcast_to(array, shape))

    def reshape(self, *shape: int) -> Regulators:
        """The same regulators in another shape."""
        return self._each(lambda array: np.reshape(array, shape))

    def _each(self, change) -> Regulators:
        arrays = {name: change(getattr(self, name)) for name in (*GAINS, "notch_frequency")}
        return replace(self, **arrays)

    def frequency_response(self, omega) -> np.ndarray:
        """(..., n) complex C at omega in rad/s: one row for all regulators, or a row for each."""
        z = self._z(omega)
        parts = (
            np.asarray(gain)[..., None] * term.at(z) for gain, term in self._terms() if np.any(gain)
        )
        return sum(parts, np.zeros(1)) * self._filter_response(z)

    @property
    def nyquist_gain(self) -> np.ndarray:
        """(...) |C| at the Nyquist frequency, in the unit of kp: what noise from sample to sample
        is multiplied by."""
        return np.abs(self.frequency_response([np.pi / self.sample_time]))[..., 0]

    def terms(self, omega) -> np.ndarray:
        """(..., n, 3) complex: what kp, ki and kd multiply; sections, notch and filter included."""
        z = self._z(omega)
        parts = [np.broadcast_to(term.at(z), z.shape) for _, term in self._terms()]
        return np.stack(parts, axis=-1) * self._filter_response(z)[..., None]

    def _z(self, omega) -> np.ndarray:
        return np.exp(1j * np.asarray(omega, dtype=float) * self.sample_time)

    def _terms(self) -> list[tuple[np.ndarray, Ratio]]:
        """(gain, what it multiplies) of kp, ki and kd."""
        return [(getattr(self, name), term(name, self.sample_time, self.Tf)) for name in GAINS]

    def _filters(self) -> list[np.ndarray]:
        """Entries of sections, notch and filter of the measurement, as far as used."""
        settings = SimpleNamespace(
            Ts=self.sample_time, zz=self.zz, zp=self.zp, sections=self.sections, Tm=self.Tm
        )
        return filters(self.notch_frequency, settings)

    def _filter_response(self, z: np.ndarray) -> np.ndarray:
        factors = (ratio_of(entries).at(z) for entries in self._filters())
        return reduce(operator.mul, factors, np.ones((*self.shape, 1)))

    def state_space(self) -> Block:
        """(A, B, C, D) of e to x over (...): states integral, filtered derivative, sections, notch
        and filter, as far as used."""
        terms = [
            block_of_ratio(ratio, np.broadcast_to(gain, self.shape))
            for gain, ratio in self._terms()
            if np.any(gain)
        ]
        system = parallel(terms, self.shape)
        for entries in self._filters():
            system = series(system, block_of(entries))
        return system

    def transfer_function(self) -> control.TransferFunction:
        """C(z) from e to x of a single regulator (shape ()), with its sample time."""
        import control

        if self.shape != ():
            raise InputError(
                f"select one regulator of the {self.shape} first, for example regulators[0, 0]."
            )
        Ts, law = self.sample_time, control.tf([0.0], [1.0], self.sample_time)
        filters = [(1.0, ratio_of(entries)) for entries in self._filters()]
        terms, factors = (
            [control.tf(*_coefficients(gain, ratio), Ts) for gain, ratio in pairs]
            for pairs in (self._terms(), filters)
        )
        for (gain, _), part in zip(self._terms(), terms, strict=True):
            if gain:
                law = law + part
        for factor in factors:
            law = law * factor
        return control.tf(law, inputs=["e"], outputs=["x"])


def _coefficients(gain, ratio: Ratio) -> tuple[np.ndarray, np.ndarray]:
    """(numerator, denominator) of gain times a ratio without leading axes."""
    numerator, denominator = (np.ravel(part) for part in (ratio.numerator, ratio.denominator))
    return float(gain) * ratio.gain * numerator, denominator
