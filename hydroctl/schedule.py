"""`GainSchedule`: regulator gains over valve opening and position, with what it needs to run and to be checked.

The tables are bilinear between nodes and clipped outside. They never interpolate across x = 0: x >= 0 uses the nodes with
x > 0, x < 0 those with x < 0. The scheduling signals are the previous saturated x and the measured y.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path

import numpy as np

from . import __version__, schedule_document
from .actuator import PARAMETERS, Actuator
from .errors import InputError
from .frequency import SampledFamily, sample
from .linearization import linearize
from .margins import MARGIN_UNITS, Loop, Margins, analyse
from .operating_point import find_operating_points
from .regulators import GAINS, STRUCTURES, Regulators, require_structure
from .specification import Specification, variants


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
    def regulators(self) -> Regulators:
        """The regulators at the nodes, shape (nx, ny)."""
        return Regulators(self.Ts, self.kp, self.ki, self.kd, self.notch_frequency, self.Tf, self.zz, self.zp)

    def gains(self, x, y) -> Regulators:
        """The regulators that act at x and y (arrays broadcast): bilinear, clipped, sides of x apart."""
        index, weight = interpolation(self.x, self.y, x, y)
        tables = (self.kp, self.ki, self.kd, self.notch_frequency)
        values = ((np.ravel(table)[index] * weight).sum(axis=-1) for table in tables)
        return Regulators(self.Ts, *values, self.Tf, self.zz, self.zp)

    @cached_property
    def margins(self) -> ScheduleMargins:
        """Margins at the design points and half-way between them, for the nominal plant and every variant."""
        return check_margins(self, _with_midpoints(self.design_x), _with_midpoints(self.design_y))

    def save(self, path: str | Path) -> Path:
        """Write the schedule as JSON (see `schedule_document`), atomically."""
        return schedule_document.write(_to_document(self), path)


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
        """Where the margin `name` of `Margins` is worst: largest Ms, Mt; smallest of the others.

        `where` (mx, my), for example `designed`, leaves the other points out.
        """
        values = np.asarray(getattr(self.margins, name), float)
        badness = values if name in ("Ms", "Mt") else -values
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
    plants = variants(actuator, specification.uncertainty)
    families = []
    for label, plant in plants.items():
        points = find_operating_points(plant, np.asarray(x, float)[:, None], np.asarray(y, float))
        if not points.feasible.all():
            raise InputError(f"{label} plant: {points.reason[~points.feasible][0]}")
        family = linearize(plant, points)
        delay = specification.delay_samples
        families.append(sample(family, loop=loop, sample_time=specification.sample_time, delay_samples=delay))
    return tuple(plants), SampledFamily.stack(families)


def check_margins(schedule: GainSchedule, x, y) -> ScheduleMargins:
    """Margins of `schedule` on the grid x (mx,) by y (my,), for every variant of its specification."""
    labels, plants = sampled_plants(schedule.actuator, x, y, schedule.loop, schedule.specification)
    regulators = schedule.gains(np.asarray(x)[:, None], y).broadcast_to(plants.shape)
    designed = np.isin(x, schedule.design_x)[:, None] & np.isin(y, schedule.design_y)
    return ScheduleMargins(labels, np.asarray(x), np.asarray(y), designed, analyse(Loop(plants, regulators)))


def load_schedule(path: str | Path) -> GainSchedule:
    """The schedule in a JSON file. Raises InputError that names the file and every fault."""
    document = schedule_document.read(path)
    try:
        return _from_document(document)
    except InputError as error:
        raise InputError(f"{path}: {fault}" for fault in error.faults) from None


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


def _with_midpoints(nodes: np.ndarray) -> np.ndarray:
    """`nodes` and the middles between neighbours of the same sign."""
    middles = [(a + b) / 2.0 for a, b in pairwise(nodes) if a * b >= 0.0]
    return np.sort(np.concatenate([nodes, middles]))


_LAW = (
    "gains from the tables at (x of the previous sample, y); e = r - m; d = (Tf*d + e - e_previous)/(Tf + Ts); "
    "u = notch(kp*e + I + kd*d) + x_ff, x_ff = 0 where v_ref = 0; x = clip(u, limits); I = I + Ts*(ki*e + (x - u)/Tt), but I stays "
    "0 where ki is 0 in the whole table; x acts delay_samples after the measurement; all states start at 0; m is {measured}"
)
_MEASURED = {"velocity": "the speed v in m/s", "position": "the position y in m"}


def _to_document(schedule: GainSchedule) -> schedule_document.Document:
    d, units = schedule_document, schedule_document.GAIN_UNITS[schedule.loop]

    axes = [
        d.Axis(name="x", signal="previous saturated x", unit="1", values=schedule.x.tolist()),
        d.Axis(name="y", signal="measured position", unit="m", values=schedule.y.tolist()),
    ]
    tables = [d.Table(name=name, unit=unit, values=getattr(schedule, name).tolist()) for name, unit in units.items()]
    feed_forward = d.FeedForward(
        enabled=schedule.feed_forward,
        gain_extend=d.Speed(value=schedule.speed_gain_extend, unit="m/s"),
        gain_retract=d.Speed(value=schedule.speed_gain_retract, unit="m/s"),
        offset_extend=float(schedule.speed_offset_extend),
        offset_retract=float(schedule.speed_offset_retract),
    )
    actuator, specification = schedule.actuator, schedule.specification
    given = {name: value for name, value in actuator.parameters().items() if value is not None}
    parameters = {name: d.Quantity(value=value, unit=PARAMETERS[name].metadata["unit"]) for name, value in given.items()}
    machine = d.Machine(
        name=actuator.name,
        source=actuator.source,
        note=actuator.note,
        fingerprint=actuator.fingerprint(),
        parameters=parameters,
    )
    uncertainty = specification.uncertainty
    design = d.Design(
        x=schedule.design_x.tolist(),
        y=schedule.design_y.tolist(),
        Ms=float(specification.Ms),
        Mt=float(specification.Mt),
        gain_margin=specification.gain_margin,
        phase_margin=_optional(d.Angle, specification.phase_margin, "rad"),
        min_crossover=_optional(d.Frequency, specification.min_crossover, "rad/s"),
        high_frequency_gain=_optional(d.Gain, specification.high_frequency_gain, units["kp"]),
        uncertainty=uncertainty if isinstance(uncertainty, str) else dict(uncertainty),
        achieved=d.Margins(**{name: _achieved(schedule.margins.worst(name), unit) for name, unit in MARGIN_UNITS.items()}),
    )
    return d.Document(
        schema=d.SCHEMA,
        version=d.VERSION,
        generator=f"hydroctl {__version__}",
        loop=schedule.loop,
        structure=schedule.structure,
        controller=_controller(schedule),
        scheduling=d.Scheduling(
            interpolation="bilinear",
            extrapolation="clipped",
            order="row-major",
            sides="x >= 0 uses the nodes x > 0, x < 0 the nodes x < 0",
            axes=axes,
            tables=tables,
        ),
        feed_forward=feed_forward,
        actuator=machine,
        design=design,
    )


_OPTIONAL_LIMITS = ("phase_margin", "high_frequency_gain", "min_crossover")


def _optional(kind, value: float | None, unit: str):
    return None if value is None else kind(value=value, unit=unit)


def _controller(schedule: GainSchedule) -> schedule_document.Controller:
    d = schedule_document
    return d.Controller(
        form="parallel",
        law=_LAW.format(measured=_MEASURED[schedule.loop]),
        sample_time=d.Time(value=schedule.Ts, unit="s"),
        delay_samples=float(schedule.delay_samples),
        integral="forward Euler, stored in units of x",
        derivative="backward Euler, on the error",
        derivative_filter_time=d.Time(value=schedule.Tf, unit="s"),
        notch="Tustin prewarped at notch_frequency",
        notch_zero_damping=float(schedule.zz),
        notch_pole_damping=float(schedule.zp),
        set_point_weight=1,
        limits=(-1, 1),
        anti_windup="back-calculation from the saturated x, after the notch",
        anti_windup_time=d.Time(value=schedule.Tt, unit="s"),
    )


def _achieved(worst: WorstPoint, unit: str) -> schedule_document.Achieved:
    value = worst.value if np.isfinite(worst.value) else None
    return schedule_document.Achieved(value=value, unit=unit, variant=worst.variant, x=worst.x, y=worst.y)


def _from_document(document: schedule_document.Document) -> GainSchedule:
    controller, machine, design = document.controller, document.actuator, document.design
    parameters = {name: quantity.value for name, quantity in machine.parameters.items()}
    actuator = Actuator(name=machine.name, source=machine.source, note=machine.note, **parameters)
    if lacking := [name for name, value in actuator.parameters().items() if value is not None and name not in parameters]:
        raise InputError(f"actuator.parameters lacks {', '.join(lacking)}.")
    if actuator.fingerprint() != machine.fingerprint:
        raise InputError("actuator.fingerprint does not belong to actuator.parameters; the file was changed after it was written.")
    require_structure(document.structure)
    for table in document.scheduling.tables:
        if table.name in GAINS and table.name not in STRUCTURES[document.structure] and np.any(table.values):
            raise InputError(f"table {table.name} is not zero, but structure {document.structure!r} has no {table.name}.")
    specification = Specification(
        sample_time=controller.sample_time.value,
        delay_samples=controller.delay_samples,
        Ms=design.Ms,
        Mt=design.Mt,
        gain_margin=design.gain_margin,
        **{name: None if (limit := getattr(design, name)) is None else limit.value for name in _OPTIONAL_LIMITS},
        uncertainty=design.uncertainty,
        Tf=controller.derivative_filter_time.value,
        notch_damping=(controller.notch_zero_damping, controller.notch_pole_damping) if "notch" in document.structure else None,
    )
    x, y = (np.array(axis.values) for axis in document.scheduling.axes)
    return GainSchedule(
        actuator=actuator,
        specification=specification,
        loop=document.loop,
        structure=document.structure,
        x=x,
        y=y,
        design_x=np.array(design.x),
        design_y=np.array(design.y),
        **{table.name: np.array(table.values) for table in document.scheduling.tables},
        zz=controller.notch_zero_damping,
        zp=controller.notch_pole_damping,
        Tt=controller.anti_windup_time.value,
        feed_forward=document.feed_forward.enabled,
        speed_gain_extend=document.feed_forward.gain_extend.value,
        speed_gain_retract=document.feed_forward.gain_retract.value,
        speed_offset_extend=document.feed_forward.offset_extend,
        speed_offset_retract=document.feed_forward.offset_retract,
    )
