"""`GainSchedule`: a scheduled regulator with the machine and the limits that it was designed
for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..loop.design_plants import sampled_plants, with_midpoints
from ..loop.hidden_coupling import CoupledLoops, cell_points, coupled_loops
from ..loop.margins import Loop, analyse
from ..machine.actuator import Actuator
from ..model import plant
from ..model.operating_point import find_operating_points
from ..regulator.compensation import Compensation
from ..regulator.scheduled import ScheduledRegulator
from ..regulator.structures import Regulators
from ..regulator.vectors import require_answers
from ..specification import Specification
from .document import read, write
from .file import document_of, fields_of, require_unchanged, vectors_in
from .margins import ScheduleMargins

_OF_THE_REGULATOR = (
    *(
        "loop",
        "structure",
        "x",
        "y",
        "kp",
        "ki",
        "kd",
        "notch_frequency",
        "Ts",
        "Tf",
        "Tm",
        "Tt",
        "b",
        "c",
        "zz",
        "zp",
        "sections",
    ),
    *(
        "feed_forward",
        "speed_gain_extend",
        "speed_gain_retract",
        "speed_offset_extend",
        "speed_offset_retract",
    ),
)


@dataclass(frozen=True, eq=False, kw_only=True)
class GainSchedule:
    """Gains at the nodes (nx, ny), the regulator law's constants, and the machine and limits that
    they were designed for."""

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
    """openings at which the limits were imposed; the nodes, unless one regulator serves a whole
    grid"""
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
    """(2, 2) in Pa: the design's drops over the open edges at A and B, retracting and extending;
    None: no compensation"""
    failed_checks: tuple[str, ...] = ()
    """requirements that its design found unmet or that an export passed over; empty: none is
    known"""

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

    @cached_property
    def regulator(self) -> ScheduledRegulator:
        """What runs on the machine: the tables and the constants of the law."""
        s, p = self.specification, plant.parameters(self.actuator)
        return ScheduledRegulator(
            **{name: getattr(self, name) for name in _OF_THE_REGULATOR},
            delay_samples=s.delay_samples,
            compensation=None
            if self.pressure_drops is None
            else compensation_of(p, self.pressure_drops),
            inverse_depth=s.dead_band_inverse * p.dead_band,
            inverse_width=p.dead_band or 1.0,
        )

    @property
    def regulators(self) -> Regulators:
        """The regulators at the nodes, shape (nx, ny)."""
        return self.regulator.regulators

    def gains(self, x, y) -> Regulators:
        """The regulators that act at x and y (arrays broadcast): bilinear, clipped, sides of x
        apart."""
        return self.regulator.gains(x, y)

    @cached_property
    def margins(self) -> ScheduleMargins:
        """Margins at the design points and half-way between them, for the nominal plant and every
        variant."""
        return check_margins(self, with_midpoints(self.design_x), with_midpoints(self.design_y))

    def save(self, path: str | Path) -> Path:
        """Write the schedule as JSON (see `schedule.document`), atomically."""
        return write(document_of(self, self.failed_checks), path)


def check_margins(schedule: GainSchedule, x, y) -> ScheduleMargins:
    """Margins of `schedule` on the grid x (mx,) by y (my,), for every variant of its
    specification."""
    x, y = np.asarray(x), np.asarray(y)
    labels, plants = sampled_plants(schedule.actuator, x, y, schedule.loop, schedule.specification)
    regulators = schedule.gains(x[:, None], y).broadcast_to(plants.shape)
    designed = np.isin(x, schedule.design_x)[:, None] & np.isin(y, schedule.design_y)
    return ScheduleMargins(labels, x, y, designed, analyse(Loop(plants, regulators)))


def check_coupling(schedule: GainSchedule) -> CoupledLoops:
    """The poles of the scheduled loops in every cell of the table, for every variant of the
    specification.

    Raises InputError for a schedule that the law cannot run, as `simulate_closed_loop` does.
    """
    x, y = cell_points(schedule.x), cell_points(schedule.y)
    labels, plants = sampled_plants(schedule.actuator, x, y, "position", schedule.specification)
    points = find_operating_points(schedule.actuator, x[:, None], y)
    return coupled_loops(schedule.regulator, labels, x, y, plants, points.v)


def load_schedule(path: str | Path) -> GainSchedule:
    """The schedule in a JSON file. Raises InputError that names the file and every fault."""
    document = read(path)
    try:
        schedule = GainSchedule(**fields_of(document))
        require_unchanged(document)
        require_answers(schedule.regulator, vectors_in(document))
    except InputError as error:
        raise InputError(f"{path}: {fault}" for fault in error.faults) from None
    return schedule


def compensation_of(p: plant.Parameters, pressure_drops: np.ndarray) -> Compensation:
    """What the compensation of the pressures needs of a machine, and the design's drops (2, 2) in Pa."""
    (retract_a, retract_b), (extend_a, extend_b) = pressure_drops
    return Compensation(
        flow_a=p.flow_coefficient_a * p.area_a,
        flow_b=p.flow_coefficient_b * p.area_b,
        volume_a=p.volume_a,
        volume_b=p.volume_b,
        area_a=p.area_a,
        area_b=p.area_b,
        stroke=p.stroke,
        supply_pressure=p.supply_pressure,
        tank_pressure=p.tank_pressure,
        extend_drop_a=float(extend_a),
        extend_drop_b=float(extend_b),
        retract_drop_a=float(retract_a),
        retract_drop_b=float(retract_b),
    )
