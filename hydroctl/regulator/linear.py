"""What the steps of the law come to where nothing is limited: linear blocks, and their transfer
functions.

A step is linear in its input and in what it remembers, so that its values at unit inputs and unit
memories are the block:  out = C s + D u,  s[k+1] = A s + B u.
"""

from __future__ import annotations

import operator
from collections.abc import Callable, Iterable
from functools import cache, reduce
from types import SimpleNamespace
from typing import NamedTuple

import numpy as np

from . import pid
from .law import AT_REST, STRUCTURES

_ROUNDING = 1e-14
_ONE = np.ones(())


class Block(NamedTuple):
    """A (..., n, n), B (..., n, 1), C (..., 1, n), D (..., 1, 1)."""

    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray


class Ratio(NamedTuple):
    """gain times numerator over denominator, each coefficients (...) in falling powers of z, powers
    above the numerator's left out."""

    numerator: list
    denominator: list
    gain: float = 1.0

    def at(self, z: np.ndarray) -> np.ndarray:
        """Its values (..., n) at z (..., n) or (n,)."""
        return self.gain * (_polynomial(self.numerator, z) / _polynomial(self.denominator, z))


def _polynomial(coefficients: list, z: np.ndarray) -> np.ndarray:
    value = coefficients[0][..., None]
    for coefficient in coefficients[1:]:
        value = value * z + coefficient[..., None]
    return value


def entries_of(step: Callable, states: int, leading: int) -> np.ndarray:
    """((D, C), (B, A)) of step(u, s) -> (out, new s) as rows and columns (n + 1, n + 1, ...), where
    s holds n = `states` numbers and the step broadcasts over so many leading axes."""
    units = np.eye(states + 1).reshape(states + 1, states + 1, *[1] * leading)
    out, new = step(units[0], units[1:])
    return np.array([out, *new])


def block_of(entries: np.ndarray) -> Block:
    """The same as matrices over the leading axes."""
    matrix = np.moveaxis(entries, (0, 1), (-2, -1))
    return Block(matrix[..., 1:, 1:], matrix[..., 1:, :1], matrix[..., :1, 1:], matrix[..., :1, :1])


def ratio_of(entries: np.ndarray) -> Ratio:
    """Its transfer function, by Leverrier's rule."""
    (D, *C), *rows = entries
    B, A = [row[0] for row in rows], [row[1:] for row in rows]
    places = range(len(A))
    denominator, numerator = [_ONE], [D]
    moved, acting = A, B
    for k in range(1, len(A) + 1):
        c = _sum(moved[i][i] for i in places) / -k
        denominator.append(c)
        numerator.append(D * c + _sum(C[i] * acting[i] for i in places))
        if k < len(A):
            M = [[moved[i][j] + c if i == j else moved[i][j] for j in places] for i in places]
            moved = [[_sum(A[i][m] * M[m][j] for m in places) for j in places] for i in places]
            acting = [_sum(M[i][j] * B[j] for j in places) for i in places]
    return Ratio(numerator, denominator)


def _sum(parts: Iterable):
    return reduce(operator.add, parts)


def _reduced(ratio: Ratio) -> Ratio:
    """The ratio without factors z that cancel, up to rounding, and with 1 as its first
    coefficients."""
    b, a = (np.array(part) for part in ratio[:2])
    b[np.abs(b) <= _ROUNDING * np.abs(b).max()] = 0.0
    a[np.abs(a) <= _ROUNDING * np.abs(a).max()] = 0.0
    last = max(np.flatnonzero(b)[-1], np.flatnonzero(a)[-1]) + 1
    first = np.flatnonzero(b)[0]
    return Ratio(list(b[first:last] / b[first]), list(a[:last]), float(b[first]))


