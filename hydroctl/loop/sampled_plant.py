"""The plant as a sampled regulator sees it: valve opening held over each sample, computational
delay, speed or position read.

    x[k] --> delay --> zero-order hold --> valve --> v/x(s) [--> 1/s] --> sampler --> m[k]

The valve is ideal unless the actuator states its lag, w^2/(s^2 + 2 zeta w s + w^2). The hold is
exact, fractions of a sample of delay included: from the eigenvectors of the model, or by scipy's
matrix exponential where they are nearly parallel. The frequency response is a sum of partial
fractions of the sampled model, so that thousands of models cost a few array operations. With delay
= k + f samples, 0 <= f < 1,

    G(z) = z^-k  sum_i (r_i + q_i / z) / (z - lambda_i),    z = exp(j omega Ts), q_i = 0 at f = 0
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ..model.linearization import LinearFamily
from .quantity import ControlledQuantity, LoopName, controlled_quantity
from .speed_models import SpeedModels, of_linear_family

_ARRAYS = ("transition", "entry", "eigenvalues", "residues", "resonance")
_WORST_CONDITION = 1e6
"""of eigenvectors that are used"""
LOWEST_FREQUENCY = 1e-4
"""of the Nyquist frequency"""
_ABOUT_A_MODE = 51
"""frequencies about each oscillating mode"""
_REACH = 0.3
"""how far they reach, over the frequency of the mode; at least three times its width"""
_SMOOTH = 0.5
"""damping from which the logarithmic frequencies are dense enough for a mode"""
_SHARPEST = 1e-9
"""half-power width, over the Nyquist frequency, below which a mode is looked at as if it had that
one"""
_FADED = 1e-12
"""size below which a sampled pole is a delay"""


@dataclass(frozen=True, eq=False)
class SampledFamily:
    """Sampled models over the shape (...) of a linear family: x[k] to m[k], in m/s (velocity) or m
    (position)."""

    sample_time: float
    whole_delays: int
    """samples that a command waits before the one in which it starts to act"""
    transition: np.ndarray
    """(..., n, n): state after one sample"""
    entry: np.ndarray
    """(..., n, 2): effect of the command that starts to act in the sample, and of the one before
    it"""
    output: np.ndarray
    """(n,): m from the state"""
    speed: np.ndarray
    """(n,): v from the state"""
    eigenvalues: np.ndarray
    """(..., n) lambda_i"""
    residues: np.ndarray
    """(..., n, 2) r_i and q_i; NaN where the eigenvectors are too nearly parallel to be used"""
    resonance: np.ndarray
    """(..., 2): natural frequency (rad/s) and damping of the least damped mode of the continuous
    model"""

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of the family."""
        return self.transition.shape[:-2]

    def frequency_response(self, omega) -> np.ndarray:
        """(..., n) complex G at omega in rad/s: one row for all models, or a row for each."""
        z = np.exp(1j * np.asarray(omega, dtype=float) * self.sample_time)
        response = np.zeros(np.broadcast_shapes((*self.shape, 1), z.shape), complex)
        for i in range(self.output.size):
            weight = self.residues[..., i, 0, None] + self.residues[..., i, 1, None] / z
            response += weight / (z - self.eigenvalues[..., i, None])
        if np.isnan(response).any():
            response = np.where(
                np.isnan(response),
                self._solved_response(np.broadcast_to(z, response.shape)),
                response,
            )
        return response * z**-self.whole_delays

    def _solved_response(self, z):
        n = self.output.size
        resolvent = z[..., None, None] * np.eye(n) - self.transition[..., None, :, :]
        entry = self.entry[..., None, :, 0] + self.entry[..., None, :, 1] / z[..., None]
        return np.linalg.solve(resolvent, entry[..., None])[..., 0] @ self.output

    def take(self, indices) -> SampledFamily:
        """The members at flat `indices`, along one axis."""
        return replace(
            self, **{name: array[indices] for name, array in self.reshape(-1)._arrays().items()}
        )

    def reshape(self, *shape: int) -> SampledFamily:
        """The same members in another shape."""
        rank = len(self.shape)
        return replace(
            self,
            **{
                name: array.reshape(*shape, *array.shape[rank:])
                for name, array in self._arrays().items()
            },
        )

    def _arrays(self) -> dict[str, Any]:
        return {name: getattr(self, name) for name in _ARRAYS}

    @classmethod
    def stack(cls, families: list[SampledFamily]) -> SampledFamily:
        """Families of one shape, sample time and delay, along a new first axis."""
        arrays = [family._arrays() for family in families]
        stacked: dict[str, Any] = {name: np.stack([a[name] for a in arrays]) for name in _ARRAYS}
        return replace(families[0], **stacked)

    def state_space(self) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(A, B, C) of the sampled models with all delays as states: (..., N, N), (..., N, 1), (1,
        N)."""
        n, memory = self.output.size, self.whole_delays + int(np.any(self.entry[..., 1]))
        A = np.zeros((*self.shape, n + memory, n + memory))
        B = np.zeros((*self.shape, n + memory, 1))
        A[..., :n, :n] = self.transition
        newest_first = [B[..., :n, 0]] + [A[..., :n, n + i] for i in range(memory)]
        newest_first[self.whole_delays][...] = self.entry[..., 0]
        if memory > self.whole_delays:
            newest_first[memory][...] = self.entry[..., 1]
        for i in range(memory):
            if i == 0:
                B[..., n, 0] = 1.0
            else:
                A[..., n + i, n + i - 1] = 1.0
        return A, B, np.concatenate([self.output, np.zeros(memory)])[None, :]


def sample(
    family: LinearFamily,
    *,
    loop: LoopName,
    sample_time: float,
    delay_samples: float = 0.0,
) -> SampledFamily:
    """`family` behind a zero-order hold and a delay, read as what the `loop` controls.

    Every point of the family must be feasible; otherwise InputError names the first that is not.
    """
    return sample_models(
        of_linear_family(family),
        controlled_quantity(loop),
        sample_time=sample_time,
        delay_samples=delay_samples,
    )


def sample_models(
    models: SpeedModels,
    quantity: ControlledQuantity,
    *,
    sample_time: float,
    delay_samples: float,
) -> SampledFamily:
    """`models` behind a zero-order hold and a delay, read as `quantity`."""
    A, B, output = models.read_as(quantity)
    whole = math.floor(delay_samples)
    times = sample_time, sample_time * (1.0 - (delay_samples - whole))
    rates, vectors = np.linalg.eig(A)
    vectors = vectors / np.linalg.norm(vectors, axis=-2, keepdims=True)
    parallel = ~(np.linalg.cond(vectors) <= _WORST_CONDITION)
    vectors[parallel] = np.eye(output.size)
    inverse = np.linalg.inv(vectors)
    modal = [_growth(rates, t) * (inverse @ B)[..., 0] for t in times]
    transition = ((vectors * np.exp(rates * sample_time)[..., None, :]) @ inverse).real
    total, newest = ((vectors @ weight[..., None])[..., 0].real for weight in modal)
    if parallel.any():
        transition[parallel], total[parallel] = _held(A[parallel], B[parallel], times[0])
        newest[parallel] = _held(A[parallel], B[parallel], times[1])[1]
    residues = (output @ vectors)[..., None] * np.stack([modal[1], modal[0] - modal[1]], axis=-1)
    residues[parallel] = np.nan
    return SampledFamily(
        sample_time=sample_time,
        whole_delays=whole,
        transition=transition,
        entry=np.stack([newest, total - newest], axis=-1),
        output=output,
        speed=np.append(models.C, np.zeros(output.size - models.C.size)),
        eigenvalues=np.exp(rates * sample_time),
        residues=residues,
        resonance=models.resonance,
    )


def _growth(rates, t: float):
    """(e^{rate t} - 1)/rate, t where the rate is 0."""
    zero = rates == 0.0
    return np.where(zero, t, np.expm1(rates * t) / np.where(zero, 1.0, rates))


def _held(A, B, t: float):
    """(e^{A t}, the response from rest to x = 1 for t), for models whose eigenvectors are of no
    use."""
    from scipy.linalg import expm

    n = A.shape[-1]
    augmented = np.zeros((len(A), n + 1, n + 1))
    augmented[:, :n, :n], augmented[:, :n, n:] = A * t, B * t
    exact = expm(augmented)
    return exact[:, :n, :n], exact[:, :n, n]


def frequency_grid(plant: SampledFamily, *, points: int = 120) -> np.ndarray:
    """(..., n) rad/s, ascending, from 1e-4 of the Nyquist frequency to it: logarithmic, plus dense
    about every lightly damped mode where the sampler shows it: one above the Nyquist frequency at
    its alias.
    """
    nyquist = np.pi / plant.sample_time
    coarse = np.geomspace(LOWEST_FREQUENCY * nyquist, nyquist, points)
    dense = np.maximum(about_modes(plant.eigenvalues, plant.sample_time), coarse[0])
    return merged(np.broadcast_to(coarse, (*plant.shape, points)), dense)


def about_modes(poles: np.ndarray, sample_time: float) -> np.ndarray:
    """(..., n) rad/s: frequencies about each oscillating pair of the sampled `poles` (..., m), as
    many as the member with the most of them needs; they lie closest where the pair is, within its
    half-power width.
    """
    nyquist = np.pi / sample_time
    s = np.log(np.where(np.abs(poles) < _FADED, _FADED, poles).astype(complex)) / sample_time
    frequency, decay = (
        np.where(s.imag > 0.0, s.imag, 0.0),
        np.maximum(np.abs(s.real), _SHARPEST * nyquist),
    )
    damping = np.where(frequency > 0.0, decay / np.where(frequency > 0.0, frequency, 1.0), np.inf)
    count = int((damping < _SMOOTH).sum(axis=-1).max(initial=0))
    kept = np.argsort(damping, axis=-1)[..., :count]
    centre, width = (
        np.take_along_axis(part, kept, axis=-1)[..., None] for part in (frequency, decay)
    )
    reach = np.maximum(_REACH * centre, 3.0 * width)
    offset = width * np.sinh(np.linspace(-1.0, 1.0, _ABOUT_A_MODE) * np.arcsinh(reach / width))
    omega = np.abs(centre + offset)
    omega = np.where(omega > nyquist, 2.0 * nyquist - omega, omega)
    return np.clip(omega, _SHARPEST * nyquist, nyquist).reshape(*poles.shape[:-1], -1)


def merged(*grids: np.ndarray) -> np.ndarray:
    """(..., n): rows of frequencies of the same leading shape as one, ascending."""
    return np.sort(np.concatenate(grids, axis=-1), axis=-1)
