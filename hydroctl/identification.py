"""Equation (3) of the source paper from measurements: `identify` finds the coefficient surfaces of the quasi-linear model.

The model v'' + a1 v' + a2 v = b x + c is linear in the coefficients of a1, a2, b and c, which invites least squares on numerical
derivatives, as the paper proposes ("least-squares"). That is badly biased, with noise and even without, because differences
over a sample are not derivatives. "srivc" is the simplified refined instrumental variable method for continuous time (P. C.
Young, Recursive Estimation and Time-Series Analysis, Springer 2011; for coefficients that vary with measured signals
V. Laurain et al., Automatica 46 (2010) 959) in its symmetric form: with v^ the speed that the present model answers to x,

    z_i = -A^-1 (phi_i v^'),  -A^-1 (phi_i v^),  A^-1 (phi_i x),  A^-1 phi_i       for the terms phi_i of a1, a2, b, c
    theta <- theta + (Z'Z)^-1 Z' (v - v^)

A^-1 filters by the model itself, with its varying coefficients. Regressors and instruments are free of noise, derivatives come
from the filter, and where the iteration rests Z'(v - v^) = 0. White noise on v leaves it unbiased, in closed loop too, where
x[k] depends on earlier v only. The covariance is sigma^2 (Z'Z)^-1.

The iteration starts from one constant model for both signs of x, found by instrumental variables with a state-variable filter
1/(s + lambda)^2, for the best of several lambda.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from .actuator import Actuator
from .bases import COEFFICIENTS, Basis
from .errors import InputError, unknown_name
from .quasi_linear import SIDES, QuasiLinearModel, Surface
from .records import Record
from .region import Region
from .second_order import respond

_METHODS = ("srivc", "least-squares")
_ITERATIONS = 40
_SETTLED = 1e-8
_HALVINGS = 8
_BANDWIDTHS = np.geomspace(0.03, 1.5, 9)
"""of the state-variable filter, times the sample rate in rad/s per rad"""
_LEAST_DAMPING = 0.1
_SINGULAR = 1e9
_NOISE_ORDER = 8
_CELLS = 8
_VISITS = 20
_CLAIM = 0.01
"""largest relative standard deviation of a1, a2 and b in a cell of the mask"""


@dataclass(frozen=True)
class Fit:
    """100 (1 - |v - v^| / |v - mean v|) in per cent: 100 is perfect, 0 no better than the mean. NaN without a hold-out part.

    Over the samples that count (see `settling` in `identify`).
    """

    estimation: float
    """free run of the model over the part it was identified from"""
    hold_out: float
    """free run over the part that was held out"""
    one_step: float
    """prediction one sample ahead over the held-out part, with an autoregressive model of what the free run leaves"""


@dataclass(frozen=True, eq=False)
class Identification:
    """What `identify` found. `model` may be used where `masks` says so; `restrictions` says what the record could not show."""

    model: QuasiLinearModel
    method: str
    parameters: np.ndarray
    """(p,): all coefficients in the order of `names`"""
    names: tuple[str, ...]
    """(p,): side, coefficient and term"""
    covariance: np.ndarray
    """(p, p)"""
    noise: float
    """m/s: standard deviation of v - v^ over the estimation part"""
    fit: Fit
    masks: Mapping[str, Region]
    """by side: the cells of (x, y) that the record visits and in which a1, a2 and b have a standard deviation of at most 1 %"""
    restrictions: tuple[str, ...]
    iterations: int

    def standard_deviation(self, x: float, y: float = 0.0) -> tuple[float, float, float]:
        """Of a1, a2 and b at one point, by the covariance."""
        side = "-" if x < 0.0 else "+"
        variances = []
        for name in COEFFICIENTS[:3]:
            rows = [k for k, label in enumerate(self.names) if label.split()[:2] == [side, name]]
            terms = self.model.basis.terms(name, x, y)
            variances.append(float(terms @ self.covariance[np.ix_(rows, rows)] @ terms))
        return tuple(np.sqrt(variances))


@dataclass(frozen=True, eq=False)
class _Regression:
    """The estimation problem on one record: the terms of every coefficient at every step, zero outside their side."""

    record: Record
    basis: Basis
    sides: tuple[str, ...]
    terms: Mapping[str, np.ndarray]
    """by coefficient: (n - 1, all sides' terms)"""
    counts: np.ndarray
    """(n,) bool: the samples whose error counts"""

    @property
    def h(self) -> np.ndarray:
        return np.full(len(self.record.t) - 1, self.record.sample_time)

    @property
    def x(self) -> np.ndarray:
        """(n - 1,): the opening of each step."""
        return self.record.x[:-1]

    def columns(self, name: str) -> slice:
        """Where the parameters of a coefficient stand in theta."""
        start = sum(self.terms[other].shape[1] for other in COEFFICIENTS[: COEFFICIENTS.index(name)])
        return slice(start, start + self.terms[name].shape[1])

    @property
    def names(self) -> tuple[str, ...]:
        labels = {name: _labels(self.basis, name) for name in COEFFICIENTS}
        return tuple(f"{side} {name} {label}" for name in COEFFICIENTS for side in self.sides for label in labels[name])

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
        forcing = np.hstack([self.terms[name] * driving[name][:, None] for name in COEFFICIENTS] + [np.zeros((len(v), 2))])
        initial = np.zeros((2, forcing.shape[1]))
        initial[:, -2:] = np.eye(2)
        return respond(a1, a2, self.h, forcing, initial)[self.counts, 0]


def identify(
    t,
    x,
    v,
    y=None,
    *,
    basis: str = "volume",
    actuator: Actuator | None = None,
    method: Literal["srivc", "least-squares"] = "srivc",
    hold_out: float = 0.25,
    settling: float = 0.0,
    progress: Callable[[int, float], None] | None = None,
) -> Identification:
    """The quasi-linear model that best answers a measured opening x with the measured speed v, each sign of x apart.

    t, x, v, y (n,) are a `Record` (s, -, m/s, m). The bases with volumes need the `actuator`, of which only areas and volumes
    count; y may be left out with basis "constant". The last `hold_out` (0 to 0.9) of the record is not used to identify, but to
    check. Samples with x = 0 belong to the side before them. After the start and after every reversal the pressures creep to those
    of the other direction, and the gain with them, which the second order does not know: samples count only once the integral of
    |x| dt has passed `settling` (s at full opening). `progress` is called with the iteration and the fit in per cent.
    Raises InputError for a record or arguments that cannot be used, or a record that does not determine the basis.
    """
    record = Record(t, x, v, y)
    faults = [] if method in _METHODS else [unknown_name("method", method, _METHODS)]
    if not 0.0 <= hold_out <= 0.9:
        faults.append(f"hold_out = {hold_out} must be between 0 and 0.9; it is the part of the record kept for checking.")
    if not 0.0 <= settling < np.inf:
        faults.append(f"settling = {settling} must be a time in s, at full opening, of at least 0.")
    if record.y is None and basis != "constant":
        faults.append(f"basis = {basis!r} needs the position y; give it, or take basis='constant'.")
    if faults:
        raise InputError(faults)
    chosen, used = Basis(basis, actuator), round((1.0 - hold_out) * len(record.t))
    whole, part = (_regression(_first(record, n), chosen, settling) for n in (len(record.t), used))
    if part.sides != whole.sides:
        missing = next(side for side in whole.sides if side not in part.sides)
        raise InputError(f"side {missing!r} appears only in the held-out part; lower hold_out or record more of it.")
    if method == "least-squares":
        theta, covariance, iterations = *_least_squares(part), 1
        initial = np.array([record.v[0], 0.0])
    else:
        theta, initial, covariance, iterations = _refine(part, *_start(part), progress)
    return _result(whole, part, method, theta, initial, covariance, iterations)


def _first(record: Record, n: int) -> Record:
    return Record(record.t[:n], record.x[:n], record.v[:n], None if record.y is None else record.y[:n])


def _regression(record: Record, basis: Basis, settling: float) -> _Regression:
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
        raise InputError(f"settling = {settling:g} s leaves {left}; lower it or reverse less often.")
    return _Regression(record, basis, sides, terms, counts)


def _labels(basis: Basis, name: str) -> list[str]:
    """The terms of a coefficient that a measured response can determine."""
    labels = basis.labels(name)
    return [labels[k] for k in basis.separable_offset()] if name == "offset" else labels


def _solve(regressors: np.ndarray, right: np.ndarray, names: tuple[str, ...], instruments: np.ndarray | None = None) -> tuple:
    """(theta, (Z'Z)^-1) of the least-squares problem, or with instruments of Z' (right - regressors theta) = 0."""
    z = regressors if instruments is None else instruments
    length = np.linalg.norm(z, axis=0)
    length = np.where(length == 0.0, 1.0, length)
    normal = z.T @ regressors / np.outer(length, length)
    _, singular, weights = np.linalg.svd(normal)
    if singular[-1] * _SINGULAR < singular[0] or not np.isfinite(singular).all():
        weakest = names[int(np.argmax(np.abs(weights[-1])))] if names else "the start"
        raise InputError(
            f"the record does not determine the basis: it says nothing about the term {weakest!r} apart from the others. "
            "Excite more of x and y, or take basis='constant'."
        )
    inverse = np.linalg.inv(normal)
    return inverse @ (z.T @ right / length) / length, inverse / np.outer(length, length)


def _least_squares(problem: _Regression) -> tuple[np.ndarray, np.ndarray]:
    """(theta, covariance) from central differences of v, the opening of the steps before and after averaged."""
    h, v = problem.record.sample_time, problem.record.v
    first, second = (v[2:] - v[:-2]) / (2.0 * h), (v[2:] - 2.0 * v[1:-1] + v[:-2]) / h**2
    x = (problem.x[1:] + problem.x[:-1]) / 2.0
    driving = {"a1": -first, "a2": -v[1:-1], "b": x, "offset": np.ones_like(x)}
    regressors = np.hstack([problem.terms[name][1:] * driving[name][:, None] for name in COEFFICIENTS])
    regressors, second = regressors[problem.counts[1:-1]], second[problem.counts[1:-1]]
    theta, inverse = _solve(regressors, second, problem.names)
    variance = np.sum((second - regressors @ theta) ** 2) / (len(second) - len(theta))
    return theta, variance * inverse


def _start(problem: _Regression) -> tuple[np.ndarray, np.ndarray]:
    """(theta, initial state) of the best constant model: a1 and a2 common to both sides, b and c of each."""
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
            "no stable second-order model starts the identification. Check the sign and the order of the columns, sample faster "
            "than ten times a period of the natural frequency, or excite x more."
        )
    return min(candidates, key=lambda candidate: candidate[0])[1:]


