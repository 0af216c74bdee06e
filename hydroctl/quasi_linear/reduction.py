"""Second-order models of the family, v/x(s) = b / (s^2 + a1 s + a2), and how far each is from the
third-order model.

The real pole p of v/x lies next to its zero z; leaving both out gives the second order, with (a1,
a2) from the other two poles:

    matched:        b = a2 n0/d0, so that the static gain is exact at every point
    paper:          b = c n1 with ONE constant c = z/p per sign of x, taken at x = +-0.1 and
                    mid stroke (section 3 of the paper)
    least-squares:  a1 and a2 minimize the sum of |G2/G3 - 1|^2 over 0.1 ... 3 omega_n, b = a2 n0/d0

The error is G2/G3 - 1. For "matched" it is (z - p)/p * s/(s - z), for "paper" (c (s - p) - (s -
z))/(s - z): both are bilinear in s, so that |error| is monotone in omega and largest at an end of
the band. For "least-squares" |error|^2 is a quotient of two cubics in omega^2, and the zeros of its
derivative are found exactly.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from typing import Literal

import numpy as np

from ..digits import apart
from ..errors import InputError, unknown_name
from ..model.linearization import LinearFamily, linearize
from ..model.operating_point import OperatingPoints, find_operating_points

_METHODS = ("matched", "least-squares", "paper")
_BAND = 3.0
"""upper end of the default band, as a multiple of the natural frequency"""
_FIT_BAND = np.geomspace(0.1, _BAND, 61)
_FIT_STEPS = 40
_PAPER_OPENING = 0.1


@dataclass(frozen=True, eq=False)
class SecondOrderFamily:
    """Second-order models b/(s^2 + a1 s + a2) over the shape of the operating points, NaN where a
    point is not feasible."""

    family: LinearFamily
    """the third-order models they stand for"""
    method: Literal["matched", "least-squares", "paper"]
    tolerance: float
    """largest relative error of an accepted point"""
    omega_max: float | None
    """rad/s: the error counts from 0 up to this frequency; None is three times the natural
    frequency of each point"""
    a1: np.ndarray
    """(...) rad/s"""
    a2: np.ndarray
    """(...) rad^2/s^2"""
    b: np.ndarray
    """(...) m/s^3 per unit of x"""

    @property
    def points(self) -> OperatingPoints:
        """The operating points."""
        return self.family.points

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of the grid of operating points."""
        return self.points.shape

    @property
    def natural_frequency(self) -> np.ndarray:
        """(...) rad/s: sqrt(a2)."""
        return np.sqrt(self.a2)

    @property
    def damping(self) -> np.ndarray:
        """(...): a1 / (2 sqrt(a2)); above 1 where the two poles are real."""
        return self.a1 / (2.0 * np.sqrt(self.a2))

    @property
    def offset(self) -> np.ndarray:
        """(...) m/s^3: c = a2 (v - k x) with k the static gain of the third-order model, for v'' +
        a1 v' + a2 v = b x + c.

        With it a tangent model rests at its operating point; for secant models without load it is
        zero up to rounding.
        """
        return self.a2 * (self.points.v - self.family.static_gain() * self.points.x)

    @property
    def pole_zero_gap(self) -> np.ndarray:
        """(...): (z - p)/p of the pole and the zero that are left out."""
        return self.family.zeros()[..., 0] / self.family.poles()[..., 0].real - 1.0

    def static_gain(self) -> np.ndarray:
        """(...) m/s: b/a2."""
        return self.b / self.a2

    @np.errstate(invalid="ignore")
    def frequency_response(self, omega) -> np.ndarray:
        """(..., n) complex: v/x at the n frequencies omega (rad/s)."""
        omega = np.asarray(omega, dtype=float)
        a1, a2, b = (c[..., None] for c in (self.a1, self.a2, self.b))
        return b / (a2 - omega**2 + 1j * a1 * omega)

    def relative_error(self, omega) -> np.ndarray:
        """(..., n) complex: G2/G3 - 1 at n frequencies (rad/s), the same for all points or (..., n)
        of them."""
        return _relative_error(
            self.family, self.a1, self.a2, self.b, np.asarray(omega, dtype=float)
        )

    @property
    def error(self) -> np.ndarray:
        """(...): the largest |G2/G3 - 1| from 0 to `band`."""
        return self._worst[0]

    @property
    def error_frequency(self) -> np.ndarray:
        """(...) rad/s: where the error is largest."""
        return self._worst[1]

    @property
    def band(self) -> np.ndarray:
        """(...) rad/s: the frequency up to which the error counts at each point."""
        return (
            _BAND * self.natural_frequency
            if self.omega_max is None
            else np.full(self.shape, self.omega_max)
        )

    @cached_property
    def _worst(self) -> tuple[np.ndarray, np.ndarray]:
        omega = np.stack([np.zeros(self.shape), self.band], axis=-1)
        if self.method == "least-squares":
            omega = np.concatenate([omega, self._stationary_frequencies()], axis=-1)
        error = np.abs(self.relative_error(omega))
        worst = np.argmax(error, axis=-1)[..., None]
        return (
            np.take_along_axis(error, worst, axis=-1)[..., 0],
            np.take_along_axis(omega, worst, axis=-1)[..., 0],
        )

    def _stationary_frequencies(self) -> np.ndarray:
        """(..., 4) rad/s: where d|error|^2/domega may vanish inside the band; 0 in place of a
        frequency that does not exist."""
        scale = np.where(np.isfinite(self.a2), self.natural_frequency, 1.0)
        n1, n0 = np.moveaxis(self.family.numerator, -1, 0)
        d0, d1, d2 = (self.family.denominator[..., k] for k in (3, 2, 1))
        reference = self._product((n0, n1 * scale), (self.a2, self.a1 * scale, scale**2))
        reduced = np.stack([self.b * c for c in (d0, d1 * scale, d2 * scale**2, scale**3)], axis=-1)
        error, size = _squared_magnitude(reduced - reference), _squared_magnitude(reference)
        powers = np.arange(1, 4)
        slope = [
            sum(
                powers[i - 1]
                * (error[..., i] * size[..., k - i + 1] - size[..., i] * error[..., k - i + 1])
                for i in range(max(1, k - 2), min(3, k + 1) + 1)
            )
            for k in range(5)
        ]
        roots = _quartic_roots(np.stack(slope, axis=-1))
        real = np.abs(roots.imag) <= 1e-6 * np.abs(roots)
        omega = scale[..., None] * np.sqrt(np.where(real, np.maximum(roots.real, 0.0), 0.0))
        return np.where(omega <= self.band[..., None], omega, 0.0)

    @staticmethod
    def _product(first, second) -> np.ndarray:
        """(..., 4): ascending coefficients of the product of a linear and a quadratic
        polynomial."""
        (f0, f1), (g0, g1, g2) = first, second
        return np.stack([f0 * g0, f0 * g1 + f1 * g0, f0 * g2 + f1 * g1, f1 * g2], axis=-1)

    @property
    def accepted(self) -> np.ndarray:
        """(...) bool: the point is feasible and its error is at most `tolerance`."""
        return self.points.feasible & (self.error <= self.tolerance)

    @property
    def reason(self) -> np.ndarray:
        """Texts: empty where the point is accepted, else why it is not and the way out."""
        texts = self.points.reason
        for index in zip(*np.nonzero(self.points.feasible & ~self.accepted), strict=True):
            error, tolerance = apart(self.error[index], self.tolerance, digits=3, factor=100.0)
            texts[index] = (
                f"The second-order model at x={self.points.x[index]:g}, y={self.points.y[index]:g}"
                f" m is off by {error}% at {self.error_frequency[index]:.4g} rad/s, above the"
                f" tolerance of {tolerance}%. Use the third-order model there."
            )
        return texts


