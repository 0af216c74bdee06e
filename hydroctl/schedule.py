"""`GainSchedule`: regulator gains over valve opening and position, with what it needs to run and to be checked.

The tables are bilinear between nodes and clipped outside. They never interpolate across x = 0: x >= 0 uses the nodes with
x > 0, x < 0 those with x < 0. The scheduling signals are the previous saturated x and the measured y.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path

import numpy as np

from . import schedule_document
from .actuator import Actuator
from .errors import InputError
from .frequency import SampledFamily, sample
from .linearization import linearize
from .margins import MARGIN_UNITS, WORST_AT_MOST, Loop, Margins, analyse
from .operating_point import find_operating_points
from .regulators import Regulators
from .schedule_file import document_of, fields_of, require_unchanged, vectors_in
from .specification import Specification, variants
from .test_vectors import require_answers


@dataclass(frozen=True, eq=False, kw_only=True)
class GainSchedule:
    """Gains at the nodes (nx, ny), the regulator law's constants, and the machine and limits that they were designed for."""

    actuator: Actuator
    specification: Specification
    loop: str
    """"velocity" or "position\""""
    structure: str
    x: np.ndarray
    """(nx,) nodes of the valve opening, ascending, none zero"""
    y: np.ndarray
    """(ny,) nodes of the position in m, ascending"""
    design_x: np.ndarray
    """openings at which the limits were imposed; the nodes, unless one regulator serves a whole grid"""
    design_y: np.ndarray
    """positions at which the limits were imposed, m"""
    kp: np.ndarray
    """(nx, ny), x per m/s (velocity) or per m (position)"""
    ki: np.ndarray
    """(nx, ny), as kp per s"""
    kd: np.ndarray
    """(nx, ny), as kp times s"""
    notch_frequency: np.ndarray
    """(nx, ny), rad/s"""
    zz: float
    """damping of the notch's zeros; equal to zp where there is no notch"""
    zp: float
    """damping of the notch's poles"""
    sections: tuple[tuple[float, float], ...] = ()
    """(zero, pole) of each lead-lag section, as multiples of the notch frequency"""
    Tt: float
    """time constant of the anti-windup in s"""
    feed_forward: bool
    """whether x_ff = v_ref / speed_gain + speed_offset is added for a moving reference"""
    speed_gain_extend: float
    """dv/dx in m/s for v_ref > 0"""
    speed_gain_retract: float
    """dv/dx in m/s for v_ref < 0"""
    speed_offset_extend: float
    """x at which extending starts (leakage)"""
    speed_offset_retract: float
    """x at which retracting starts (leakage)"""
    pressure_drops: np.ndarray | None = None
    """(2, 2) in Pa: the design's drops over the open edges at A and B, retracting and extending; None: no compensation"""
    failed_checks: tuple[str, ...] = ()
    """requirements that its design found unmet or that an export passed over; empty: none is known"""

    @property
    def Ts(self) -> float:
        """Sample time in s."""
        return self.specification.sample_time

    @property
    def delay_samples(self) -> float:
        """Delay from measurement to valve command in samples."""
        return self.specification.delay_samples

    @property
    def Tf(self) -> float:
        """Derivative filter time in s."""
        return self.specification.Tf

    @property
    def Tm(self) -> float:
        """Time of the filter of the measurement in s; 0: none."""
        return self.specification.measurement_filter

    @property
    def b(self) -> float:
        """Set-point weight of kp."""
        return self.specification.set_point_weight

    @property
    def c(self) -> float:
        """Set-point weight of kd: 1 for a derivative on the error, 0 on the measurement."""
        return 1.0 if self.specification.derivative_on == "error" else 0.0

    @property
    def dead_band_inverse(self) -> float:
        """The share of the valve's dead band that the command jumps over."""
        return self.specification.dead_band_inverse

    @property
    def regulators(self) -> Regulators:
        """The regulators at the nodes, shape (nx, ny)."""
        return self._regulators(self.kp, self.ki, self.kd, self.notch_frequency)

    def gains(self, x, y) -> Regulators:
        """The regulators that act at x and y (arrays broadcast): bilinear, clipped, sides of x apart."""
        index, weight = interpolation(self.x, self.y, x, y)
        tables = (self.kp, self.ki, self.kd, self.notch_frequency)
        values = ((np.ravel(table)[index] * weight).sum(axis=-1) for table in tables)
        return self._regulators(*values)

    def _regulators(self, *tables) -> Regulators:
        return Regulators(self.Ts, *tables, self.Tf, self.zz, self.zp, self.sections, self.Tm)

    @cached_property
    def margins(self) -> ScheduleMargins:
        """Margins at the design points and half-way between them, for the nominal plant and every variant."""
        return check_margins(self, with_midpoints(self.design_x), with_midpoints(self.design_y))

    def save(self, path: str | Path) -> Path:
        """Write the schedule as JSON (see `schedule_document`), atomically."""
        return schedule_document.write(document_of(self, self.failed_checks), path)


