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
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from numbers import Real
from types import SimpleNamespace
from typing import Any

from ..digits import apart
from ..errors import InputError, shown, unknown_name

STANDARD_GRAVITY = 9.80665
"""m/s^2"""
_FOLLOWS = {"flow_coefficient_b": "flow_coefficient", "breakaway_friction": "coulomb_friction"}
"""Parameters that, left out, equal another one."""
ADDED_LATER = ("inclination", "pressure_rating")
"""Parameters that older files lack: at their defaults, files and fingerprints leave them out, and
stay as they were."""


def _parameter(
    unit: str,
    text: str,
    *,
    above: float = -math.inf,
    least: float = -math.inf,
    below: float = math.inf,
    most: float = math.inf,
    default: Any = dataclasses.MISSING,
):
    metadata = {
        "unit": unit,
        "text": text,
        "above": above,
        "least": least,
        "below": below,
        "most": most,
    }
    return field(default=default, metadata=metadata)


@dataclass(frozen=True, kw_only=True)
class Actuator:
    """A cylinder, its valve, its supply and its load. SI throughout; symbols of the source paper in
    brackets.

    What is left out is left out of the model: no tank pressure, load, inclination, dry friction,
    overlap or end stop, an ideal valve. Two parameters follow another one when left out: the b
    edges are as the a edges, breakaway friction is Coulomb friction. Raises InputError with every
    fault at once: field, value and way out.
    """

    name: str = "unnamed"
    source: str = ""
    note: str = ""
    area_a: float = _parameter("m^2", "piston area, cap side [F1]", above=0)
    area_b: float = _parameter("m^2", "piston area, rod side [F2]", above=0)
    volume_a: float = _parameter(
        "m^3", "volume of chamber a with its lines at y = 0 [V10]", above=0
    )
    volume_b: float = _parameter(
        "m^3", "volume of chamber b with its lines at y = 0 [V20]", above=0
    )
    stroke: float = _parameter("m", "travel of the piston, y in [0, stroke]", above=0)
    bulk_modulus: float = _parameter("Pa", "effective bulk modulus of the fluid [Ec]", above=0)
    leakage: float = _parameter(
        "m^3/s/Pa", "leakage from chamber to chamber [Kv]", least=0, default=0.0
    )
    flow_coefficient: float = _parameter(
        "m^3/s/Pa^0.5", "flow per root of pressure drop of the a edges at x = 1 [alpha]", above=0
    )
    flow_coefficient_b: float | None = _parameter(
        "m^3/s/Pa^0.5", "the same of the b edges (default: as the a edges)", above=0, default=None
    )
    supply_pressure: float = _parameter("Pa", "supply pressure [p0]", above=0)
    tank_pressure: float = _parameter("Pa", "tank line pressure", least=0, default=0.0)
    mass: float = _parameter("kg", "moving mass [m]", above=0)
    viscous_friction: float = _parameter("N*s/m", "viscous friction [B]", least=0, default=0.0)
    coulomb_friction: float = _parameter(
        "N", "dry friction of the moving piston", least=0, default=0.0
    )
    breakaway_friction: float | None = _parameter(
        "N", "dry friction at rest (default: as coulomb_friction)", least=0, default=None
    )
    stribeck_speed: float | None = _parameter(
        "m/s",
        "speed at which breakaway friction has fallen half way to coulomb_friction",
        above=0,
        default=None,
    )
    creep_speed: float = _parameter(
        "m/s", "speed scale below which dry friction stands for rest", above=0, default=1e-3
    )
    load_force: float = _parameter(
        "N", "constant load, besides weight by inclination, positive against extension", default=0.0
    )
    inclination: float = _parameter(
        "rad",
        "angle of the axis above the horizontal, positive where extension lifts the mass",
        least=-math.pi / 2.0,
        most=math.pi / 2.0,
        default=0.0,
    )
    end_stop_stiffness: float = _parameter(
        "N/m", "contact stiffness of both end stops (0: no stops)", least=0, default=0.0
    )
    end_stop_damping: float = _parameter(
        "s/m", "relative rise of the contact force per speed of approach", least=0, default=0.0
    )
    valve_natural_frequency: float | None = _parameter(
        "rad/s",
        "natural frequency of the valve as a second-order lag (default: ideal valve)",
        above=0,
        default=None,
    )
    valve_damping: float | None = _parameter(
        "", "damping ratio of the same lag", above=0, default=None
    )
    valve_rate_limit: float | None = _parameter(
        "1/s",
        "largest spool speed in full openings per second (default: none)",
        above=0,
        default=None,
    )
    dead_band: float = _parameter(
        "", "overlap of the valve on both sides of x = 0, as x", least=0, below=1, default=0.0
    )
    pressure_rating: float | None = _parameter(
        "Pa", "pressure that the chambers may reach (default: not stated)", above=0, default=None
    )

    def __post_init__(self):
        if faults := field_faults(
            {f.name: getattr(self, f.name) for f in dataclasses.fields(self)}
        ):
            raise InputError(faults)
        for name in PARAMETERS:
            if getattr(self, name) is not None:
                object.__setattr__(self, name, float(getattr(self, name)))
        for name, leader in _FOLLOWS.items():
            if getattr(self, name) is None:
                object.__setattr__(self, name, getattr(self, leader))

    def replace(self, **changes) -> Actuator:
        """A copy with some parameters changed, checked like a new one. An unknown name raises
        InputError.

        A parameter that equals the one it follows by default keeps following it.
        """
        known = {f.name for f in dataclasses.fields(self)}
        if faults := [
            unknown_name("parameter", name, known) for name in changes if name not in known
        ]:
            raise InputError(faults)
        follow = {
            name: None
            for name, leader in _FOLLOWS.items()
            if getattr(self, name) == getattr(self, leader)
        }
        return dataclasses.replace(self, **follow | changes)

    @property
    def axial_gravity(self) -> float:
        """g sin(inclination) in m/s^2, positive against extension."""
        return STANDARD_GRAVITY * math.sin(self.inclination)

    @property
    def constant_load(self) -> float:
        """load_force + mass g sin(inclination): all that loads the piston at rest, in N, positive
        against extension."""
        return self.load_force + self.mass * self.axial_gravity

    def parameters(self) -> dict[str, float | None]:
        """All physical parameters by name, in SI; None where an effect has none."""
        return {name: getattr(self, name) for name in PARAMETERS}

    def recorded_parameters(self) -> dict[str, float | None]:
        """`parameters()` as fingerprints and files hold them: without those of ADDED_LATER that
        have their default."""
        at_default = {
            name for name in ADDED_LATER if getattr(self, name) == PARAMETERS[name].default
        }
        return {name: value for name, value in self.parameters().items() if name not in at_default}

    def fingerprint(self) -> str:
        """SHA-256 of the physical parameters (not of name, source and note): equal machines, equal
        fingerprints."""
        return hashlib.sha256(
            json.dumps(self.recorded_parameters(), sort_keys=True).encode()
        ).hexdigest()

    def to_toml(self) -> str:
        """This machine as a data sheet in SI, which `load_actuator` reads back to an equal
        `Actuator`, bit for bit."""
        texts = [
            f"{name} = {_toml_text(getattr(self, name))}"
            for name in ("name", "source", "note")
            if getattr(self, name)
        ]
        numbers = [
            f"{name} = {value!r}  # {PARAMETERS[name].metadata['unit']}".removesuffix("  # ")
            for name, value in self.parameters().items()
            if value is not None
        ]
        return "\n".join([*texts, "", *numbers, ""])


