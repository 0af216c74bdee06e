"""What a regulator must hold, over which variations of the plant, and the settings of its law that are not tuned."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from numbers import Real

from .actuator import PARAMETERS, Actuator, field_fault
from .errors import InputError, unknown_name
from .units import from_si, to_si, unit_in

VARIATIONS = {"bulk_modulus": 0.3, "mass": 0.5, "supply_pressure": 0.2}
"""What a machine is expected to vary by: relative half-widths"""
_HIGH_SUPPLY = 1.0 + VARIATIONS["supply_pressure"]
_BOTH_WAYS = {name: (1.0 - VARIATIONS[name], 1.0 + VARIATIONS[name]) for name in ("bulk_modulus", "mass")}
_NAMED = {
    "box": {name: (1.0 - half, 1.0 + half) for name, half in VARIATIONS.items()},
    "nominal": {},
    "corners": _BOTH_WAYS | {"supply_pressure": (_HIGH_SUPPLY, _HIGH_SUPPLY)},
    "one-at-a-time": _BOTH_WAYS,
}
"""The factors of the uncertainties that have a name, as one would state them"""
Ends = tuple[float, float] | tuple[str, str]
"""(low, high) of one parameter: two factors, or two values with units"""


@dataclass(frozen=True, kw_only=True)
class Specification:
    """Limits, sampling and settings of a design. Raises InputError with every fault at once."""

    sample_time: float = 1e-3
    """Ts in s"""
    delay_samples: float = 1.0
    """computational and communication delay in samples, fractions allowed"""
    Ms: float = 1.6
    """largest |S| allowed, above 1"""
    Mt: float = 1.3
    """largest |T| allowed, above 1"""
    uncertainty: str | Mapping[str, Ends] = "box"
    """"box" (bulk modulus +-30 %, mass +-50 %, supply +-20 %: all plants between its corners, searched), {parameter: (low, high)}
    for a box of your own, of which two numbers are factors on the machine's value and two texts with units values of either sign,
    such as ("-5 kN", "20 kN"); or plants that are counted: "nominal", "corners" (nominal; bulk modulus +-30 % with mass +-50 % at
    supply +20 %), "one-at-a-time" (nominal; each of these alone, at nominal supply)"""
    added_plants: tuple[Mapping[str, float], ...] = ()
    """further plants, {parameter: value in SI} each, on which the limits must hold; `tune` adds those that it finds in a box"""
    gain_margin: float | None = None
    """least factor above 1 that may bring L to -1; None: no limit beside Ms and Mt"""
    phase_margin: float | None = None
    """least phase, of either sign, that may bring L to -1, in rad, below pi/2; None: no limit beside Ms and Mt"""
    high_frequency_gain: float | None = None
    """largest |C| at the Nyquist frequency, in x per m/s (velocity) or x per m (position); None: no limit"""
    min_crossover: float | None = None
    """least crossover that the tuned loop must reach on every plant, in rad/s; None: as low as the other limits demand"""
    Tf: float = 5e-4
    """derivative filter time in s"""
    notch_damping: tuple[float, float] | None = None
    """(zz, zp) of the notch; None: (0.12, 0.75) in a velocity loop and (0.2, 0.6) in a position loop"""
    notch_ratio: float | None = None
    """notch frequency over the nominal plant's natural frequency; None: 1, but where `notch_damping` is None, too, at most 1.22
    times the lowest natural frequency of all plants"""
    lead_lag: tuple[tuple[float, float], tuple[float, float]] = ((0.5, 3.0), (0.05, 0.02))
    """(zero, pole) of the two sections of a lead-lag structure, as multiples of the notch frequency; the first is that of a lead"""
    measurement_filter: float = 0.0
    """Tm in s of a first-order filter of the measured quantity; 0: none"""
    derivative_on: str = "error"
    """"error" or "measurement\""""
    set_point_weight: float = 1.0
    """b: the share of the reference that kp sees"""
    pressure_compensation: bool = False
    """whether the command is multiplied by q_ref/q of the measured pressures, which undoes what the load does to the gain"""
    dead_band_inverse: float = 0.0
    """the share of the valve's dead band that the command jumps over, smoothly; 0.8 to 0.9 where the dead band is known; 0: none"""

    def __post_init__(self):
        faults = [fault for name, bound in _ABOVE.items() if (fault := _number_fault(name, getattr(self, name), bound))]
        if not _is_number(self.delay_samples) or self.delay_samples < 0.0:
            faults.append(f"delay_samples = {self.delay_samples!r} must be a finite number of at least 0.")
        optional = {name: bound for name, bound in _ABOVE_IF_GIVEN.items() if getattr(self, name) is not None}
        faults += [fault for name, bound in optional.items() if (fault := _number_fault(name, getattr(self, name), bound))]
        if _is_number(self.phase_margin) and self.phase_margin >= math.pi / 2:
            faults.append(f"phase_margin = {self.phase_margin!r} rad must be below pi/2 (90 degrees, the margin of an integrator).")
        faults += _uncertainty_faults(self.uncertainty)
        faults += _added_faults(self.added_plants)
        damping = self.notch_damping
        if damping is not None and not (_is_pair(damping) and 0 < damping[0] < damping[1]):
            faults.append(f"notch_damping = {damping!r} must be (zz, zp) with 0 < zz < zp.")
        faults += _law_faults(self)
        if faults:
            raise InputError(faults)


