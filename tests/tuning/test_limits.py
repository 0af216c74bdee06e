"""The sets that loops must stay out of, and designs with margins beyond Ms and Mt."""

import re

import numpy as np
import pytest

import hydroctl as hc
from hydroctl.proof.margin_verdicts import margin_verdicts
from hydroctl.tuning.limits import Disc, Segment, limits_of

CASES = [("velocity", "pid+notch"), ("position", "pi+notch")]
X, Y = [-1.0, -0.1], [0.2]


def _designed(reference, loop, structure, **limits):
    asked = hc.Specification(uncertainty="corners", **limits)
    schedule = hc.tune(reference, X, Y, loop=loop, structure=structure, specification=asked)
    return (
        schedule,
        lambda name: schedule.margins.worst(name, where=schedule.margins.designed).value,
    )


@pytest.mark.parametrize("limit", [Disc(-1.0, 0.625), Disc(-0.7, 0.3), Segment(0.5), Segment(1.2)])
def test_a_half_plane_holds_the_point_outside_and_no_point_of_the_set(limit):
    generator = np.random.default_rng(1)
    L = generator.uniform(-3, 2, 4000) + 1j * generator.uniform(-3, 3, 4000)
    inside = L[limit.intrusion(L) > 0.0]
    outside = L[limit.intrusion(L) <= 0.0]
    normal, bound = limit.half_planes(outside)
    assert inside.size > 5
    assert np.all((normal.conj() * outside).real >= bound - 1e-12)
    assert np.all((normal.conj()[:, None] * inside).real <= bound[:, None] + 1e-12)
    np.testing.assert_allclose(
        (normal.conj() * outside).real - bound, -limit.intrusion(outside), atol=1e-12
    )


def test_the_segment_holds_the_arc_within_the_phase_margin_and_little_more():
    """Beyond the arc only what its widening by 0.01 covers."""
    angle = np.linspace(-np.pi, np.pi, 100_001)
    forbidden = np.abs(angle) < 0.8
    intrusion = Segment(0.8).intrusion(-np.exp(1j * angle))
    assert np.all(intrusion[forbidden] > 0.0)
    assert np.all(intrusion[np.abs(angle) > 0.8 + 0.0101] < 0.0)


def test_the_disc_of_a_gain_margin_spans_its_part_of_the_real_axis():
    disc = limits_of(hc.Specification(gain_margin=4.0))["gain_margin"]
    np.testing.assert_allclose(disc.intrusion(np.array([-1.0, -0.25])), 0.0, atol=1e-15)
    assert disc.gain_margin == pytest.approx(4.0)
    assert np.all(disc.intrusion(np.linspace(-0.999, -0.251, 50)) > 0.0)


@pytest.mark.parametrize(("loop", "structure"), CASES)
@pytest.mark.parametrize(
    ("name", "limit"), [("gain_margin", 4.0), ("phase_margin", np.radians(68.0))]
)
def test_a_margin_beyond_Ms_and_Mt_is_kept_and_costs_integral_gain(
    reference, loop, structure, name, limit
):
    plain, without = _designed(reference, loop, structure)
    schedule, worst = _designed(reference, loop, structure, **{name: limit})
    assert without(name) < limit
    assert worst(name) >= limit * (1.0 - 1e-3)
    assert worst("Ms") <= 1.6 * 1.0001
    assert worst("Mt") <= 1.3 * 1.0001
    assert schedule.margins.unstable == 0
    assert np.all(schedule.ki < plain.ki)
    assert np.all(schedule.ki > 0.02 * plain.ki)


@pytest.mark.parametrize(("loop", "structure"), CASES)
def test_the_gain_at_the_nyquist_frequency_is_the_limit_where_it_binds(reference, loop, structure):
    plain, _ = _designed(reference, loop, structure)
    limit = np.abs(plain.regulators.frequency_response([np.pi / plain.Ts])).min() / 3.0
    schedule, _ = _designed(reference, loop, structure, high_frequency_gain=limit)
    gains = np.abs(schedule.regulators.frequency_response([np.pi / plain.Ts]))
    np.testing.assert_allclose(gains, limit, rtol=1e-6)
    assert np.all(schedule.ki < plain.ki)


