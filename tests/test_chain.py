"""The main job on the reference actuator, for both loops: what it leaves, what it says, and its
exit code."""

import json

import numpy as np
import pytest

import hydroctl as hc
from hydroctl.chain import STAGES


@pytest.fixture(scope="module", params=["velocity", "position"])
def designed(request, reference):
    return hc.design(reference, loop=request.param)


def test_each_stage_is_told_as_it_begins_and_timed(reference):
    told = []
    result = hc.design(reference, loop="velocity", on_stage=told.append)
    assert tuple(told) == STAGES == tuple(result.seconds)


def test_every_requirement_is_met(designed):
    assert designed.passed
    assert designed.margin_verdicts
    assert designed.validation.verdicts
    assert designed.schedule.margins.unstable == 0


def at_a_corner(plant, actuator):
    """Whether each parameter is at an end of the box of bulk modulus +-30 %, mass +-50 %, supply
    +-20 %."""
    halves = {"bulk_modulus": 0.3, "mass": 0.5, "supply_pressure": 0.2}
    return all(
        abs(abs(plant[name] / getattr(actuator, name) - 1.0) - half) < 1e-12
        for name, half in halves.items()
    )


def test_margins_are_reported_at_and_between_all_nodes_for_all_plants(designed):
    lines = designed.schedule.margins.to_csv().splitlines()
    x, y = designed.schedule.design_x.size, designed.schedule.design_y.size
    added = [
        plant
        for plant in designed.schedule.specification.added_plants
        if not at_a_corner(plant, designed.actuator)
    ]
    variants, sides = 1 + 2**3 + len(added), 2
    assert len(lines) == 1 + variants * (2 * x - sides) * (2 * y - 1)
    margins = [
        "Ms [1]",
        "Mt [1]",
        "gain_margin [1]",
        "gain_reduction_margin [1]",
        "phase_margin [rad]",
        "delay_margin [s]",
    ]
    assert lines[0].endswith(",".join(["", *margins, "crossover [rad/s]", "stable"]))


def test_the_fixed_regulator_stands_beside_the_schedule(designed):
    scheduled = designed.schedule.gains(
        designed.schedule.design_x[:, None], designed.schedule.design_y
    ).ki
    assert designed.fixed.ki.item() <= scheduled.mean()
    assert "fixed" in designed.summary()
    for found in designed.to_dict()["iae_over_fixed"].values():
        assert 0.0 < found["nominal"] <= found["worst"]
    assert designed.to_dict()["iae_over_fixed"]["scheduled"]["worst"] < 1.05


def test_a_bare_p_and_a_p_with_feed_forward_stand_beside_the_schedule(designed):
    for name in ("scheduled", "P", "P + feed-forward"):
        assert f"  {name} " in designed.summary()
    assert (
        designed.comparison["P"].nominal.mean > designed.comparison["P + feed-forward"].nominal.mean
    )
    assert designed.comparison["P"].worst_variant in designed.schedule.margins.variants
    assert designed.comparison["P"].nominal.cases == 17


def test_the_nonlinear_trial_covers_three_positions_both_directions_and_saturation(designed):
    runs = designed.validation.runs
    steps = [run for run in runs if run.scenario.kind == "step"]
    travel = np.array([run.trajectory.y[-1] - run.trajectory.y[0] for run in steps])
    middle = np.array([run.trajectory.y[0] for run in steps]) + travel / 2.0
    for direction in (1.0, -1.0):
        positions = np.sort(middle[np.sign(travel) == direction]) / designed.actuator.stroke
        np.testing.assert_allclose(positions, [0.15, 0.5, 0.85], atol=0.05)
    assert any(
        np.abs(run.trajectory.command).max() == 1.0
        for run in runs
        if run.scenario.kind == "saturated"
    )


def test_a_design_is_saved_whole_and_its_schedule_loads(designed, tmp_path):
    written = designed.save(tmp_path / "out")
    assert {path.name for path in written} >= {
        "schedule.json",
        "margins.csv",
        "summary.txt",
        "report.html",
        "bode.svg",
    }
    assert sorted(path.name for path in (tmp_path / "out").iterdir()) == sorted(
        path.name for path in written
    )
    assert all(path.stat().st_size > 100 for path in written)
    np.testing.assert_array_equal(
        hc.load_schedule(tmp_path / "out" / "schedule.json").ki, designed.schedule.ki
    )


def test_a_design_that_misses_a_requirement_ends_with_code_1_and_says_which_where_and_by_how_much(
    command, tmp_path
):
    """PI without a notch is too slow for the fast machine at small openings: its speed does not
    settle in time."""
    code, stdout, _ = command("design", "fast_50_28", "-o", tmp_path / "out", "--json")
    failed = [verdict for verdict in json.loads(stdout)["verdicts"] if not verdict["passed"]]
    assert code == 1
    assert "settling time" in {verdict["name"] for verdict in failed}
    assert all(
        verdict["achieved"] > verdict["limit"] and verdict["scenario"] and verdict["variant"]
        for verdict in failed
    )
    assert "A REQUIREMENT IS NOT MET" in (tmp_path / "out" / "summary.txt").read_text()


def test_an_operating_point_that_the_load_forbids_is_code_2_with_the_reason(
    command, reference, tmp_path
):
    hc.save_actuator(reference.replace(load_force=-1.2e6), tmp_path / "loaded.toml")
    code, _, stderr = command("design", tmp_path / "loaded.toml", "-o", tmp_path / "out")
    assert code == 2
    assert "fall below tank pressure" in stderr
    assert not (tmp_path / "out").exists()
