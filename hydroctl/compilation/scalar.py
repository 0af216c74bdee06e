"""The numpy names that compiled equations use, for single numbers and free of branches.

In compiled code these take the place of numpy: `numpy.where` of three numbers would make an array
on every call there, and a library call for the tangent would keep a loop over lanes from becoming
vector code.
"""

from __future__ import annotations

from numba import njit
from numpy import abs, arccos, cbrt, ceil, cos, floor, isfinite, sqrt

__all__ = [
    "abs",
    "arccos",
    "cbrt",
    "ceil",
    "copysign",
    "cos",
    "floor",
    "isfinite",
    "maximum",
    "minimum",
    "real",
    "signed_root",
    "sqrt",
    "tan",
    "where",
]


@njit(error_model="numpy", forceinline=True)
def where(condition, yes, no):
    """`yes` where the condition holds, else `no`."""
    return yes if condition else no


@njit(error_model="numpy", forceinline=True)
def copysign(size, sign):
    """|size| with the sign of `sign`; a zero of either sign counts as positive."""
    return abs(size) if sign >= 0.0 else -abs(size)


@njit(error_model="numpy", forceinline=True)
def maximum(one, other):
    """The larger number."""
    return one if one > other else other


@njit(error_model="numpy", forceinline=True)
def minimum(one, other):
    """The smaller number."""
    return one if one < other else other


@njit(error_model="numpy", forceinline=True)
def real(value):
    """The number itself: compiled code is real."""
    return value


@njit(error_model="numpy", forceinline=True)
def tan(angle):
    """tan(angle) for |angle| < pi/2.

    Lambert's continued fraction z/(1 - z^2/(3 - z^2/(5 - ...))) at z = angle/2, cut after 17 where
    it has reached the rounding error for |z| <= pi/4, then the formula for the double angle.
    """
    half = 0.5 * angle
    s = half * half
    p, q = 255.0 - s, 17.0
    p, q = 13.0 * p - s * q, p
    p, q = 11.0 * p - s * q, p
    p, q = 9.0 * p - s * q, p
    p, q = 7.0 * p - s * q, p
    p, q = 5.0 * p - s * q, p
    p, q = 3.0 * p - s * q, p
    p, q = p - s * q, half * p
    return 2.0 * p * q / (p * p - q * q)


@njit(error_model="numpy", forceinline=True)
def signed_root(dp):
    """`plant.signed_root` for real numbers, to the last bit, without its products."""
    return copysign(sqrt(abs(dp)), dp)