def test_a_phase_margin_that_is_kept_anyway_costs_nothing(reference):
    plain, _ = _designed(reference, "velocity", "pi")
    schedule, _ = _designed(reference, "velocity", "pi", phase_margin=np.radians(50.0))
    np.testing.assert_allclose(schedule.ki, plain.ki, rtol=1e-4)


def test_every_further_limit_has_its_verdict(reference):
    limits = {"gain_margin": 3.0, "phase_margin": 1.0, "high_frequency_gain": 3.0}
    schedule, _ = _designed(reference, "velocity", "pid+notch", **limits)
    verdicts = {verdict.name: verdict for verdict in margin_verdicts(schedule)}
    assert all(verdict.passed for verdict in verdicts.values())
    assert (
        verdicts["gain margin at the design points"].achieved
        == schedule.margins.worst("gain_margin", where=schedule.margins.designed).value
    )
    assert " >= " in str(verdicts["phase margin between them"])
    assert verdicts["gain at the Nyquist frequency"].unit == "s/m"


def test_a_design_that_misses_a_further_limit_fails_its_verdicts(reference):
    from dataclasses import replace

    plain, _ = _designed(reference, "velocity", "pid+notch")
    limits = {"gain_margin": 5.0, "phase_margin": 1.5, "high_frequency_gain": 0.1}
    strict = replace(plain, specification=hc.Specification(uncertainty="corners", **limits))
    failed = [verdict for verdict in margin_verdicts(strict) if not verdict.passed]
    assert [verdict.name for verdict in failed] == [
        "gain margin at the design points",
        "gain margin between them",
        "phase margin at the design points",
        "phase margin between them",
        "gain at the Nyquist frequency",
    ]
    assert " < " in str(failed[0])


def test_the_further_limits_are_in_the_file_and_read_back(reference, tmp_path):
    limits = {
        "gain_margin": 3.0,
        "phase_margin": 1.0,
        "high_frequency_gain": 3.0,
        "min_crossover": 10.0,
    }
    schedule, _ = _designed(reference, "velocity", "pi", **limits)
    path = schedule.save(tmp_path / "schedule.json")
    assert hc.load_schedule(path).specification == schedule.specification
    changed = path.read_text().replace(
        '"value": 3.0,\n   "unit": "s/m"', '"value": 3.0,\n   "unit": "1/m"'
    )
    path.write_text(changed)
    with pytest.raises(hc.InputError, match="unit of high_frequency_gain is '1/m', must be 's/m'"):
        hc.load_schedule(path)


DELAYED = {"Ms": 1.05, "delay_samples": 20.0}


def _largest_delayed_integrator(delay, Ms):
    """k of L = k e^{-j w delay}/(j w), whose crossover is k, with max |S| = Ms: by bisection on a
    dense grid."""
    unit = np.exp(-1j * np.linspace(1e-3, 6.0, 60_000)) / (1j * np.linspace(1e-3, 6.0, 60_000))
    low, high = 0.0, 1.0
    for _ in range(50):
        k = (low + high) / 2.0
        low, high = (k, high) if np.abs(1.0 + k * unit).min() >= 1.0 / Ms else (low, k)
    return low / delay


