"""Validation: metrics against known answers, scenarios that fit the machine, and requirements that
tell good loops from bad."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
from loops import schedule
from machines import total_load
from motions import TS, ZETA, second_order_answer, step_of_second_order, trajectory_of, verdicts_of

import hydroctl as hc
from hydroctl.errors import InputError
from hydroctl.simulation import Scenario
from hydroctl.validation import (
    Metrics,
    compare,
    contact_scenarios,
    default_requirements,
    library,
    measure,
    rivals,
    scale_of,
    step_scenarios,
    tracking_scenarios,
    validate,
)
from hydroctl.validation.verdict import judge

ACTUATOR = hc.load_actuator("reference")


@pytest.mark.parametrize("size", [0.02, -0.01])
def test_step_metrics_of_a_second_order_loop_are_the_textbook_ones(size):
    """Overshoot exp(-pi zeta/sqrt(1 - zeta^2)); rise and settling by python-control."""
    import control

    asked, y = step_of_second_order(size)
    found = measure(ACTUATOR, asked, trajectory_of(y, np.zeros(y.size)))
    overshoot = math.exp(-math.pi * ZETA / math.sqrt(1 - ZETA**2))
    t = TS * np.arange(6000)
    info = control.step_info(second_order_answer(t), t, SettlingTimeThreshold=0.02)
    assert found.overshoot == pytest.approx(overshoot, abs=1e-4)
    assert found.passing == pytest.approx(overshoot * abs(size), abs=1e-4 * abs(size))
    assert found.rise_time == pytest.approx(info["RiseTime"], abs=2 * TS)
    assert found.settling_time == pytest.approx(info["SettlingTime"], abs=2 * TS)
    assert abs(found.steady_error) <= 1e-4
    assert found.largest_error == pytest.approx(abs(size), rel=1e-12)


def test_integrals_of_the_error_are_the_closed_forms():
    """For an exponential e = exp(-t/T): IAE = T, ISE = T/2; left sums are high by Ts/2 each, up to
    (Ts/T)^2."""
    T, n = 0.05, 20000
    y = 0.1 - 0.02 * np.exp(-TS * np.arange(n) / T)
    asked = Scenario(name="decay", loop="position", Ts=TS, reference=np.full(n, 0.1), y=0.08)
    found = measure(ACTUATOR, asked, trajectory_of(y, np.zeros(n)))
    assert found.iae == pytest.approx(0.02 * (T + TS / 2), rel=1e-5)
    assert found.ise == pytest.approx(0.02**2 * (T / 2 + TS / 2), rel=1e-5)


def test_counts_of_pressure_command_and_stroke():
    n = 1000
    command = np.zeros(n)
    command[100:300], command[300:400] = 1.0, -1.0
    p_a = np.full(n, 1e7)
    p_a[50:70], p_a[80] = -1e5, 4e7
    y = np.full(n, 0.1)
    y[500] = -0.003
    asked = Scenario(name="counts", loop="position", Ts=TS, reference=np.full(n, 0.1), y=0.1)
    found = measure(ACTUATOR, asked, trajectory_of(y, command, p_a=p_a))
    assert found.total_variation == 4.0
    assert found.saturation_time == pytest.approx(300 * TS, rel=1e-12)
    assert found.cavitation_time == pytest.approx(20 * TS, rel=1e-12)
    assert (found.peak_pressure, found.lowest_pressure) == (4e7, -1e5)
    assert found.beyond_stroke == pytest.approx(0.003, rel=1e-12)
    assert math.isnan(found.settling_time)


def test_either_chamber_and_either_end_counts_and_the_first_command_is_a_change_from_rest():
    n, command = 1000, np.full(1000, 0.25)
    y = np.full(n, 0.1)
    y[500] = ACTUATOR.stroke + 0.002
    p_b = np.full(n, 1e7)
    p_b[50:70], p_b[80] = -1e5, 4e7
    asked = Scenario(name="counts", loop="position", Ts=TS, reference=np.full(n, 0.1), y=0.1)
    found = measure(ACTUATOR, asked, trajectory_of(y, command, p_b=p_b))
    assert found.total_variation == 0.25
    assert found.saturation_time == 0.0
    assert found.cavitation_time == pytest.approx(20 * TS, rel=1e-12)
    assert (found.peak_pressure, found.lowest_pressure) == (4e7, -1e5)
    assert found.beyond_stroke == pytest.approx(0.002, rel=1e-9)


@pytest.mark.parametrize("size", [0.02, -0.01])
def test_the_steady_error_is_positive_where_the_motion_stops_short_and_a_mean_of_the_last_tenth(
    size,
):
    """Half-way until a tenth before the end, then 3 and 5 % short in turn."""
    k = np.arange(2000)
    reached = np.where(k < 1800, 0.5, np.where(k % 2, 0.97, 0.95))
    reached[0] = 0.0
    asked = Scenario(
        name="short",
        loop="position",
        Ts=TS,
        reference=np.full(2000, 0.1 + size),
        y=0.1,
        kind="step",
        settle_by=0.1,
    )
    found = measure(ACTUATOR, asked, trajectory_of(0.1 + size * reached, np.zeros(2000)))
    assert found.steady_error == pytest.approx(0.04, rel=1e-9)


def test_step_metrics_concern_the_last_change_of_the_reference():
    """A step up that overshoots by half, and back by a third of it without overshoot. What lasts is
    counted from the first sample that is not before `settle_by`."""
    reference, y = np.full(3000, 0.1), np.full(3000, 0.1)
    reference[1000:], y[1000:] = 0.13, 0.13
    y[1050:1100] = 0.145
    reference[2000:] = 0.12
    y[2000:] = 0.12 + 0.01 * np.exp(-np.arange(1000) / 100.0)
    asked = Scenario(
        name="back",
        loop="position",
        Ts=TS,
        reference=reference,
        y=0.1,
        kind="reversal",
        settle_by=0.04995,
    )
    found = measure(ACTUATOR, asked, trajectory_of(y, np.zeros(3000)))
    assert found.overshoot == 0.0
    assert found.settling_time == pytest.approx(100 * TS * math.log(50.0), abs=TS)
    assert found.oscillation == pytest.approx(math.exp(-5.0) - math.exp(-9.99), rel=1e-9)


def test_a_loop_that_does_not_settle_has_an_infinite_settling_time_and_fails():
    n = 4000
    y = 0.1 + 0.01 * (1.0 + 0.1 * np.sin(300 * TS * np.arange(n)))
    y[0] = 0.1
    asked = Scenario(
        name="hunting",
        loop="position",
        Ts=TS,
        reference=np.full(n, 0.11),
        y=0.1,
        kind="step",
        settle_by=0.2,
    )
    metrics = measure(ACTUATOR, asked, trajectory_of(y, np.zeros(n)))
    assert metrics.settling_time == math.inf
    assert metrics.oscillation == pytest.approx(0.2, rel=0.01)
    failed = {name for name, verdict in verdicts_of(asked, metrics).items() if not verdict.passed}
    assert failed == {"settling time", "residual oscillation"}


def test_what_cannot_be_judged_is_not_met():
    """A "step" to where the piston is already has no settling time, whatever the loop; the
    requirement must not vanish."""
    n = 400
    asked = Scenario(
        name="no step",
        loop="position",
        Ts=TS,
        reference=np.full(n, 0.1),
        y=0.1,
        kind="step",
        settle_by=0.02,
    )
    metrics = measure(ACTUATOR, asked, trajectory_of(np.full(n, 0.1), np.zeros(n)))
    verdicts = verdicts_of(asked, metrics)
    assert not verdicts["settling time"].passed
    assert "cannot be judged" in str(verdicts["settling time"])
    assert verdicts["peak pressure"].passed
    assert "overshoot after saturation" not in verdicts


@pytest.mark.parametrize(("rating", "word"), [(None, "note"), (3.9e7, "FAIL"), (4.1e7, "pass")])
def test_peak_pressure_is_judged_by_the_rating_and_without_one_it_is_a_remark(rating, word):
    """Supply pressure is no limit: a load may lift a chamber above it, and the machine may stand
    it."""
    machine, n = ACTUATOR.replace(supply_pressure=3e7, pressure_rating=rating), 100
    asked = Scenario(name="ramp", loop="position", Ts=TS, reference=np.linspace(0.1, 0.2, n), y=0.1)
    runs = []
    for peak in (3.5e7, 4e7, 3.6e7):
        motion = replace(
            trajectory_of(np.full(n, 0.1), np.zeros(n)), p_a=np.full(n, peak), p_b=np.full(n, 1e6)
        )
        made = {
            "scenario": asked,
            "actuator": machine,
            "metrics": measure(machine, asked, motion),
            "reason": "",
        }
        runs.append(SimpleNamespace(variant=f"peak {peak:g}", **made))
    (found,) = [
        v
        for v in judge(default_requirements(scale_of(machine, "position"), "position"), runs)
        if v.name == "peak pressure"
    ]
    assert (found.achieved, found.variant, found.passed) == (4e7, "peak 4e+07", word != "FAIL")
    assert found.is_remark == (rating is None)
    assert str(found).startswith(f"{word}  peak pressure: 4e+07")
    assert ("pressure_rating is not stated" in str(found)) == (rating is None)


@pytest.mark.parametrize("loop", ["velocity", "position"])
def test_library_has_three_positions_both_ways_saturation_and_reversal(loop):
    asked = step_scenarios(ACTUATOR, loop)
    kinds = [scenario.kind for scenario in asked]
    assert [kinds.count(kind) for kind in ("step", "saturated", "reversal")] == [6, 2, 1]
    assert len({scenario.name for scenario in asked}) == len(asked)
    changes = [
        scenario.reference[-1] - scenario.reference[0]
        for scenario in asked
        if scenario.kind == "step"
    ]
    assert sorted(np.sign(changes)) == [-1, -1, -1, 1, 1, 1]
    for scenario in asked:
        travelled = (
            np.cumsum(scenario.reference) * scenario.Ts
            if loop == "velocity"
            else scenario.reference - scenario.y
        )
        if scenario.kind != "saturated":
            assert (
                0.0 < scenario.y + travelled.min() <= scenario.y + travelled.max() < ACTUATOR.stroke
            )


def test_time_constant_of_the_machine_comes_from_its_hydraulic_mode():
    """At |x| = 1 the complex pair of the reference machine is -104 +- 541i at y = 0.1: 1/(2 * 104)
    s, slowest near the middle."""
    scale = scale_of(ACTUATOR, "velocity")
    assert 1 / (2 * 103.749) < scale.time_constant < 1.02 / (2 * 103.0)
    assert scale.speed(1.0) == pytest.approx(0.151457632, rel=1e-8)


@pytest.mark.parametrize("name", ["reference", "differential_100_56"])
def test_a_machine_is_asked_for_steps_and_times_of_its_own_size(name):
    """40 or 80 of its time constants; a third of the lower speed, or 2 % of the stroke."""
    machine = hc.load_actuator(name)
    points = hc.find_operating_points(machine, [-1.0, 1.0], machine.stroke / 2.0)
    speed, position = (scale_of(machine, loop) for loop in ("velocity", "position"))
    assert speed.settling == pytest.approx(40.0 * speed.time_constant, rel=1e-12)
    assert position.settling == pytest.approx(80.0 * speed.time_constant, rel=1e-12)
    assert speed.step == pytest.approx(np.abs(points.v).min() / 3.0, rel=1e-9)
    assert position.step == pytest.approx(0.02 * machine.stroke, rel=1e-12)


def test_sound_loops_meet_every_requirement_on_the_nominal_machine_and_its_corners():
    for loop in ("velocity", "position"):
        gains = {
            "kp": np.full((4, 3), 0.3 if loop == "velocity" else 280.0),
            "ki": np.full((4, 3), 280.0 if loop == "velocity" else 5700.0),
        }
        given = schedule(
            loop,
            **gains,
            Tt=0.02 if loop == "velocity" else 0.05,
            zz=0.3,
            specification=SimpleNamespace(Mt=1.3),
        )
        report = validate(ACTUATOR, given, variants="box")
        assert report.passed, report.summary()
        assert len(report.runs) == 81
        assert len({run.variant for run in report.runs}) == 9


@pytest.mark.parametrize(
    ("changes", "failing"),
    [
        ({"Tt": np.inf}, {"settling time", "steady error"}),
        ({"ki": np.full((4, 3), 1500.0)}, {"overshoot of a step", "overshoot after saturation"}),
        ({"ki": np.full((4, 3), 4000.0)}, {"settling time", "residual oscillation"}),
        ({"ki": np.full((4, 3), 20.0)}, {"settling time"}),
    ],
    ids=["no anti-windup", "ringing", "unstable", "sluggish"],
)
def test_faulty_velocity_loops_fail_the_requirement_that_they_violate(changes, failing):
    common = {"kp": np.full((4, 3), 0.3), "zz": 0.3, "Tt": 0.02}
    given = schedule(specification=SimpleNamespace(Mt=1.3), **common | changes)
    report = validate(ACTUATOR, given)
    assert not report.passed
    assert failing <= {verdict.name for verdict in report.verdicts if not verdict.passed}, (
        report.summary()
    )
    assert "not met" in report.summary()


def test_a_run_that_fails_is_a_verdict_with_its_reason():
    away = Scenario(
        name="out of the stroke", loop="velocity", Ts=1e-3, reference=np.full(9000, 0.1), y=0.25
    )
    good = Scenario(name="stay", loop="velocity", Ts=1e-3, reference=np.zeros(100), y=0.25)
    report = validate(
        ACTUATOR, schedule(specification=SimpleNamespace(Mt=1.3)), scenarios=[good, away]
    )
    verdict = report.verdicts[0]
    assert (verdict.name, verdict.passed, verdict.achieved, verdict.scenario) == (
        "simulations that failed",
        False,
        1.0,
        away.name,
    )
    assert "stroke" in verdict.reason
    assert report.metrics[("nominal", away.name)] is None
    assert isinstance(report.metrics[("nominal", good.name)], Metrics)


def test_unusable_requests_are_refused():
    given = schedule(specification=SimpleNamespace(Mt=1.3))
    with pytest.raises(InputError, match="variants 'boxes' is unknown; did you mean 'box'"):
        validate(ACTUATOR, given, variants="boxes")
    with pytest.raises(InputError, match="at least one Actuator"):
        validate(ACTUATOR, given, variants={"light": 1.0})
    with pytest.raises(InputError, match="scenarios is empty"):
        validate(ACTUATOR, given, scenarios=[])
    with pytest.raises(InputError, match="loop 'speed' is unknown"):
        step_scenarios(ACTUATOR, "speed")
    for Ts in (0.0, -1e-3, np.nan, 1.0, "1 ms", 1e-12):
        with pytest.raises(InputError, match="Ts = "):
            step_scenarios(ACTUATOR, "velocity", Ts=Ts)
    with pytest.raises(InputError, match="is for the position loop"):
        validate(ACTUATOR, given, scenarios=step_scenarios(ACTUATOR, "position"))


@pytest.mark.parametrize("loop", ["velocity", "position"])
@pytest.mark.parametrize("name", ["reference", "differential_100_56", "crane_80_45"])
def test_tracking_references_stay_within_what_the_machine_can_do(loop, name):
    actuator = hc.load_actuator(name)
    scale = scale_of(actuator, loop)
    asked = tracking_scenarios(actuator, loop)
    assert len({scenario.name for scenario in asked}) == 8
    for scenario in asked:
        assert np.abs(scenario.v_ref).max() <= 0.5 * min(scale.extend_speed, scale.retract_speed)
        if loop == "position":
            rate = np.gradient(scenario.reference, scenario.Ts)
            assert np.abs(rate - scenario.v_ref)[1:-1].max() <= 1e-2 * np.abs(scenario.v_ref).max()
            assert 0.0 < scenario.reference.min() <= scenario.reference.max() < actuator.stroke
        if scenario.initial is not None:
            force = actuator.area_a * scenario.initial.p_a - actuator.area_b * scenario.initial.p_b
            assert force == pytest.approx(
                total_load(actuator), abs=1e-9 * actuator.area_a * actuator.supply_pressure
            )
            for pressure in scenario.initial[:2]:
                assert actuator.tank_pressure < pressure < actuator.supply_pressure


@pytest.mark.parametrize("loop", ["velocity", "position"])
def test_contact_scenarios_meet_each_stop_and_leave_it_and_need_stops(loop):
    crane = hc.load_actuator("crane_80_45")
    asked = contact_scenarios(crane, loop)
    for scenario, end, direction in zip(asked, (crane.stroke, 0.0), (1.0, -1.0), strict=True):
        path = (
            scenario.y + np.cumsum(scenario.reference) * scenario.Ts
            if loop == "velocity"
            else scenario.reference
        )
        assert (direction * (path - end)).max() > 0.0
        assert direction * (path[-1] - end) < 0.0
    assert contact_scenarios(ACTUATOR, loop) == ()
    assert len(library(crane, loop)) == 9 + 8 + 2
    assert len(library(ACTUATOR, loop)) == 9 + 8


def test_comparison_is_the_ratio_of_the_errors_case_by_case():
    """An integral alone makes e = exp(-ki K t) of a velocity step, K = v/x: over T the IAE is (1 -
    exp(-ki K T))/(ki K).

    The hydraulic mode and the delay, a few ms, hardly enter the ratio.
    """
    tables = {
        "kp": np.zeros((4, 3)),
        "zz": 0.5,
        "zp": 0.5,
        "specification": SimpleNamespace(Mt=1.3),
    }
    quick, slow = (schedule(ki=np.full((4, 3), ki), **tables) for ki in (100.0, 50.0))
    asked = [
        scenario for scenario in step_scenarios(ACTUATOR, "velocity") if scenario.kind == "step"
    ][:2]
    (found,) = compare(ACTUATOR, {"quick": quick, "slow": slow}, scenarios=asked)
    assert (found.name, found.baseline, found.failed) == ("slow", "quick", 0)
    assert found.best <= found.mean <= found.worst
    T, scale = asked[0].duration - 0.05, scale_of(ACTUATOR, "velocity")
    one, two = (
        [(1 - math.exp(-ki * K * T)) / (ki * K) for K in (scale.extend_speed, scale.retract_speed)]
        for ki in (100.0, 50.0)
    )
    assert found.mean == pytest.approx(math.sqrt(two[0] / one[0] * two[1] / one[1]), rel=0.02)
    reports = [validate(ACTUATOR, given, scenarios=asked).metrics for given in (quick, slow)]
    ratios = [reports[1][key].iae / reports[0][key].iae for key in reports[0]]
    assert found.mean == pytest.approx(math.sqrt(ratios[0] * ratios[1]), rel=1e-12)
    assert (found.best, found.worst) == (min(ratios), max(ratios))
    with pytest.raises(InputError, match="at least two"):
        compare(ACTUATOR, {"quick": quick})


def test_rivals_of_a_schedule_are_its_plainer_fellows_tuned_to_the_same_limits():
    x, y = np.array([-1.0, -0.1, 0.1, 1.0]), np.array([0.0, 0.25, 0.5])
    tuned = hc.tune(
        ACTUATOR, x, y, structure="pi+notch", specification=hc.Specification(uncertainty="nominal")
    )
    found = rivals(tuned)
    assert list(found) == ["P", "P + feed-forward", "fixed", "scheduled"]
    assert [given.feed_forward for given in found.values()] == [
        False,
        True,
        tuned.feed_forward,
        tuned.feed_forward,
    ]
    assert not found["P"].ki.any()
    assert found["fixed"].kp.size == 1
    assert found["fixed"].structure == found["scheduled"].structure == "pi+notch"
    assert found["fixed"].specification == found["scheduled"].specification, (
        "the notch, too, is that of the schedule"
    )
    for given in found.values():
        assert given.margins.worst("Ms", where=given.margins.designed).value <= 1.6 * (1 + 1e-3)
    asked = [
        scenario for scenario in step_scenarios(ACTUATOR, "velocity") if scenario.kind == "step"
    ][:2]
    forward, fixed, scheduled = compare(ACTUATOR, found, scenarios=asked, variants="design")
    assert scheduled.cases == 2
    assert scheduled.mean < 1.0
    assert fixed.mean < 1.0
    assert forward.mean < 1.0
