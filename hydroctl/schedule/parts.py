"""The parts of a schedule file that make up the schedule: regulator, machine and specification."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, model_validator

from ..errors import unknown_name
from ..machine.actuator import ADDED_LATER, PARAMETERS
from ..regulator.compensation import LEAST_RATIO, MOST_RATIO

Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(allow_inf_nan=False, gt=0)]
MOST_NODES = 256
"""of one axis"""


class Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class Quantity(Part):
    """A number with its unit."""

    value: Number
    unit: str


class Time(Part):
    """A time in s."""

    value: Positive
    unit: Literal["s"]


class Duration(Part):
    """A time in s that may be 0."""

    value: Annotated[float, Field(ge=0, allow_inf_nan=False)]
    unit: Literal["s"]


class Pressure(Part):
    """A pressure."""

    value: Positive
    unit: Literal["Pa"]


class Angle(Part):
    """An angle in rad."""

    value: Positive
    unit: Literal["rad"]


class Frequency(Part):
    """An angular frequency."""

    value: Positive
    unit: Literal["rad/s"]


class Gain(Part):
    """A gain of the regulator, in the unit of kp."""

    value: Positive
    unit: str


class Speed(Part):
    """A speed in m/s, per unit of valve opening."""

    value: Positive
    unit: Literal["m/s"]


def require_ascending(name: str, values: list[float]) -> None:
    if any(b <= a for a, b in pairwise(values)):
        raise ValueError(f"{name} is not strictly ascending")


class Axis(Part):
    """One axis of the tables."""

    signal: Literal["previous_x", "y"]
    """the command of the sample before, or the measured position"""
    unit: Literal["1", "m"]
    nodes: Annotated[list[Number], Field(min_length=1, max_length=MOST_NODES)]
    """strictly ascending"""
    slopes: Annotated[list[Annotated[float, Field(ge=0, allow_inf_nan=False)]], Field(min_length=1)]
    """1/(distance to the next node), 0 at the last: never negative, because the nodes ascend"""

    @model_validator(mode="after")
    def _ordered(self):
        require_ascending(f"axis {self.signal}", self.nodes)
        if self.signal == "previous_x" and 0.0 in self.nodes:
            raise ValueError("axis previous_x must not have a node at 0")
        if self.slopes != slopes(self.nodes):
            raise ValueError("slopes are not 1/(distance to the next node), 0 at the last")
        return self


def slopes(nodes: list[float]) -> list[float]:
    """1/(distance to the next of the ascending `nodes`), 0 at the last."""
    return [*(1.0 / (b - a) for a, b in pairwise(nodes)), 0.0]


class Table(Part):
    """One table, rows along x, columns along y."""

    unit: str
    values: list[list[Number]]


class Tables(Part):
    """What is looked up."""

    kp: Table
    ki: Table
    kd: Table
    notch_frequency: Table

    def items(self) -> Iterator[tuple[str, Table]]:
        """(name, table)"""
        yield from ((name, getattr(self, name)) for name in type(self).model_fields)


class Scheduling(Part):
    """How gains are looked up."""

    interpolation: Literal["bilinear"]
    extrapolation: Literal["clipped"]
    sides: Literal["separate"]
    """previous_x >= 0 uses the nodes above 0, previous_x < 0 those below"""
    x: Axis
    y: Axis
    tables: Tables

    @model_validator(mode="after")
    def _shapes(self):
        rows, columns = len(self.x.nodes), len(self.y.nodes)
        for name, table in self.tables.items():
            if len(table.values) != rows or any(len(row) != columns for row in table.values):
                raise ValueError(f"table {name} is not {rows} rows of {columns} values")
        return self


class Section(Part):
    """A lead-lag section (s/(zero*wn) + 1)/(s/(pole*wn) + 1), wn = notch_frequency; Tustin
    prewarped at wn."""

    zero: Positive
    pole: Positive


class PressureCompensation(Part):
    """The command is multiplied by a ratio of the measured pressure drops to these, which are the
    design's."""

    limits: tuple[
        Annotated[float, Field(ge=LEAST_RATIO, le=LEAST_RATIO)],
        Annotated[float, Field(ge=MOST_RATIO, le=MOST_RATIO)],
    ]
    drop_a_retract: Pressure
    drop_b_retract: Pressure
    drop_a_extend: Pressure
    drop_b_extend: Pressure


class Controller(Part):
    """The settings of the regulator; what the law makes of them stands in `law`."""

    form: Literal["parallel"]
    sample_time: Time
    delay_samples: Annotated[float, Field(ge=0, allow_inf_nan=False)]
    derivative_on: Literal["error", "measurement"]
    derivative_filter_time: Time
    measurement_filter_time: Duration
    lead_lag: Annotated[list[Section], Field(max_length=2)]
    notch_zero_damping: Positive
    notch_pole_damping: Positive
    set_point_weight: Annotated[float, Field(ge=0, le=1)]
    limits: tuple[Literal[-1], Literal[1]]
    anti_windup_time: Time
    pressure_compensation: PressureCompensation | None
    dead_band_inverse: Annotated[float, Field(ge=0, le=1)]


class FeedForward(Part):
    """x_ff = v_ref / gain + offset for a moving reference, gain and offset by the sign of v_ref."""

    enabled: bool
    gain_extend: Speed
    gain_retract: Speed
    offset_extend: Number
    offset_retract: Number


class Machine(Part):
    """The actuator that the schedule was designed for."""

    name: str
    source: str
    note: str
    fingerprint: str
    parameters: dict[str, Quantity]

    @model_validator(mode="after")
    def _units(self):
        require_known(self.parameters)
        required = {
            name
            for name, spec in PARAMETERS.items()
            if spec.default is not None and name not in ADDED_LATER
        }
        if missing := sorted(required - set(self.parameters)):
            raise ValueError(f"parameter {', '.join(missing)} is missing")
        return self


def require_known(parameters: dict[str, Quantity]) -> None:
    if faults := [
        unknown_name("parameter", name, PARAMETERS) for name in parameters if name not in PARAMETERS
    ]:
        raise ValueError(" ".join(faults))
    for name, quantity in parameters.items():
        if quantity.unit != (unit := PARAMETERS[name].metadata["unit"]):
            raise ValueError(f"unit of {name} is {quantity.unit!r}, must be {unit!r}")


class Design(Part):
    """The specification, and the points x by y at which it was imposed."""

    x: Annotated[list[Number], Field(min_length=1)]
    y: Annotated[list[Number], Field(min_length=1)]
    Ms: Positive
    Mt: Positive
    gain_margin: Positive | None
    phase_margin: Angle | None
    high_frequency_gain: Gain | None
    min_crossover: Frequency | None
    notch_ratio: Positive = 1.0
    """notch frequency over the natural frequency of the nominal plant, as designed; left out of the
    file where it is 1"""
    uncertainty: str | dict[str, tuple[Positive, Positive] | tuple[str, str]]
    added_plants: list[dict[str, Quantity]] = []
    """further plants on which the limits were imposed, what each differs by; left out of the file
    where there is none"""

    @model_validator(mode="after")
    def _ordered(self):
        require_ascending("design.x", self.x)
        require_ascending("design.y", self.y)
        for change in self.added_plants:
            require_known(change)
        return self
