"""Remarks on a machine: pressures above its rating, weights stated as mere loads."""

import json

import numpy as np
import pytest

import hydroctl as hc
from hydroctl.model.characteristics import resonance
from hydroctl.proof.remarks import machine_remarks

OPENINGS, POSITIONS = [-1.0, -0.1, 0.1, 1.0], [0.1, 0.4]
CORNERS, NOMINAL = hc.Specification(uncertainty="corners"), hc.Specification(uncertainty="nominal")


def test_a_pressure_above_the_rating_names_the_worst_opening_and_plant(reference):
    """Extending without load, p_b = p_s a^2/(1 + a^3) and p_a is less; retracting p_b = p_s/(1 +
    a^3), a the area ratio."""
    plain = reference.replace(leakage=0.0, viscous_friction=0.0)
    ratio = plain.area_b / plain.area_a
    highest = 1.2 * plain.supply_pressure / (1.0 + ratio**3)
    (remark,) = machine_remarks(
        plain.replace(pressure_rating=0.99 * highest), OPENINGS, POSITIONS, CORNERS
    )
    assert f"reaches {highest / 1e5:.4g} bar" in remark
    assert "supply_pressure +20 % plant" in remark
    assert f"pressure_rating = {0.99 * highest / 1e5:.4g} bar" in remark
    assert (
        machine_remarks(plain.replace(pressure_rating=1.01 * highest), OPENINGS, POSITIONS, CORNERS)
        == ()
    )
    assert (
        machine_remarks(plain.replace(pressure_rating=0.99 * highest), OPENINGS, POSITIONS, NOMINAL)
        == ()
    )
    assert machine_remarks(plain, OPENINGS, POSITIONS, CORNERS) == ()


@pytest.mark.parametrize(
    ("factor", "angle"), [(1.0, "90"), (-1.0, "-90"), (1.09, "90"), (0.91, "90")]
)
def test_a_load_near_the_weight_of_a_mass_that_varies_gets_a_word(reference, factor, angle):
    hanging = reference.replace(mass=3000.0, load_force=factor * 29420.0)
    (remark,) = machine_remarks(hanging, OPENINGS, POSITIONS, CORNERS)
    assert f'inclination = "{angle} deg"' in remark
    assert "29420 N" in remark
    rest = float(remark.split("and load_force = ")[1].removesuffix(" N."))
    assert rest == pytest.approx(factor * 29420.0 - 29419.95 * (1 if factor > 0 else -1), abs=1.0)


@pytest.mark.parametrize(
    ("changes", "specification"),
    [
        ({"load_force": 29420.0}, NOMINAL),
        ({"load_force": 29420.0}, hc.Specification(uncertainty={"bulk_modulus": (0.7, 1.3)})),
        ({"load_force": 29420.0, "inclination": 0.2}, CORNERS),
        ({"load_force": 1.12 * 29420.0}, CORNERS),
        ({"load_force": 0.88 * 29420.0}, CORNERS),
        ({}, CORNERS),
    ],
)
def test_other_loads_get_none(reference, changes, specification):
    assert (
        machine_remarks(
            reference.replace(mass=3000.0, **changes), OPENINGS, POSITIONS, specification
        )
        == ()
    )


def test_a_design_prints_the_remarks(command, reference, tmp_path):
    machine = reference.replace(mass=3000.0, load_force=29420.0, pressure_rating=1e7)
    sheet = hc.save_actuator(machine, tmp_path / "press.toml")
    asked = "design", sheet, "--loop", "position", "--uncertainty", "one-at-a-time", "-o"
    _, stdout, _ = command(*asked, tmp_path / "text")
    _, answer, _ = command(*asked, tmp_path / "json", "--json")
    rating, weight = json.loads(answer)["remarks"][:2]
    assert "above pressure_rating = 100 bar" in rating
    assert "near the weight" in weight
    for text in (stdout, (tmp_path / "text" / "summary.txt").read_text()):
        assert rating in text
        assert weight in text


def test_a_resonance_above_half_the_sample_rate_is_said_with_the_scan_time_that_avoids_it(
    reference,
):
    points = hc.find_operating_points(reference, np.array(OPENINGS)[:, None], POSITIONS)
    highest = resonance(hc.linearize(reference, points))[0].max()
    slow, fast = (
        hc.Specification(uncertainty="nominal", sample_time=share * np.pi / highest)
        for share in (1.01, 0.99)
    )
    (remark,) = machine_remarks(reference, OPENINGS, POSITIONS, slow)
    assert f"A scan time below {1e3 * np.pi / highest:.3g} ms avoids it" in remark
    assert "3.17, above pi" in remark
    assert machine_remarks(reference, OPENINGS, POSITIONS, fast) == ()
