"""Linear plants of one's own, of which no machine is known: models on a grid of points, and the
quasi-linear model, whose coefficients are surfaces."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import NoReturn

import numpy as np

from ..errors import InputError
from ..quasi_linear.model import SIDES, QuasiLinearModel
from .plant_family import Change, PlantFamily, SpeedGains
from .quantity import ControlledQuantity
from .sampled_plant import SampledFamily, sample_models
from .speed_models import SpeedModels, of_second_order

_SAME = 1e-9
"""of the largest node: the distance from which two are two"""


class ModelPlants(PlantFamily):
    """What families of models without a machine have in common."""

    actuator = None
    changes = ()

    @abstractmethod
    def _models(self, x: np.ndarray, y: np.ndarray) -> SpeedModels:
        """(variants, mx, my) continuous models at x (mx,) by y (my,) m."""

    def _sampled(
        self, x: np.ndarray, y: np.ndarray, quantity: ControlledQuantity, Ts: float, delay: float
    ) -> SampledFamily:
        models = self._models(x, y)
        return sample_models(models, quantity, sample_time=Ts, delay_samples=delay)

    def on_grid(self, x: np.ndarray, y: np.ndarray) -> GridPlants:
        """The models at x (mx,) by y (my,) m, and at these points alone."""
        speeds = self.speed(x, y) if self.knows_speed else None
        return GridPlants(self.labels, x, y, self._models(x, y), speeds)

    def pressure_drops(self, x) -> NoReturn:
        raise InputError(
            "pressure_compensation needs the pressures of a machine; these are models from x to v. "
            "Tune on the Actuator, or leave it out."
        )

    @property
    def added_plants(self) -> tuple[Change, ...]:
        return ()

    @property
    def box(self) -> None:
        return None

    @property
    def without_corners(self) -> PlantFamily:
        return self

    def varied(self, changes: Sequence[Change]) -> NoReturn:
        raise InputError(
            "these models have no parameters to vary; give their variants to as_plant instead."
        )


@dataclass(frozen=True, eq=False)
class GridPlants(ModelPlants):
    """Models at the points x (nx,) by y (ny,) m, and nowhere else."""

    variants: tuple[str, ...]
    x: np.ndarray
    """(nx,), ascending, none zero"""
    y: np.ndarray
    """(ny,) m, ascending"""
    models: SpeedModels
    """(variants, nx, ny)"""
    speeds: np.ndarray | None
    """(nx, ny) m/s: steady speeds of the nominal plant; None where they are not known"""

    @property
    def labels(self) -> tuple[str, ...]:
        return self.variants

    @property
    def grid(self) -> tuple[np.ndarray, np.ndarray]:
        return self.x, self.y

    def defined(self, x, y) -> np.ndarray:
        return _is_node(self.x, x)[:, None] & _is_node(self.y, y)

    def nearest(self, x, y) -> tuple[np.ndarray, np.ndarray]:
        x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
        apart = np.abs(self.x - x[:, None])
        other_side = self.x * x[:, None] < 0.0
        apart = np.where(other_side & ~other_side.all(axis=1)[:, None], np.inf, apart)
        return self.x[np.argmin(apart, axis=1)], self.y[_nearest_node(self.y, y)]

    def _models(self, x: np.ndarray, y: np.ndarray) -> SpeedModels:
        self._require_defined(x, y)
        return self.models.at(
            np.ix_(
                np.arange(len(self.variants)), _nearest_node(self.x, x), _nearest_node(self.y, y)
            )
        )

    def _require_defined(self, x: np.ndarray, y: np.ndarray) -> None:
        missing = np.argwhere(~self.defined(x, y))
        if missing.size:
            i, j = missing[0]
            raise InputError(
                f"there is no model at x={x[i]:g}, y={y[j]:g} m; the models stand at "
                f"x = {_listed(self.x)} by y = {_listed(self.y)} m."
            )

    @property
    def knows_speed(self) -> bool:
        return self.speeds is not None

    def speed(self, x, y) -> np.ndarray:
        if self.speeds is None:
            raise InputError(
                "the steady speeds of these models are not known: a transfer function tells what "
                "follows a small change of x. Give a LinearFamily, or the Actuator."
            )
        x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
        self._require_defined(x, y)
        return self.speeds[np.ix_(_nearest_node(self.x, x), _nearest_node(self.y, y))]

    def speed_gains(self) -> SpeedGains:
        middle = len(self.y) // 2
        if self.speeds is not None:
            return _through(self.x, self.speeds[:, middle])
        slopes = self.models.static_gain()[0, :, middle]
        outermost = {sign: np.argmax(sign * self.x) for sign in (1.0, -1.0)}
        return SpeedGains(float(slopes[outermost[1.0]]), float(slopes[outermost[-1.0]]), 0.0, 0.0)


@dataclass(frozen=True, eq=False)
class SurfacePlants(ModelPlants):
    """The second-order models of quasi-linear `surfaces`, by variant, wherever all of them may be
    used.

    The speeds are those of the nominal model. A model that was fitted to linear models knows no
    valve: the lag that its machine states is added; one that was identified holds it already.
    """

    surfaces: Mapping[str, QuasiLinearModel]

    @property
    def labels(self) -> tuple[str, ...]:
        return tuple(self.surfaces)

    @property
    def grid(self) -> None:
        return None

    def defined(self, x, y) -> np.ndarray:
        x, y = np.asarray(x, dtype=float), np.asarray(y, dtype=float)
        return np.all([m.contains(x[:, None], y) for m in self.surfaces.values()], axis=0)

    def nearest(self, x, y) -> tuple[np.ndarray, np.ndarray]:
        """The nearest within the bounds of the regions; holes in them are not looked at."""
        x, y = np.array(x, dtype=float), np.asarray(y, dtype=float)
        for model in self.surfaces.values():
            for side, surface in model.surfaces.items():
                corners_x, corners_y = surface.region.corners()
                own = np.sign(x) == SIDES[side]
                x[own] = np.clip(x[own], corners_x.min(), corners_x.max())
                y = np.clip(y, corners_y.min(), corners_y.max()) if own.any() else y
        return x, y

    def _models(self, x: np.ndarray, y: np.ndarray) -> SpeedModels:
        found = [_of_surfaces(model, x[:, None], y) for model in self.surfaces.values()]
        return SpeedModels.stack(found)

    @property
    def _nominal(self) -> QuasiLinearModel:
        return next(iter(self.surfaces.values()))

    @property
    def knows_speed(self) -> bool:
        return True

    def speed(self, x, y) -> np.ndarray:
        """(b x + c)/a2."""
        x, y = np.asarray(x, dtype=float)[:, None], np.asarray(y, dtype=float)
        _, a2, b = self._nominal.evaluate(x, y)
        return (b * x + self._nominal.offset(x, y)) / a2

    def speed_gains(self) -> SpeedGains:
        x, v = [], []
        for surface in self._nominal.surfaces.values():
            openings, positions = (np.unique(values) for values in surface.region.corners())
            middle = positions.mean() if np.isfinite(positions).all() else 0.0
            x += list(openings)
            v += list(self.speed(openings, [middle])[:, 0])
        order = np.argsort(x)
        return _through(np.array(x)[order], np.array(v)[order])


def _of_surfaces(model: QuasiLinearModel, x: np.ndarray, y: np.ndarray) -> SpeedModels:
    found, machine = of_second_order(*model.evaluate(x, y)), model.basis.actuator
    fitted = all(surface.fit_error for surface in model.surfaces.values())
    if machine is None or not fitted:
        return found
    return found.behind_valve(machine.valve_natural_frequency, machine.valve_damping)


def _through(x: np.ndarray, v: np.ndarray) -> SpeedGains:
    """The straight lines through the innermost and the outermost opening of each side; through 0
    for a single one. A side without openings takes the line of the other, mirrored.

    Raises InputError where a line does not rise.
    """
    lines = {}
    for sign in (1.0, -1.0):
        side = np.flatnonzero(sign * x > 0.0)
        if side.size:
            first, last = side[[np.argmin(np.abs(x[side])), np.argmax(np.abs(x[side]))]]
            alone = first == last
            gain = v[last] / x[last] if alone else (v[last] - v[first]) / (x[last] - x[first])
            lines[sign] = float(gain), float(x[last] - v[last] / gain)
    if bad := [gain for gain, _ in lines.values() if not 0.0 < gain < np.inf]:
        raise InputError(f"the steady speed must rise with x; it does so by {bad[0]:.3g} m/s.")
    for sign in (1.0, -1.0):
        if sign not in lines:
            gain, offset = lines[-sign]
            lines[sign] = gain, -offset
    return SpeedGains(lines[1.0][0], lines[-1.0][0], lines[1.0][1], lines[-1.0][1])


def _nearest_node(nodes: np.ndarray, values) -> np.ndarray:
    return np.argmin(np.abs(nodes - np.asarray(values, dtype=float)[:, None]), axis=1)


def _is_node(nodes: np.ndarray, values) -> np.ndarray:
    values = np.asarray(values, dtype=float)
    slack = _SAME * max(float(np.abs(nodes).max()), np.finfo(float).tiny)
    return np.abs(nodes[_nearest_node(nodes, values)] - values) <= slack


def _listed(nodes: np.ndarray) -> str:
    return ", ".join(f"{node:g}" for node in nodes)