def _embed(problem: _Regression, constants: np.ndarray) -> np.ndarray:
    """theta with only the constant terms, from a1, a2 and then b and c of each side."""
    theta = np.zeros(len(problem.names))
    free = "offset 1" if problem.basis.separable_offset() else "b 1/x"
    for k, side in enumerate(problem.sides):
        labels = ("a1 1", "a2 1", "b 1", free)
        for label, value in zip(labels, (*constants[:2], *constants[2 + 2 * k : 4 + 2 * k]), strict=True):
            theta[problem.names.index(f"{side} {label}")] = value
    return theta


def _state_variable_filter(problem: _Regression, bandwidth: float) -> np.ndarray:
    """a1, a2, then b and c of each side: least squares on filtered signals, then once more with instruments from that model."""
    on = np.array([problem.terms["b"][:, k * len(problem.basis.labels("b"))] for k in range(len(problem.sides))])
    inputs = np.vstack([row for side in on for row in (side * problem.x, side)])
    held = _filtered(np.hstack([inputs, inputs[:, -1:]]), bandwidth, problem.record.sample_time, "zoh")[0].T
    v, dv = _filtered(problem.record.v[None], bandwidth, problem.record.sample_time, "foh")
    second = problem.record.v - 2.0 * bandwidth * dv[0] - bandwidth**2 * v[0]
    regressors, second = np.hstack([-dv.T, -v.T, held])[problem.counts], second[problem.counts]
    constants = _damped(_solve(regressors, second, ())[0])
    answer = problem.simulate(_embed(problem, constants), np.array([problem.record.v[0], 0.0]))
    if answer is None:
        return constants
    clean, slope = _filtered(answer[None, :, 0], bandwidth, problem.record.sample_time, "foh")
    return _damped(_solve(regressors, second, (), np.hstack([-slope.T, -clean.T, held])[problem.counts])[0])


