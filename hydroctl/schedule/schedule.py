"""`GainSchedule`: a scheduled regulator with the machine and the limits that it was designed
for."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import InputError
from ..loop.hidden_coupling import HiddenCoupling, hidden_coupling
from ..loop.machine_plants import machine_plants
from ..loop.margins import Loop, analyse
from ..loop.model_plants import ModelPlants
from ..loop.plant_family import PlantFamily
from ..loop.points import cell_points
from ..loop.quantity import POSITION, ControlledQuantity, LoopName, controlled_quantity
from ..loop.sampled_plant import SampledFamily
from ..machine.actuator import Actuator
from ..model import plant
from ..regulator.compensation import Compensation
from ..regulator.scheduled import ScheduledRegulator
from ..regulator.structures import Regulators
from ..regulator.vectors import require_answers
from ..specification import Specification
from .document import document_in, read, require_unchanged, write
from .file import document_of, fields_of, schedule_fingerprint, vectors_in
from .margins import ScheduleMargins
from .proof import Proof

_OF_THE_REGULATOR = (
    *(
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

    actuator: Actuator | None = None
    """the machine; None for a schedule of `models`"""
    models: ModelPlants | None = None
    """plants of which no machine is known; None for a schedule of a machine"""
    specification: Specification
    loop: LoopName
    """what is controlled: "velocity" or "position\""""
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
    """requirements that are known not to be met; an export by force passed over them"""
    proof: Proof | None = None
    """what was shown of it; see `own_proof`"""

    def __post_init__(self):
        if (self.actuator is None) == (self.models is None):
            raise InputError(
                "a schedule is for an actuator or for models of one's own; give one of the two."
            )
        if self.actuator is None and (self.pressure_drops is not None or self.dead_band_inverse):
            raise InputError(
                "pressure_compensation and dead_band_inverse need the pressures and the valve of a "
                "machine, which the models do not tell; leave them out."
            )

    @property
    def machine(self) -> Actuator:
        """The actuator. Raises InputError where there is none."""
        if self.actuator is None:
            raise InputError(
                "this schedule was designed on linear models; the nonlinear machine that this needs"
                " is not known. Design on the Actuator, or name one where an argument takes it."
            )
        return self.actuator

    @property
    def travel(self) -> float:
        """m: the farthest position, the stroke of the machine or the last of the design points."""
        return float(self.design_y[-1]) if self.actuator is None else self.actuator.stroke

    @property
    def quantity(self) -> ControlledQuantity:
        """What the loop controls."""
        return controlled_quantity(self.loop)

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
        return ScheduledRegulator(
            measured=self.quantity.signal,
            **{name: getattr(self, name) for name in _OF_THE_REGULATOR},
            delay_samples=self.delay_samples,
            **self._of_the_machine(),
        )

    def _of_the_machine(self) -> dict[str, Any]:
        """The constants of the law that a machine's pressures and valve set."""
        if self.actuator is None:
            return {"compensation": None, "inverse_depth": 0.0, "inverse_width": 1.0}
        p, drops = plant.parameters(self.actuator), self.pressure_drops
        return {
            "compensation": None if drops is None else compensation_of(p, drops),
            "inverse_depth": self.dead_band_inverse * p.valve.dead_band,
            "inverse_width": p.valve.dead_band or 1.0,
        }

    @property
    def plants(self) -> PlantFamily:
        """The nominal plant and every variant of the specification, or the schedule's `models`."""
        if self.models is not None:
            return self.models
        s = self.specification
        return machine_plants(self.machine, s.uncertainty, s.added_plants)

    def sampled_plants(self, x, y, quantity: ControlledQuantity | None = None) -> SampledFamily:
        """(variants, mx, my) models of `plants` from x[k] to what the loop controls, or to
        `quantity`, at x (mx,) by y (my,) m; errors as in `PlantFamily.sampled`."""
        return self.plants.sampled(
            x,
            y,
            self.quantity if quantity is None else quantity,
            sample_time=self.Ts,
            delay_samples=self.delay_samples,
        )

    @cached_property
    def fingerprint(self) -> str:
        """SHA-256 of the regulator, the plants and the specification."""
        return schedule_fingerprint(self)

    @property
    def own_proof(self) -> Proof | None:
        """`proof`, unless it was made for another schedule, as after `dataclasses.replace`."""
        own = self.proof is not None and self.proof.schedule == self.fingerprint
        return self.proof if own else None

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
        return check_margins(self, *self.plants.between(self.design_x, self.design_y))

    def save(self, path: str | Path) -> Path:
        """Write the schedule as JSON (see `schedule.document`), atomically."""
        return write(document_of(self), path)


def check_margins(schedule: GainSchedule, x, y) -> ScheduleMargins:
    """Margins of `schedule` on the grid x (mx,) by y (my,), for every variant of its
    specification."""
    x, y = np.asarray(x), np.asarray(y)
    plants = schedule.sampled_plants(x, y)
    regulators = schedule.gains(x[:, None], y).broadcast_to(plants.shape)
    designed = np.isin(x, schedule.design_x)[:, None] & np.isin(y, schedule.design_y)
    found = analyse(Loop(plants, regulators))
    return ScheduleMargins(schedule.plants.labels, x, y, designed, found)


def check_coupling(schedule: GainSchedule) -> HiddenCoupling:
    """The poles of the scheduled loops in every cell of the table, for every variant of the
    specification.

    Models that are known at some points alone stand for what is nearest to them. Raises InputError
    for a schedule that the law cannot run, as `simulate_closed_loop` does, and for plants whose
    steady speeds are not known.
    """
    x, y = cell_points(schedule.x), cell_points(schedule.y)
    places = schedule.plants.nearest(x, y)
    plants, speed = schedule.sampled_plants(*places, POSITION), schedule.plants.speed(*places)
    return hidden_coupling(schedule.regulator, schedule.plants.labels, x, y, plants, speed)


def load_schedule(path: str | Path) -> GainSchedule:
    """The schedule in a JSON file. Raises InputError that names the file and every fault."""
    content = read(path)
    try:
        document = document_in(content)
        schedule = GainSchedule(**fields_of(document))
        require_unchanged(content)
        require_answers(schedule.regulator, vectors_in(document))
    except InputError as error:
        raise InputError(f"{path}: {fault}" for fault in error.faults) from None
    return schedule


def compensation_of(p: plant.Parameters, pressure_drops: np.ndarray) -> Compensation:
    """What the compensation of the pressures needs of a machine, and the design's drops (2, 2) in
    Pa."""
    (retract_a, retract_b), (extend_a, extend_b) = pressure_drops
    return Compensation(
        flow_a=p.valve.flow_coefficient_a * p.chambers.area_a,
        flow_b=p.valve.flow_coefficient_b * p.chambers.area_b,
        volume_a=p.chambers.volume_a,
        volume_b=p.chambers.volume_b,
        area_a=p.chambers.area_a,
        area_b=p.chambers.area_b,
        stroke=p.end_stops.stroke,
        supply_pressure=p.supply.supply_pressure,
        tank_pressure=p.supply.tank_pressure,
        extend_drop_a=float(extend_a),
        extend_drop_b=float(extend_b),
        retract_drop_a=float(retract_a),
        retract_drop_b=float(retract_b),
    )
