"""The two ways to estimate the coefficients of equation (3) from a record; `identification` says
what they are for.

"least-squares" takes numerical derivatives of v. It is badly biased, with noise and even without,
because differences over a sample are not derivatives.

"srivc" is the simplified refined instrumental variable method for continuous time (P. C. Young,
Recursive Estimation and Time-Series Analysis, Springer 2011; for coefficients that vary with
measured signals V. Laurain et al., Automatica 46 (2010) 959) in its symmetric form: with v^ the
speed that the present model answers to x,

    z_i = -A^-1 (phi_i v^'),  -A^-1 (phi_i v^),  A^-1 (phi_i x),  A^-1 phi_i

    for the terms phi_i of a1, a2, b, c
    theta <- theta + (Z'Z)^-1 Z' (v - v^)

A^-1 filters by the model itself, with its varying coefficients. Regressors and instruments are free
of noise, derivatives come from the filter, and where the iteration rests Z'(v - v^) = 0. White
noise on v leaves it unbiased, in closed loop too, where x[k] depends on earlier v only. The
covariance is sigma^2 (Z'Z)^-1.

The iteration starts from one constant model for both signs of x, found by instrumental variables
with a state-variable filter 1/(s + lambda)^2, for the best of several lambda.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..quasi_linear.bases import COEFFICIENTS, Basis
from ..quasi_linear.model import SIDES
from ..quasi_linear.second_order import respond
from .records import Record

MOST_ITERATIONS = 40
_SETTLED = 1e-8
_HALVINGS = 8
_BANDWIDTHS = np.geomspace(0.03, 1.5, 7)
"""of the state-variable filter, times the sample rate"""
_LEAST_DAMPING = 0.1
_SINGULAR = 1e9


@dataclass(frozen=True, eq=False)
class Regression:
    """The estimation problem on one record: the terms of every coefficient at every step, zero
    outside their side."""

    record: Record
    basis: Basis
    sides: tuple[str, ...]
    terms: Mapping[str, np.ndarray]
    """by coefficient: (n - 1, all sides' terms)"""
    counts: np.ndarray
    """(n,) bool: the samples whose error counts"""

    @property
    def h(self) -> np.ndarray:
        """(n - 1,): the length of each step in s."""
        return np.full(len(self.record.t) - 1, self.record.sample_time)

    @property
    def x(self) -> np.ndarray:
        """(n - 1,): the opening of each step."""
        return self.record.x[:-1]

    def columns(self, name: str) -> slice:
        """Where the parameters of a coefficient stand in theta."""
        start = sum(
            self.terms[other].shape[1] for other in COEFFICIENTS[: COEFFICIENTS.index(name)]
        )
        return slice(start, start + self.terms[name].shape[1])

    @property
    def names(self) -> tuple[str, ...]:
        """What each entry of theta multiplies: side, coefficient and term."""
        labels = {name: _labels(self.basis, name) for name in COEFFICIENTS}
        return tuple(
            f"{side} {name} {label}"
            for name in COEFFICIENTS
            for side in self.sides
            for label in labels[name]
        )

    def rows(self, side: str, name: str) -> list[int]:
        """Where the parameters of one coefficient on one side stand in theta."""
        return [k for k, label in enumerate(self.names) if label.split()[:2] == [side, name]]

    def coefficients(self, theta: np.ndarray) -> list[np.ndarray]:
        """a1, a2, b and c of every step."""
        return [self.terms[name] @ theta[self.columns(name)] for name in COEFFICIENTS]

    def simulate(self, theta: np.ndarray, initial: np.ndarray) -> np.ndarray | None:
        """(n, 2): v^ and its derivative; None where the model is not stable at every step."""
        a1, a2, b, c = self.coefficients(theta)
        if min(a1.min(), a2.min()) <= 0.0:
            return None
        answer = respond(a1, a2, self.h, (b * self.x + c)[:, None], initial[:, None])[..., 0]
        return answer if np.isfinite(answer).all() else None

    def cost(self, answer: np.ndarray) -> float:
        """Sum of (v - v^)^2 over the samples that count."""
        return float(np.sum((self.record.v - answer[:, 0])[self.counts] ** 2))

    def instruments(self, theta: np.ndarray, answer: np.ndarray) -> np.ndarray:
        """(samples that count, p + 2): z_i for every parameter, then for the initial v and v'."""
        a1, a2, _, _ = self.coefficients(theta)
        v, dv = ((answer[1:] + answer[:-1]) / 2.0).T
        driving = {"a1": -dv, "a2": -v, "b": self.x, "offset": np.ones_like(v)}
        forcing = np.hstack(
            [self.terms[name] * driving[name][:, None] for name in COEFFICIENTS]
            + [np.zeros((len(v), 2))]
        )
        initial = np.zeros((2, forcing.shape[1]))
        initial[:, -2:] = np.eye(2)
        return respond(a1, a2, self.h, forcing, initial)[self.counts, 0]


def regression(record: Record, basis: Basis, settling: float) -> Regression:
    """The problem of a record; x = 0 belongs to the side before it. InputError where too few
    samples count."""
    x = record.x[:-1]
    y = np.zeros_like(x) if record.y is None else (record.y[1:] + record.y[:-1]) / 2.0
    turning = np.maximum.accumulate(np.where(x != 0.0, np.arange(len(x)), -1))
    sign = np.sign(x[np.where(turning >= 0, turning, np.argmax(x != 0.0))])
    sides = tuple(side for side, value in SIDES.items() if (sign == value).any())
    opening = np.where(x == 0.0, sign * np.min(np.abs(x[x != 0.0])), x)
    terms = {}
    for name in COEFFICIENTS:
        values = basis.terms(name, opening, y)
        values = values[:, basis.separable_offset()] if name == "offset" else values
        terms[name] = np.hstack([values * (sign == SIDES[side])[:, None] for side in sides])
    opened = np.concatenate([[0.0], np.cumsum(np.abs(x)) * record.sample_time])
    turned = np.concatenate([[True], np.diff(sign) != 0.0, [False]])
    counts = opened - np.maximum.accumulate(np.where(turned, opened, 0.0)) >= settling
    if np.sum(counts) < len(x) / 10:
        left = f"{np.sum(counts)} of {len(counts)} samples"
        raise InputError(
            f"settling = {settling:g} s leaves {left}; lower it or reverse less often."
        )
    return Regression(record, basis, sides, terms, counts)


def _labels(basis: Basis, name: str) -> list[str]:
    """The terms of a coefficient that a measured response can determine."""
    labels = basis.labels(name)
    return [labels[k] for k in basis.separable_offset()] if name == "offset" else labels


def _solve(
    regressors: np.ndarray,
    right: np.ndarray,
    names: tuple[str, ...],
    instruments: np.ndarray | None = None,
) -> tuple:
    """(theta, (Z'Z)^-1) of the least-squares problem, or with instruments of Z' (right - regressors
    theta) = 0."""
    z = regressors if instruments is None else instruments
    length = np.linalg.norm(z, axis=0)
    length = np.where(length == 0.0, 1.0, length)
    normal = z.T @ regressors / np.outer(length, length)
    _, singular, weights = np.linalg.svd(normal)
    if singular[-1] * _SINGULAR < singular[0] or not np.isfinite(singular).all():
        weakest = names[int(np.argmax(np.abs(weights[-1])))] if names else "the start"
        raise InputError(
            f"the record does not determine the basis: it says nothing about the term {weakest!r}"
            " apart from the others. Excite more of x and y, or take basis='constant'."
        )
    inverse = np.linalg.inv(normal)
    return inverse @ (z.T @ right / length) / length, inverse / np.outer(length, length)


def least_squares(problem: Regression) -> tuple[np.ndarray, np.ndarray]:
    """(theta, covariance) from central differences of v, the opening of the steps before and after
    averaged."""
    h, v = problem.record.sample_time, problem.record.v
    first, second = (v[2:] - v[:-2]) / (2.0 * h), (v[2:] - 2.0 * v[1:-1] + v[:-2]) / h**2
    x = (problem.x[1:] + problem.x[:-1]) / 2.0
    driving = {"a1": -first, "a2": -v[1:-1], "b": x, "offset": np.ones_like(x)}
    regressors = np.hstack(
        [problem.terms[name][1:] * driving[name][:, None] for name in COEFFICIENTS]
    )
    regressors, second = regressors[problem.counts[1:-1]], second[problem.counts[1:-1]]
    theta, inverse = _solve(regressors, second, problem.names)
    variance = np.sum((second - regressors @ theta) ** 2) / (len(second) - len(theta))
    return theta, variance * inverse


def start(problem: Regression) -> tuple[np.ndarray, np.ndarray]:
    """(theta, initial state) of the best constant model: a1 and a2 common to both sides, b and c of
    each."""
    candidates = []
    for bandwidth in _BANDWIDTHS / problem.record.sample_time:
        try:
            constants = _state_variable_filter(problem, bandwidth)
        except InputError:
            continue
        theta = _embed(problem, constants)
        initial = np.array([problem.record.v[0], 0.0])
        answer = problem.simulate(theta, initial)
        if answer is not None:
            candidates.append((problem.cost(answer), theta, initial))
    if not candidates:
        raise InputError(
            "no second-order model with a positive a2 starts the identification. Check the order of"
            " the columns, take at least ten samples for each period of the natural frequency, or"
            " excite x more."
        )
    return min(candidates, key=lambda candidate: candidate[0])[1:]


def _embed(problem: Regression, constants: np.ndarray) -> np.ndarray:
    """theta with only the constant terms, from a1, a2 and then b and c of each side."""
    theta = np.zeros(len(problem.names))
    free = "offset 1" if problem.basis.separable_offset() else "b 1/x"
    for k, side in enumerate(problem.sides):
        labels = ("a1 1", "a2 1", "b 1", free)
        for label, value in zip(
            labels, (*constants[:2], *constants[2 + 2 * k : 4 + 2 * k]), strict=True
        ):
            theta[problem.names.index(f"{side} {label}")] = value
    return theta


def _state_variable_filter(problem: Regression, bandwidth: float) -> np.ndarray:
    """a1, a2, then b and c of each side: least squares on filtered signals, then once more with
    instruments from that model."""
    on = [
        problem.terms["b"][:, k * len(problem.basis.labels("b"))] for k in range(len(problem.sides))
    ]
    inputs = np.stack([column for side in on for column in (side * problem.x, side)], axis=1)
    v, counts = problem.record.v, problem.counts
    low, high = _filtered(problem, v, inputs, bandwidth)
    second = (v - 2.0 * bandwidth * high[:, 0] - bandwidth**2 * low[:, 0])[counts]
    regressors = np.column_stack([-high[:, 0], -low[:, 0], low[:, 1:]])[counts]
    constants = _damped(_solve(regressors, second, ())[0])
    answer = problem.simulate(_embed(problem, constants), np.array([v[0], 0.0]))
    if answer is None:
        return constants
    clean, slope = _filtered(problem, answer[:, 0], inputs, bandwidth)
    instruments = np.column_stack([-slope[:, 0], -clean[:, 0], clean[:, 1:]])[counts]
    return _damped(_solve(regressors, second, (), instruments)[0])


def _filtered(
    problem: Regression, v: np.ndarray, inputs: np.ndarray, bandwidth: float
) -> tuple[np.ndarray, np.ndarray]:
    """v (n,), averaged over each step, and the inputs (n - 1, m) behind 1/(s + bandwidth)^2: (n, 1
    + m) values and derivatives."""
    forcing = np.column_stack([(v[1:] + v[:-1]) / 2.0, inputs])
    a1, a2 = np.full(len(forcing), 2.0 * bandwidth), np.full(len(forcing), bandwidth**2)
    answer = respond(
        a1,
        a2,
        problem.h,
        forcing,
        np.stack([forcing[0] / bandwidth**2, np.zeros(forcing.shape[1])]),
    )
    return answer[:, 0], answer[:, 1]


def _damped(constants: np.ndarray) -> np.ndarray:
    """The same start with the damping of a stable model, where noise has turned a small one
    negative."""
    return np.concatenate(
        [[max(constants[0], _LEAST_DAMPING * np.sqrt(max(constants[1], 0.0)))], constants[1:]]
    )


def refine(problem: Regression, theta: np.ndarray, initial: np.ndarray, progress) -> tuple:
    """(theta, initial state, covariance, iterations): the iteration of the module's text, its steps
    halved where the fit falls."""
    v, p, counts = problem.record.v, len(theta), problem.counts
    names = (*problem.names, "initial v", "initial v'")
    free = len(names) if counts[0] else p
    unknown, answer = np.concatenate([theta, initial]), problem.simulate(theta, initial)
    assert answer is not None  # a start has one
    for iteration in range(1, MOST_ITERATIONS + 1):
        cost = problem.cost(answer)
        step, inverse = _solve(
            problem.instruments(unknown[:p], answer)[:, :free], (v - answer[:, 0])[counts], names
        )
        promised = step @ np.linalg.solve(inverse, step)
        for shorter in 0.5 ** np.arange(_HALVINGS):
            trial = unknown.copy()
            trial[:free] += shorter * step
            tried = problem.simulate(trial[:p], trial[p:])
            if tried is not None and problem.cost(tried) <= cost:
                break
        else:
            break
        unknown, answer = trial, tried
        if progress is not None:
            progress(iteration, fit_in_per_cent(v[counts], answer[counts, 0]))
        if promised <= _SETTLED * cost:
            break
    _, inverse = _solve(problem.instruments(unknown[:p], answer)[:, :free], v[counts], names)
    variance = problem.cost(answer) / (np.sum(counts) - free)
    return unknown[:p], unknown[p:], variance * inverse[:p, :p], iteration


def fit_in_per_cent(v: np.ndarray, model: np.ndarray) -> float:
    """100 (1 - |v - model| / |v - mean v|); NaN for less than two samples."""
    return (
        float(100.0 * (1.0 - np.linalg.norm(v - model) / np.linalg.norm(v - v.mean())))
        if len(v) > 1
        else np.nan
    )