PARAMETERS: dict[str, dataclasses.Field] = {
    f.name: f for f in dataclasses.fields(Actuator) if f.metadata
}
"""The physical parameters by name; `.metadata` holds unit, text and bounds."""


def field_faults(values: Mapping[str, object]) -> list[str]:
    """Every fault of fields of `Actuator` by name, a sentence each: first of those taken alone,
    then between sound ones.

    What is not in `values` is unknown, and no fault.
    """
    alone = {name: fault for name, value in values.items() if (fault := field_fault(name, value))}
    sound: dict[str, float | None] = dict.fromkeys(PARAMETERS, math.nan)
    for name in PARAMETERS.keys() & values.keys() - alone.keys():
        value = values[name]
        sound[name] = float(value) if isinstance(value, Real) else None
    return [*alone.values(), *_contradictions(SimpleNamespace(**sound))]


def _contradictions(p: SimpleNamespace) -> Iterator[str]:
    """Faults between parameters; NaN stands for one whose value is not known, and no comparison
    with it holds."""
    swept = p.area_b * p.stroke
    if p.volume_b <= swept:
        held, needed = apart(p.volume_b, swept)
        yield (
            f"volume_b = {held} m^3 is used up before the end of the stroke (area_b * stroke ="
            f" {needed} m^3); volume_b counts from y = 0, so raise it or shorten stroke."
        )
    if p.tank_pressure >= p.supply_pressure:
        tank, supply = apart(p.tank_pressure, p.supply_pressure)
        yield (
            f"tank_pressure = {tank} Pa is not below supply_pressure = {supply} Pa; "
            "give both on the same scale (both gauge or both absolute)."
        )
    if p.breakaway_friction is not None and p.breakaway_friction < p.coulomb_friction:
        breakaway, coulomb = apart(p.breakaway_friction, p.coulomb_friction)
        yield (
            f"breakaway_friction = {breakaway} N is below coulomb_friction = {coulomb} N; raise it"
            " or leave it out."
        )
    if (p.breakaway_friction or 0.0) > p.coulomb_friction and p.stribeck_speed is None:
        yield (
            f"stribeck_speed is missing: breakaway_friction = {p.breakaway_friction:g} N is above"
            " coulomb_friction; add the speed in m/s over which it falls."
        )
    if p.valve_natural_frequency is None:
        for name, value in (
            ("valve_damping", p.valve_damping),
            ("valve_rate_limit", p.valve_rate_limit),
        ):
            if value is not None:
                given = name if math.isnan(value) else f"{name} = {value:g}"
                yield f"{given} needs valve_natural_frequency; add it or leave {name} out."
    elif p.valve_damping is None:
        yield (
            "valve_damping is missing: valve_natural_frequency is given; add the damping ratio of"
            " the valve."
        )