def _damped(constants: np.ndarray) -> np.ndarray:
    """The same start with the damping of a stable model, where noise has turned a small one negative."""
    return np.concatenate([[max(constants[0], _LEAST_DAMPING * np.sqrt(max(constants[1], 0.0)))], constants[1:]])


def _filtered(signals: np.ndarray, bandwidth: float, h: float, hold: str) -> tuple[np.ndarray, np.ndarray]:
    """The signals (m, n) behind 1/(s + bandwidth)^2 and s/(s + bandwidth)^2, exact for inputs held or linear between samples."""
    from scipy.signal import cont2discrete, lfilter

    denominator = [1.0, 2.0 * bandwidth, bandwidth**2]
    systems = (cont2discrete((numerator, denominator), h, method=hold)[:2] for numerator in ([1.0], [1.0, 0.0]))
    low, high = (lfilter(np.ravel(numerator), poles, signals, axis=-1) for numerator, poles in systems)
    return low, high


def _refine(problem: _Regression, theta: np.ndarray, initial: np.ndarray, progress) -> tuple:
    """(theta, initial state, covariance, iterations): the iteration of the module's text, its steps halved where the fit falls."""
    v, p, counts = problem.record.v, len(theta), problem.counts
    free = len(names := (*problem.names, "initial v", "initial v'")) if counts[0] else p
    unknown, answer = np.concatenate([theta, initial]), problem.simulate(theta, initial)
    for iteration in range(1, _ITERATIONS + 1):
        cost = problem.cost(answer)
        step, inverse = _solve(problem.instruments(unknown[:p], answer)[:, :free], (v - answer[:, 0])[counts], names)
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
            progress(iteration, _percent(v[counts], answer[counts, 0]))
        if promised <= _SETTLED * cost:
            break
    _, inverse = _solve(problem.instruments(unknown[:p], answer)[:, :free], v[counts], names)
    variance = problem.cost(answer) / (np.sum(counts) - free)
    return unknown[:p], unknown[p:], variance * inverse[:p, :p], iteration


