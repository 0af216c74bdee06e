"""The scheduled loop with the slopes of its own gains: against hand calculation, the frozen loops and the nonlinear plant."""

from dataclasses import replace

import numpy as np
import pytest

import hydroctl as hc
from hydroctl.coupling import check_coupling, coupled_poles
from hydroctl.margins import Loop
from hydroctl.schedule import sampled_plants
from hydroctl.verdicts import margin_verdicts

X, Y = [-1.0, -0.02, 0.02, 1.0], [0.0, 0.25, 0.5]
AT = np.array([-0.4, 0.5]), np.array([0.1, 0.3])


@pytest.fixture(scope="module")
def schedules(reference):
    return {structure: hc.tune(reference, X, Y, loop="position", structure=structure) for structure in ("p", "pi")}


def _weighted(schedule, b):
    return replace(schedule, specification=replace(schedule.specification, set_point_weight=b))


@pytest.mark.parametrize("structure", ["p", "pi+lead-lag", "pid+notch"])
@pytest.mark.parametrize("settings", [{}, {"measurement_filter": 1e-3, "derivative_on": "measurement", "delay_samples": 1.4}])
def test_with_constant_gains_the_law_that_runs_has_the_poles_of_the_design_loop(reference, structure, settings):
    """Beside them it has poles at 0."""
    specification = hc.Specification(uncertainty="nominal", **settings)
    fixed = hc.tune_fixed(reference, X, Y, loop="position", structure=structure, specification=specification)
    _, plants = sampled_plants(reference, *AT, "position", specification)
    found = coupled_poles(fixed, *AT, plants)
    frozen = Loop(plants, fixed.gains(AT[0][:, None], AT[1]).broadcast_to(plants.shape)).poles()
    nearest = np.abs(frozen[..., :, None] - found[..., None, :]).min(axis=-1)
    assert nearest.max() < 1e-5
    for power in (1, 2):
        np.testing.assert_allclose((found**power).sum(axis=-1), (frozen**power).sum(axis=-1), atol=1e-6)


def test_a_proportional_loop_feeds_its_command_back_through_the_slope_of_kp(schedules):
    """By hand: x = kp e, so that dx[k] = -kp dy[k] + (dkp/dx dx[k-1] + dkp/dy dy[k]) x_0/kp."""
    schedule = schedules["p"]
    steep = replace(schedule, kp=schedule.kp * (1.0 + 0.5 * np.abs(schedule.x)[:, None]) * (1.0 + schedule.y))
    _, plants = sampled_plants(steep.actuator, *AT, "position", steep.specification)
    found = coupled_poles(steep, *AT, plants)
    A, B, C = plants.state_space()
    for i, j in np.ndindex(2, 2):
        x, y, h = AT[0][i], AT[1][j], 1e-4
        kp = steep.gains(x, y).kp
        by_x, by_y = (steep.gains(x + h, y).kp - kp) / h, (steep.gains(x, y + h).kp - kp) / h
        back, straight = by_x * x / kp, by_y * x / kp - kp
        for k in range(len(A)):
            closed = np.block([[A[k, i, j] + B[k, i, j] * straight @ C, B[k, i, j] * back], [straight * C, np.array([[back]])]])
            expected = np.linalg.eigvals(closed)
            assert np.abs(expected[:, None] - found[k, i, j]).min(axis=1).max() < 1e-5


def test_tuned_schedules_are_stable_with_the_slopes_of_their_gains(schedules):
    for schedule in schedules.values():
        verdicts = {verdict.name: verdict for verdict in margin_verdicts(schedule)}
        assert verdicts["unstable loops with the slopes of the gains"].passed
        assert check_coupling(schedule).unstable == 0


def test_a_set_point_weight_makes_a_loop_scheduled_on_x_oscillate(schedules):
    """The frozen loops do not know the weight; the coupled ones, and the nonlinear plant, do."""
    quiet, weighted = schedules["pi"], _weighted(schedules["pi"], 0.5)
    assert weighted.margins.unstable == 0
    coupled = check_coupling(weighted)
    size, variant, *_ = coupled.worst
    assert coupled.unstable > 0
    assert size > 1.0
    assert variant in coupled.variants
    assert not {v.name: v.passed for v in margin_verdicts(weighted)}["unstable loops with the slopes of the gains"]
    reference = np.where(np.arange(400) < 20, 0.45, 0.451)
    scenario = hc.Scenario(name="step of 1 mm", loop="position", Ts=1e-3, y=0.45, reference=reference, v_ref=np.zeros(400))
    late = {name: _unrest(each, scenario) for name, each in (("quiet", quiet), ("weighted", weighted))}
    assert late["weighted"] > 20.0 * late["quiet"]


def _unrest(schedule, scenario):
    """The spread of the command in the last tenth of a second."""
    return float(np.ptp(hc.simulate_closed_loop(schedule.actuator, schedule, scenario).x[-100:]))


def test_the_combination_is_refused_with_its_reason_and_allowed_where_it_is_clean(reference):
    weighted = hc.Specification(uncertainty="nominal", set_point_weight=0.5)
    with pytest.raises(hc.InputError, match=r"set_point_weight = 0.5 with kp scheduled on x: .* tune_fixed"):
        hc.tune(reference, X, Y, loop="position", specification=weighted)
    along_y = hc.tune(reference, [0.5], Y, loop="position", specification=weighted)
    fixed = hc.tune_fixed(reference, X, Y, loop="position", specification=weighted)
    velocity = hc.tune(reference, X, Y, specification=weighted)
    assert [check_coupling(schedule).unstable for schedule in (along_y, fixed, velocity)] == [0, 0, 0]
