"""Roots of cubic polynomials, for arrays of them at once."""

from __future__ import annotations

import numpy as np

_NEWTON_STEPS = 3


def cubic_roots(coefficients: np.ndarray) -> np.ndarray:
    """(..., 3) complex roots of s^3 + c2 s^2 + c1 s + c0 from (..., 3) real c2, c1, c0; the first root is real.

    Cardano's formula (trigonometric where all roots are real) gives one real root, Newton's method on the polynomial itself
    sharpens it, and the quadratic that is left gives the other two, the one with the larger imaginary or real part first.
    """
    c2, c1, c0 = np.moveaxis(np.asarray(coefficients, dtype=float), -1, 0)
    root = _real_root(c2, c1, c0)
    for _ in range(_NEWTON_STEPS):
        value = ((root + c2) * root + c1) * root + c0
        slope = (3.0 * root + 2.0 * c2) * root + c1
        root = root - np.where(slope == 0.0, 0.0, value / np.where(slope == 0.0, 1.0, slope))
    half = -(c2 + root) / 2.0
    radical = np.sqrt((half * half - (c1 - 2.0 * root * half)).astype(complex))
    return np.stack([root.astype(complex), half + radical, half - radical], axis=-1)


def _real_root(c2, c1, c0):
    shift = c2 / 3.0
    p, q = c1 / 3.0 - shift * shift, shift**3 - shift * c1 / 2.0 + c0 / 2.0
    discriminant = q * q + p**3
    with np.errstate(invalid="ignore", divide="ignore"):
        u = np.cbrt(-q - np.copysign(np.sqrt(np.maximum(discriminant, 0.0)), q))
        single = np.where(u == 0.0, 0.0, u - p / u)
        radius = np.sqrt(np.maximum(-p, 0.0))
        triple = 2.0 * radius * np.cos(np.arccos(np.clip(-q / radius**3, -1.0, 1.0)) / 3.0)
    return np.where(discriminant > 0.0, single, np.where(radius == 0.0, 0.0, triple)) - shift
