"""Roots of cubic polynomials, for arrays of them at once."""

from __future__ import annotations

import sys
from functools import cache
from math import inf, nan

import numpy as np

_SEARCH_STEPS, _POLISH_STEPS = 12, 3


def cubic_roots(coefficients: np.ndarray, near: np.ndarray) -> np.ndarray:
    """(..., 3) complex roots of s^3 + c2 s^2 + c1 s + c0 from (..., 3) real c2, c1, c0.

    The first root is the real one nearest to `near` (...); of the other two, the one with the
    larger imaginary or real part comes first. Newton's method from `near` finds a real root, from
    Cardano's where that fails; the quadratic that is left gives the others. Coefficients that are
    not finite give roots that are NaN.
    """
    coefficients = np.asarray(coefficients, dtype=float)
    shape = coefficients.shape[:-1]
    columns = np.ascontiguousarray(np.moveaxis(coefficients, -1, 0)).reshape(3, -1)
    hints = np.ascontiguousarray(np.broadcast_to(np.asarray(near, dtype=float), shape)).ravel()
    found = np.empty((3, hints.size), dtype=complex)
    _kernels().roots_of_all(columns, hints, found)
    return np.moveaxis(found.reshape(3, *shape), 0, -1)


@cache
def _kernels():
    from ..compilation.compiling import compiled

    return compiled(sys.modules[__name__], "cubic")


def roots_of_all(columns, near, found):
    """Fill found (3, n) from columns (3, n) and near (n,)."""
    for i in range(near.size):
        found[0, i], found[1, i], found[2, i] = _roots(
            columns[0, i], columns[1, i], columns[2, i], near[i]
        )


def _roots(c2, c1, c0, near):
    if not np.isfinite(c2 + c1 + c0):
        unknown = complex(nan, nan)
        return unknown, unknown, unknown
    root, settled = _search(c2, c1, c0, near)
    if not settled:
        root = _polished(c2, c1, c0, _real_root(c2, c1, c0))
    half = -0.5 * (c2 + root)
    radicand = half * half - (c1 - 2.0 * root * half)
    spread = np.sqrt(abs(radicand))
    if radicand < 0.0:
        return complex(root, 0.0), complex(half, spread), complex(half, -spread)
    first, second, third = _nearest_first(root, half + spread, half - spread, near)
    return complex(first, 0.0), complex(second, 0.0), complex(third, 0.0)


def _value_and_slope(c2, c1, c0, root):
    partial = root + c2
    factor = partial * root + c1
    return factor * root + c0, (partial + root) * root + factor


def _search(c2, c1, c0, root):
    """(root, settled): Newton's method on the polynomial itself."""
    for _ in range(_SEARCH_STEPS):
        value, slope = _value_and_slope(c2, c1, c0, root)
        step = value / slope if slope != 0.0 else (0.0 if value == 0.0 else inf)
        root -= step
        if abs(step) <= 1e-9 * abs(
            root
        ):  # convergence is quadratic: the next step would be below rounding
            return root, np.isfinite(root)
    return root, False


def _polished(c2, c1, c0, root):
    """The root after the steps of Newton's method that lower the polynomial's size; at a multiple
    root rounding makes others."""
    value, slope = _value_and_slope(c2, c1, c0, root)
    for _ in range(_POLISH_STEPS):
        better = root - value / slope
        better_value, better_slope = _value_and_slope(c2, c1, c0, better)
        if not abs(better_value) < abs(value):
            break
        root, value, slope = better, better_value, better_slope
    return root


def _nearest_first(root, larger, smaller, near):
    """Three real roots with the one nearest to `near` first, the others falling."""
    high, middle, low = larger, smaller, root
    if root >= larger:
        high, middle, low = root, larger, smaller
    elif root >= smaller:
        high, middle, low = larger, root, smaller
    to_high, to_middle, to_low = abs(high - near), abs(middle - near), abs(low - near)
    if to_high <= min(to_middle, to_low):
        return high, middle, low
    return (middle, high, low) if to_middle <= to_low else (low, high, middle)


def _real_root(c2, c1, c0):
    """Cardano's formula, trigonometric where all roots are real."""
    shift = c2 / 3.0
    p, q = c1 / 3.0 - shift * shift, shift**3 - shift * c1 / 2.0 + c0 / 2.0
    discriminant = q * q + p**3
    if discriminant > 0.0:
        u = np.cbrt(-q - np.sqrt(discriminant) if q >= 0.0 else -q + np.sqrt(discriminant))
        return u - p / u - shift
    if p >= 0.0:  # a triple root, or so nearly that its powers vanish
        return -shift
    radius = np.sqrt(-p)
    cosine = -q / radius**3
    return 2.0 * radius * np.cos(np.arccos(min(max(cosine, -1.0), 1.0)) / 3.0) - shift