def test_a_crossover_out_of_reach_names_limit_place_variant_and_what_is_feasible(reference):
    """At so low a crossover the loop is an integrator with the delay and half a sample of hold; kp
    and the plant's own lag a1/a2 (under 1 ms against 20.5 ms), and the higher static gain of the
    corners, change its crossover by less than a fifth.
    """
    with pytest.raises(hc.InfeasibleError) as caught:
        _designed(reference, "velocity", "pi", **DELAYED, min_crossover=20.0)
    text = str(caught.value)
    found = re.fullmatch(
        r"x=\S+, y=\S+ m, .* plant: the largest gains cross over at (\S+) rad/s, below"
        r" min_crossover = 20 rad/s; "
        r"Ms <= 1.05 binds \(x=\S+, y=\S+ m, .* plant\). Feasible is min_crossover = (\S+)"
        r" rad/s; .*",
        text,
    )
    assert found, text
    assert float(found[1]) == pytest.approx(_largest_delayed_integrator(20.5e-3, 1.05), rel=0.2)
    schedule, worst = _designed(
        reference, "velocity", "pi", **DELAYED, min_crossover=float(found[2])
    )
    assert worst("crossover") >= float(found[2])
    verdicts = {verdict.name: verdict for verdict in margin_verdicts(schedule)}
    assert verdicts["crossover at the design points"].passed


def test_a_fixed_regulator_out_of_reach_names_the_point(reference):
    specification = hc.Specification(uncertainty="corners", min_crossover=1e3)
    with pytest.raises(
        hc.InfeasibleError, match=r"x=(-1|-0.1), y=0.2 m, .* plant: .*Ms <= 1.6 binds \(x="
    ):
        hc.tune_fixed(reference, X, Y, specification=specification)


@pytest.mark.parametrize("structure", ["pi", "pi+notch"])
@pytest.mark.parametrize("loop", ["velocity", "position"])
def test_a_phase_margin_just_below_a_right_angle_is_reached(reference, loop, structure):
    """A velocity PI gains phase by kp; a position loop loses little at a low crossover."""
    least = {"velocity": 1.57, "position": np.radians(85.0)}[loop]
    schedule, worst = _designed(reference, loop, structure, phase_margin=least)
    assert worst("phase_margin") >= least - 2e-4
    assert schedule.margins.unstable == 0
    assert schedule.ki.min() > 0.0


@pytest.mark.parametrize("structure", ["pi", "pi+notch", "pid+notch"])
@pytest.mark.parametrize("x", [[-1.0, 0.1], [-1.0, -0.1]])
@pytest.mark.parametrize("uncertainty", ["nominal", "corners"])
def test_a_steep_phase_margin_never_ends_in_an_unstable_loop(reference, x, structure, uncertainty):
    limits = hc.Specification(uncertainty=uncertainty, phase_margin=np.radians(68.0))
    schedule = hc.tune(
        reference, x, [0.2], loop="position", structure=structure, specification=limits
    )
    assert schedule.margins.unstable == 0
    assert (
        schedule.margins.worst("phase_margin", where=schedule.margins.designed).value
        >= np.radians(68.0) - 2e-4
    )
    assert schedule.margins.worst("Ms", where=schedule.margins.designed).value <= 1.6 * 1.0001


def test_a_gain_margin_that_the_other_limits_give_costs_nothing(reference):
    plain, without = _designed(reference, "velocity", "pi")
    schedule, _ = _designed(reference, "velocity", "pi", gain_margin=0.999 * without("gain_margin"))
    np.testing.assert_allclose(schedule.ki, plain.ki, rtol=1e-9)


def test_gains_that_end_above_a_limit_are_not_handed_over(reference, monkeypatch):
    monkeypatch.setattr("hydroctl.tuning.refinement._ROUNDS", 1)
    with pytest.raises(
        hc.InfeasibleError,
        match=r"x=-\S+, y=0.2 m, .* plant: the tuner ended .* break gain_margin >= 4",
    ):
        _designed(reference, "velocity", "pid+notch", gain_margin=4.0)


def test_faults_of_the_further_limits_are_told_at_once():
    with pytest.raises(hc.InputError) as caught:
        hc.Specification(gain_margin=1.0, phase_margin=60.0, high_frequency_gain=-1.0)
    assert [fault.split(" = ")[0] for fault in caught.value.faults] == [
        "gain_margin",
        "high_frequency_gain",
        "phase_margin",
    ]