_ABOVE = {"sample_time": 0.0, "Ms": 1.0, "Mt": 1.0, "Tf": 0.0}
_ABOVE_IF_GIVEN = {"gain_margin": 1.0, "phase_margin": 0.0, "high_frequency_gain": 0.0, "min_crossover": 0.0, "notch_ratio": 0.0}


def _is_number(value: object) -> bool:
    return isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)


def _is_pair(value: object) -> bool:
    return isinstance(value, tuple) and len(value) == 2 and all(map(_is_number, value))


def _number_fault(name: str, value: object, bound: float) -> str | None:
    return None if _is_number(value) and value > bound else f"{name} = {value!r} must be a finite number above {bound:g}."


def _law_faults(specification: Specification) -> list[str]:
    faults = []
    for name, lowest, highest in (("measurement_filter", 0, math.inf), ("set_point_weight", 0, 1), ("dead_band_inverse", 0, 1)):
        value = getattr(specification, name)
        if not (_is_number(value) and lowest <= value <= highest):
            faults.append(
                f"{name} = {value!r} must be a finite number of at least 0{'' if highest == math.inf else ' and at most 1'}."
            )
    sections = specification.lead_lag
    if not (isinstance(sections, tuple) and len(sections) == 2 and all(_is_pair(s) and min(s) > 0 for s in sections)):
        faults.append(
            f"lead_lag = {sections!r} must be two pairs (zero, pole) of numbers above 0, multiples of the notch frequency."
        )
    if specification.derivative_on not in ("error", "measurement"):
        faults.append(unknown_name("derivative_on", specification.derivative_on, ("error", "measurement")))
    if not isinstance(specification.pressure_compensation, bool):
        faults.append(f"pressure_compensation = {specification.pressure_compensation!r} must be True or False.")
    return faults


def _uncertainty_faults(uncertainty) -> list[str]:
    if isinstance(uncertainty, str):
        return [] if uncertainty in _NAMED else [unknown_name("uncertainty", uncertainty, _NAMED)]
    if not isinstance(uncertainty, Mapping):
        return [f'uncertainty = {uncertainty!r} must be one of {", ".join(_NAMED)}, or factors such as {{"mass": (0.5, 1.5)}}.']
    if not uncertainty:
        return ['uncertainty names no parameter; write "nominal" for the nominal plant alone.']
    faults = [unknown_name("parameter", name, PARAMETERS) for name in uncertainty if name not in PARAMETERS]
    for name, ends in uncertainty.items():
        faults += _value_faults(name, ends) if _is_pair_of_texts(ends) else _factor_faults(name, ends)
    return faults


def _added_faults(plants: object) -> list[str]:
    if not isinstance(plants, tuple) or not all(isinstance(plant, Mapping) and plant for plant in plants):
        return [f"added_plants = {plants!r} must be a tuple of {{parameter: value in SI}}, none of them empty."]
    named = {(name, value) for plant in plants for name, value in plant.items()}
    faults = (
        field_fault(name, value) if name in PARAMETERS else unknown_name("parameter", name, PARAMETERS) for name, value in named
    )
    return sorted(f"added_plants: {fault}" for fault in faults if fault)


def _is_pair_of_texts(ends: object) -> bool:
    return isinstance(ends, tuple) and len(ends) == 2 and all(isinstance(end, str) for end in ends)


def _factor_faults(name: str, factors: object) -> list[str]:
    if _is_pair(factors) and 0 < factors[0] <= factors[1]:
        return []
    return [
        f"uncertainty of {name} = {factors!r} must be two factors (low, high) with 0 < low <= high, "
        "or two values as texts with units."
    ]


