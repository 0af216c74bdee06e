"""Equation (3) of the source paper from measurements: `identify` finds the coefficient surfaces of
the quasi-linear model.

The model is linear in the coefficients of a1, a2, b and c, which invites least squares, as the
paper proposes. `estimation` tells why "srivc" is the default all the same, and how both work.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..errors import InputError, unknown_name
from ..loop.as_plant import as_plant
from ..loop.plant_family import PlantFamily
from ..machine.actuator import Actuator
from ..quasi_linear.bases import COEFFICIENTS, Basis
from ..quasi_linear.model import SIDES, QuasiLinearModel, Surface
from ..quasi_linear.region import Region
from .estimation import (
    MOST_ITERATIONS,
    Regression,
    fit_in_per_cent,
    least_squares,
    refine,
    regression,
    start,
)
from .records import Record

_METHODS = ("srivc", "least-squares")
_NOISE_ORDER = 8
_CELLS = 8
_VISITS = 20
_CLAIM = 0.01
"""largest relative standard deviation of a1, a2 and b in a cell of the mask"""


@dataclass(frozen=True)
class Fit:
    """100 (1 - |v - v^| / |v - mean v|) in per cent: 100 is perfect, 0 no better than the mean. NaN
    without a hold-out part.

    Over the samples that count (see `settling` in `identify`).
    """

    estimation: float
    """free run of the model over the part it was identified from"""
    hold_out: float
    """free run over the part that was held out"""
    one_step: float
    """prediction one sample ahead over the held-out part, with an autoregressive model of what the
    free run leaves"""


@dataclass(frozen=True, eq=False)
class Identification:
    """What `identify` found. `model` may be used where `masks` says so; `restrictions` says what
    the record could not show."""

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
    """by side: the cells of (x, y) that the record visits and in which a1, a2 and b have a standard
    deviation of at most 1 %"""
    restrictions: tuple[str, ...]
    iterations: int

    def plant_family(self) -> PlantFamily:
        """The model as plants for `tune` and the margins, where `masks` says that it is known; the
        valve's lag is in it."""
        return as_plant(self.model)

    def standard_deviation(self, x: float, y: float = 0.0) -> tuple[float, float, float]:
        """Of a1, a2 and b at one point, by the covariance. Raises InputError for a sign of x that
        the record did not show."""
        side = "-" if x < 0.0 else "+"
        self.model.coefficients(side)
        variances = []
        for name in COEFFICIENTS[:3]:
            rows = [k for k, label in enumerate(self.names) if label.split()[:2] == [side, name]]
            terms = self.model.basis.terms(name, x, y)
            variances.append(float(terms @ self.covariance[np.ix_(rows, rows)] @ terms))
        return tuple(np.sqrt(variances))


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
    """The quasi-linear model that best answers a measured opening x with the measured speed v, each
    sign of x apart.

    t, x, v, y (n,) are a `Record` (s, -, m/s, m). The bases with volumes need the `actuator`, of
    which only areas and volumes count; y may be left out with basis "constant". The last `hold_out`
    (0 to 0.9) of the record is not used to identify, but to check. Samples with x = 0 belong to the
    side before them. After the start and after every reversal the pressures creep to those of the
    other direction, and the gain with them, which the second order does not know: samples count
    only once the integral of |x| dt has passed `settling` (s at full opening). `progress` is called
    with the iteration and the fit in per cent. Raises InputError for a record or arguments that
    cannot be used, or a record that does not determine the basis.
    """
    record = Record(t, x, v, y)
    faults = [] if method in _METHODS else [unknown_name("method", method, _METHODS)]
    if not 0.0 <= hold_out <= 0.9:
        faults.append(
            f"hold_out = {hold_out} must be between 0 and 0.9; it is the part of the record kept"
            " for checking."
        )
    if not 0.0 <= settling < np.inf:
        faults.append(f"settling = {settling} must be a time in s, at full opening, of at least 0.")
    if record.y is None and basis != "constant":
        faults.append(f"basis = {basis!r} needs the position y; give it, or take basis='constant'.")
    if faults:
        raise InputError(faults)
    chosen, used = Basis(basis, actuator), round((1.0 - hold_out) * len(record.t))
    whole, part = (regression(_first(record, n), chosen, settling) for n in (len(record.t), used))
    if part.sides != whole.sides:
        missing = next(side for side in whole.sides if side not in part.sides)
        raise InputError(
            f"side {missing!r} appears only in the held-out part; lower hold_out or record more"
            " of it."
        )
    if method == "least-squares":
        theta, covariance, iterations = *least_squares(part), 1
        initial = np.array([record.v[0], 0.0])
    else:
        theta, initial, covariance, iterations = refine(part, *start(part), progress)
    return _result(whole, part, method, theta, initial, covariance, iterations)


def _first(record: Record, n: int) -> Record:
    return Record(
        record.t[:n], record.x[:n], record.v[:n], None if record.y is None else record.y[:n]
    )


