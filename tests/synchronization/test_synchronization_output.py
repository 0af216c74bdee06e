"""What a user sees of synchronised motion: the summary, the figures, the command line."""

import dataclasses

import numpy as np
import pytest
from groups import machines_of, pair
from matplotlib.figure import Figure

import hydroctl as hc
from hydroctl import plotting
from hydroctl.errors import OperatingPointError
from hydroctl.synchronization import Failure, StopStrategy, s_curve, standard_motion


@pytest.fixture(scope="module")
def stopped():
    schedules = pair()
    rules = {"stop": StopStrategy(distance=1e-3), "failure": Failure(cylinder=1, time=0.4)}
    return hc.synchronize(
        machines_of(schedules), schedules, s_curve(0.1, 0.15, 0.6), coupling="mean", **rules
    )


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    directory = tmp_path_factory.mktemp("schedules")
    return [schedule.save(directory / f"{i}.json") for i, schedule in enumerate(pair())]


def test_the_summary_says_what_was_reached_and_why_it_stopped(stopped):
    text = stopped.summary()
    for part in (
        "2 cylinders, coupling mean",
        "kept: limit 2",
        "rms",
        "NOT to the end",
        "cylinder 2: its position is not known",
        "(1 mm stated)",
    ):
        assert part in text
    assert f"{1e3 * stopped.metrics.rms:.4f} mm" in text


def test_figures_show_the_numbers_of_the_result(stopped):
    axes = plotting.group_motion(stopped)
    assert axes.shape == (4,)
    reference, *cylinders = axes[0].lines[:3]
    assert np.array_equal(reference.get_ydata(), stopped.reference)
    for line, trajectory in zip(cylinders, stopped.trajectories, strict=True):
        assert np.array_equal(line.get_ydata(), trajectory.y)
    assert axes[2].lines[0].get_ydata() == pytest.approx(1e3 * stopped.error)
    assert axes[0].lines[-1].get_xdata()[0] == stopped.stop.time
    given = Figure().subplots(2, 1)
    assert (
        plotting.synchronization_errors({"one": stopped, "two": stopped}, ax=given)[0] is given[0]
    )
    assert given[1].lines[1].get_ydata() == pytest.approx(stopped.v_ref)


def test_the_standard_motion_follows_the_cylinders_own_measures():
    machines = machines_of(pair())
    profile, loads = standard_motion(machines)
    assert (profile.position[0], profile.position[-1]) == pytest.approx((0.15, 0.35))
    full = min(float(hc.find_operating_points(machine, 1.0, 0.25).v) for machine in machines)
    assert profile.speed.max() == pytest.approx(0.5 * full, rel=1e-4)
    stall = min(46e6 * machines[1].area_a, 46e6 * machines[1].area_b)
    assert not loads[0].any()
    assert loads[1][-1] == pytest.approx(0.1 * stall)
    weak = machines[0].replace(load_force=3e6)
    with pytest.raises(OperatingPointError, match="stall"):
        standard_motion([machines[1], weak])


def test_the_command_line_moves_several_schedules_together(command, files):
    code, stdout, _ = command("validate", *files, "--synchronize", "--count", 3, "--seed", 1)
    assert code == 0
    for part in ("2 cylinders, coupling mean", "3 random cases, seed 1: 0 failed", "pass  rms"):
        assert part in stdout
    code, stdout, _ = command(
        "validate", *files, "--synchronize", "--coupling", "ring", "--tolerance", "1e-9"
    )
    assert code == 1
    assert "FAIL  rms" in stdout


def test_the_command_line_refuses_what_is_no_group(command, files, tmp_path):
    for arguments, words in (
        (files, "2 schedules were given; add --synchronize"),
        ([files[0], "--synchronize"], "one cylinder has none to follow"),
        ([*files, "--synchronize", "--coupling", "rind"], "did you mean 'ring'"),
    ):
        code, stdout, stderr = command("validate", *arguments)
        assert (code, stdout) == (2, "")
        assert words in stderr
    slow = dataclasses.replace(
        pair()[0], specification=hc.Specification(uncertainty="nominal", sample_time=2e-3)
    ).save(tmp_path / "slow.json")
    code, _, stderr = command("validate", files[0], slow, "--synchronize")
    assert code == 2
    assert "sampled every 0.001, 0.002 s" in stderr
