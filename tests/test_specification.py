"""Specifications and the plants that they stand for."""

import pytest

import hydroctl as hc
from hydroctl.machine.variants import VARIATIONS, ranges, variant_label, variants


def test_corners_are_the_nominal_plant_and_four_corners_at_high_supply(reference):
    plants = variants(reference, "corners")
    assert len(plants) == 5
    assert plants.pop("nominal") is reference
    assert {(p.bulk_modulus / 1.2e9, p.mass / 500) for p in plants.values()} == {
        (e, m) for e in (0.7, 1.3) for m in (0.5, 1.5)
    }
    assert all(
        p.supply_pressure == pytest.approx(1.2 * reference.supply_pressure, rel=1e-15)
        for p in plants.values()
    )


def test_one_at_a_time_changes_one_parameter_of_each_plant_at_nominal_supply(reference):
    plants = variants(reference, "one-at-a-time")
    assert plants.pop("nominal") is reference
    changes = [
        {
            name: value / getattr(reference, name)
            for name, value in plant.parameters().items()
            if value != getattr(reference, name)
        }
        for plant in plants.values()
    ]
    expected = [{"bulk_modulus": 0.7}, {"bulk_modulus": 1.3}, {"mass": 0.5}, {"mass": 1.5}]
    assert changes == [pytest.approx(change, rel=1e-15) for change in expected]


def test_one_at_a_time_lies_between_nominal_and_corners(reference):
    """Fewer demands allow more gain; supply +20 % alone, which only the corners hold, multiplies
    the plant's gain by its root."""
    ki = {
        name: hc.tune(
            reference,
            [0.1],
            [0.25],
            specification=hc.Specification(uncertainty=name, notch_damping=(0.3, 0.8)),
        ).ki.item()
        for name in ("nominal", "one-at-a-time", "corners")
    }
    assert ki["nominal"] > ki["one-at-a-time"] > 1.2**0.5 * 0.98 * ki["corners"]


def test_ranges_of_any_parameter_give_every_combination_of_their_ends(reference):
    plants = variants(
        reference,
        {"mass": (0.5, 2.0), "leakage": (0.1, 10.0), "viscous_friction": (1.0, 3.0)},
    )
    assert len(plants) == 9
    assert len(set(plants.values())) == 9


def test_all_faults_are_told_at_once():
    with pytest.raises(hc.InputError) as caught:
        hc.Specification(
            Ms=0.9,
            Mt=1.0,
            sample_time=-1e-3,
            delay_samples=float("nan"),
            uncertainty="corner",
            notch_damping=(0.8, 0.2),
        )
    text = str(caught.value)
    assert len(caught.value.faults) == 6
    for part in (
        "Ms = 0.9",
        "Mt = 1.0",
        "sample_time = -0.001",
        "delay_samples = nan",
        "did you mean 'corners'",
        "notch_damping",
    ):
        assert part in text


def test_close_factors_are_different_plants(reference):
    assert len(variants(reference, {"mass": (1.0, 1.0004), "bulk_modulus": (0.9, 1.1)})) == 5


@pytest.mark.parametrize(
    ("name", "unit"), [("load_force", "N"), ("valve_natural_frequency", "rad/s")]
)
def test_a_factor_on_what_is_not_there_is_refused_and_a_range_in_units_offered(
    reference, name, unit
):
    with pytest.raises(
        hc.InputError, match=f"uncertainty of {name} varies nothing.*texts with units, in {unit}"
    ):
        variants(reference, {name: (0.5, 2.0)})
    with pytest.raises(
        hc.InputError, match=r"uncertainty of dead_band varies nothing.*leave it out"
    ):
        variants(reference, {"dead_band": (0.5, 2.0)})


def test_values_with_units_are_absolute_and_of_either_sign(reference):
    plants = variants(reference, {"load_force": ("-5 kN", "20 kN"), "mass": (0.5, 1.5)})
    assert list(plants) == [
        "nominal",
        "load_force -5 kN, mass -50 %",
        "load_force -5 kN, mass +50 %",
        "load_force 20 kN, mass -50 %",
        "load_force 20 kN, mass +50 %",
    ]
    found = [(plant.load_force, plant.mass) for plant in plants.values()]
    assert found == [
        (0.0, 500.0),
        (-5000.0, 250.0),
        (-5000.0, 750.0),
        (20000.0, 250.0),
        (20000.0, 750.0),
    ]


def test_ranges_are_the_lowest_and_highest_value_in_si(reference):
    stated = {
        "bulk_modulus": ("9000 bar", "1.2 GPa"),
        "load_force": (0.5, 2.0),
        "valve_rate_limit": ("5 1/s", "5 1/s"),
    }
    loaded = reference.replace(load_force=-1000.0)
    assert ranges(loaded, stated) == {
        "bulk_modulus": (9e8, 1.2e9),
        "load_force": (-2000.0, -500.0),
        "valve_rate_limit": (5.0, 5.0),
    }


def test_ranges_of_a_named_uncertainty_are_what_a_machine_is_expected_to_vary_by(reference):
    assert ranges(reference, "nominal") == {}
    apart, corners = ranges(reference, "one-at-a-time"), ranges(reference, "corners")
    assert corners.pop("supply_pressure") == (1.2 * reference.supply_pressure,) * 2
    assert corners == apart
    for name in ("bulk_modulus", "mass"):
        value = getattr(reference, name)
        halves = (1.0 - VARIATIONS[name]) * value, (1.0 + VARIATIONS[name]) * value
        assert apart[name] == pytest.approx(halves, rel=1e-15)


def test_a_plant_within_the_ranges_is_called_as_they_are_stated(reference):
    stated = {"load_force": ("5000 N", "20 kN"), "mass": (0.5, 1.5)}
    assert (
        variant_label(reference, stated, {"load_force": 7250.0, "mass": 450.0})
        == "load_force 7.25 kN, mass -10 %"
    )


def test_values_that_no_machine_can_have_are_refused_with_the_reason(reference):
    with pytest.raises(hc.InputError, match="is not below supply_pressure"):
        variants(reference, {"tank_pressure": ("0 bar", "460 bar")})


BAD_RANGES = [
    {},
    5,
    {"masss": (0.5, 2.0)},
    {"masss": ("1 kg", "2 kg")},
    {"mass": (2.0, 0.5)},
    {"mass": 0.5},
    {"mass": (0.0, 1.0)},
    {"mass": ("a", "b")},
    {"mass": ("400 kg", 1.5)},
    {"mass": ("600 kg", "400 kg")},
    {"mass": ("-1 kg", "400 kg")},
    {"mass": ("400", "600")},
    {"mass": ("400 m", "600 m")},
    {"dead_band": ("0.01", "0.05")},
]


@pytest.mark.parametrize("stated", BAD_RANGES)
def test_bad_ranges_are_refused(stated):
    with pytest.raises(hc.InputError, match=r"uncertainty|masss"):
        hc.Specification(uncertainty=stated)


def test_all_faults_of_values_with_units_are_told_at_once():
    with pytest.raises(hc.InputError) as caught:
        hc.Specification(
            uncertainty={
                "mass": ("-1 kg", "10 m"),
                "load_force": ("1", "2 N"),
                "dead_band": ("1 %", "2 %"),
            }
        )
    mass, metres, bare, no_unit = caught.value.faults
    assert "mass = -1 kg must be above 0" in mass
    assert "10 m" in metres
    assert "'1' has no unit; write N" in bare
    assert "dead_band" in no_unit
    assert "two factors" in no_unit
