"""What a machine varies by: ranges of its parameters, and the plants that stand for them."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Mapping
from numbers import Real
from typing import TypeGuard

from ..errors import InputError, unknown_name
from .actuator import PARAMETERS, Actuator, field_fault
from .units import from_si, to_si, unit_in

VARIATIONS = {"bulk_modulus": 0.3, "mass": 0.5, "supply_pressure": 0.2}
"""What a machine is expected to vary by: relative half-widths"""
_HIGH_SUPPLY = 1.0 + VARIATIONS["supply_pressure"]
_BOTH_WAYS = {
    name: (1.0 - VARIATIONS[name], 1.0 + VARIATIONS[name]) for name in ("bulk_modulus", "mass")
}
_NAMED = {
    "box": {name: (1.0 - half, 1.0 + half) for name, half in VARIATIONS.items()},
    "nominal": {},
    "corners": _BOTH_WAYS | {"supply_pressure": (_HIGH_SUPPLY, _HIGH_SUPPLY)},
    "one-at-a-time": _BOTH_WAYS,
}
"""The factors of the uncertainties that have a name, as one would state them"""
Ends = tuple[float, float] | tuple[str, str]
"""(low, high) of one parameter: two factors, or two values with units"""


def is_number(value: object) -> TypeGuard[float]:
    return isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)


def is_pair(value: object) -> TypeGuard[tuple[float, float]]:
    return isinstance(value, tuple) and len(value) == 2 and all(map(is_number, value))


def uncertainty_faults(uncertainty) -> list[str]:
    if isinstance(uncertainty, str):
        return [] if uncertainty in _NAMED else [unknown_name("uncertainty", uncertainty, _NAMED)]
    if not isinstance(uncertainty, Mapping):
        return [
            f"uncertainty = {uncertainty!r} must be one of {', '.join(_NAMED)}, or factors such as"
            ' {"mass": (0.5, 1.5)}.'
        ]
    if not uncertainty:
        return ['uncertainty names no parameter; write "nominal" for the nominal plant alone.']
    faults = [
        unknown_name("parameter", name, PARAMETERS)
        for name in uncertainty
        if name not in PARAMETERS
    ]
    for name, ends in uncertainty.items():
        faults += (
            _value_faults(name, ends) if _is_pair_of_texts(ends) else _factor_faults(name, ends)
        )
    return faults


def added_faults(plants: object) -> list[str]:
    if not isinstance(plants, tuple) or not all(
        isinstance(plant, Mapping) and plant for plant in plants
    ):
        return [
            f"added_plants = {plants!r} must be a tuple of {{parameter: value in SI}}, none of them"
            " empty."
        ]
    named = {(name, value) for plant in plants for name, value in plant.items()}
    faults = (
        (
            field_fault(name, value)
            if name in PARAMETERS
            else unknown_name("parameter", name, PARAMETERS)
        )
        for name, value in named
    )
    return sorted(f"added_plants: {fault}" for fault in faults if fault)


def _is_pair_of_texts(ends: object) -> TypeGuard[tuple[str, str]]:
    return isinstance(ends, tuple) and len(ends) == 2 and all(isinstance(end, str) for end in ends)


def _factor_faults(name: str, factors: object) -> list[str]:
    if is_pair(factors) and 0 < factors[0] <= factors[1]:
        return []
    return [
        f"uncertainty of {name} = {factors!r} must be two factors (low, high) with 0 < low <= high,"
        " or two values as texts with units."
    ]


def _value_faults(name: str, texts: tuple[str, str]) -> list[str]:
    unit = PARAMETERS[name].metadata["unit"] if name in PARAMETERS else None
    if unit is None:
        return []
    if not unit:
        return [
            f"uncertainty of {name} = {texts!r}: it has no unit; give two factors (low, high),"
            " numbers."
        ]
    faults: list[str] = []
    values: list[float] = []
    for text in texts:
        try:
            values.append(to_si(f"uncertainty of {name}", text, unit))
        except InputError as error:
            faults += error.faults
            continue
        if unit_in(text) is None:
            faults.append(
                f"uncertainty of {name} = {text!r} has no unit; write {unit} or the like, or"
                " factors as numbers."
            )
        elif fault := field_fault(name, values[-1]):
            faults.append(f"uncertainty of {name}: {fault}")
    if not faults and values[0] > values[1]:
        faults.append(f"uncertainty of {name} = {texts!r} must be (low, high) with low <= high.")
    return faults


def ranges(
    actuator: Actuator, uncertainty: str | Mapping[str, Ends]
) -> dict[str, tuple[float, float]]:
    """(lowest, highest value) in SI of every parameter that `uncertainty` varies, by name;
    "nominal" varies none.

    The supply pressure of "corners" is the high one at both ends. Raises InputError for a factor on
    a parameter that the actuator does not have or that is 0.
    """
    stated = _stated(uncertainty)
    if faults := [
        fault for name, ends in stated.items() if (fault := _nothing_varied(actuator, name, ends))
    ]:
        raise InputError(faults)
    found = {name: [_value(actuator, name, end) for end in ends] for name, ends in stated.items()}
    return {name: (min(ends), max(ends)) for name, ends in found.items()}


def _stated(uncertainty: str | Mapping[str, Ends]) -> Mapping[str, Ends]:
    return _NAMED[uncertainty] if isinstance(uncertainty, str) else uncertainty


def _nothing_varied(actuator: Actuator, name: str, ends: Ends) -> str | None:
    value, unit = getattr(actuator, name), PARAMETERS[name].metadata["unit"]
    if value or _is_pair_of_texts(ends):
        return None
    way_out = (
        f"write its lowest and highest value as texts with units, in {unit} or the like"
        if unit
        else "leave it out"
    )
    return f"uncertainty of {name} varies nothing: factors of {value} are {value}; {way_out}."


def _value(actuator: Actuator, name: str, end: float | str) -> float:
    """What one end stands for, in SI."""
    if isinstance(end, str):
        return to_si(f"uncertainty of {name}", end, PARAMETERS[name].metadata["unit"])
    return getattr(actuator, name) * end


def box_of(
    actuator: Actuator, uncertainty: str | Mapping[str, Ends]
) -> dict[str, tuple[float, float]]:
    """The `ranges` that span a box, of which every plant counts; none where `uncertainty` counts
    its plants."""
    ends = (
        ranges(actuator, uncertainty)
        if uncertainty == "box" or not isinstance(uncertainty, str)
        else {}
    )
    return {name: (low, high) for name, (low, high) in ends.items() if low < high}


def variants(
    actuator: Actuator,
    uncertainty: str | Mapping[str, Ends],
    added_plants: Iterable[Mapping[str, float]] = (),
) -> dict[str, Actuator]:
    """The plants that a design must hold on, by label: the nominal one, those at ends of `ranges`,
    then `added_plants`, {parameter: value in SI} each.

    Raises InputError as `ranges` does, and for values that no actuator can have.
    """
    changes = (*counted_changes(actuator, uncertainty), *added_plants)
    return changed_plants(actuator, uncertainty, changes)


def counted_changes(
    actuator: Actuator, uncertainty: str | Mapping[str, Ends]
) -> list[dict[str, float]]:
    """What the plants at ends of `ranges` differ by, {parameter: value in SI} each."""
    ends = ranges(actuator, uncertainty)
    if uncertainty == "one-at-a-time":
        return [{name: value} for name, pair in ends.items() for value in pair]
    return (
        [dict(zip(ends, values, strict=True)) for values in itertools.product(*ends.values())]
        if ends
        else []
    )


def changed_plants(
    actuator: Actuator,
    uncertainty: str | Mapping[str, Ends],
    changes: Iterable[Mapping[str, float]],
) -> dict[str, Actuator]:
    """The nominal plant and those that differ by `changes`, {parameter: value in SI} each, by
    label."""
    labels = {variant_label(actuator, uncertainty, change): change for change in changes}
    return {"nominal": actuator} | {
        label: actuator.replace(**change) for label, change in labels.items()
    }


def variant_label(
    actuator: Actuator, uncertainty: str | Mapping[str, Ends], change: Mapping[str, float]
) -> str:
    """How a plant is called whose parameters in `change` (SI) differ from the actuator's: "mass +50
    %, load_force 20 kN".

    In per cent of the actuator's value where `uncertainty` states factors, in the unit of its upper
    end where it states values.
    """
    stated = _stated(uncertainty)
    return ", ".join(
        f"{name} {_shown(actuator, name, value, stated.get(name))}"
        for name, value in change.items()
    )


def _shown(actuator: Actuator, name: str, value: float, ends: Ends | None) -> str:
    unit = PARAMETERS[name].metadata["unit"]
    if ends is not None and _is_pair_of_texts(ends):
        return from_si(value, unit, unit_in(ends[1]) or unit)
    if not getattr(actuator, name):
        return f"{value:.8g} {unit}".rstrip()
    return f"{100 * (value / getattr(actuator, name) - 1):+.8g} %"
