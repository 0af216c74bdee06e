"""The recursion of `second_order`, compiled. Imported where it is used, because numba loads
slowly."""

from __future__ import annotations

import numpy as np
from numba import njit


@njit(cache=True)
def run(p: np.ndarray, goals: np.ndarray, initial: np.ndarray) -> np.ndarray:
    """(n + 1, 2, m): z[k + 1] = g + P (z[k] - g) with g = (goals[k], 0), from P (n, 2, 2), goals
    (n, m) and z[0] (2, m)."""
    n, m = goals.shape
    z = np.empty((n + 1, 2, m))
    z[0] = initial
    for k in range(n):
        p00, p01, p10, p11 = p[k, 0, 0], p[k, 0, 1], p[k, 1, 0], p[k, 1, 1]
        for j in range(m):
            away = z[k, 0, j] - goals[k, j]
            z[k + 1, 0, j] = goals[k, j] + p00 * away + p01 * z[k, 1, j]
            z[k + 1, 1, j] = p10 * away + p11 * z[k, 1, j]
    return z
