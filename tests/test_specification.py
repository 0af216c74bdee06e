"""Specifications and the plants that they stand for."""

import pytest

import hydroctl as hc
from hydroctl.specification import variants


def test_corners_are_the_nominal_plant_and_four_corners_at_high_supply(reference):
    plants = variants(reference, "corners")
    assert len(plants) == 5
    assert plants.pop("nominal") is reference
    assert {(p.bulk_modulus / 1.2e9, p.mass / 500) for p in plants.values()} == {(e, m) for e in (0.7, 1.3) for m in (0.5, 1.5)}
    assert all(p.supply_pressure == pytest.approx(1.2 * reference.supply_pressure, rel=1e-15) for p in plants.values())


def test_one_at_a_time_changes_one_parameter_of_each_plant_at_nominal_supply(reference):
    plants = variants(reference, "one-at-a-time")
    assert plants.pop("nominal") is reference
    changes = [
        {name: value / getattr(reference, name) for name, value in plant.parameters().items() if value != getattr(reference, name)}
        for plant in plants.values()
    ]
    expected = [{"bulk_modulus": 0.7}, {"bulk_modulus": 1.3}, {"mass": 0.5}, {"mass": 1.5}]
    assert changes == [pytest.approx(change, rel=1e-15) for change in expected]


def test_one_at_a_time_lies_between_nominal_and_corners(reference):
    """Fewer demands allow more gain; supply +20 % alone, which only the corners hold, multiplies the plant's gain by its root."""
    ki = {
        name: hc.tune(
            reference, [0.1], [0.25], specification=hc.Specification(uncertainty=name, notch_damping=(0.3, 0.8))
        ).ki.item()
        for name in ("nominal", "one-at-a-time", "corners")
    }
    assert ki["nominal"] > ki["one-at-a-time"] > 1.2**0.5 * 0.98 * ki["corners"]


def test_ranges_of_any_parameter_give_every_combination_of_their_ends(reference):
    plants = variants(reference, {"mass": (0.5, 2.0), "leakage": (0.1, 10.0), "viscous_friction": (1.0, 3.0)})
    assert len(plants) == 9
    assert len(set(plants.values())) == 9


def test_all_faults_are_told_at_once():
    with pytest.raises(hc.InputError) as caught:
        hc.Specification(
            Ms=0.9, Mt=1.0, sample_time=-1e-3, delay_samples=float("nan"), uncertainty="corner", notch_damping=(0.8, 0.2)
        )
    text = str(caught.value)
    assert len(caught.value.faults) == 6
    for part in ("Ms = 0.9", "Mt = 1.0", "sample_time = -0.001", "delay_samples = nan", "did you mean 'corners'", "notch_damping"):
        assert part in text


def test_close_factors_are_different_plants(reference):
    assert len(variants(reference, {"mass": (1.0, 1.0004), "bulk_modulus": (0.9, 1.1)})) == 5


@pytest.mark.parametrize("name", ["load_force", "valve_natural_frequency"])
def test_a_factor_on_what_is_not_there_is_refused(reference, name):
    with pytest.raises(hc.InputError, match=f"uncertainty of {name} varies nothing"):
        variants(reference, {name: (0.5, 2.0)})


BAD_RANGES = [{}, {"masss": (0.5, 2.0)}, {"mass": (2.0, 0.5)}, {"mass": 0.5}, {"mass": (0.0, 1.0)}, {"mass": ("a", "b")}, 5]


@pytest.mark.parametrize("ranges", BAD_RANGES)
def test_bad_ranges_are_refused(ranges):
    with pytest.raises(hc.InputError):
        hc.Specification(uncertainty=ranges)
