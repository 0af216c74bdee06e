"""v/x(s) = (n1 s + n0)/(s^3 + d2 s^2 + d1 s + d0) from the entries of A and b, for one model or for
arrays of them."""

from __future__ import annotations

import sys
from functools import cache

import numpy as np


def coefficients(A: np.ndarray, B: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Numerator (..., 2): n1, n0, and denominator (..., 4): 1, d2, d1, d0, from A (..., 3, 3) and B
    (..., 3, 1)."""
    shape = A.shape[:-2]
    a = np.ascontiguousarray(np.moveaxis(A, (-2, -1), (0, 1))).reshape(3, 3, -1)
    b = np.ascontiguousarray(np.moveaxis(B[..., 0], -1, 0)).reshape(3, -1)
    numerator, denominator = np.empty((2, *shape)), np.empty((4, *shape))
    denominator[0] = 1.0
    _kernels().coefficients_of_all(a, b, numerator.reshape(2, -1), denominator.reshape(4, -1))
    return np.moveaxis(numerator, 0, -1), np.moveaxis(denominator, 0, -1)


@cache
def _kernels():
    from ..compilation.compiling import compiled

    return compiled(sys.modules[__name__], "transfer_function")


def coefficients_of_all(a, b, numerator, denominator):
    """Fill numerator (2, n) and all but the first row of denominator (4, n) from a (3, 3, n) and b
    (3, n)."""
    for i in range(a.shape[2]):
        numerator[0, i] = a[2, 0, i] * b[0, i] + a[2, 1, i] * b[1, i]
        numerator[1, i] = a[2, 0, i] * (a[0, 1, i] * b[1, i] - a[1, 1, i] * b[0, i]) + a[
            2, 1, i
        ] * (a[1, 0, i] * b[0, i] - a[0, 0, i] * b[1, i])
        minor_a = a[1, 1, i] * a[2, 2, i] - a[1, 2, i] * a[2, 1, i]
        minor_b = a[0, 0, i] * a[2, 2, i] - a[0, 2, i] * a[2, 0, i]
        minor_v = a[0, 0, i] * a[1, 1, i] - a[0, 1, i] * a[1, 0, i]
        denominator[1, i] = -(a[0, 0, i] + a[1, 1, i] + a[2, 2, i])
        denominator[2, i] = minor_a + minor_b + minor_v
        denominator[3, i] = (
            a[0, 1, i] * (a[1, 0, i] * a[2, 2, i] - a[1, 2, i] * a[2, 0, i])
            - a[0, 2, i] * (a[1, 0, i] * a[2, 1, i] - a[1, 1, i] * a[2, 0, i])
            - a[0, 0, i] * minor_a
        )