@dataclass(frozen=True, eq=False)
class ScheduleMargins:
    """Margins of a schedule over variants of the plant and points between and at its nodes."""

    variants: tuple[str, ...]
    x: np.ndarray
    """(mx,)"""
    y: np.ndarray
    """(my,) m"""
    designed: np.ndarray
    """(mx, my): True where the limits were imposed"""
    margins: Margins
    """over (variants, mx, my)"""

    def worst(self, name: str, *, where: np.ndarray | None = None) -> WorstPoint:
        """Where the margin `name` of `Margins` is worst: the largest of `WORST_AT_MOST`, the smallest of the others.

        `where` (mx, my), for example `designed`, leaves the other points out.
        """
        values = np.asarray(getattr(self.margins, name), float)
        badness = values if name in WORST_AT_MOST else -values
        if where is not None:
            badness = np.where(where, badness, -np.inf)
        k, i, j = np.unravel_index(np.argmax(badness), badness.shape)
        return WorstPoint(name, float(values[k, i, j]), self.variants[k], float(self.x[i]), float(self.y[j]))

    def to_csv(self) -> str:
        """One line for each point and variant: x, y in m, whether it is a design point, and the margins with their units."""
        header = ["variant", "x", "y [m]", "design point", *(f"{name} [{unit}]" for name, unit in MARGIN_UNITS.items()), "stable"]
        lines = [",".join(header)]
        columns = [getattr(self.margins, name) for name in MARGIN_UNITS]
        for k, i, j in np.ndindex(self.margins.Ms.shape):
            values = [f"{column[k, i, j]:.8g}" for column in columns]
            flags = [str(bool(self.designed[i, j])), *values, str(bool(self.margins.stable[k, i, j]))]
            lines.append(",".join([f'"{self.variants[k]}"', f"{self.x[i]:.8g}", f"{self.y[j]:.8g}", *flags]))
        return "\n".join(lines) + "\n"

    @property
    def unstable(self) -> int:
        """How many closed loops are unstable."""
        return int(np.count_nonzero(~self.margins.stable))


@dataclass(frozen=True)
class WorstPoint:
    """One margin's worst value and where it is."""

    margin: str
    value: float
    variant: str
    x: float
    y: float


def sampled_plants(actuator: Actuator, x, y, loop: str, specification: Specification) -> tuple[tuple[str, ...], SampledFamily]:
    """(labels, models): the sampled design plants over (variants, x, y); the first variant is the nominal plant.

    Raises InputError for a point that no linear model can describe, with variant and reason.
    """
    plants = variants(actuator, specification)
    return tuple(plants), sampled(plants, x, y, loop, specification)


def sampled(plants: Mapping[str, Actuator], x, y, loop: str, specification: Specification) -> SampledFamily:
    """(plants, x, y) models of `plants`, by label; errors as in `sampled_plants`."""
    families = []
    for label, plant in plants.items():
        points = find_operating_points(plant, np.asarray(x, float)[:, None], np.asarray(y, float))
        if not points.feasible.all():
            raise InputError(f"{label} plant: {points.reason[~points.feasible][0]}")
        family = linearize(plant, points)
        delay = specification.delay_samples
        families.append(sample(family, loop=loop, sample_time=specification.sample_time, delay_samples=delay))
    return SampledFamily.stack(families)


