"""Quantities at the file boundary."""

import itertools
import math
import subprocess
import sys
from decimal import Decimal
from importlib.util import find_spec

import pint
import pytest

from hydroctl.errors import InputError
from hydroctl.machine.units import _registry, to_si


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


@pytest.fixture(scope="module")
def full():
    """All of pint's own units, with the hertz as a cycle frequency."""
    registry = pint.UnitRegistry(on_redefinition="ignore", non_int_type=Decimal)
    registry.define("hertz = turn / second = Hz")
    return registry


def test_every_unit_with_every_prefix_reads_as_in_the_full_registry(full):
    def factor(registry, name):
        quantity = registry.Quantity(Decimal(1), registry.parse_units(name)).to_root_units()
        return float(quantity.magnitude), dict(quantity.dimensionality)

    units = _registry()
    names = [
        prefix + unit for prefix, unit in itertools.product(units._prefixes, units._units)
    ]  # each look-up adds units
    known = [name for name in names if name in units and name in full]
    differ = {
        name: str(full.parse_units(name))
        for name in known
        if factor(units, name) != factor(full, name)
    }
    # none is on a data sheet; pint has the chain from 0.26 on
    assert set(differ.items()) - {("ch", "chain")} == {
        ("hbar", "dirac_constant"),
        ("mcc", "microspeed_of_light"),
    }


@pytest.mark.parametrize(
    ("units", "si"),
    [
        ("m dm cm mm um µm μm nm in inch ft foot yd thou millimeter metre", "m"),
        ("m^2 cm^2 mm^2 dm^2 cm² in^2 in**2 ft^2", "m^2"),
        ("m^3 dm^3 cm^3 mm^3 cm³ L l mL ml cL liter litre cc in^3 ft^3 gal qt floz", "m^3"),
        ("L/min l/min L/s m^3/s m^3/h cm^3/s cm^3/min gal/min in^3/s", "m^3/s"),
        ("L/min/bar cm^3/s/MPa m^3/s/Pa mL/min/bar in^3/s/psi", "m^3/s/Pa"),
        (
            "Pa hPa kPa MPa GPa bar mbar kbar psi ksi atm torr mmHg N/mm^2 N/m^2 kgf/cm^2 lbf/in^2",
            "Pa",
        ),
        ("kg g mg t tonne ton lb oz slug", "kg"),
        ("N mN kN MN dyn kgf lbf kip", "N"),
        ("s ms us µs min h", "s"),
        ("Hz kHz rad/s deg/s rpm rps 1/s", "rad/s"),
        ("m/s mm/s cm/s um/s m/min in/s ft/s", "m/s"),
        ("N*s/m N·s/m kN*s/m N*s/mm kg/s lbf*s/in", "N*s/m"),
        ("N/m N/mm kN/mm N/um MN/m lbf/in", "N/m"),
        ("% percent", ""),
    ],
)
@pytest.mark.parametrize(
    "number", ["1", "63", "31.2", "0.7", "3000", "1.5e-3", "2.718281828459045", "1e-13"]
)
def test_the_units_of_data_sheets_round_as_in_the_full_registry(full, units, si, number):
    for unit in units.split():
        text = unit.replace("³", "^3").replace("²", "^2").replace("·", "*")
        expected = full.Quantity(Decimal(number), full.parse_units(text)).m_as(
            si or "dimensionless"
        )
        assert to_si("field", f"{number} {unit}", si) == float(expected), unit


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


WITH_DASK = """
import hydroctl.machine.units
hydroctl.machine.units.to_si("stroke", "1 m", "m")
import dask.array, pint
print(pint.UnitRegistry().Quantity(dask.array.ones(3), "m").compute().magnitude.sum())
"""
ON_THE_COMMAND_LINE = """
import sys
import hydroctl.cli
sys.argv = ["hydroctl", "actuators", "reference", "--json"]
try:
    hydroctl.cli.main()
finally:
    print("pint" in sys.modules, "dask" in sys.modules)
"""


@pytest.mark.skipif(find_spec("dask") is None, reason="needs dask")
@pytest.mark.parametrize(
    ("code", "last"),
    [(WITH_DASK, "3.0"), (ON_THE_COMMAND_LINE, "True False")],
    ids=["library", "command"],
)
def test_quantities_leave_pint_whole_for_others_and_the_command_line_does_without_dask(code, last):
    told = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert told.stdout.splitlines()[-1] == last, told.stderr
