"""Gains by formula: what the formulas promise on their own model, and that no miss is handed
over."""

import control
import numpy as np
import pytest

import hydroctl as hc
from hydroctl.schedule.schedule import check_margins

NOMINAL, CORNERS = (hc.Specification(uncertainty=name) for name in ("nominal", "corners"))
QUICK = hc.Specification(uncertainty="nominal", sample_time=2e-5, Tf=1e-5, Ms=2.0, Mt=1.6)
"""so quick a regulator that the plant is nearly the model of the formulas"""


def _continuous(found, i=0, j=0):
    """(C, G) of a node without filter, delay and hold."""
    s, schedule, reduced = control.tf("s"), found.schedule, found.reduced
    law = control.tf([schedule.kd[i, j], schedule.kp[i, j], schedule.ki[i, j]], [1.0, 0.0])
    return law, reduced.b[i, j] / (s**2 + reduced.a1[i, j] * s + reduced.a2[i, j])


def test_imc_makes_an_integrator_of_the_model(reference):
    found = hc.tune_fast(reference, [-0.5, 0.5], [0.1, 0.4])
    omega = np.geomspace(1.0, 1e3, 20)
    for i, j in np.ndindex(2, 2):
        law, plant = _continuous(found, i, j)
        np.testing.assert_allclose(
            (law * plant)(1j * omega), found.reached[i, j] / (1j * omega), rtol=1e-9
        )


def test_pole_placement_puts_the_poles_where_they_were_asked(reference):
    found = hc.tune_fast(
        reference, [0.1], [0.25], method="pole-placement", bandwidth=600.0, specification=QUICK
    )
    poles = control.feedback(np.prod(_continuous(found)), 1).poles()
    expected = [-600.0, *(600.0 * np.exp(1j * sign * (np.pi - np.arccos(0.7))) for sign in (-1, 1))]
    np.testing.assert_allclose(
        np.sort_complex(poles), np.sort_complex(np.array(expected)), rtol=1e-9
    )
    assert found.schedule.margins.worst("Ms").value <= QUICK.Ms


@pytest.mark.parametrize("loop", ["velocity", "position"])
@pytest.mark.parametrize("uncertainty", ["nominal", "corners"])
def test_imc_is_slowed_until_every_limit_holds_and_no_further(reference, loop, uncertainty):
    specification = hc.Specification(uncertainty=uncertainty)
    found = hc.tune_fast(
        reference, [-1.0, 0.1], [0.0, 0.25], loop=loop, specification=specification
    )
    nodes = check_margins(found.schedule, found.schedule.x, found.schedule.y)
    assert np.all(found.reached < found.wanted)
    assert nodes.unstable == 0
    assert nodes.worst("Ms").value <= 1.6
    assert nodes.worst("Mt").value <= 1.3
    np.testing.assert_allclose(
        np.maximum(nodes.margins.Ms / 1.6, nodes.margins.Mt / 1.3).max(axis=0), 1.0, rtol=2e-3
    )


def test_a_slow_imc_is_left_as_it_was_asked(reference):
    found = hc.tune_fast(reference, [0.1], [0.25], bandwidth=10.0, specification=NOMINAL)
    np.testing.assert_array_equal(found.reached, 10.0)
    assert found.schedule.margins.worst(
        "crossover", where=found.schedule.margins.designed
    ).value == pytest.approx(10.0, rel=0.05)


def test_imc_keeps_the_further_limits_too(reference):
    limits = {"gain_margin": 5.0, "high_frequency_gain": 0.3}
    found = hc.tune_fast(
        reference, [0.1], [0.25], specification=hc.Specification(uncertainty="nominal", **limits)
    )
    gain = np.abs(found.schedule.regulators.frequency_response([np.pi / found.schedule.Ts]))
    np.testing.assert_allclose(gain, 0.3, rtol=1e-3)
    assert found.schedule.margins.worst("gain_margin").value >= 5.0


def test_imc_never_gains_more_than_the_tuner_with_the_same_structure(reference):
    fast = hc.tune_fast(reference, [0.1], [0.25], specification=NOMINAL).schedule
    assert (
        fast.ki[0, 0]
        <= hc.tune(reference, [0.1], [0.25], structure="pid", specification=NOMINAL).ki[0, 0]
    )


@pytest.mark.parametrize(("bandwidth", "state"), [(None, "an unstable loop"), (300.0, r"Ms = \d")])
def test_pole_placement_that_misses_a_limit_is_not_handed_over(reference, bandwidth, state):
    with pytest.raises(
        hc.InfeasibleError,
        match=rf"x=0.1, y=0.25 m, nominal plant: .*{state}.*Ms <= 1.6 and Mt <= 1.3",
    ):
        hc.tune_fast(
            reference,
            [0.1],
            [0.25],
            method="pole-placement",
            bandwidth=bandwidth,
            specification=NOMINAL,
        )


def test_all_faults_are_told_at_once(reference):
    with pytest.raises(hc.InputError) as caught:
        hc.tune_fast(reference, [0.1], [0.25], method="icm", bandwidth=-1.0)
    assert len(caught.value.faults) == 2
    assert "did you mean 'imc'" in caught.value.faults[0]
    with pytest.raises(hc.InputError, match="needs a velocity loop"):
        hc.tune_fast(reference, [0.1], [0.25], method="pole-placement", loop="position")


@pytest.mark.parametrize("ratio", [0.8, 1.0])
def test_the_notch_of_a_position_loop_stands_where_its_specification_says(reference, ratio):
    asked = hc.Specification(notch_ratio=ratio)
    found = hc.tune_fast(reference, [0.5], [0.2], loop="position", specification=asked)
    natural = found.reduced.natural_frequency
    np.testing.assert_allclose(found.schedule.notch_frequency, ratio * natural, rtol=1e-12)
    assert found.schedule.specification.notch_ratio == ratio
