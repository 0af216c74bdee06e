"""Data sheets: one TOML file, one machine. `load_actuator` reads it, `save_actuator` writes it,
`list_actuators` names the shipped ones.

Keys are the parameters of `Actuator`, in SI or with a unit ("210 bar"), or one of the ways a maker
states them:

    bore_diameter, rod_diameter            instead of  area_a, area_b
        rod_diameter_a                     too, where a second rod leaves through the cap side
    dead_volume_a, dead_volume_b           instead of  volume_a, volume_b     (at its stroke end)
        hose_volume_a, hose_volume_b       too, for the lines, or hose_volume in all, half each
    rated_flow, and its pressure drop      instead of  flow_coefficient       (at x = 1)
        rated_pressure_drop_per_edge       the drop over one edge, or
        rated_pressure_drop_per_valve      the drop over both edges in series, half on each
        rated_flow_b                       too, where the b edges pass another flow at that drop
"""

from __future__ import annotations

import math
import os
import re
import tomllib
from dataclasses import MISSING
from importlib import resources
from pathlib import Path
from typing import NamedTuple

from ..digits import apart
from ..errors import InputError, shown, unknown_name
from ..files import write_file
from .actuator import PARAMETERS, Actuator, field_fault, field_faults
from .units import to_si


class _Way(NamedTuple):
    """Two ways to state the same parameters: those of `Actuator`, or a maker's. `both` need each
    other, `one_of` is a choice."""

    direct: tuple[str, ...]
    direct_extra: tuple[str, ...]
    both: tuple[str, ...]
    one_of: tuple[str, ...]
    extra: tuple[str, ...]

    @property
    def makers(self) -> tuple[str, ...]:
        """The keys of the maker's way."""
        return (*self.both, *self.one_of, *self.extra)


_WAYS = (
    _Way(("area_a", "area_b"), (), ("bore_diameter", "rod_diameter"), (), ("rod_diameter_a",)),
    _Way(
        ("volume_a", "volume_b"),
        (),
        ("dead_volume_a", "dead_volume_b"),
        (),
        ("hose_volume", "hose_volume_a", "hose_volume_b"),
    ),
    _Way(
        ("flow_coefficient",),
        ("flow_coefficient_b",),
        ("rated_flow",),
        ("rated_pressure_drop_per_edge", "rated_pressure_drop_per_valve"),
        ("rated_flow_b",),
    ),
)
_UNIT_OF = {"diameter": "m", "volume": "m^3", "flow": "m^3/s", "pressure": "Pa"}
_MAKERS = {
    key: next(unit for word, unit in _UNIT_OF.items() if word in key)
    for way in _WAYS
    for key in way.makers
}
_UNITS = {name: spec.metadata["unit"] for name, spec in PARAMETERS.items()} | _MAKERS
_TEXTS = ("name", "source", "note")
_LARGEST_FILE = 100_000
_MOST_UNKNOWN_KEYS = 20


def list_actuators() -> list[str]:
    """Names of the shipped machines, each of which `load_actuator` accepts."""
    return sorted(
        Path(entry.name).stem for entry in _shipped().iterdir() if entry.name.endswith(".toml")
    )


def load_actuator(name_or_path: str | Path) -> Actuator:
    """The shipped machine of that name, or the one that a TOML data sheet describes.

    A text that ends in `.toml`, holds a path separator or names an existing file is a path. Raises
    InputError with all faults of the file at once.
    """
    given = str(name_or_path)
    if not (given.endswith(".toml") or "/" in given or "\\" in given or os.path.isfile(given)):
        if given not in list_actuators():
            raise InputError(
                unknown_name("actuator", given, list_actuators())
                + " A data sheet's file name ends in .toml."
            )
        return _actuator(given, (_shipped() / f"{given}.toml").read_bytes(), given)
    path = Path(name_or_path)
    try:
        with path.open("rb") as file:
            data = file.read(_LARGEST_FILE + 1)
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise InputError(
            f"{path}: cannot be read ({reason}); name an existing TOML data sheet."
        ) from None
    if len(data) > _LARGEST_FILE:
        raise InputError(
            f"{path}: more than {_LARGEST_FILE // 1000} kB is no data sheet; name the right file."
        )
    return _actuator(path.stem, data, str(path))


def save_actuator(actuator: Actuator, path: str | Path) -> Path:
    """Write `actuator.to_toml()` to `path`, whole or not at all; `load_actuator` gives an equal
    `Actuator` back."""
    return write_file(path, actuator.to_toml().encode())


def _shipped():
    return resources.files("hydroctl") / "actuators"


def _actuator(default_name: str, data: bytes, where: str) -> Actuator:
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise InputError(
            f"{where}: byte {error.start} is not UTF-8 text; save the data sheet as a UTF-8 TOML"
            " file."
        ) from None
    try:
        return Actuator(**{"name": default_name} | _fields(_parsed(text)))
    except InputError as error:
        raise InputError(f"{where}: {fault}" for fault in error.faults) from None


def _parsed(text: str) -> dict:
    try:
        return tomllib.loads(text)
    except (
        ValueError,
        RecursionError,
    ) as error:  # an integer of thousands of digits is a ValueError of Python's own
        place = re.search(r"at line (\d+)", str(error))
        line = "" if place is None else " in " + shown(text.split("\n")[int(place[1]) - 1].strip())
        raise InputError(
            f"not valid TOML{line} ({error}); write one `key = value` a line, each key once, a"
            " quantity with a unit in quotes."
        ) from None


