"""The schedule file: JSON with a unit on every quantity, and the regulator law stated in full.

The pydantic models below are the file's definition. Reading is strict: unknown or missing fields,
wrong types, numbers that are not finite, wrong shapes and unsorted axes are errors, all of them
reported at once.
"""

from __future__ import annotations

import hashlib
import json
from itertools import pairwise
from pathlib import Path
from typing import Annotated, Literal

from pydantic import BaseModel, ConfigDict, Field, ValidationError, model_validator

from ..errors import InputError, unknown_name
from ..files import write_file
from ..machine.actuator import ADDED_LATER, PARAMETERS
from ..regulator.compensation import LEAST_RATIO, MOST_RATIO
from ..regulator.units import GAIN_UNITS
from .versions import upgraded

SCHEMA = "hydroctl.gain-schedule"
FALLBACK = "where an input, a state or x is not finite, x = 0, and the next sound sample is a start"
SCHEMA_FILE = Path(__file__).with_name("schedule.schema.json")
_LARGEST_FILE = 50_000_000

Number = Annotated[float, Field(allow_inf_nan=False)]
Positive = Annotated[float, Field(allow_inf_nan=False, gt=0)]


class _Part(BaseModel):
    model_config = ConfigDict(extra="forbid", frozen=True, strict=True)


class Quantity(_Part):
    """A number with its unit."""

    value: Number
    unit: str


class Time(_Part):
    """A time in s."""

    value: Positive
    unit: Literal["s"]


class Duration(_Part):
    """A time in s that may be 0."""

    value: Annotated[float, Field(ge=0, allow_inf_nan=False)]
    unit: Literal["s"]


class Pressure(_Part):
    """A pressure."""

    value: Positive
    unit: Literal["Pa"]


class Angle(_Part):
    """An angle in rad."""

    value: Positive
    unit: Literal["rad"]


class Frequency(_Part):
    """An angular frequency."""

    value: Positive
    unit: Literal["rad/s"]


class Gain(_Part):
    """A gain of the regulator, in the unit of kp."""

    value: Positive
    unit: str


class Speed(_Part):
    """A speed in m/s, per unit of valve opening."""

    value: Positive
    unit: Literal["m/s"]


def _require_ascending(name: str, values: list[float]) -> None:
    if any(b <= a for a, b in pairwise(values)):
        raise ValueError(f"{name} is not strictly ascending")


class Axis(_Part):
    """One axis of the tables, ascending."""

    name: Literal["x", "y"]
    signal: str
    unit: str
    values: Annotated[list[Number], Field(min_length=1)]

    @model_validator(mode="after")
    def _ordered(self):
        _require_ascending(f"axis {self.name}", self.values)
        return self


class Table(_Part):
    """One table, rows along x, columns along y."""

    name: Literal["kp", "ki", "kd", "notch_frequency"]
    unit: str
    values: list[list[Number]]


class Scheduling(_Part):
    """How gains are looked up."""

    interpolation: Literal["bilinear"]
    extrapolation: Literal["clipped"]
    order: Literal["row-major"]
    sides: Literal["x >= 0 uses the nodes x > 0, x < 0 the nodes x < 0"]
    axes: list[Axis]
    tables: list[Table]

    @model_validator(mode="after")
    def _shapes(self):
        if [axis.name for axis in self.axes] != ["x", "y"]:
            raise ValueError("axes must be x, then y")
        if [table.name for table in self.tables] != ["kp", "ki", "kd", "notch_frequency"]:
            raise ValueError("tables must be kp, ki, kd, notch_frequency, in this order")
        if 0.0 in self.axes[0].values:
            raise ValueError("axis x must not have a node at 0")
        rows, columns = (len(axis.values) for axis in self.axes)
        for table in self.tables:
            if len(table.values) != rows or any(len(row) != columns for row in table.values):
                raise ValueError(f"table {table.name} is not {rows} rows of {columns} values")
        return self


class Section(_Part):
    """A lead-lag section (s/(zero*wn) + 1)/(s/(pole*wn) + 1), wn = notch_frequency; Tustin
    prewarped at wn."""

    zero: Positive
    pole: Positive