def reduce_order(
    family: LinearFamily,
    *,
    method: Literal["matched", "least-squares", "paper"] = "matched",
    tolerance: float = 0.05,
    omega_max: float | None = None,
) -> SecondOrderFamily:
    """The second-order model of every member of `family`.

    `omega_max` (rad/s) bounds the band in which the error counts; None is three times the natural
    frequency of each point. A point that is not feasible holds NaN. Raises InputError for an
    unknown method, a tolerance that is not positive or a frequency that is not positive and finite.
    """
    faults = [] if method in _METHODS else [unknown_name("method", method, _METHODS)]
    if not tolerance > 0.0:
        faults.append(
            f"tolerance = {tolerance} must be above 0; it is a relative error, 0.05 is five per"
            " cent."
        )
    if omega_max is not None and not 0.0 < omega_max < math.inf:
        faults.append(
            f"omega_max = {omega_max} must be a positive frequency in rad/s, or None for three"
            " natural frequencies."
        )
    if faults:
        raise InputError(faults)
    pole = family.poles()[..., 0].real
    a1 = family.denominator[..., 1] + pole
    a2 = family.denominator[..., 2] + pole * a1
    if method == "least-squares":
        a1, a2 = _least_squares(family, a1, a2)
    b = (
        _single_constant(family) * family.numerator[..., 0]
        if method == "paper"
        else a2 * family.static_gain()
    )
    return SecondOrderFamily(family, method, float(tolerance), omega_max, a1, a2, b)