def _fields(table: dict) -> dict:
    """The arguments of `Actuator` from a parsed data sheet; raises InputError with every fault that
    can be told."""
    unknown = [key for key in table if key not in _UNITS and key not in _TEXTS]
    if len(unknown) > _MOST_UNKNOWN_KEYS:
        raise InputError(
            f"{len(unknown)} keys are unknown, {unknown[0][:60]!r} the first; this is no data"
            " sheet, name the right file."
        )
    faults = [unknown_name("key", key, [*_UNITS, *_TEXTS]) for key in unknown]
    values = {}
    for key in (key for key in table if key in _UNITS):
        try:
            values[key] = _value(key, table[key])
        except InputError as error:
            faults += error.faults
            values[key] = math.nan
    bore = values.get("bore_diameter", math.inf)
    for rod in ("rod_diameter", "rod_diameter_a"):
        if values.get(rod, 0.0) >= bore:
            given, limit = apart(values[rod], bore)
            faults.append(
                f"{rod} = {given} m is not below bore_diameter = {limit} m; give them the right way"
                " round."
            )
            values[rod] = math.nan
    faults += _choice_faults(table)
    texts = {key: table[key] for key in _TEXTS if key in table}
    fields = _converted(values)
    if faults:
        known = {name: value for name, value in fields.items() if not math.isnan(value)}
        left_out = {
            name: spec.default
            for name, spec in PARAMETERS.items()
            if name not in table and spec.default is not MISSING
        }
        raise InputError([*faults, *field_faults(texts | left_out | known)])
    return texts | fields


def _value(key: str, given: object) -> float:
    """The number of one key in SI; raises InputError where it is wrong taken alone."""
    value = to_si(key, given, _UNITS[key])
    if key in PARAMETERS:
        fault = field_fault(key, value)
    elif key.startswith("hose"):
        fault = (
            f"{key} = {value:g} m^3 must be at least 0; leave it out where there are no lines."
            if value < 0.0
            else None
        )
    else:
        fault = (
            f"{key} = {value:g} {_UNITS[key]} must be above 0; give its size."
            if value <= 0.0
            else None
        )
    if fault:
        raise InputError(fault)
    return value


def _choice_faults(table: dict):
    """Missing and doubly given parameters."""
    chosen = {name for way in _WAYS for name in way.direct}
    for way in _WAYS:
        direct = [key for key in (*way.direct, *way.direct_extra) if key in table]
        makers = [key for key in way.makers if key in table]
        if direct and makers:
            yield (
                f"{', '.join(direct)} and {', '.join(makers)} are both given; keep one way to"
                " state it."
            )
            continue
        if missing := [key for key in (way.both if makers else way.direct) if key not in table]:
            other = "" if makers else f", or {' and '.join(way.both)}"
            yield (
                f"{', '.join(missing)} is missing; add"
                f" {'it' if len(missing) == 1 else 'them'}{other}."
            )
        drops = [key for key in way.one_of if key in table]
        if way.one_of and makers and len(drops) != 1:
            stated = (
                f"{' and '.join(drops)} are both given"
                if drops
                else "the pressure drop of rated_flow is missing"
            )
            yield f"{stated}; give one of {' and '.join(way.one_of)}."
    if "hose_volume" in table and ("hose_volume_a" in table or "hose_volume_b" in table):
        yield (
            "hose_volume is given in all and per side; keep hose_volume, or hose_volume_a and"
            " hose_volume_b."
        )
    for name, spec in PARAMETERS.items():
        if name not in table and name not in chosen and spec.default is MISSING:
            yield f"{name} is missing; add {spec.metadata['text']} in {spec.metadata['unit']}."


def _converted(values: dict[str, float]) -> dict[str, float]:
    """Parameters of `Actuator` from `values`, makers' data turned into them; NaN where one of them
    is NaN or missing."""
    fields = {}
    if "bore_diameter" in values:
        bore = values["bore_diameter"]
        for side, rod in (
            ("a", values.get("rod_diameter_a", 0.0)),
            ("b", values.get("rod_diameter", math.nan)),
        ):
            fields[f"area_{side}"] = math.pi / 4 * (bore * bore - rod * rod)
    fields |= {key: value for key, value in values.items() if key in PARAMETERS}
    swept = {"a": 0.0, "b": fields.get("area_b", math.nan) * fields.get("stroke", math.nan)}
    for side in (
        side for side in swept if f"dead_volume_{side}" in values and f"volume_{side}" not in values
    ):
        hose = values.get(f"hose_volume_{side}", values.get("hose_volume", 0.0) / 2.0)
        fields[f"volume_{side}"] = values[f"dead_volume_{side}"] + hose + swept[side]
    edges = 2.0 if "rated_pressure_drop_per_valve" in values else 1.0
    root = math.sqrt(
        values.get(
            "rated_pressure_drop_per_valve", values.get("rated_pressure_drop_per_edge", math.nan)
        )
    )
    for flow, parameter in (
        ("rated_flow", "flow_coefficient"),
        ("rated_flow_b", "flow_coefficient_b"),
    ):
        if flow in values and parameter not in values:
            fields[parameter] = values[flow] * math.sqrt(edges) / root
    return fields
