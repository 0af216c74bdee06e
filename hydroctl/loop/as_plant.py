"""`as_plant`: whatever describes linear plants, as a `PlantFamily`."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Any, Protocol, TypeAlias, runtime_checkable

import numpy as np

from ..errors import InputError
from ..machine.actuator import Actuator
from ..machine.variants import Ends, is_number
from ..model.linearization import LinearFamily
from ..model.operating_point import OperatingPoints
from ..quasi_linear.model import QuasiLinearModel
from ..quasi_linear.reduction import SecondOrderFamily
from .machine_plants import machine_plants
from .model_plants import GridPlants, SurfacePlants
from .plant_family import Change, PlantFamily
from .speed_models import SpeedModels, of_linear_family, of_second_order_family, of_systems

if TYPE_CHECKING:
    import control

Systems: TypeAlias = "Mapping[tuple[float, float], control.TransferFunction | control.StateSpace]"
Models: TypeAlias = "LinearFamily | SecondOrderFamily | QuasiLinearModel | Systems"
Plant: TypeAlias = "Actuator | Models | HasPlantFamily | PlantFamily"
NOMINAL = "nominal"
_FEEDBACK_FORM = "tangent"


@runtime_checkable
class HasPlantFamily(Protocol):
    """What knows its own plants, as an `Identification` does."""

    def plant_family(self) -> PlantFamily:
        """The plants."""
        ...


def as_plant(
    plant: Plant,
    *,
    variants: Mapping[str, Models] | None = None,
    uncertainty: str | Mapping[str, Ends] = NOMINAL,
    added_plants: Sequence[Change] = (),
) -> PlantFamily:
    """The linear plants of `plant`, from the valve opening x to the speed v in m/s, as everything
    that designs or judges a regulator sees them.

    plant: an `Actuator`, which varies by `uncertainty` and `added_plants` as in `Specification`; a
    tangent `LinearFamily` or `SecondOrderFamily` over a grid of x by y, behind the valve of its
    machine; a `QuasiLinearModel` or what identified one, wherever it may be used; or continuous
    python-control models {(x, y in m): TransferFunction or StateSpace from x to v} over a grid.
    Models vary by `variants`, {label: the same kind over the same points}. A `PlantFamily` is
    returned as it is.

    Raises InputError, all faults at once, for what is none of these, points that are no grid,
    points without a model, and models whose static gain is not above 0.
    """
    if isinstance(plant, Actuator):
        if variants:
            raise InputError(
                "variants are for models; an Actuator varies by uncertainty and added_plants."
            )
        return machine_plants(plant, uncertainty, added_plants)
    if uncertainty != NOMINAL or added_plants:
        raise InputError(
            f"{type(plant).__name__} has no parameters that an uncertainty or added_plants could "
            "vary; give its variants, {label: models}."
        )
    if isinstance(plant, PlantFamily | HasPlantFamily):
        if variants:
            raise InputError(
                "variants are of models; give them together with the models that the plants of "
                f"{type(plant).__name__} are made of."
            )
        return plant if isinstance(plant, PlantFamily) else plant.plant_family()
    return _of_models({NOMINAL: plant} | _checked(variants or {}))


def _checked(variants: Mapping[str, Models]) -> dict[str, Models]:
    if NOMINAL in variants:
        raise InputError(
            f"variants hold {NOMINAL!r}, which is what the plant itself is called; name them apart."
        )
    return dict(variants)


def _of_models(models: Mapping[str, Models]) -> PlantFamily:
    """The family of `models` of one kind, by label, the nominal one first."""
    nominal = models[NOMINAL]
    if isinstance(nominal, QuasiLinearModel):
        return SurfacePlants(_of_one_kind(models, QuasiLinearModel))
    if isinstance(nominal, LinearFamily):
        return _of_families(
            {
                label: (m, of_linear_family(m))
                for label, m in _of_one_kind(models, LinearFamily).items()
            }
        )
    if isinstance(nominal, SecondOrderFamily):
        reduced = _of_one_kind(models, SecondOrderFamily)
        return _of_families(
            {label: (m.family, of_second_order_family(m)) for label, m in reduced.items()}
        )
    if isinstance(nominal, Mapping):
        return _of_systems(_of_one_kind(models, Mapping))
    raise InputError(
        f"plant = {type(nominal).__name__} cannot be used; give an Actuator, a LinearFamily, "
        "SecondOrderFamily or QuasiLinearModel, an Identification, or "
        "{(x, y): control.TransferFunction or StateSpace}."
    )


def _of_one_kind(models: Mapping[str, Models], kind: type) -> dict[str, Any]:
    """The `models`, all of them of one `kind`."""
    if faults := [
        f"variant {label!r} is a {type(model).__name__}; it must be a {kind.__name__} as the plant."
        for label, model in models.items()
        if not isinstance(model, kind)
    ]:
        raise InputError(faults)
    return dict(models)


def _of_families(families: Mapping[str, tuple[LinearFamily, SpeedModels]]) -> GridPlants:
    """From the linear families that know points and form, and the models that are to count."""
    stacked, speeds, grids = [], [], []
    for label, (linear, models) in families.items():
        if linear.form != _FEEDBACK_FORM:
            raise InputError(
                f"{label} plant: form = {linear.form!r} is for simulation; a regulator needs "
                f"linearize(..., form={_FEEDBACK_FORM!r})."
            )
        x, y, order = _grid(label, linear.points)
        stacked.append(_flat(models).at(order))
        speeds.append(np.ravel(linear.points.v)[order])
        grids.append((x, y))
    _require_one_grid(list(families), grids)
    return _grid_plants(tuple(families), *grids[0], SpeedModels.stack(stacked), speeds[0])


def _of_systems(models: Mapping[str, Systems]) -> GridPlants:
    grids = [_grid_of_keys(label, systems) for label, systems in models.items()]
    _require_one_grid(list(models), grids)
    x, y = grids[0]
    places = [(label, a, b) for label in models for a in x.tolist() for b in y.tolist()]
    found = of_systems(
        [models[label][a, b] for label, a, b in places],
        [f"{label} plant, x={a:g}, y={b:g} m" for label, a, b in places],
    )
    order = np.arange(len(places)).reshape(len(models), x.size, y.size)
    return _grid_plants(tuple(models), x, y, found.at(order), None)


def _grid_plants(
    labels: tuple[str, ...],
    x: np.ndarray,
    y: np.ndarray,
    found: SpeedModels,
    speeds: np.ndarray | None,
) -> GridPlants:
    gain = found.static_gain()
    bad = np.argwhere(~((gain > 0.0) & np.isfinite(gain)))
    if bad.size:
        k, i, j = bad[0]
        raise InputError(
            f"{labels[k]} plant, x={x[i]:g}, y={y[j]:g} m: the static gain is {gain[k, i, j]:.4g} "
            "m/s; the speed must rise with x, and rest where x rests. Check the model's sign."
        )
    return GridPlants(labels, x, y, found, speeds)


def _grid(label: str, points: OperatingPoints) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """(x (nx,), y (ny,), flat index (nx, ny)) of points that fill a grid, each once."""
    x, y = (np.ravel(np.broadcast_to(values, points.shape)) for values in (points.x, points.y))
    nodes_x, row = np.unique(x, return_inverse=True)
    nodes_y, column = np.unique(y, return_inverse=True)
    order = np.full((nodes_x.size, nodes_y.size), -1)
    order[row, column] = np.arange(x.size)
    _require_filled(label, nodes_x, nodes_y, order >= 0, x.size)
    return nodes_x, nodes_y, order


def _grid_of_keys(label: str, systems: Systems) -> tuple[np.ndarray, np.ndarray]:
    keys = list(systems)
    if not keys or not all(_is_point(key) for key in keys):
        raise InputError(
            f"{label} plant: the keys of the models must be (x, y): valve opening and position in "
            "m, two finite numbers each."
        )
    x, y = (np.unique([float(key[axis]) for key in keys]) for axis in (0, 1))
    filled = np.array([[(a, b) in systems for b in y.tolist()] for a in x.tolist()])
    _require_filled(label, x, y, filled, len(keys))
    return x, y


def _is_point(key: object) -> bool:
    return isinstance(key, tuple) and len(key) == 2 and all(map(is_number, key))


def _require_filled(label: str, x, y, filled: np.ndarray, count: int) -> None:
    if (x == 0.0).any():
        raise InputError(
            f"{label} plant: x = 0 cannot be a node, because the plant has no derivative there; "
            "use a small opening of either sign."
        )
    if not filled.all():
        i, j = np.argwhere(~filled)[0]
        raise InputError(
            f"{label} plant: there is no model at x={x[i]:g}, y={y[j]:g} m; models must stand at "
            "every x by every y."
        )
    if count != filled.size:
        raise InputError(
            f"{label} plant: {count} models for {filled.size} points; give one load, and each "
            "point once."
        )


def _require_one_grid(labels: list[str], grids: list[tuple[np.ndarray, np.ndarray]]) -> None:
    for label, grid in zip(labels[1:], grids[1:], strict=True):
        if not all(np.array_equal(own, first) for own, first in zip(grid, grids[0], strict=True)):
            raise InputError(
                f"{label} plant: its models stand at other points than those of the nominal plant."
            )


def _flat(models: SpeedModels) -> SpeedModels:
    n = models.C.size
    count = math.prod(models.shape)
    return SpeedModels(
        models.A.reshape(count, n, n),
        models.B.reshape(count, n, 1),
        models.C,
        models.resonance.reshape(count, 2),
    )