def field_fault(name: str, value: object) -> str | None:
    """What is wrong with `value` as the field `name` taken alone, in one sentence; None where
    nothing is."""
    if name not in PARAMETERS:
        return (
            None
            if isinstance(value, str)
            else f"{name} = {shown(value)} is not a text; write it in quotes."
        )
    spec = PARAMETERS[name]
    if value is None and spec.default is None:
        return None
    unit = spec.metadata["unit"]
    form, suffix = (f"in {unit}", f" {unit}") if unit else ("as a plain number", "")
    if isinstance(value, bool) or not isinstance(value, Real):
        return f"{name} = {shown(value)} is not a number; give it {form}."
    try:
        value = float(value)
    except OverflowError:
        value = math.inf
    if not math.isfinite(value):
        return f"{name} = {value} is not finite; give {spec.metadata['text']} {form}."
    for relation, bound, broken in (
        ("above", spec.metadata["above"], value <= spec.metadata["above"]),
        ("at least", spec.metadata["least"], value < spec.metadata["least"]),
        ("at most", spec.metadata["most"], value > spec.metadata["most"]),
        ("below", spec.metadata["below"], value >= spec.metadata["below"]),
    ):
        if broken:
            given, allowed = apart(value, bound)
            return (
                f"{name} = {given}{suffix} must be {relation} {allowed} ({spec.metadata['text']})."
            )
    return None


def _toml_text(text: str) -> str:
    """A TOML basic string. JSON escapes the same way but for DEL, which TOML wants escaped too."""
    return json.dumps(text, ensure_ascii=False).replace("\x7f", "\\u007f")