class PressureCompensation(_Part):
    """The command is multiplied by a ratio of the measured pressure drops to these, which are the
    design's."""

    ratio: Literal[
        "q_ref/q, q = g_a*sqrt(drop_a)/V_a(y) + g_b*sqrt(drop_b)/V_b(y) over the open edges, g = area*flow coefficient"
    ]
    limits: tuple[
        Annotated[float, Field(ge=LEAST_RATIO, le=LEAST_RATIO)],
        Annotated[float, Field(ge=MOST_RATIO, le=MOST_RATIO)],
    ]
    drop_a_retract: Pressure
    drop_b_retract: Pressure
    drop_a_extend: Pressure
    drop_b_extend: Pressure


class Controller(_Part):
    """The regulator law."""

    form: Literal["parallel"]
    law: str
    sample_time: Time
    delay_samples: Annotated[float, Field(ge=0, allow_inf_nan=False)]
    integral: Literal["forward Euler, stored in units of x"]
    derivative: Literal["backward Euler, on the error", "backward Euler, on the measurement"]
    derivative_filter_time: Time
    measurement_filter_time: Duration
    lead_lag: Annotated[list[Section], Field(max_length=2)]
    notch: Literal["Tustin prewarped at notch_frequency"]
    notch_zero_damping: Positive
    notch_pole_damping: Positive
    set_point_weight: Annotated[float, Field(ge=0, le=1)]
    limits: tuple[Literal[-1], Literal[1]]
    anti_windup: Literal["back-calculation from the saturated x, after the notch"]
    anti_windup_time: Time
    pressure_compensation: PressureCompensation | None
    dead_band_inverse: Annotated[float, Field(ge=0, le=1)]
    start: Literal["m_f = m, g_previous = (c - 1)*m, all other states 0"]
    fallback: Literal[
        FALLBACK, "where an input is not finite, x = 0, and the next sound sample is a start"
    ]
    """the second text stands in older files"""


class FeedForward(_Part):
    """x_ff = v_ref / gain + offset for a moving reference, gain and offset by the sign of v_ref."""

    enabled: bool
    gain_extend: Speed
    gain_retract: Speed
    offset_extend: Number
    offset_retract: Number


class Machine(_Part):
    """The actuator that the schedule was designed for."""

    name: str
    source: str
    note: str
    fingerprint: str
    parameters: dict[str, Quantity]

    @model_validator(mode="after")
    def _units(self):
        _require_known(self.parameters)
        required = {
            name
            for name, spec in PARAMETERS.items()
            if spec.default is not None and name not in ADDED_LATER
        }
        if missing := sorted(required - set(self.parameters)):
            raise ValueError(f"parameter {', '.join(missing)} is missing")
        return self


def _require_known(parameters: dict[str, Quantity]) -> None:
    if faults := [
        unknown_name("parameter", name, PARAMETERS) for name in parameters if name not in PARAMETERS
    ]:
        raise ValueError(" ".join(faults))
    for name, quantity in parameters.items():
        if quantity.unit != (unit := PARAMETERS[name].metadata["unit"]):
            raise ValueError(f"unit of {name} is {quantity.unit!r}, must be {unit!r}")


class Achieved(_Part):
    """The worst value of one margin, and where it is; null where it is infinite."""

    value: Number | None
    unit: Literal["1", "rad", "s", "rad/s"]
    variant: str
    x: Number
    y: Number


class Margins(_Part):
    """The worst margins over nodes, midpoints and variants."""

    Ms: Achieved
    Mt: Achieved
    gain_margin: Achieved
    gain_reduction_margin: Achieved | None = None
    """left out of files that were written before it had a name"""
    phase_margin: Achieved
    delay_margin: Achieved
    crossover: Achieved


class Design(_Part):
    """The specification, the points x by y at which it was imposed, and the margins that were
    reached."""

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
    achieved: Margins

    @model_validator(mode="after")
    def _ordered(self):
        _require_ascending("design.x", self.x)
        _require_ascending("design.y", self.y)
        for change in self.added_plants:
            _require_known(change)
        return self


class TestVectors(_Part):
    """What the law answers, sample by sample; an input that is not finite (a broken sensor) is
    null, and so are its gains.

    start: null where the law goes on (at the first row from rest), else the x at which it is
    started just before the row.
    """

    columns: Literal[
        "start, reference, v_ref, p_a, p_b, v, y, kp, ki, kd, notch_frequency (0 where the law has no use for it), x"
    ]
    units: list[str]
    tolerance: Literal[1e-9]
    rows: Annotated[
        list[Annotated[list[Number | None], Field(min_length=12, max_length=12)]],
        Field(min_length=1),
    ]

    @model_validator(mode="after")
    def _answers(self):
        if any(row[-1] is None for row in self.rows):
            raise ValueError("a row of test_vectors has no x")
        return self


