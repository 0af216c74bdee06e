"""The sampled plants that a design must hold on."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise

import numpy as np

from ..errors import InputError
from ..machine.actuator import Actuator
from ..machine.variants import variants
from ..model.linearization import linearize
from ..model.operating_point import find_operating_points
from ..specification import Specification
from .sampled_plant import SampledFamily, sample


def sampled_plants(
    actuator: Actuator, x, y, loop: str, specification: Specification
) -> tuple[tuple[str, ...], SampledFamily]:
    """(labels, models): the sampled design plants over (variants, x, y); the first variant is the
    nominal plant.

    Raises InputError for a point that no linear model can describe, with variant and reason.
    """
    plants = variants(actuator, specification.uncertainty, specification.added_plants)
    return tuple(plants), sampled(plants, x, y, loop, specification)


def sampled(
    plants: Mapping[str, Actuator], x, y, loop: str, specification: Specification
) -> SampledFamily:
    """(plants, x, y) models of `plants`, by label; errors as in `sampled_plants`."""
    families = []
    for label, plant in plants.items():
        points = find_operating_points(plant, np.asarray(x, float)[:, None], np.asarray(y, float))
        if not points.feasible.all():
            raise InputError(f"{label} plant: {points.reason[~points.feasible][0]}")
        family = linearize(plant, points)
        delay = specification.delay_samples
        families.append(
            sample(family, loop=loop, sample_time=specification.sample_time, delay_samples=delay)
        )
    return SampledFamily.stack(families)


def design_pressure_drops(actuator: Actuator, x) -> np.ndarray:
    """(2, 2) in Pa: the drops over the open edges at A and B, retracting and extending, under the
    actuator's own load.

    They are those in the middle of the stroke and of the design openings x (nx,) of each side.
    """
    x = np.asarray(x, float)
    middles = [
        np.median(side) if (side := x[sign * x > 0.0]).size else sign for sign in (-1.0, 1.0)
    ]
    points = find_operating_points(actuator, middles, actuator.stroke / 2.0)
    if not points.feasible.all():
        raise InputError(
            f"pressure_compensation needs a motion either way: {points.reason[~points.feasible][0]}"
        )
    supply, tank = actuator.supply_pressure, actuator.tank_pressure
    (retract_a, extend_a), (retract_b, extend_b) = points.p_a, points.p_b
    return np.array([[retract_a - tank, supply - retract_b], [supply - extend_a, extend_b - tank]])


def with_midpoints(nodes: np.ndarray) -> np.ndarray:
    """`nodes` and the middles between neighbours of the same sign."""
    middles = [(a + b) / 2.0 for a, b in pairwise(nodes) if a * b >= 0.0]
    return np.sort(np.concatenate([nodes, middles]))