def _single_constant(family: LinearFamily) -> np.ndarray:
    """(...): z/p at x = +-0.1 and mid stroke, on the side and under the load of each point."""
    points, actuator = family.points, family.points.actuator
    side = np.where(points.x < 0.0, -_PAPER_OPENING, _PAPER_OPENING)
    load = points.load_force - actuator.constant_load
    reference = linearize(
        actuator,
        find_operating_points(actuator, side, actuator.stroke / 2.0, load_force=load),
        form=family.form,
    )
    return reference.zeros()[..., 0] / reference.poles()[..., 0].real


@np.errstate(invalid="ignore")
def _relative_error(family: LinearFamily, a1, a2, b, omega: np.ndarray) -> np.ndarray:
    (n1, n0), (_, d2, d1, d0) = (
        np.moveaxis(c, -1, 0)[..., None] for c in (family.numerator, family.denominator)
    )
    s = 1j * omega
    third = (n1 * s + n0) / (((s + d2) * s + d1) * s + d0)
    return b[..., None] / ((s + a1[..., None]) * s + a2[..., None]) / third - 1.0


@np.errstate(invalid="ignore")
def _least_squares(
    family: LinearFamily, a1: np.ndarray, a2: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(a1, a2) by the Levenberg-Marquardt method at all points at once, in units of the natural
    frequency given."""
    gain, scale = family.static_gain(), np.sqrt(a2)
    omega = scale[..., None] * _FIT_BAND
    sigma = 1j * _FIT_BAND
    theta = np.stack([a1 / scale, np.ones_like(a1)], axis=-1)

    def residual(theta):
        return _relative_error(
            family,
            theta[..., 0] * scale,
            theta[..., 1] * scale**2,
            theta[..., 1] * scale**2 * gain,
            omega,
        )

    error = residual(theta)
    cost, damping = np.sum(np.abs(error) ** 2, axis=-1), np.full(a1.shape, 1e-3)
    for _ in range(_FIT_STEPS):
        inverse = 1.0 / (sigma**2 + theta[..., :1] * sigma + theta[..., 1:])
        slopes = (1.0 + error)[..., None, :] * np.stack(
            [-sigma * inverse, 1.0 / theta[..., 1:] - inverse], axis=-2
        )
        normal = np.real(slopes @ np.conj(np.swapaxes(slopes, -1, -2)))
        gradient = np.real(slopes @ np.conj(error)[..., None])
        step = np.linalg.solve(normal + damping[..., None, None] * normal * np.eye(2), gradient)[
            ..., 0
        ]
        trial = theta - step
        trial_error = residual(trial)
        trial_cost = np.sum(np.abs(trial_error) ** 2, axis=-1)
        better = (trial_cost <= cost) & (trial > 0.0).all(axis=-1)
        theta, error = (
            np.where(better[..., None], trial, theta),
            np.where(better[..., None], trial_error, error),
        )
        cost, damping = (
            np.where(better, trial_cost, cost),
            np.where(better, damping / 10.0, damping * 10.0),
        )
    return theta[..., 0] * scale, theta[..., 1] * scale**2


def _squared_magnitude(c: np.ndarray) -> np.ndarray:
    """(..., 4): ascending coefficients in w = sigma^2 of |c0 + c1 s + c2 s^2 + c3 s^3|^2 at s = j
    sigma."""
    c0, c1, c2, c3 = np.moveaxis(c, -1, 0)
    return np.stack([c0**2, c1**2 - 2.0 * c0 * c2, c2**2 - 2.0 * c1 * c3, c3**2], axis=-1)


def _quartic_roots(ascending: np.ndarray) -> np.ndarray:
    """(..., 4) complex roots from (..., 5) ascending coefficients; 0 where a coefficient is not
    finite."""
    usable = np.isfinite(ascending).all(axis=-1)
    largest = np.max(np.abs(ascending), axis=-1, initial=0.0)
    scaled = np.where(
        usable[..., None],
        ascending / np.where(usable & (largest > 0.0), largest, 1.0)[..., None],
        0.0,
    )
    lead = np.where(np.abs(scaled[..., 4]) < 1e-14, 1e-14, scaled[..., 4])
    companion = np.zeros((*usable.shape, 4, 4))
    companion[..., np.arange(1, 4), np.arange(3)] = 1.0
    companion[..., :, 3] = -scaled[..., :4] / lead[..., None]
    return np.linalg.eigvals(companion).astype(complex)
