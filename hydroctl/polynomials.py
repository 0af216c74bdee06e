"""Roots of cubic polynomials, for arrays of them at once."""

from __future__ import annotations

import numpy as np

_SEARCH_STEPS, _POLISH_STEPS = 12, 3


def cubic_roots(coefficients: np.ndarray, near: np.ndarray) -> np.ndarray:
    """(..., 3) complex roots of s^3 + c2 s^2 + c1 s + c0 from (..., 3) real c2, c1, c0.

    The first root is the real one nearest to `near` (...); of the other two, the one with the larger imaginary or real part comes
    first. Newton's method from `near` finds a real root, from Cardano's where that fails; the quadratic that is left gives the
    others. Coefficients that are not finite give roots that are NaN.
    """
    coefficients = np.asarray(coefficients, dtype=float)
    rows = np.atleast_2d(coefficients)
    c2, c1, c0 = rows[..., 0], rows[..., 1], rows[..., 2]
    near = np.broadcast_to(np.asarray(near, dtype=float), c2.shape)
    with np.errstate(invalid="ignore", divide="ignore", over="ignore"):
        root, settled = _newton(c2, c1, c0, near, _SEARCH_STEPS)
        if not settled.all():
            lost = ~settled
            c = c2[lost], c1[lost], c0[lost]
            root[lost] = _newton(*c, _real_root(*c), _POLISH_STEPS)[0]
        roots, radicand = _with_quadratic(c2, c1, root)
    all_real = radicand >= 0.0
    if all_real.any():
        roots[all_real] = _nearest_first(roots[all_real], near[all_real])
    return roots.reshape(coefficients.shape)


def _newton(c2, c1, c0, root, steps):
    """(root, settled): Newton's method on the polynomial itself. What is not a number counts as settled."""
    for _ in range(steps):
        partial = root + c2
        slope = (partial + root) * root
        partial *= root
        partial += c1
        slope += partial
        partial *= root
        partial += c0
        np.divide(partial, slope, out=partial, where=slope != 0.0)
        root = root - partial
        settled = ~(np.abs(partial) > 1e-9 * np.abs(root))  # convergence is quadratic: the next step would be below rounding
        if settled.all():
            break
    return root, settled


def _with_quadratic(c2, c1, root):
    """(roots, radicand): `root` with the two roots of the quadratic that dividing it out leaves; complex where radicand < 0."""
    half = -0.5 * (c2 + root)
    radicand = half * half - (c1 - 2.0 * root * half)
    roots = np.empty((3, *np.shape(root)), dtype=complex)
    spread = np.sqrt(np.maximum(radicand, 0.0))
    roots[0].real, roots[1].real, roots[2].real = root, half + spread, half - spread
    roots[0].imag = 0.0
    np.sqrt(np.maximum(-radicand, 0.0), out=roots[1].imag)
    np.negative(roots[1].imag, out=roots[2].imag)
    return roots.transpose(*range(1, roots.ndim), 0), radicand


def _nearest_first(roots, near):
    """Three real roots with the one nearest to `near` first, the others falling."""
    order = np.argsort(-roots.real, axis=-1)
    falling = np.take_along_axis(roots, order, axis=-1)
    nearest = np.argmin(np.abs(falling - near[..., None]), axis=-1)[..., None]
    rank = np.array([0, 1, 2])
    return np.take_along_axis(falling, np.argsort(np.where(rank == nearest, -1, rank), axis=-1), axis=-1)


def _real_root(c2, c1, c0):
    """Cardano's formula, trigonometric where all roots are real."""
    shift = c2 / 3.0
    p, q = c1 / 3.0 - shift * shift, shift**3 - shift * c1 / 2.0 + c0 / 2.0
    discriminant = q * q + p**3
    u = np.cbrt(-q - np.copysign(np.sqrt(np.maximum(discriminant, 0.0)), q))
    single = np.where(u == 0.0, 0.0, u - p / u)
    radius = np.sqrt(np.maximum(-p, 0.0))
    triple = 2.0 * radius * np.cos(np.arccos(np.clip(-q / radius**3, -1.0, 1.0)) / 3.0)
    return np.where(discriminant > 0.0, single, np.where(radius == 0.0, 0.0, triple)) - shift
