"""The schedule file: JSON with a unit on every quantity, the regulator law as formulas, and what
was shown of the schedule.

The pydantic models of this module, of `parts` and of `shown` are the file's definition. Keys and
choices are identifiers; sentences stand under `description` and `reason` alone. Reading is strict:
unknown or missing fields, wrong types, numbers that are not finite, wrong shapes and unsorted axes
are errors, all of them reported at once.
"""

from __future__ import annotations

import hashlib
import json
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final, Literal

from pydantic import BaseModel, Field, ValidationError, model_validator

from ..errors import InputError
from ..files import write_file
from ..loop.quantity import LoopName, controlled_quantity
from .models import PlantModels
from .parts import MOST_NODES, Controller, Design, FeedForward, Machine, Part, Scheduling
from .shown import Law, ProofPart, Remark, TestVectors
from .versions import upgraded

SCHEMA: Final = "hydroctl.gain-schedule"
SCHEMA_FILE = Path(__file__).with_name("schedule.schema.json")
_LARGEST_FILE = 50_000_000
_ONLY_OLDER_LACK = ("law", "test_vectors", "fingerprint")
"""parts that every file of this version has"""


class Document(Part):
    """A whole schedule file."""

    schema_: Literal["hydroctl.gain-schedule"] = Field(alias="schema")
    version: Literal[4]
    generator: str
    loop: LoopName
    structure: str
    controller: Controller
    scheduling: Scheduling
    feed_forward: FeedForward
    actuator: Machine | None
    """null where there are models in its place"""
    models: PlantModels | None = None
    """plants of which no machine is known; left out of the file of a machine"""
    design: Design
    law: Law | None
    """None where a file of a version before 4 was read"""
    proof: ProofPart | None
    """null: nothing was shown"""
    failed_checks: list[Remark]
    """requirements that the schedule is known not to meet"""
    test_vectors: TestVectors | None
    """None where a file of a version before 3 was read"""
    fingerprint: str | None
    """SHA-256 of everything else, without blanks and with sorted keys; None where a file of a
    version before 3 was read"""

    @model_validator(mode="after")
    def _gain_units(self):
        limit, units = (
            self.design.high_frequency_gain,
            controlled_quantity(self.loop).gain_units,
        )
        if limit is not None and limit.unit != (unit := units["kp"]):
            raise ValueError(
                f"unit of high_frequency_gain is {limit.unit!r}, must be {unit!r} for a {self.loop}"
                " loop"
            )
        for name, table in self.scheduling.tables.items():
            if table.unit != (unit := units[name]):
                raise ValueError(
                    f"unit of table {name} is {table.unit!r}, must be {unit!r} for a {self.loop}"
                    " loop"
                )
        return self


def fingerprint(content: Mapping[str, Any]) -> str:
    """What the fingerprint of a file with this content must be."""
    rest = {key: value for key, value in content.items() if key != "fingerprint"}
    text = json.dumps(rest, sort_keys=True, separators=(",", ":"), allow_nan=False)
    return hashlib.sha256(text.encode()).hexdigest()


def content_of(part: BaseModel) -> dict[str, Any]:
    """What is written; a part of the default value is left out, so that files from before it are as
    they were."""
    return part.model_dump(by_alias=True, mode="json", exclude_defaults=True)


def json_schema() -> str:
    """The JSON Schema (draft 2020-12) of the file, as shipped in SCHEMA_FILE."""
    schema = Document.model_json_schema()
    for name in _ONLY_OLDER_LACK:
        some, _ = schema["properties"][name].pop("anyOf")
        schema["properties"][name] |= some
    schema["$defs"]["Scheduling"]["allOf"] = list(_SIZES)
    content = {"$schema": "https://json-schema.org/draft/2020-12/schema"} | schema
    text = json.dumps(content, indent=1) + "\n"
    for name, of_size in _SIZES.items():
        choices = {"anyOf": [of_size(n) for n in range(1, MOST_NODES + 1)]}
        text = text.replace(f'"{name}"', json.dumps(choices, separators=(",", ":")))
    return text


def _as_many_rows(n: int) -> dict[str, Any]:
    return _of_one_size("x", n, {"minItems": n, "maxItems": n})


def _as_many_columns(n: int) -> dict[str, Any]:
    return _of_one_size("y", n, {"items": {"minItems": n, "maxItems": n}})


def _of_one_size(axis: str, n: int, values: dict[str, Any]) -> dict[str, Any]:
    """The axis has n nodes, and the values of every table are like `values`."""
    size = {"minItems": n, "maxItems": n}
    return {
        "properties": {
            axis: {"properties": {"nodes": size, "slopes": size}},
            "tables": {"additionalProperties": {"properties": {"values": values}}},
        }
    }


_SIZES = {"as many rows": _as_many_rows, "as many columns": _as_many_columns}
"""JSON Schema knows no equal lengths, but it can list them"""


def write(document: Document, path: str | Path) -> Path:
    """Write `document` atomically; floats are written so that they read back to the same bits."""
    text = json.dumps(content_of(document), indent=1, allow_nan=False, ensure_ascii=False)
    return write_file(path, (text + "\n").encode())


def read(path: str | Path) -> dict[str, Any]:
    """The content of a schedule file of any version. Raises InputError for what is none."""
    data = _read_json(Path(path))
    if not isinstance(data, dict) or data.get("schema") != SCHEMA:
        raise InputError(f'{path}: not a gain schedule (schema must be "{SCHEMA}").')
    return data


def document_in(content: dict[str, Any]) -> Document:
    """The checked document of what was read. Raises InputError with every fault."""
    try:
        return Document.model_validate_json(json.dumps(upgraded(content)))
    except ValidationError as error:
        raise InputError(_sentence(fault) for fault in error.errors()) from None


def require_unchanged(content: Mapping[str, Any]) -> None:
    """InputError where a file that has a fingerprint does not fit to it."""
    if content.get("fingerprint", fingerprint(content)) != fingerprint(content):
        raise InputError(
            "fingerprint does not belong to the rest of the file, which was changed after it was "
            "written."
        )


def _read_json(path: Path):
    try:
        if path.stat().st_size > _LARGEST_FILE:
            raise InputError(
                f"{path}: more than {_LARGEST_FILE // 1_000_000} MB is no schedule; name the right"
                " file."
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