@cache
def term(name: str, Ts: float, Tf: float) -> Ratio:
    """What the gain `name` multiplies: 1 for kp, the integral for ki, the derivative for kd."""
    regulator = SimpleNamespace(
        Ts=Ts, Tf=Tf, b=1.0, c=1.0, integrates=True, derives=True, tracking_rate=0.0
    )
    kp, ki, kd = (float(name == gain) for gain in ("kp", "ki", "kd"))

    def step(e, s):
        memory = AT_REST._replace(integral=s[0], derivative=s[1], last=s[2], running=1.0)
        derivative, last = pid.differentiate(e, 0.0, 0.0, memory, regulator)
        u = pid.combine(e, 0.0, derivative, kp, kd, memory, regulator)
        integral = pid.integrate(e, 0.0, ki, memory, regulator)
        return u, (integral, derivative, last)

    return _reduced(ratio_of(_acting(entries_of(step, 3, 0))))


def _acting(entries: np.ndarray) -> np.ndarray:
    """The entries without states that the input does not reach, or that do not reach the output."""
    A, B, C, _ = block_of(entries)
    powers = [np.linalg.matrix_power(A, k) for k in range(len(A))]
    reached = np.any([power @ B for power in powers], axis=0)[:, 0]
    seen = np.any([C @ power for power in powers], axis=0)[0]
    kept = [0, *(1 + np.flatnonzero(reached & seen))]
    return entries[np.ix_(kept, kept)]


def filters(wn: np.ndarray, regulator) -> list[np.ndarray]:
    """The entries of the blocks after the terms that are in use: sections, notch, filter of the
    measurement. wn (...); regulator: anything with their settings, and Ts."""
    w = np.tan(0.5 * np.asarray(wn, dtype=float) * regulator.Ts)
    return [
        entries_of(step, states, w.ndim)
        for structure in STRUCTURES
        if hasattr(structure, "blocks")
        for step, states in structure.blocks(w, regulator)
    ]


def block_of_ratio(ratio: Ratio, gain: np.ndarray) -> Block:
    """A gain (...) times a ratio without leading axes, with the gain at the input."""
    b, a = (np.ravel(part) for part in (ratio.numerator, ratio.denominator))
    n = a.size - 1
    b = ratio.gain * np.concatenate([np.zeros(a.size - b.size), b])
    A = np.eye(n, k=-1)
    A[:1] = -a[1:]
    B = np.eye(n, 1) * gain[..., None, None]
    C = (b[1:] - b[0] * a[1:])[None]
    shape = gain.shape
    return Block(
        np.broadcast_to(A, (*shape, n, n)),
        B,
        np.broadcast_to(C, (*shape, 1, n)),
        b[0] * gain[..., None, None],
    )


def parallel(blocks: list[Block], shape: tuple[int, ...]) -> Block:
    """The sum of blocks over `shape` with the same input."""
    n = sum(block.A.shape[-1] for block in blocks)
    A, B, C, D = (np.zeros((*shape, *size)) for size in ((n, n), (n, 1), (1, n), (1, 1)))
    first = 0
    for block in blocks:
        own = slice(first, first + block.A.shape[-1])
        A[..., own, own], B[..., own, :], C[..., own] = block.A, block.B, block.C
        D, first = D + block.D, own.stop
    return Block(A, B, C, D)


def series(first, second) -> Block:
    """`second` after `first`, each (A, B, C, D) with leading axes that broadcast."""
    (A1, B1, C1, D1), (A2, B2, C2, D2) = first, second
    n1, n2 = A1.shape[-1], A2.shape[-1]
    shape = np.broadcast_shapes(A1.shape[:-2], A2.shape[:-2])
    A = np.zeros((*shape, n1 + n2, n1 + n2))
    A[..., :n1, :n1], A[..., n1:, n1:], A[..., n1:, :n1] = A1, A2, B2 @ C1
    B = np.concatenate(
        [np.broadcast_to(B1, (*shape, n1, 1)), np.broadcast_to(B2 @ D1, (*shape, n2, 1))], axis=-2
    )
    C = np.concatenate(
        [np.broadcast_to(D2 @ C1, (*shape, 1, n1)), np.broadcast_to(C2, (*shape, 1, n2))], axis=-1
    )
    return Block(A, B, C, D2 @ D1)