def _result(
    whole: Regression, part: Regression, method: str, theta, initial, covariance, iterations: int
) -> Identification:
    v, used = whole.record.v, len(part.record.v)
    answer = whole.simulate(theta, initial)
    free_run = np.full(len(v), np.nan) if answer is None else answer[:, 0]
    early, late = (
        np.flatnonzero(whole.counts & inside)
        for inside in (np.arange(len(v)) < used, np.arange(len(v)) >= used)
    )
    ahead = _one_step(v, free_run, used)
    fit = Fit(
        *(
            fit_in_per_cent(v[rows], model[rows])
            for rows, model in ((early, free_run), (late, free_run), (late, ahead))
        )
    )
    masks = {side: _mask(part, side, theta, covariance) for side in part.sides}
    surfaces = {}
    for side in part.sides:
        values = {name: theta[part.rows(side, name)] for name in COEFFICIENTS[:3]}
        values["offset"] = np.zeros(len(part.basis.labels("offset")))
        values["offset"][part.basis.separable_offset()] = theta[part.rows(side, "offset")]
        surfaces[side] = Surface(values, masks[side])
    model = QuasiLinearModel(part.basis, surfaces)
    noise = float(np.std((v - free_run)[early]))
    restrictions = tuple(_restrictions(part, masks, iterations))
    return Identification(
        model, method, theta, part.names, covariance, noise, fit, masks, restrictions, iterations
    )


def _one_step(v: np.ndarray, free_run: np.ndarray, used: int) -> np.ndarray:
    """(n,): prediction one sample ahead, with what the free run leaves as an autoregression found
    on the first `used` samples."""
    rest = v - free_run
    ahead = np.full(len(v), np.nan)
    if np.isfinite(rest).all():
        past = np.lib.stride_tricks.sliding_window_view(rest, _NOISE_ORDER)[:-1]
        weights = np.linalg.lstsq(past[: used - _NOISE_ORDER], rest[_NOISE_ORDER:used], rcond=None)[
            0
        ]
        ahead[_NOISE_ORDER:] = free_run[_NOISE_ORDER:] + past @ weights
    return ahead


def _mask(problem: Regression, side: str, theta: np.ndarray, covariance: np.ndarray) -> Region:
    """The cells of one side that the record visits, or lie between two of one position that it
    visits, and that are known."""
    on = np.sign(problem.x) == SIDES[side]
    x = problem.x[on]
    y = np.zeros_like(x) if problem.record.y is None else problem.record.y[:-1][on]
    edges_x, edges_y = (
        _edges(x),
        (np.array([-np.inf, np.inf]) if problem.record.y is None else _edges(y)),
    )
    visits = np.histogram2d(x, y, bins=(edges_x, edges_y))[0] >= _VISITS
    visits = (
        np.maximum.accumulate(visits, axis=0) & np.maximum.accumulate(visits[::-1], axis=0)[::-1]
    )
    node_x, node_y = np.meshgrid(
        edges_x, np.where(np.isfinite(edges_y), edges_y, 0.0), indexing="ij"
    )
    known = np.ones(node_x.shape, dtype=bool)
    for name in COEFFICIENTS[:3]:
        rows = problem.rows(side, name)
        terms = problem.basis.terms(name, node_x, node_y)
        deviation = np.sqrt(np.einsum("...j,jk,...k", terms, covariance[np.ix_(rows, rows)], terms))
        known &= deviation <= _CLAIM * np.abs(terms @ theta[rows])
    visits &= known[:-1, :-1] & known[1:, :-1] & known[:-1, 1:] & known[1:, 1:]
    return Region(edges_x, edges_y, visits)


def _edges(values: np.ndarray) -> np.ndarray:
    low, high = values.min(), values.max()
    return np.linspace(low, high, _CELLS + 1) if high > low else low + 1e-9 * np.array([-1.0, 1.0])


def _restrictions(
    problem: Regression, masks: Mapping[str, Region], iterations: int
) -> Iterator[str]:
    for side in SIDES:
        if side not in problem.sides:
            yield (
                f"the record has no x {'<' if side == '-' else '>'} 0: the model says nothing about"
                " that side."
            )
    for side, mask in masks.items():
        unknown = np.sum(~mask.covered)
        if unknown == mask.covered.size:
            yield (
                f"side {side!r}: no cell of (x, y) is known to {_CLAIM:.0%}; record longer, excite"
                " more, or take a smaller basis."
            )
        elif unknown:
            yield (
                f"side {side!r}: {unknown} of {mask.covered.size} cells of (x, y) are not excited"
                " enough to be known."
            )
    if iterations == MOST_ITERATIONS:
        yield (
            f"the iteration has not settled after {iterations} steps: the coefficients may still"
            " change. Take a smaller basis."
        )
    if problem.record.y is None:
        yield "y was not given: the model is that of the positions at which the record was taken."
