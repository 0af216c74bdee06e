"""Quantities at the file boundary."""

import math

import pytest

from hydroctl.errors import InputError
from hydroctl.units import to_si


@pytest.mark.parametrize(
    ("text", "unit", "value"),
    [
        ("63 mm", "m", 0.063),
        ("31.2 cm^2", "m^2", 31.2e-4),
        ("0.5 L", "m^3", 0.5e-3),
        ("819 cm³", "m^3", 819e-6),
        ("40 L/min", "m^3/s", 40e-3 / 60),
        ("210 bar", "Pa", 210e5),
        ("3000 psi", "Pa", 3000 * 4.4482216152605 / 0.0254**2),
        ("1.2 GPa", "Pa", 1.2e9),
        ("12 kN", "N", 12e3),
        ("4000 N*s/m", "N*s/m", 4000.0),
        ("4000 N·s/m", "N*s/m", 4000.0),
        ("50 Hz", "rad/s", 100 * math.pi),
        ("12 1/s", "1/s", 12.0),
        ("-1.5e3 N", "N", -1500.0),
        ("7", "kg", 7.0),
        (7, "kg", 7.0),
        ("0.7", "", 0.7),
    ],
)
def test_a_quantity_becomes_si(text, unit, value):
    assert to_si("field", text, unit) == pytest.approx(value, rel=1e-15)


def test_a_conversion_is_exact_where_the_decimal_is():
    assert to_si("bore_diameter", "63 mm", "m") == 0.063
    assert to_si("supply_pressure", "210 bar", "Pa") == 210e5


@pytest.mark.parametrize(
    "text",
    [
        "3,5 mm",
        "40 L/min @ 70 bar",
        "4..20 mm",
        "4...20",
        "10 ± 1 mm",
        "10 +- 1 mm",
        "1 2 mm",
        "mm 10",
        "ten mm",
        "",
        " ",
        "0x10 mm",
        "1_000 mm",
        "10 bar",
        "10 furlongz",
        "10 mm mm",
        "inf m",
        "nan m",
        "1e999 m",
        "__import__('os')",
        "9" * 500,
        "1 m" + "*m" * 500,
    ],
)
def test_what_is_not_one_number_with_one_fitting_unit_is_refused(text):
    with pytest.raises(InputError, match=r"^stroke = .*write a number in m") as caught:
        to_si("stroke", text, "m")
    assert len(caught.value.faults) == 1
    assert len(str(caught.value)) < 300


@pytest.mark.parametrize("value", [True, None, [1.0], {"m": 1}, math.inf, math.nan, 10**400])
def test_a_value_that_is_no_finite_number_is_refused(value):
    with pytest.raises(InputError, match=r"^stroke = "):
        to_si("stroke", value, "m")
