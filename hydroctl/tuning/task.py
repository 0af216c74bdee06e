"""What is to be tuned: plants, points, structure and limits, and what each gain contributes to
every loop."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, SupportsIndex

import numpy as np

from ..digits import apart
from ..errors import InputError, unknown_name
from ..loop.as_plant import NOMINAL, as_plant
from ..loop.plant_family import Change, PlantFamily
from ..loop.quantity import LOOPS, ControlledQuantity, LoopName, controlled_quantity
from ..loop.sampled_plant import SampledFamily
from ..machine.actuator import Actuator
from ..model.chambers import volumes
from ..model.plant import parameters
from ..regulator.structures import GAINS, STRUCTURES, Regulators, section_count
from ..specification import Specification
from .convex import Bounds

if TYPE_CHECKING:
    from ..loop.as_plant import Plant

_SMALLEST_FLOW = 0.02
_OPENINGS = np.array([_SMALLEST_FLOW, 0.06, 0.15, 0.4, 1.0])
_POSITIONS = (9, 25)
_RATIO_STEP = 0.2
_FINE = 2001
_NOTCH_REACH = 1.22
"""notch frequency over the lowest natural frequency of all plants: the most by default"""


def default_points(actuator: Actuator) -> tuple[np.ndarray, np.ndarray]:
    """(x, y) design points: five openings a side, from the smallest at which a linear model is
    used, and 9 to 25 positions.

    The smallest opening lets 2 % of the full flow pass; a dead band adds to it. From one position
    to the next the ratio of the chamber volumes changes by the same factor, because the stiffness
    of the oil follows it.
    """
    openings = actuator.dead_band + _OPENINGS * (1.0 - actuator.dead_band)
    y = np.linspace(0.0, actuator.stroke, _FINE)
    volume_a, volume_b = volumes(y, parameters(actuator).chambers)
    ratio = np.log(volume_a / volume_b)
    count = int(np.clip(np.ceil((ratio[-1] - ratio[0]) / _RATIO_STEP) + 1, *_POSITIONS))
    return np.concatenate([-openings[::-1], openings]), np.interp(
        np.linspace(ratio[0], ratio[-1], count), ratio, y
    )


@dataclass(frozen=True, eq=False)
class Task:
    """What is to be tuned: the sampled plants (variants, nx, ny) at the points x by y, and for
    what."""

    family: PlantFamily
    """the nominal plant and those that are counted; of a box, those that a search has found so
    far"""
    specification: Specification
    loop: LoopName
    structure: str
    x: np.ndarray
    y: np.ndarray
    plants: SampledFamily

    def part(self, rows, columns) -> Task:
        """The same task at some of the points."""
        flat = np.ravel_multi_index(
            np.ix_(range(self.plants.shape[0]), rows, columns), self.plants.shape
        )
        plants = self.plants.take(flat.ravel()).reshape(*flat.shape)
        return replace(self, x=self.x[rows], y=self.y[columns], plants=plants)

    def at(self, x: np.ndarray, y: np.ndarray) -> Task:
        """The same task at other points."""
        plants = _sampled(self.family, x, y, self.loop, self.specification)
        return replace(self, x=x, y=y, plants=plants)

    def with_plants(self, changes: Sequence[Change]) -> Task:
        """The same task on further plants, which differ from the nominal one by `changes`."""
        family = self.family.varied(changes)
        plants = _sampled(family, self.x, self.y, self.loop, self.specification)
        return replace(self, family=family, plants=plants)

    @property
    def searched_specification(self) -> Specification:
        """The specification, with the plants that were found in its box."""
        return replace(self.specification, added_plants=self.family.added_plants)

    def place(self, k: SupportsIndex, i: SupportsIndex, j: SupportsIndex) -> str:
        """The words for plant k at point (i, j)."""
        return f"x={self.x[i]:g}, y={self.y[j]:g} m, {self.family.labels[k]} plant"

    @property
    def notch_frequency(self) -> np.ndarray:
        """(nx, ny) rad/s: where notch and sections stand, in proportion to the natural frequency of
        the nominal plant."""
        return (self.specification.notch_ratio or 1.0) * self.plants.resonance[0, ..., 0]

    @property
    def used(self) -> list[int]:
        """Which of kp, ki, kd the structure uses."""
        return [GAINS.index(name) for name in STRUCTURES[self.structure]]

    @property
    def objective(self) -> int:
        """The gain to maximize, among those used: ki, or kp where there is no ki."""
        return min(1, len(self.used) - 1)

    @property
    def first(self) -> int:
        """The gain that the tuner starts from, among those used: in a velocity loop the objective,
        in a position loop, whose plant integrates, kp."""
        return 0 if self.quantity.integrations else self.objective

    @property
    def quantity(self) -> ControlledQuantity:
        """What the loop controls."""
        return controlled_quantity(self.loop)

    def regulators(self, gains: np.ndarray, notch_frequency: np.ndarray) -> Regulators:
        """Regulators of the shape of `notch_frequency` with gains (N, t)."""
        table = np.zeros((len(GAINS), *notch_frequency.shape))
        table[self.used] = gains.T.reshape(-1, *notch_frequency.shape)
        damping = self.specification.notch_damping if "notch" in self.structure else None
        zz, zp = damping or (1.0, 1.0)
        sections = self.specification.lead_lag[: section_count(self.structure)]
        Ts, Tf, Tm = (
            self.specification.sample_time,
            self.specification.Tf,
            self.specification.measurement_filter,
        )
        kp, ki, kd = table
        return Regulators(Ts, kp, ki, kd, notch_frequency, Tf, zz, zp, sections, Tm)

    def terms(self, notch_frequency: np.ndarray, omega: np.ndarray) -> np.ndarray:
        """(points, variants * n, t): what each gain contributes to the loop gain at omega
        (variants, nx, ny, n)."""
        terms = (
            self._notch(notch_frequency).terms(omega)[..., self.used]
            * self.plants.frequency_response(omega)[..., None]
        )
        return np.stack([self.by_point(terms[..., t]) for t in range(len(self.used))], axis=-1)

    def by_point(self, values: np.ndarray) -> np.ndarray:
        """(points, variants * n) from (variants, nx, ny, n)."""
        variants, nx, ny, n = values.shape
        return values.transpose(1, 2, 0, 3).reshape(nx * ny, variants * n)

    def bounds(self, notch_frequency: np.ndarray) -> Bounds:
        """|C| at the Nyquist frequency, where every term is real, as two bounds on the gains of
        each point; none if unlimited."""
        limit = self.specification.high_frequency_gain
        terms = (
            self._notch(notch_frequency)
            .terms([np.pi / self.specification.sample_time])[..., 0, self.used]
            .real
        )
        terms = terms.reshape(-1, 1, len(self.used))
        rows = terms[:, :0] if limit is None else np.concatenate([terms, -terms], axis=1)
        return Bounds(rows, np.full(rows.shape[:2], limit, dtype=float))

    def _notch(self, notch_frequency: np.ndarray) -> Regulators:
        return self.regulators(np.zeros((notch_frequency.size, len(self.used))), notch_frequency)


def task_of(
    plant: Plant, x, y, loop: LoopName, structure: str, specification: Specification | None
) -> Task:
    """The task with its arguments checked: errors as in `tune`."""
    specification = Specification() if specification is None else specification
    everything, specification = _family_of(plant, specification)
    if everything.grid is not None:
        x, y = (
            own if given is None else given
            for own, given in zip(everything.grid, (x, y), strict=True)
        )
    faults = [
        fault for name, values in (("x", x), ("y", y)) if (fault := _points_fault(name, values))
    ]
    faults += [] if structure in STRUCTURES else [unknown_name("structure", structure, STRUCTURES)]
    faults += [] if loop in LOOPS else [unknown_name("loop", loop, LOOPS)]
    if faults:
        raise InputError(faults)
    x, y = (np.atleast_1d(np.asarray(values, dtype=float)) for values in (x, y))
    if "notch" in structure:
        plants = _sampled(everything, x, y, loop, specification)
        specification = _notch_settled(specification, loop, plants)
    family = everything.without_corners
    plants = _sampled(family, x, y, loop, specification)
    task = Task(family, specification, loop, structure, x, y, plants)
    highest = task.notch_frequency.max()
    shaped = "notch" in structure or section_count(structure) > 0
    if shaped and task.notch_frequency.min() <= 0.0:
        raise InputError(
            f"structure = {structure!r} stands a notch or lead at the plant's natural frequency, "
            "and a model has none; choose a structure without."
        )
    if shaped and highest >= np.pi / specification.sample_time:
        given, needed = apart(specification.sample_time, np.pi / highest, digits=3)
        raise InputError(
            f"sample_time = {given} s: a notch or lead at {highest:.4g} rad/s, where the plant's"
            f" natural frequency puts it, needs one below {needed} s. Sample faster or choose a"
            " structure without."
        )
    return task


def _family_of(plant: Plant, specification: Specification) -> tuple[PlantFamily, Specification]:
    """The plants that are to count, and the specification with what they vary by."""
    given = specification.uncertainty
    if isinstance(plant, Actuator):
        added = specification.added_plants
        return as_plant(plant, uncertainty=given, added_plants=added), specification
    family = as_plant(plant)
    if family.actuator is not None:
        return _family_of(family.actuator, specification)
    if given not in (Specification.uncertainty, NOMINAL) or specification.added_plants:
        raise InputError(
            f"uncertainty = {given!r} and added_plants vary the parameters of a machine; models "
            "vary by their own variants (see as_plant)."
        )
    return family, replace(specification, uncertainty=NOMINAL)


def _sampled(
    family: PlantFamily, x: np.ndarray, y: np.ndarray, loop: str, specification: Specification
) -> SampledFamily:
    return family.sampled(
        x,
        y,
        controlled_quantity(loop),
        sample_time=specification.sample_time,
        delay_samples=specification.delay_samples,
    )


def _notch_settled(specification: Specification, loop: str, plants: SampledFamily) -> Specification:
    """`specification` with what it leaves open of the notch; `plants` are all that it counts, and
    the corners of its box.

    A notch above the natural frequency of a plant turns the phase of its resonance towards -180
    degrees: it must not stand far above that of the softest and heaviest one, where the gain is
    largest, too.
    """
    ratio, resonance = specification.notch_ratio, plants.resonance[..., 0]
    if ratio is None:
        reach = (
            _NOTCH_REACH * float((resonance / resonance[0]).min())
            if specification.notch_damping is None
            else 1.0
        )
        ratio = min(1.0, reach)
    return replace(
        specification,
        notch_damping=specification.notch_damping or controlled_quantity(loop).notch_damping,
        notch_ratio=ratio,
    )


def _points_fault(name: str, values) -> str | None:
    if values is None:
        return f"{name} nodes are missing; only models on a grid have points of their own."
    try:
        points = np.atleast_1d(np.asarray(values, dtype=float))
    except (TypeError, ValueError):
        points = np.array([])
    if (
        points.ndim != 1
        or points.size == 0
        or not np.isfinite(points).all()
        or (np.diff(points) <= 0.0).any()
    ):
        return f"{name} nodes = {values!r} must be one ascending row of finite numbers."
    if name == "x" and (points == 0.0).any():
        return (
            "x = 0 cannot be a node, because the plant has no derivative there; use a small opening"
            " of either sign."
        )
    return None
