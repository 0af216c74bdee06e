"""Data sheets: one TOML file, one machine. `load_actuator` reads it, `list_actuators` names the shipped ones.

Keys are the parameters of `Actuator`, in SI or with a unit ("210 bar"), or one of the ways a maker states them:

    bore_diameter, rod_diameter            instead of  area_a, area_b
    dead_volume_a, dead_volume_b           instead of  volume_a, volume_b     (each side at its own end of the stroke)
    rated_flow, rated_pressure_drop        instead of  flow_coefficient       (the drop over one edge, at x = 1)
"""

from __future__ import annotations

import math
import tomllib
from dataclasses import MISSING
from importlib import resources
from pathlib import Path

from .actuator import PARAMETERS, Actuator, parameter_fault
from .errors import InputError, unknown_name
from .units import to_si

_TEXTS = ("name", "source", "note")
_MAKERS = {
    "bore_diameter": "m",
    "rod_diameter": "m",
    "dead_volume_a": "m^3",
    "dead_volume_b": "m^3",
    "rated_flow": "m^3/s",
    "rated_pressure_drop": "Pa",
}
_UNITS = {name: spec.metadata["unit"] for name, spec in PARAMETERS.items()} | _MAKERS
_ALTERNATIVES = (
    (("area_a", "area_b"), ("bore_diameter", "rod_diameter")),
    (("volume_a", "volume_b"), ("dead_volume_a", "dead_volume_b")),
    (("flow_coefficient",), ("rated_flow", "rated_pressure_drop")),
)
_LARGEST_FILE = 1_000_000


def list_actuators() -> list[str]:
    """Names of the shipped machines, each of which `load_actuator` accepts."""
    return sorted(Path(entry.name).stem for entry in _shipped().iterdir() if entry.name.endswith(".toml"))


def load_actuator(name_or_path: str | Path) -> Actuator:
    """The shipped machine of that name, or the one that a TOML data sheet describes.

    A text that ends in `.toml`, holds a path separator or names an existing file is a path. Raises InputError with all
    faults of the file at once.
    """
    given = str(name_or_path)
    if not (given.endswith(".toml") or "/" in given or "\\" in given or Path(given).is_file()):
        if given not in list_actuators():
            raise InputError(unknown_name("actuator", given, list_actuators()) + " A data sheet's file name ends in .toml.")
        return _actuator(given, (_shipped() / f"{given}.toml").read_bytes(), given)
    path = Path(name_or_path)
    try:
        if path.is_file() and path.stat().st_size > _LARGEST_FILE:
            raise InputError(f"{path}: more than {_LARGEST_FILE // 1000} kB is no data sheet; name the right file.")
        data = path.read_bytes()
    except (OSError, ValueError) as error:
        reason = error.strerror if isinstance(error, OSError) and error.strerror else str(error)
        raise InputError(f"{path}: cannot be read ({reason}); name an existing TOML data sheet.") from None
    return _actuator(path.stem, data, str(path))


def _shipped():
    return resources.files("hydroctl") / "actuators"


def _actuator(default_name: str, data: bytes, where: str) -> Actuator:
    try:
        table = tomllib.loads(data.decode())
    except UnicodeDecodeError as error:
        raise InputError(f"{where}: byte {error.start} is not UTF-8 text; save the data sheet as a UTF-8 TOML file.") from None
    except (tomllib.TOMLDecodeError, RecursionError) as error:
        raise InputError(f"{where}: not valid TOML ({error}); write one `key = value` a line.") from None
    try:
        return Actuator(**{"name": default_name} | _fields(table))
    except InputError as error:
        raise InputError(f"{where}: {fault}" for fault in error.faults) from None


def _fields(table: dict) -> dict:
    """The arguments of `Actuator` from a parsed data sheet; raises InputError with every fault that can be told."""
    faults = [unknown_name("key", key, [*_UNITS, *_TEXTS]) for key in table if key not in _UNITS and key not in _TEXTS]
    values = {}
    for key in (key for key in table if key in _UNITS):
        try:
            values[key] = to_si(key, table[key], _UNITS[key])
        except InputError as error:
            faults += error.faults
    faults += _choice_faults(table)
    faults += [f"{key} = {values[key]:g} {_MAKERS[key]} must be above 0." for key in _MAKERS if values.get(key, 1.0) <= 0]
    if values.get("rod_diameter", 0.0) >= values.get("bore_diameter", math.inf):
        faults.append(
            f"rod_diameter = {values['rod_diameter']:g} m is not below bore_diameter = {values['bore_diameter']:g} m; "
            "give the two the right way round."
        )
    if faults:
        faults += [fault for key in values if key in PARAMETERS and (fault := parameter_fault(key, values[key]))]
        raise InputError(faults)
    return {key: table[key] for key in _TEXTS if key in table} | _converted(values)


def _choice_faults(table: dict):
    """Missing and doubly given parameters."""
    chosen = {name for pair in _ALTERNATIVES for way in pair for name in way}
    for direct, makers in _ALTERNATIVES:
        has_direct, has_makers = ([key for key in way if key in table] for way in (direct, makers))
        if has_direct and has_makers:
            yield f"{', '.join(has_direct)} and {', '.join(has_makers)} are both given; keep one way to state it."
        elif missing := [key for key in (makers if has_makers else direct) if key not in table]:
            other = "" if has_makers else f", or {' and '.join(makers)}"
            yield f"{', '.join(missing)} is missing; add {'it' if len(missing) == 1 else 'them'}{other}."
    for name, spec in PARAMETERS.items():
        if name not in table and name not in chosen and spec.default is MISSING:
            yield f"{name} is missing; add {spec.metadata['text']} in {spec.metadata['unit']}."


def _converted(values: dict) -> dict:
    """Makers' data turned into parameters of `Actuator`."""
    fields = {key: value for key, value in values.items() if key in PARAMETERS}
    if "bore_diameter" in values:
        fields["area_a"] = math.pi / 4 * values["bore_diameter"] ** 2
        fields["area_b"] = fields["area_a"] - math.pi / 4 * values["rod_diameter"] ** 2
    if "dead_volume_a" in values:
        fields["volume_a"] = values["dead_volume_a"]
        fields["volume_b"] = values["dead_volume_b"] + fields["area_b"] * values["stroke"]
    if "rated_flow" in values:
        fields["flow_coefficient"] = values["rated_flow"] / math.sqrt(values["rated_pressure_drop"])
    return fields
