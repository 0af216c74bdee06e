"""v'' + a1 v' + a2 v = f with coefficients that change from step to step and are constant within
each: solved exactly.

Over a step of length h the state (v, v') moves by z -> P z + (I - P) (f/a2, 0) with P = exp(M h), M
= [[0, 1], [-a2, -a1]]. With mu = -a1/2 and r = sqrt(mu^2 - a2) (imaginary below critical damping),
P = e^(mu h) (cosh(r h) I + sinh(r h)/r (M - mu I)). Any number of forcings run at once.
"""

from __future__ import annotations

import numpy as np


def transition(a1: np.ndarray, a2: np.ndarray, h: np.ndarray) -> np.ndarray:
    """(n, 2, 2): P of each of n steps of length h (s)."""
    mu = -a1 / 2.0
    r = np.sqrt((mu * mu - a2).astype(complex))
    slow, fast = np.exp((mu + r) * h), np.exp((mu - r) * h)
    critical = np.abs(r * h) < 1e-6
    cosh = (slow + fast).real / 2.0
    ratio = np.where(
        critical, h * slow.real, ((slow - fast) / np.where(critical, 1.0, 2.0 * r)).real
    )
    p = np.empty((len(mu), 2, 2))
    p[:, 0, 0], p[:, 0, 1] = cosh - mu * ratio, ratio
    p[:, 1, 0], p[:, 1, 1] = -a2 * ratio, cosh - (a1 + mu) * ratio
    return p


def respond(
    a1: np.ndarray, a2: np.ndarray, h: np.ndarray, forcing: np.ndarray, initial: np.ndarray
) -> np.ndarray:
    """(n + 1, 2, m): v and v' at the ends of n steps for m forcings f (n, m), each constant within
    a step, from (2, m)."""
    from .recursion import run

    return run(
        transition(a1, a2, h), forcing / a2[:, None], np.ascontiguousarray(initial, dtype=float)
    )
