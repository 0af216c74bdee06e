"""Fitting the quasi-linear model to the second-order models of a family, with its error on the
points and between them."""

from __future__ import annotations

import warnings

import numpy as np

from ..digits import apart
from ..errors import InputError
from ..model.linearization import linearize
from ..model.operating_point import find_operating_points
from .bases import BASES, COEFFICIENTS, Basis
from .model import SIDES, FitError, QuasiLinearModel, Surface
from .reduction import SecondOrderFamily, reduce_order
from .region import Region

_POOR = 0.01
_SINGULAR = 1e12


class PoorFitWarning(UserWarning):
    """A coefficient surface misses the models it was fitted to by more than one per cent."""


def fit_surfaces(reduced: SecondOrderFamily, *, basis: str = "volume") -> QuasiLinearModel:
    """The surfaces that fit a1, a2 and b of the accepted points by least squares of the relative
    error, each sign of x apart.

    The offset is fitted last, to the speed at rest that b and a2 leave over. `basis` is one of
    `hydroctl.bases.BASES`. Warns with PoorFitWarning, naming a better basis, where a1, a2 or b is
    missed by more than 1 %, on the points or midway between them. Raises InputError where a side
    has points, but too few accepted ones for the basis.
    """
    points = reduced.points
    chosen = Basis(basis, points.actuator)
    if np.size(points.load_force) and np.ptp(points.load_force) > 0.0:
        lowest, highest = apart(points.load_force.min(), points.load_force.max())
        raise InputError(f"load_force goes from {lowest} to {highest} N; fit one load at a time.")
    sides = {
        side: np.sign(points.x) == sign
        for side, sign in SIDES.items()
        if np.any(np.sign(points.x) == sign)
    }
    if not sides:
        raise InputError("no point with x > 0 or x < 0 is given; add openings of at least 1e-4.")
    if faults := [
        fault for side, mask in sides.items() if (fault := _shortage(reduced, chosen, side, mask))
    ]:
        raise InputError(faults)
    surfaces = {side: _surface(reduced, chosen, mask) for side, mask in sides.items()}
    for side, surface in surfaces.items():
        _warn_if_poor(reduced, chosen, side, sides[side], surface)
    return QuasiLinearModel(chosen, surfaces)


def _shortage(reduced: SecondOrderFamily, basis: Basis, side: str, mask: np.ndarray) -> str | None:
    """Why the accepted points of one side do not determine the surfaces; None where they do."""
    used = mask & reduced.accepted
    x, y = reduced.points.x[used], reduced.points.y[used]
    terms = len(basis.labels("a1"))
    if len(x) >= terms and all(
        _condition(basis.terms(name, x, y)) < _SINGULAR for name in COEFFICIENTS
    ):
        return None
    rejected = [text for text in reduced.reason[mask] if text]
    why = f" The first of {len(rejected)} rejected points: {rejected[0]}" if rejected else ""
    return (
        f"side {side!r}: {len(x)} accepted points at {len(np.unique(x))} openings and"
        f" {len(np.unique(y))} positions do not determine the {terms} terms of basis"
        f" {basis.name!r}. Add openings and positions, raise tolerance in reduce_order, or take a"
        f" smaller basis.{why}"
    )


def _condition(terms: np.ndarray) -> float:
    size = np.linalg.norm(terms, axis=0)
    return float(np.linalg.cond(terms / size)) if size.all() else np.inf


def _surface(reduced: SecondOrderFamily, basis: Basis, mask: np.ndarray) -> Surface:
    used = mask & reduced.accepted
    x, y = reduced.points.x[used], reduced.points.y[used]
    coefficients: dict[str, np.ndarray] = {}
    condition: dict[str, float] = {}
    for name in COEFFICIENTS:
        target, scale = _target(reduced, used, basis, name, coefficients)
        weighted = basis.terms(name, x, y) / scale[:, None]
        length = np.linalg.norm(weighted, axis=0)
        solution, _, _, singular = np.linalg.lstsq(weighted / length, target / scale, rcond=None)
        coefficients[name], condition[name] = solution / length, float(singular[0] / singular[-1])
    between, midway = _midway(reduced, mask)
    errors = {
        name: FitError(
            *_errors(reduced, used, basis, name, coefficients),
            *_errors(between, midway, basis, name, coefficients),
        )
        for name in COEFFICIENTS
    }
    region = Region.of_points(
        reduced.points.x[mask], reduced.points.y[mask], reduced.accepted[mask]
    )
    return Surface(coefficients, region, errors, condition)