def _percent(v: np.ndarray, model: np.ndarray) -> float:
    return float(100.0 * (1.0 - np.linalg.norm(v - model) / np.linalg.norm(v - v.mean()))) if len(v) > 1 else np.nan


def _result(whole: _Regression, part: _Regression, method: str, theta, initial, covariance, iterations: int) -> Identification:
    v, used = whole.record.v, len(part.record.v)
    answer = whole.simulate(theta, initial)
    free_run = np.full(len(v), np.nan) if answer is None else answer[:, 0]
    early, late = (np.flatnonzero(whole.counts & inside) for inside in (np.arange(len(v)) < used, np.arange(len(v)) >= used))
    ahead = _one_step(v, free_run, used)
    fit = Fit(*(_percent(v[rows], model[rows]) for rows, model in ((early, free_run), (late, free_run), (late, ahead))))
    masks = {side: _mask(part, side, theta, covariance) for side in part.sides}
    surfaces = {}
    for side in part.sides:
        values = {name: theta[part.rows(side, name)] for name in COEFFICIENTS[:3]}
        values["offset"] = np.zeros(len(part.basis.labels("offset")))
        values["offset"][part.basis.separable_offset()] = theta[part.rows(side, "offset")]
        surfaces[side] = Surface(values, masks[side])
    model = QuasiLinearModel(part.basis, surfaces)
    noise = float(np.std((v - free_run)[early]))
    restrictions = tuple(_restrictions(part, masks))
    return Identification(model, method, theta, part.names, covariance, noise, fit, masks, restrictions, iterations)


