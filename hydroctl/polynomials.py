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
        root, settled = _search(c2, c1, c0, near)
        lost = ~settled | np.isnan(root)
        if lost.any():
            c = c2[lost], c1[lost], c0[lost]
            root[lost] = _polished(*c, _real_root(*c))
        roots, radicand = _with_quadratic(c2, c1, root)
    all_real = radicand >= 0.0
    if all_real.any():
        roots[all_real] = _nearest_first(roots[all_real], near[all_real])
    return roots.reshape(coefficients.shape)


def _value_and_slope(c2, c1, c0, root):
    value = root + c2
    slope = (value + root) * root
    value *= root
    value += c1
    slope += value
    value *= root
    value += c0
    return value, slope


def _search(c2, c1, c0, root):
    """(root, settled): Newton's method on the polynomial itself. What is not a number counts as settled."""
    for _ in range(_SEARCH_STEPS):
        step, slope = _value_and_slope(c2, c1, c0, root)
        step /= slope
        root = root - step
        settled = ~(np.abs(step) > 1e-9 * np.abs(root))  # convergence is quadratic: the next step would be below rounding
        if settled.all():
            break
    return root, settled


def _polished(c2, c1, c0, root):
    """The root after a few steps of Newton's method, none where the slope vanishes: at a multiple root."""
    for _ in range(_POLISH_STEPS):
        value, slope = _value_and_slope(c2, c1, c0, root)
        root = root - np.where(slope == 0.0, 0.0, value / slope)
    return root


def _with_quadratic(c2, c1, root):
    """(roots, radicand): `root` with the two roots of the quadratic that dividing it out leaves; complex where radicand < 0."""
    half = -0.5 * (c2 + root)
    radicand = half * half - (c1 - 2.0 * root * half)
    spread = np.sqrt(np.abs(radicand))
    apart = radicand >= 0.0
    roots = np.empty((3, *np.shape(root)), dtype=complex)
    real, imaginary = roots.real, roots.imag
    real[0], imaginary[0] = root, 0.0
    if apart.any():
        along = np.where(apart, spread, 0.0)
        real[1], real[2] = half + along, half - along
        spread = np.where(apart, 0.0, spread)
    else:
        real[1], real[2] = half, half
    imaginary[1], imaginary[2] = spread, -spread
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
