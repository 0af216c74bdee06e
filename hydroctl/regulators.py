"""Regulator structures P, PI and PID, each with an optional notch, as linear combinations of fixed sampled terms.

    e[k] --> kp + ki Ts/(z - 1) + kd (z - 1)/((Tf + Ts) z - Tf) --> notch --> x[k]

The integral is forward Euler, the derivative backward Euler, the notch (s^2 + 2 zz wn s + wn^2)/(s^2 + 2 zp wn s + wn^2) by
Tustin's rule prewarped at wn. For fixed Tf and notch the loop gain is linear in (kp, ki, kd), on which the tuner rests.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from .errors import InputError, unknown_name

if TYPE_CHECKING:
    import control

GAINS = ("kp", "ki", "kd")
STRUCTURES: dict[str, tuple[str, ...]] = {
    f"{letters}{'+notch' if notch else ''}": tuple("k" + letter for letter in letters)
    for letters in ("p", "pi", "pid")
    for notch in (False, True)
}
"""The gains that each structure uses."""


def require_structure(name: str) -> None:
    """InputError unless `name` is a structure."""
    if name not in STRUCTURES:
        raise InputError(unknown_name("structure", name, STRUCTURES))


@dataclass(frozen=True, eq=False)
class Regulators:
    """Regulators over an array shape (...): kp, ki, kd and notch_frequency are arrays, the rest is common.

    Parallel form, gains in units of x per unit of the measured quantity (kp), per second (ki), times second (kd). zz = zp
    leaves the notch out. `regulators[index]` selects.
    """

    sample_time: float
    kp: np.ndarray
    ki: np.ndarray
    kd: np.ndarray
    notch_frequency: np.ndarray
    """wn in rad/s"""
    Tf: float
    """derivative filter time in s"""
    zz: float
    """damping of the notch's zeros"""
    zp: float
    """damping of the notch's poles"""

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
        gains = np.stack(np.broadcast_arrays(self.kp, self.ki, self.kd), axis=-1)
        return np.einsum("...nt,...t->...n", self.terms(omega), gains)

    def terms(self, omega) -> np.ndarray:
        """(..., n, 3) complex: what kp, ki and kd multiply, notch included."""
        z = np.exp(1j * np.asarray(omega, dtype=float) * self.sample_time)
        integral = self.sample_time / (z - 1.0)
        derivative = (z - 1.0) / ((self.Tf + self.sample_time) * z - self.Tf)
        plain = np.stack([np.ones_like(z), integral, derivative], axis=-1)
        return plain * self._notch_response(z)[..., None]

    def _notch_response(self, z):
        (b0, b1, b2), (_, a1, a2) = self.notch()
        return (b0 + (b1 + b2 / z) / z) / (1.0 + (a1 + a2 / z) / z)

    def notch(self):
        """((b0, b1, b2), (1, a1, a2)), each (..., 1): the sampled notch, in falling powers of z."""
        t = np.tan(np.asarray(self.notch_frequency)[..., None] * self.sample_time / 2.0)
        middle, lead = 2.0 * (t * t - 1.0), 1.0 + 2.0 * self.zp * t + t * t

        def coefficients(damping):
            return (1.0 + 2.0 * damping * t + t * t) / lead, middle / lead, (1.0 - 2.0 * damping * t + t * t) / lead

        return coefficients(self.zz), coefficients(self.zp)

    def state_space(self):
        """(A, B, C, D) of e to x over (...): states integral, filtered derivative and notch, as far as the gains use them."""
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
        pid = A, B, np.ones((*self.shape, 1, len(blocks))), D
        return series(pid, self._notch_states()) if self.zz != self.zp else pid

    def _notch_states(self):
        (b0, b1, b2), (_, a1, a2) = self.notch()
        A = np.zeros((*self.shape, 2, 2))
        A[..., 0, :] = np.concatenate([-a1, -a2], axis=-1)
        A[..., 1, 0] = 1.0
        B = np.broadcast_to([[1.0], [0.0]], (*self.shape, 2, 1))
        return A, B, np.stack([b1 - b0 * a1, b2 - b0 * a2], axis=-1), b0[..., None]

    def transfer_function(self) -> control.TransferFunction:
        """C(z) from e to x of a single regulator (shape ()), with its sample time."""
        import control

        if self.shape != ():
            raise InputError(f"select one regulator of the {self.shape} first, for example regulators[0, 0].")
        Ts, z = self.sample_time, control.tf([1.0, 0.0], [1.0], self.sample_time)
        law = control.tf([self.kp], [1.0], Ts)
        if self.ki:
            law = law + self.ki * Ts / (z - 1.0)
        if self.kd:
            law = law + self.kd * (z - 1.0) / ((self.Tf + Ts) * z - self.Tf)
        if self.zz != self.zp:
            law = law * control.tf(*(np.ravel(c) for c in self.notch()), Ts)
        return control.tf(law, inputs=["e"], outputs=["x"])


def series(first, second):
    """The state space of `second` after `first`, each (A, B, C, D) with leading axes that broadcast."""
    (A1, B1, C1, D1), (A2, B2, C2, D2) = first, second
    n1, n2 = A1.shape[-1], A2.shape[-1]
    shape = np.broadcast_shapes(A1.shape[:-2], A2.shape[:-2])
    A = np.zeros((*shape, n1 + n2, n1 + n2))
    A[..., :n1, :n1], A[..., n1:, n1:], A[..., n1:, :n1] = A1, A2, B2 @ C1
    B = np.concatenate([np.broadcast_to(B1, (*shape, n1, 1)), np.broadcast_to(B2 @ D1, (*shape, n2, 1))], axis=-2)
    C = np.concatenate([np.broadcast_to(D2 @ C1, (*shape, 1, n1)), np.broadcast_to(C2, (*shape, 1, n2))], axis=-1)
    return A, B, C, D2 @ D1