def _one_step(v: np.ndarray, free_run: np.ndarray, used: int) -> np.ndarray:
    """(n,): prediction one sample ahead, with what the free run leaves as an autoregression found on the first `used` samples."""
    rest = v - free_run
    ahead = np.full(len(v), np.nan)
    if np.isfinite(rest).all():
        past = np.lib.stride_tricks.sliding_window_view(rest, _NOISE_ORDER)[:-1]
        weights = np.linalg.lstsq(past[: used - _NOISE_ORDER], rest[_NOISE_ORDER:used], rcond=None)[0]
        ahead[_NOISE_ORDER:] = free_run[_NOISE_ORDER:] + past @ weights
    return ahead


def _mask(problem: _Regression, side: str, theta: np.ndarray, covariance: np.ndarray) -> Region:
    """The cells of one side that the record visits, or lie between two of one position that it visits, and that are known."""
    on = np.sign(problem.x) == SIDES[side]
    x = problem.x[on]
    y = np.zeros_like(x) if problem.record.y is None else problem.record.y[:-1][on]
    edges_x, edges_y = _edges(x), (np.array([-np.inf, np.inf]) if problem.record.y is None else _edges(y))
    visits = np.histogram2d(x, y, bins=(edges_x, edges_y))[0] >= _VISITS
    visits = np.maximum.accumulate(visits, axis=0) & np.maximum.accumulate(visits[::-1], axis=0)[::-1]
    for i, j in np.argwhere(visits):
        corner_x, corner_y = np.repeat(edges_x[i : i + 2], 2), np.tile(edges_y[j : j + 2], 2)
        corner_y = np.where(np.isfinite(corner_y), corner_y, 0.0)
        for name in COEFFICIENTS[:3]:
            rows = problem.rows(side, name)
            terms = problem.basis.terms(name, corner_x, corner_y)
            deviation = np.sqrt(np.einsum("ij,jk,ik->i", terms, covariance[np.ix_(rows, rows)], terms))
            visits[i, j] &= bool((deviation <= _CLAIM * np.abs(terms @ theta[rows])).all())
    return Region(edges_x, edges_y, visits)


def _edges(values: np.ndarray) -> np.ndarray:
    low, high = values.min(), values.max()
    return np.linspace(low, high, _CELLS + 1) if high > low else low + 1e-9 * np.array([-1.0, 1.0])


def _restrictions(problem: _Regression, masks: Mapping[str, Region]):
    for side in SIDES:
        if side not in problem.sides:
            yield f"the record has no x {'<' if side == '-' else '>'} 0: the model says nothing about that side."
    for side, mask in masks.items():
        unknown = np.sum(~mask.covered)
        if unknown == mask.covered.size:
            yield f"side {side!r}: no cell of (x, y) is known to {_CLAIM:.0%}; record longer, excite more, or take a smaller basis."
        elif unknown:
            yield f"side {side!r}: {unknown} of {mask.covered.size} cells of (x, y) are not excited enough to be known."
    if problem.record.y is None:
        yield "y was not given: the model is that of the positions at which the record was taken."
