"""Linear plants of one's own in the schedule file: what stands there in place of a machine."""

from __future__ import annotations

from itertools import pairwise
from typing import Annotated, Literal

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from ..loop.model_plants import GridPlants, ModelPlants
from ..loop.speed_models import SpeedModels

Number = Annotated[float, Field(allow_inf_nan=False)]
Row = Annotated[list[Number], Field(min_length=1)]
Matrix = Annotated[list[Row], Field(min_length=1)]


class PlantModels(BaseModel):
    """Models dz/dt = A z + B x, v = C z at the points x by y; v in m/s, t in s, states of any
    unit."""

    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)

    variants: Annotated[list[str], Field(min_length=1)]
    """the first is the nominal plant"""
    x: Row
    y: Row
    unit_of_y: Literal["m"]
    A: list[list[list[Matrix]]]
    """by variant, x and y: n rows of n"""
    B: list[list[list[Row]]]
    """by variant, x and y: n numbers"""
    C: Row
    """n numbers, the same for all"""
    natural_frequency: list[list[Row]]
    """by variant, x and y, in rad/s"""
    damping: list[list[Row]]
    """by variant, x and y"""
    steady_speed: list[Row] | None
    """of the nominal plant by x and y, in m/s; null where it is not known"""

    @model_validator(mode="after")
    def _shapes(self):
        for name in ("x", "y"):
            if any(b <= a for a, b in pairwise(getattr(self, name))):
                raise ValueError(f"{name} is not strictly ascending")
        points, n = (len(self.variants), len(self.x), len(self.y)), len(self.C)
        shapes = {
            "A": (*points, n, n),
            "B": (*points, n),
            "natural_frequency": points,
            "damping": points,
        }
        if self.steady_speed is not None:
            shapes["steady_speed"] = points[1:]
        for name, shape in shapes.items():
            if _shape(getattr(self, name)) != shape:
                raise ValueError(f"{name} is not of the shape {shape}")
        return self


def _shape(values) -> tuple[int, ...] | None:
    """The shape of nested lists; None where they are ragged."""
    try:
        return np.shape(values)
    except ValueError:
        return None


def models_part(models: ModelPlants, x: np.ndarray, y: np.ndarray) -> PlantModels:
    """`models` at the points x by y."""
    grid = models.on_grid(x, y)
    frequency, damping = np.moveaxis(grid.models.resonance, -1, 0)
    return PlantModels(
        variants=list(grid.variants),
        x=grid.x.tolist(),
        y=grid.y.tolist(),
        unit_of_y="m",
        A=grid.models.A.tolist(),
        B=grid.models.B[..., 0].tolist(),
        C=grid.models.C.tolist(),
        natural_frequency=frequency.tolist(),
        damping=damping.tolist(),
        steady_speed=None if grid.speeds is None else grid.speeds.tolist(),
    )


def models_of(part: PlantModels) -> GridPlants:
    """The plants that `models_part` describes."""
    resonance = np.stack([np.array(part.natural_frequency), np.array(part.damping)], axis=-1)
    models = SpeedModels(np.array(part.A), np.array(part.B)[..., None], np.array(part.C), resonance)
    speeds = None if part.steady_speed is None else np.array(part.steady_speed)
    return GridPlants(tuple(part.variants), np.array(part.x), np.array(part.y), models, speeds)