def check_margins(schedule: GainSchedule, x, y) -> ScheduleMargins:
    """Margins of `schedule` on the grid x (mx,) by y (my,), for every variant of its specification."""
    labels, plants = sampled_plants(schedule.actuator, x, y, schedule.loop, schedule.specification)
    regulators = schedule.gains(np.asarray(x)[:, None], y).broadcast_to(plants.shape)
    designed = np.isin(x, schedule.design_x)[:, None] & np.isin(y, schedule.design_y)
    return ScheduleMargins(labels, np.asarray(x), np.asarray(y), designed, analyse(Loop(plants, regulators)))


def design_pressure_drops(actuator: Actuator, x) -> np.ndarray:
    """(2, 2) in Pa: the drops over the open edges at A and B, retracting and extending, under the actuator's own load.

    They are those in the middle of the stroke and of the design openings x (nx,) of each side.
    """
    x = np.asarray(x, float)
    middles = [np.median(side) if (side := x[sign * x > 0.0]).size else sign for sign in (-1.0, 1.0)]
    points = find_operating_points(actuator, middles, actuator.stroke / 2.0)
    if not points.feasible.all():
        raise InputError(f"pressure_compensation needs a motion either way: {points.reason[~points.feasible][0]}")
    supply, tank = actuator.supply_pressure, actuator.tank_pressure
    (retract_a, extend_a), (retract_b, extend_b) = points.p_a, points.p_b
    return np.array([[retract_a - tank, supply - retract_b], [supply - extend_a, extend_b - tank]])


def load_schedule(path: str | Path) -> GainSchedule:
    """The schedule in a JSON file. Raises InputError that names the file and every fault."""
    document = schedule_document.read(path)
    try:
        schedule = GainSchedule(**fields_of(document))
        require_unchanged(document)
        require_answers(schedule, vectors_in(document))
    except InputError as error:
        raise InputError(f"{path}: {fault}" for fault in error.faults) from None
    return schedule


def interpolation(x_nodes: np.ndarray, y_nodes: np.ndarray, x, y):
    """(index, weight), each (..., 4): which entries of a raveled table (nx, ny) make up the value at x and y (broadcast).

    Bilinear and clipped. x >= 0 uses the nodes x > 0 and x < 0 the nodes x < 0; where a side has no nodes, all of them.
    """
    x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
    row, along_x = _locate_sided(x_nodes, x)
    column, along_y = _locate(y_nodes, y)
    next_row, next_column = np.minimum(row + 1, len(x_nodes) - 1), np.minimum(column + 1, len(y_nodes) - 1)
    corners = ((row, column), (row, next_column), (next_row, column), (next_row, next_column))
    index = np.stack([i * len(y_nodes) + j for i, j in corners], axis=-1)
    along = ((1.0 - along_x, 1.0 - along_y), (1.0 - along_x, along_y), (along_x, 1.0 - along_y), (along_x, along_y))
    return index, np.stack([a * b for a, b in along], axis=-1)


def _locate(nodes: np.ndarray, value: np.ndarray):
    """(index of the node at or below, fraction of the way to the next), clipped to the nodes."""
    index = np.clip(np.searchsorted(nodes, value, side="right") - 1, 0, max(len(nodes) - 2, 0))
    if len(nodes) == 1:
        return index, np.zeros_like(value)
    return index, np.clip((value - nodes[index]) / (nodes[index + 1] - nodes[index]), 0.0, 1.0)


def _locate_sided(nodes: np.ndarray, value: np.ndarray):
    """`_locate` among the nodes on the side of `value`, or among all where that side has none."""
    first = int(np.searchsorted(nodes, 0.0))
    left, along_left = _locate(nodes[:first] if first else nodes, value)
    right, along_right = _locate(nodes[first:] if first < len(nodes) else nodes, value)
    positive = value >= 0.0
    return np.where(positive, right + (first if first < len(nodes) else 0), left), np.where(positive, along_right, along_left)


def with_midpoints(nodes: np.ndarray) -> np.ndarray:
    """`nodes` and the middles between neighbours of the same sign."""
    middles = [(a + b) / 2.0 for a, b in pairwise(nodes) if a * b >= 0.0]
    return np.sort(np.concatenate([nodes, middles]))
