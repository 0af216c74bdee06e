"""`Actuator`: the parameters of one valve-controlled cylinder, in SI, checked when made.

    supply_pressure --+------- valve (opening x) -------+-- tank_pressure
                      |                                 |
                 +----+---------------+-----------------+----+
                 |  chamber a (cap)   |   chamber b (rod)    |====== load, mass
                 +--------------------+----------------------+
                 y = 0 -> area_a                area_b       y = stroke

x > 0 connects chamber a to the supply and extends the piston (v = dy/dt > 0); x < 0 retracts it.
"""

from __future__ import annotations

import dataclasses
import hashlib
import json
import math
from dataclasses import dataclass, field
from typing import Any

from .errors import InputError, unknown_name


def _parameter(unit: str, text: str, *, above: float = -math.inf, least: float = -math.inf, default: Any = dataclasses.MISSING):
    metadata = {"unit": unit, "text": text, "above": above, "least": least}
    return field(default=default, metadata=metadata)


@dataclass(frozen=True, kw_only=True)
class Actuator:
    """A cylinder, its valve, its supply and its load. SI throughout; symbols of the source paper in brackets.

    Raises InputError with every fault at once: field, value and way out.
    """

    name: str = "unnamed"
    source: str = ""
    note: str = ""
    area_a: float = _parameter("m^2", "piston area, cap side [F1]", above=0)
    area_b: float = _parameter("m^2", "piston area, rod side [F2]", above=0)
    volume_a: float = _parameter("m^3", "volume of chamber a with its lines at y = 0 [V10]", above=0)
    volume_b: float = _parameter("m^3", "volume of chamber b with its lines at y = 0 [V20]", above=0)
    stroke: float = _parameter("m", "travel of the piston, y in [0, stroke]", above=0)
    bulk_modulus: float = _parameter("Pa", "effective bulk modulus of the fluid [Ec]", above=0)
    leakage: float = _parameter("m^3/s/Pa", "leakage from chamber to chamber [Kv]", least=0, default=0.0)
    flow_coefficient: float = _parameter("m^3/s/Pa^0.5", "flow per root of pressure drop of the a edges at x = 1 [alpha]", above=0)
    flow_coefficient_b: float | None = _parameter(
        "m^3/s/Pa^0.5", "the same of the b edges (default: as the a edges)", above=0, default=None
    )
    supply_pressure: float = _parameter("Pa", "supply pressure [p0]", above=0)
    tank_pressure: float = _parameter("Pa", "tank line pressure", least=0, default=0.0)
    mass: float = _parameter("kg", "moving mass [m]", above=0)
    viscous_friction: float = _parameter("N*s/m", "viscous friction [B]", least=0, default=0.0)
    load_force: float = _parameter("N", "constant load, positive against extension", default=0.0)

    def __post_init__(self):
        faults = [fault for name in PARAMETERS if (fault := parameter_fault(name, getattr(self, name)))]
        for name in ("name", "source", "note"):
            if not isinstance(getattr(self, name), str):
                faults.append(f"{name} = {getattr(self, name)!r} is not a text; write it in quotes.")
        if not faults:
            faults = list(self._contradictions())
        if faults:
            raise InputError(faults)
        for name in PARAMETERS:
            if getattr(self, name) is not None:
                object.__setattr__(self, name, float(getattr(self, name)))
        if self.flow_coefficient_b is None:
            object.__setattr__(self, "flow_coefficient_b", self.flow_coefficient)

    def _contradictions(self):
        swept = self.area_b * self.stroke
        if self.volume_b <= swept:
            yield (
                f"volume_b = {self.volume_b:g} m^3 is used up before the end of the stroke (area_b * stroke = {swept:g} m^3); "
                "volume_b counts from y = 0, so raise it or shorten stroke."
            )
        if self.tank_pressure >= self.supply_pressure:
            yield (
                f"tank_pressure = {self.tank_pressure:g} Pa is not below supply_pressure = {self.supply_pressure:g} Pa; "
                "give both on the same scale (both gauge or both absolute)."
            )

    def replace(self, **changes) -> Actuator:
        """A copy with some parameters changed, checked like a new one. An unknown name raises InputError."""
        known = {f.name for f in dataclasses.fields(self)}
        if faults := [unknown_name("parameter", name, known) for name in changes if name not in known]:
            raise InputError(faults)
        return dataclasses.replace(self, **changes)

    def parameters(self) -> dict[str, float]:
        """All physical parameters by name, in SI."""
        return {name: getattr(self, name) for name in PARAMETERS}

    def fingerprint(self) -> str:
        """SHA-256 of the physical parameters (not of name, source and note): equal machines, equal fingerprints."""
        return hashlib.sha256(json.dumps(self.parameters(), sort_keys=True).encode()).hexdigest()


PARAMETERS: dict[str, dataclasses.Field] = {f.name: f for f in dataclasses.fields(Actuator) if f.metadata}
"""The physical parameters by name; `.metadata` holds unit, text and bounds."""


def parameter_fault(name: str, value: object) -> str | None:
    """What is wrong with `value` as the parameter `name` taken alone, in one sentence; None where nothing is."""
    spec = PARAMETERS[name]
    if value is None and spec.default is None:
        return None
    unit = spec.metadata["unit"]
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        return f"{name} = {value!r} is not a number; give it in {unit}."
    if not math.isfinite(value):
        return f"{name} = {value} is not finite; give {spec.metadata['text']} in {unit}."
    if value <= spec.metadata["above"]:
        return f"{name} = {value:g} {unit} must be above {spec.metadata['above']:g} ({spec.metadata['text']})."
    if value < spec.metadata["least"]:
        return f"{name} = {value:g} {unit} must be at least {spec.metadata['least']:g} ({spec.metadata['text']})."
    return None