def _target(
    reduced: SecondOrderFamily, where: np.ndarray, basis: Basis, name: str, fitted: dict
) -> tuple[np.ndarray, np.ndarray]:
    """What a surface should be at the points `where`, and what its error is divided by.

    For the offset that is what brings the speed at rest, (b x + c)/a2 with the surfaces `fitted`
    for b and a2, to that of the second-order model; its error is then the relative error of that
    speed.
    """
    if name != "offset":
        value = getattr(reduced, name)[where]
        return value, value
    x, y = reduced.points.x[where], reduced.points.y[where]
    at_rest = (reduced.b[where] * x + reduced.offset[where]) / reduced.a2[where]
    a2, b = (basis.terms(other, x, y) @ fitted[other] for other in ("a2", "b"))
    return a2 * at_rest - b * x, a2 * np.abs(at_rest)


def _midway(reduced: SecondOrderFamily, mask: np.ndarray) -> tuple[SecondOrderFamily, np.ndarray]:
    """The same reduction midway between the openings and the positions of one side, and where it is
    accepted."""
    points = reduced.points
    x, y = (
        (values[:-1] + values[1:]) / 2.0
        for values in (np.unique(points.x[mask]), np.unique(points.y[mask]))
    )
    load = points.load_force[mask][0] - points.actuator.constant_load
    family = linearize(
        points.actuator,
        find_operating_points(points.actuator, x[:, None], y, load_force=load),
        form=reduced.family.form,
    )
    between = reduce_order(
        family, method=reduced.method, tolerance=reduced.tolerance, omega_max=reduced.omega_max
    )
    return between, between.accepted


def _errors(
    reduced: SecondOrderFamily, where: np.ndarray, basis: Basis, name: str, fitted: dict
) -> tuple[float, float]:
    """(largest, rms) relative error of one surface over the points `where`; NaN without any."""
    if not where.any():
        return np.nan, np.nan
    target, scale = _target(reduced, where, basis, name, fitted)
    errors = (
        basis.terms(name, reduced.points.x[where], reduced.points.y[where]) @ fitted[name] - target
    ) / scale
    return float(np.max(np.abs(errors))), float(np.sqrt(np.mean(errors**2)))


def _poorest(surface: Surface) -> tuple[float, str]:
    """The largest error of a1, a2 and b, on the points or between them, and whose it is."""
    errors = {name: surface.fit_error[name] for name in ("a1", "a2", "b")}
    return max(
        (np.fmax(error.largest, error.largest_between), name) for name, error in errors.items()
    )


def _warn_if_poor(
    reduced: SecondOrderFamily, basis: Basis, side: str, mask: np.ndarray, surface: Surface
) -> None:
    error, name = _poorest(surface)
    if error <= _POOR:
        return
    others = [Basis(other, basis.actuator) for other in BASES if other != basis.name]
    usable = [other for other in others if _shortage(reduced, other, side, mask) is None]
    best, better = min(
        ((_poorest(_surface(reduced, other, mask))[0], other.name) for other in usable),
        default=(np.inf, ""),
    )
    missed, other = apart(error, best, digits=3, factor=100.0)
    advice = (
        f"basis={better!r} misses by {other}%"
        if best < error
        else "no other basis does better, so fit a smaller range"
    )
    warnings.warn(
        f"side {side!r}: basis {basis.name!r} misses {name} by {missed}%; {advice}.",
        PoorFitWarning,
        stacklevel=3,
    )