class Document(_Part):
    """A whole schedule file."""

    schema_: Literal["hydroctl.gain-schedule"] = Field(alias="schema")
    version: Literal[3]
    generator: str
    loop: Literal["velocity", "position"]
    structure: str
    controller: Controller
    scheduling: Scheduling
    feed_forward: FeedForward
    actuator: Machine
    design: Design
    failed_checks: list[str]
    """requirements on margins or nonlinear plant that the schedule is known not to meet"""
    test_vectors: TestVectors | None
    """null in a file of a version before 3"""
    fingerprint: str | None
    """SHA-256 of everything else, without blanks and with sorted keys; null in a file of a version
    before 3"""

    @model_validator(mode="after")
    def _gain_units(self):
        limit, unit = self.design.high_frequency_gain, GAIN_UNITS[self.loop]["kp"]
        if limit is not None and limit.unit != unit:
            raise ValueError(
                f"unit of high_frequency_gain is {limit.unit!r}, must be {unit!r} for a {self.loop} loop"
            )
        for table in self.scheduling.tables:
            if table.unit != (unit := GAIN_UNITS[self.loop][table.name]):
                raise ValueError(
                    f"unit of table {table.name} is {table.unit!r}, must be {unit!r} for a {self.loop} loop"
                )
        return self


def fingerprint(document: Document) -> str:
    """What `document.fingerprint` must be."""
    content = _content(document)
    del content["fingerprint"]
    return hashlib.sha256(
        json.dumps(content, sort_keys=True, separators=(",", ":"), allow_nan=False).encode()
    ).hexdigest()


def _content(document: Document) -> dict:
    """What is written; a part of the default value is left out, so that files from before it are as
    they were."""
    return document.model_dump(by_alias=True, mode="json", exclude_defaults=True)


def json_schema() -> str:
    """The JSON Schema (draft 2020-12) of the file, as shipped in SCHEMA_FILE."""
    content = {
        "$schema": "https://json-schema.org/draft/2020-12/schema"
    } | Document.model_json_schema()
    return json.dumps(content, indent=1) + "\n"


def write(document: Document, path: str | Path) -> Path:
    """Write `document` atomically; floats are written so that they read back to the same bits."""
    text = json.dumps(_content(document), indent=1, allow_nan=False, ensure_ascii=False)
    return write_file(path, (text + "\n").encode())


def read(path: str | Path) -> Document:
    """The checked document of a schedule file. Raises InputError with every fault."""
    data = _read_json(Path(path))
    if not isinstance(data, dict) or data.get("schema") != SCHEMA:
        raise InputError(f'{path}: not a gain schedule (schema must be "{SCHEMA}").')
    try:
        return Document.model_validate_json(json.dumps(upgraded(data)))
    except InputError as error:
        raise InputError(f"{path}: {fault}" for fault in error.faults) from None
    except ValidationError as error:
        raise InputError(f"{path}: {_sentence(fault)}" for fault in error.errors()) from None


def _read_json(path: Path):
    try:
        if path.stat().st_size > _LARGEST_FILE:
            raise InputError(
                f"{path}: more than {_LARGEST_FILE // 1_000_000} MB is no schedule; name the right file."
            )
        return json.loads(
            path.read_bytes(), parse_constant=_refuse_constant, object_pairs_hook=_unique_keys
        )
    except OSError as error:
        raise InputError(
            f"{path}: cannot be read ({error.strerror}); name an existing schedule file."
        ) from None
    except (ValueError, RecursionError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: not valid JSON ({error}).") from None


def _refuse_constant(name: str):
    raise ValueError(f"{name} is not a finite number")


def _unique_keys(pairs):
    keys = [key for key, _ in pairs]
    if twice := {key for key in keys if keys.count(key) > 1}:
        raise ValueError(f"key {sorted(twice)[0]!r} is given twice")
    return dict(pairs)


def _sentence(fault) -> str:
    where = ".".join(str(part) for part in fault["loc"]) or "document"
    given = repr(fault["input"])
    shown = given if len(given) <= 40 else given[:37] + "..."
    return f"{where} = {shown}: {fault['msg'].removeprefix('Value error, ')}."
