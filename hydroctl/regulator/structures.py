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

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError, unknown_name

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
        z = np.exp(1j * np.asarray(omega, dtype=float) * self.sample_time)
        gains = (np.asarray(gain)[..., None] for gain in (self.kp, self.ki, self.kd))
        parts = [
            gain * part for gain, part in zip(gains, self._parts(z), strict=True) if np.any(gain)
        ]
        return sum(parts, np.zeros(1)) * self._filter_response(z)

    @property
    def nyquist_gain(self) -> np.ndarray:
        """(...) |C| at the Nyquist frequency, in the unit of kp: what noise from sample to sample
        is multiplied by."""
        return np.abs(self.frequency_response([np.pi / self.sample_time]))[..., 0]

    def terms(self, omega) -> np.ndarray:
        """(..., n, 3) complex: what kp, ki and kd multiply; sections, notch and filter included."""
        z = np.exp(1j * np.asarray(omega, dtype=float) * self.sample_time)
        return np.stack(list(self._parts(z)), axis=-1) * self._filter_response(z)[..., None]

    def _parts(self, z):
        """What kp, ki and kd multiply, without the filters: 1, forward Euler, backward Euler behind
        Tf."""
        yield np.ones_like(z)
        yield self.sample_time / (z - 1.0)
        yield (z - 1.0) / ((self.Tf + self.sample_time) * z - self.Tf)

    def _filter_response(self, z):
        response = np.ones(np.broadcast_shapes((*self.shape, 1), z.shape), complex)
        for numerator, denominator in self._filters():
            response = response * (_falling(numerator, z) / _falling(denominator, z))
        return response

    def _filters(self):
        """(numerator, denominator) in falling powers of z, each a sequence of arrays (..., 1), of
        the factors that are in use."""
        t = np.tan(np.asarray(self.notch_frequency)[..., None] * self.sample_time / 2.0)
        one = np.ones_like(t)
        factors = [(_section(zero, t), _section(pole, t)) for zero, pole in self.sections]
        if self.zz != self.zp:
            factors.append((_quadratic(self.zz, t), _quadratic(self.zp, t)))
        if self.Tm:
            factors.append(
                (
                    (self.sample_time * one, 0.0 * one),
                    ((self.Tm + self.sample_time) * one, -self.Tm * one),
                )
            )
        return factors

    def state_space(self):
        """(A, B, C, D) of e to x over (...): states integral, filtered derivative, sections, notch
        and filter, as far as used."""
        zero, one = np.zeros(self.shape), np.ones(self.shape)
        blocks = []
        if np.any(self.ki):
            blocks.append((one, self.sample_time * self.ki, zero))
        if np.any(self.kd):
            fade = self.Tf / (self.Tf + self.sample_time)
            gain = self.kd / (self.Tf + self.sample_time)
            blocks.append((fade * one, (fade - 1.0) * gain, gain))
        A = np.zeros((*self.shape, len(blocks), len(blocks)))
        B = np.zeros((*self.shape, len(blocks), 1))
        D = np.array(self.kp + sum(block[2] for block in blocks), dtype=float)[..., None, None]
        for i, (pole, gain, _) in enumerate(blocks):
            A[..., i, i], B[..., i, 0] = pole, gain
        system = A, B, np.ones((*self.shape, 1, len(blocks))), D
        for numerator, denominator in self._filters():
            system = series(system, _companion(numerator, denominator))
        return system

    def transfer_function(self) -> control.TransferFunction:
        """C(z) from e to x of a single regulator (shape ()), with its sample time."""
        import control

        if self.shape != ():
            raise InputError(
                f"select one regulator of the {self.shape} first, for example regulators[0, 0]."
            )
        Ts, z = self.sample_time, control.tf([1.0, 0.0], [1.0], self.sample_time)
        law = control.tf([self.kp], [1.0], Ts)
        if self.ki:
            law = law + self.ki * Ts / (z - 1.0)
        if self.kd:
            law = law + self.kd * (z - 1.0) / ((self.Tf + Ts) * z - self.Tf)
        for factor in self._filters():
            law = law * control.tf(*(np.ravel(part) for part in factor), Ts)
        return control.tf(law, inputs=["e"], outputs=["x"])


def _section(corner: float, t):
    """Coefficients of s/(corner wn) + 1 under Tustin's rule, t = tan(wn Ts/2), up to the factor t
    (1 + 1/z)."""
    return 1.0 / corner + t, t - 1.0 / corner


def _quadratic(damping: float, t):
    """Coefficients of s^2 + 2 damping wn s + wn^2, likewise."""
    return 1.0 + 2.0 * damping * t + t * t, 2.0 * (t * t - 1.0), 1.0 - 2.0 * damping * t + t * t


def _falling(coefficients, z):
    """c0 + c1/z + ..."""
    value = coefficients[-1]
    for coefficient in coefficients[-2::-1]:
        value = coefficient + value / z
    return value


def _companion(numerator, denominator):
    """(A, B, C, D) of numerator/denominator, coefficients (..., 1) in falling powers of z."""
    b, a = (
        np.stack(part, axis=-1)[..., 0, :] / denominator[0] for part in (numerator, denominator)
    )
    n = a.shape[-1] - 1
    A = np.zeros((*a.shape[:-1], n, n))
    A[..., 0, :] = -a[..., 1:]
    A[..., range(1, n), range(n - 1)] = 1.0
    B = np.broadcast_to(np.eye(n)[:, :1], (*a.shape[:-1], n, 1))
    D = b[..., :1]
    return A, B, (b[..., 1:] - D * a[..., 1:])[..., None, :], D[..., None]


def series(first, second):
    """The state space of `second` after `first`, each (A, B, C, D) with leading axes that
    broadcast."""
    (A1, B1, C1, D1), (A2, B2, C2, D2) = first, second
    n1, n2 = A1.shape[-1], A2.shape[-1]
    shape = np.broadcast_shapes(A1.shape[:-2], A2.shape[:-2])
    A = np.zeros((*shape, n1 + n2, n1 + n2))
    A[..., :n1, :n1], A[..., n1:, n1:], A[..., n1:, :n1] = A1, A2, B2 @ C1
    B = np.concatenate(
        [np.broadcast_to(B1, (*shape, n1, 1)), np.broadcast_to(B2 @ D1, (*shape, n2, 1))], axis=-2
    )
    C = np.concatenate(
        [np.broadcast_to(D2 @ C1, (*shape, 1, n1)), np.broadcast_to(C2, (*shape, 1, n2))], axis=-1
    )
    return A, B, C, D2 @ D1
