"""Equation (3) of the source paper: the quasi-linear model, whose coefficients are surfaces over x
and y,

    v'' + a1(x, y) v' + a2(x, y) v = b(x, y) x + c(x, y)        dy/dt = v

one set for each sign of x, linear in the functions of a basis. The paper has no offset c: it is
zero for secant models without load, and lets tangent models rest at the true operating points.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from numbers import Real

import numpy as np

from ..errors import InputError
from .bases import COEFFICIENTS, Basis
from .region import Region
from .second_order import respond

SIDES = {"+": 1.0, "-": -1.0}
"""The sign of x of each side."""
_LONGEST_STEP = 0.5
"""of the simulation, times the natural frequency"""
_SWEEPS = 100


@dataclass(frozen=True)
class FitError:
    """Relative errors of one coefficient surface; the offset's are those of the speed at rest. NaN
    where there is no point."""

    largest: float
    """over the points of the fit"""
    rms: float
    largest_between: float
    """over the points midway between them"""
    rms_between: float


@dataclass(frozen=True, eq=False)
class Surface:
    """The coefficients for one sign of x."""

    coefficients: Mapping[str, np.ndarray]
    """by name (a1, a2, b, offset): one value for each term of the basis, in SI"""
    region: Region
    """where the surface may be used"""
    fit_error: Mapping[str, FitError] = field(default_factory=dict)
    """by coefficient name; empty for a model that was not fitted to linear models"""
    condition: Mapping[str, float] = field(default_factory=dict)
    """by coefficient name: condition number of the weighted terms, each scaled to unit length"""


@dataclass(frozen=True, eq=False)
class Response:
    """What the quasi-linear model does: arrays over t."""

    t: np.ndarray
    """s"""
    x: np.ndarray
    """valve opening, held from each time to the next"""
    y: np.ndarray
    """m"""
    v: np.ndarray
    """m/s"""


@dataclass(frozen=True, eq=False)
class QuasiLinearModel:
    """The model above. `surfaces` holds one `Surface` for each sign of x that is known, under "+"
    and "-"."""

    basis: Basis
    surfaces: Mapping[str, Surface]

    def coefficients(self, side: str) -> dict[str, np.ndarray]:
        """By name (a1, a2, b, offset): the values that multiply `basis.labels(name)`, for x > 0
        ("+") or x < 0 ("-")."""
        if side not in self.surfaces:
            raise InputError(
                f"side = {side!r} is not in this model; it has"
                f" {' and '.join(map(repr, self.surfaces))}."
            )
        return dict(self.surfaces[side].coefficients)

    @property
    def fit_error(self) -> dict[str, dict[str, FitError]]:
        """By side, then by coefficient name."""
        return {side: dict(surface.fit_error) for side, surface in self.surfaces.items()}

    @property
    def condition(self) -> dict[str, dict[str, float]]:
        """By side, then by coefficient name."""
        return {side: dict(surface.condition) for side, surface in self.surfaces.items()}

    def contains(self, x, y) -> np.ndarray:
        """True where the model may be used at opening x and position y (m)."""
        x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        inside = np.zeros(x.shape, dtype=bool)
        for side, surface in self.surfaces.items():
            inside |= ((x < 0.0) == (side == "-")) & surface.region.contains(x, y)
        return inside

    def nearest(self, x, y) -> tuple[np.ndarray, np.ndarray]:
        """(x, y) moved into the bounds of the region of its sign, for a caller who accepts a held
        value outside."""
        x, y = (
            np.array(value)
            for value in np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        )
        for side, surface in self.surfaces.items():
            chosen = (x < 0.0) == (side == "-")
            x[chosen], y[chosen] = surface.region.clip(x[chosen], y[chosen])
        return x, y

    def evaluate(self, x, y) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(a1, a2, b) in rad/s, rad^2/s^2 and m/s^3, over the broadcast shape of x and y (m).

        Raises InputError outside the region of the fit; `nearest` brings a point inside.
        """
        self._require_inside(x, y)
        return self._surface("a1", x, y), self._surface("a2", x, y), self._surface("b", x, y)

    def offset(self, x, y) -> np.ndarray:
        """c in m/s^3, over the broadcast shape of x and y (m); raises as `evaluate`."""
        self._require_inside(x, y)
        return self._surface("offset", x, y)

    def _require_inside(self, x, y) -> None:
        inside = self.contains(x, y)
        if not inside.all():
            x, y = (np.broadcast_to(value, inside.shape)[~inside].flat[0] for value in (x, y))
            regions = "; ".join(
                f"side {side!r}: {surface.region}" for side, surface in self.surfaces.items()
            )
            raise InputError(
                f"x = {x}, y = {y} m is outside the region of the fit ({regions}). "
                "Fit a grid that covers it, or hold the value at the border with nearest(x, y)."
            )

    def _surface(self, name: str, x, y) -> np.ndarray:
        x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        value = np.full(x.shape, np.nan)
        for side, surface in self.surfaces.items():
            chosen = (x < 0.0) == (side == "-")
            value[chosen] = (
                self.basis.terms(name, x[chosen], y[chosen]) @ surface.coefficients[name]
            )
        return value

    def simulate(self, t, x, y0: float, *, v0: float = 0.0) -> Response:
        """The answer to the opening x (n,), held from each of the times t (n,) in s to the next,
        from y0 (m) and v0 (m/s).

        Within the gap around x = 0 that the fit leaves out, the coefficients are those of its
        border. Each step is exact for coefficients taken at its mid position; y follows from
        repeated sweeps over the whole record. Raises InputError for a record that is not usable, an
        opening of a sign that the model lacks, or where the position leaves the region of the fit.
        """
        t, x = _record(t, x)
        self._require_start(x, y0, v0)
        repeat = self._substeps(t, x)
        h = np.repeat(np.diff(t) / repeat, repeat)
        opening = np.repeat(x[:-1], repeat)
        held = self._outside_gap(opening)
        y = np.full(len(h) + 1, float(y0))
        for _ in range(_SWEEPS):
            at = self.nearest(held, (y[:-1] + y[1:]) / 2.0)
            a1, a2, b, c = (self._surface(name, *at) for name in COEFFICIENTS)
            force = b * opening + c
            v, dv = np.moveaxis(
                respond(a1, a2, h, force[:, None], np.array([[v0], [0.0]]))[..., 0], 1, 0
            )
            travel = (force * h - np.diff(dv) - a1 * np.diff(v)) / a2
            before, y = y, y0 + np.concatenate([[0.0], np.cumsum(travel)])
            if np.max(np.abs(y - before)) <= 1e-12:
                break
        else:
            raise InputError(
                f"the position did not settle in {_SWEEPS} sweeps over {t[-1] - t[0]:g} s; simulate"
                " a shorter record."
            )
        self._require_inside(held, (y[:-1] + y[1:]) / 2.0)
        ends = np.concatenate([[0], np.cumsum(repeat)])
        return Response(t, x, y[ends], v[ends])

    def _require_start(self, x: np.ndarray, y0, v0) -> None:
        faults = [
            f"x holds openings of side {side!r}, which this model lacks (it has"
            f" {' and '.join(map(repr, self.surfaces))})."
            for side, used in (("-", (x[:-1] < 0.0).any()), ("+", (x[:-1] >= 0.0).any()))
            if used and side not in self.surfaces
        ]
        for name, value, unit in (("y0", y0, "m"), ("v0", v0, "m/s")):
            if not (isinstance(value, Real) and math.isfinite(value)):
                faults.append(f"{name} = {value!r} must be a finite number in {unit}.")
        if faults:
            raise InputError(faults)

    def _substeps(self, t: np.ndarray, x: np.ndarray) -> np.ndarray:
        """(n - 1,): into how many steps each interval is cut, so that none is long against the
        natural frequency."""
        corners = [
            self._surface("a2", *surface.region.corners()) for surface in self.surfaces.values()
        ]
        return np.ceil(np.diff(t) * np.sqrt(np.max(corners)) / _LONGEST_STEP).astype(int)

    def _outside_gap(self, x: np.ndarray) -> np.ndarray:
        for side, surface in self.surfaces.items():
            least = np.min(np.abs(surface.region.x))
            x = np.where(((x < 0.0) == (side == "-")) & (np.abs(x) < least), SIDES[side] * least, x)
        return x

    def table(self) -> str:
        """The coefficients as text, laid out as in the paper: the terms above their values, for
        each sign of x."""
        lines = []
        for side, surface in self.surfaces.items():
            lines.append(f"x {'<' if side == '-' else '>'} 0")
            for name in COEFFICIENTS:
                labels, values = self.basis.labels(name), surface.coefficients[name]
                lines.append(f"  {name:<8}" + "".join(f"{label:>14}" for label in labels))
                lines.append(" " * 10 + "".join(f"{value:>14.6g}" for value in values))
        return "\n".join(lines)


def _record(t, x) -> tuple[np.ndarray, np.ndarray]:
    t, x = np.asarray(t, dtype=float), np.asarray(x, dtype=float)
    if t.ndim != 1 or t.shape != x.shape or len(t) < 2:
        raise InputError(
            f"t {t.shape} and x {x.shape} must be two arrays of one length, at least 2."
        )
    if not (np.isfinite(t).all() and np.isfinite(x).all() and (np.diff(t) > 0.0).all()):
        raise InputError("t must rise and t and x must be finite; remove repeated times and gaps.")
    return t, x