def _value_faults(name: str, texts: tuple[str, str]) -> list[str]:
    unit = PARAMETERS[name].metadata["unit"] if name in PARAMETERS else None
    if unit is None:
        return []
    if not unit:
        return [f"uncertainty of {name} = {texts!r}: it has no unit; give two factors (low, high), numbers."]
    faults, values = [], []
    for text in texts:
        try:
            values.append(to_si(f"uncertainty of {name}", text, unit))
        except InputError as error:
            faults += error.faults
            continue
        if unit_in(text) is None:
            faults.append(f"uncertainty of {name} = {text!r} has no unit; write {unit} or the like, or factors as numbers.")
        elif fault := field_fault(name, values[-1]):
            faults.append(f"uncertainty of {name}: {fault}")
    if not faults and values[0] > values[1]:
        faults.append(f"uncertainty of {name} = {texts!r} must be (low, high) with low <= high.")
    return faults


def ranges(actuator: Actuator, uncertainty: str | Mapping[str, Ends]) -> dict[str, tuple[float, float]]:
    """(lowest, highest value) in SI of every parameter that `uncertainty` varies, by name; "nominal" varies none.

    The supply pressure of "corners" is the high one at both ends. Raises InputError for a factor on a parameter that the actuator
    does not have or that is 0.
    """
    stated = _stated(uncertainty)
    if faults := [fault for name, ends in stated.items() if (fault := _nothing_varied(actuator, name, ends))]:
        raise InputError(faults)
    return {name: tuple(sorted(_value(actuator, name, end) for end in ends)) for name, ends in stated.items()}


def _stated(uncertainty: str | Mapping[str, Ends]) -> Mapping[str, Ends]:
    return _NAMED[uncertainty] if isinstance(uncertainty, str) else uncertainty


def _nothing_varied(actuator: Actuator, name: str, ends: Ends) -> str | None:
    value, unit = getattr(actuator, name), PARAMETERS[name].metadata["unit"]
    if value or _is_pair_of_texts(ends):
        return None
    way_out = f"write its lowest and highest value as texts with units, in {unit} or the like" if unit else "leave it out"
    return f"uncertainty of {name} varies nothing: factors of {value} are {value}; {way_out}."


def _value(actuator: Actuator, name: str, end: float | str) -> float:
    """What one end stands for, in SI."""
    if isinstance(end, str):
        return to_si(f"uncertainty of {name}", end, PARAMETERS[name].metadata["unit"])
    return getattr(actuator, name) * end


def box_of(actuator: Actuator, uncertainty: str | Mapping[str, Ends]) -> dict[str, tuple[float, float]]:
    """The `ranges` that span a box, of which every plant counts; none where `uncertainty` counts its plants."""
    ends = ranges(actuator, uncertainty) if uncertainty == "box" or not isinstance(uncertainty, str) else {}
    return {name: (low, high) for name, (low, high) in ends.items() if low < high}


def variants(actuator: Actuator, specification: Specification) -> dict[str, Actuator]:
    """The plants that a design must hold on, by label: the nominal one, those at ends of `ranges`, then `added_plants`.

    Raises InputError as `ranges` does, and for values that no actuator can have.
    """
    changes = (*counted_changes(actuator, specification.uncertainty), *specification.added_plants)
    return changed_plants(actuator, specification, changes)


def counted_changes(actuator: Actuator, uncertainty: str | Mapping[str, Ends]) -> list[dict[str, float]]:
    """What the plants at ends of `ranges` differ by, {parameter: value in SI} each."""
    ends = ranges(actuator, uncertainty)
    if uncertainty == "one-at-a-time":
        return [{name: value} for name, pair in ends.items() for value in pair]
    return [dict(zip(ends, values, strict=True)) for values in itertools.product(*ends.values())] if ends else []


def changed_plants(actuator: Actuator, specification: Specification, changes: Iterable[Mapping[str, float]]) -> dict[str, Actuator]:
    """The nominal plant and those that differ by `changes`, {parameter: value in SI} each, by label."""
    labels = {variant_label(actuator, specification.uncertainty, change): change for change in changes}
    return {"nominal": actuator} | {label: actuator.replace(**change) for label, change in labels.items()}


def variant_label(actuator: Actuator, uncertainty: str | Mapping[str, Ends], change: Mapping[str, float]) -> str:
    """How a plant is called whose parameters in `change` (SI) differ from the actuator's: "mass +50 %, load_force 20 kN".

    In per cent of the actuator's value where `uncertainty` states factors, in the unit of its upper end where it states values.
    """
    stated = _stated(uncertainty)
    return ", ".join(f"{name} {_shown(actuator, name, value, stated.get(name))}" for name, value in change.items())


def _shown(actuator: Actuator, name: str, value: float, ends: Ends | None) -> str:
    unit = PARAMETERS[name].metadata["unit"]
    if ends is not None and _is_pair_of_texts(ends):
        return from_si(value, unit, unit_in(ends[1]))
    if not getattr(actuator, name):
        return f"{value:.8g} {unit}".rstrip()
    return f"{100 * (value / getattr(actuator, name) - 1):+.8g} %"
