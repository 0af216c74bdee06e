"""Quantities at the file boundary: `"63 mm"` becomes 0.063, a plain number is taken as SI.

Grammar: one number with a decimal point, then one unit (`bar`, `L/min`, `N*s/m`, `cm^2`, `1/s`). A
decimal comma, a range, a plus-minus sign or a second quantity ("40 L/min @ 70 bar") is an error,
because each of them has more than one reading. A frequency in Hz is a cycle frequency: `"50 Hz"`
becomes 314.159 rad/s. `units.txt` holds the units.
"""

from __future__ import annotations

import math
import re
import sys
from contextlib import contextmanager
from decimal import Decimal
from functools import cache
from pathlib import Path

from ..errors import InputError, shown

_FACTOR = r"[A-Za-zµμ°%]+((\^|\*\*)-?\d(\.\d)?|[²³])?"
_QUANTITY = re.compile(
    rf"(?P<number>[+-]?(\d+(\.\d*)?|\.\d+)([eE][+-]?\d+)?)\s*(?P<unit>(1\s*/\s*)?{_FACTOR}(\s*[*·/"
    rf" ]\s*{_FACTOR})*)?"
)
_LONGEST = 80

_EXAMPLES = {
    "m": "63 mm",
    "m^2": "31.2 cm^2",
    "m^3": "0.5 L",
    "m^3/s": "40 L/min",
    "m/s": "20 mm/s",
    "Pa": "210 bar",
    "kg": "200 kg",
    "N": "12 kN",
    "s": "1 ms",
    "rad/s": "50 Hz",
    "N*s/m": "4000 N*s/m",
    "N/m": "100 N/um",
    "1/s": "12 1/s",
    "rad": "30 deg",
}


@contextmanager
def without_dask():
    """Quantities are read without loading dask, which pint does for arrays of them: a third of the
    time that its own import takes.

    pint then knows nothing of dask to the end of the process: only for one that is hydroctl's own.
    """
    absent = "dask" not in sys.modules
    if absent:
        sys.modules["dask"] = None
    try:
        yield
    finally:
        if absent:
            del sys.modules["dask"]


@cache
def _registry():
    import pint

    return pint.UnitRegistry(Path(__file__).with_name("units.txt"), non_int_type=Decimal)


def to_si(field: str, value: object, unit: str) -> float:
    """`value` of the field named `field` in SI, where `unit` names the SI unit (`""` for a pure
    number).

    A number is SI already. Raises InputError that names the field, the value and the expected form.
    """
    if isinstance(value, str):
        return _parse(field, value, unit)
    if isinstance(value, bool) or not isinstance(value, (int, float)):
        raise _fault(field, value, "is not a quantity", unit)
    try:
        return _finite(field, value, float(value), unit)
    except OverflowError:
        raise _fault(field, value, "is not finite", unit) from None


def unit_in(text: str) -> str | None:
    """The unit of the quantity that `text` is, as written there; None where it has none or is no
    quantity."""
    match = _QUANTITY.fullmatch(text.strip())
    return None if match is None else match["unit"]


def from_si(value: float, unit: str, wanted: str) -> str:
    """`value` in the SI unit `unit` as a quantity in the unit `wanted`, to eight digits: 2e4 in N
    is "20 kN"."""
    return f"{value / to_si('unit', f'1 {wanted}', unit):.8g} {wanted}"


def _parse(field: str, text: str, unit: str) -> float:
    match = _QUANTITY.fullmatch(text.strip()) if len(text) <= _LONGEST else None
    if match is None:
        raise _fault(field, text, "is not one number with one unit", unit)
    number = _finite(field, text, float(match["number"]), unit)
    if match["unit"] is None:
        return number
    registry = _registry()
    try:
        given = registry.Quantity(Decimal(match["number"]), registry.parse_units(match["unit"]))
        return _finite(field, text, float(given.m_as(unit or "dimensionless")), unit)
    except InputError:
        raise
    except (
        Exception
    ):  # pint raises a dozen kinds for a text that is no unit, and one for the wrong dimension
        raise _fault(
            field, text, "has an unknown unit or one of the wrong dimension", unit
        ) from None


def _finite(field: str, given: object, number: float, unit: str) -> float:
    if not math.isfinite(number):
        raise _fault(field, given, "is not finite", unit)
    return number


def _fault(field: str, value: object, what: str, unit: str) -> InputError:
    example = f' or a text such as "{_EXAMPLES[unit]}"' if unit in _EXAMPLES else ""
    way_out = f"write a number in {unit}{example}" if unit else "write a plain number"
    return InputError(f"{field} = {shown(value)} {what}; {way_out}.")
