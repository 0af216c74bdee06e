"""The plant as a python-control system."""

import numpy as np
import pytest
from machines import DIFFERENTIAL, REFERENCE

import hydroctl as hc
from hydroctl.model import plant

control = pytest.importorskip("control")
BAR = 1e5
SOFT = DIFFERENTIAL.replace(valve_natural_frequency=300.0, valve_damping=0.8, dead_band=0.03)


def _state(point, y, *valve):
    return np.array([float(point.p_a) / BAR, float(point.p_b) / BAR, float(point.v), y, *valve])


@pytest.mark.parametrize("actuator", [REFERENCE, DIFFERENTIAL], ids=lambda actuator: actuator.name)
@pytest.mark.parametrize("x", [-0.4, 0.1])
def test_its_linearization_agrees_with_ours_to_what_its_finite_difference_allows(actuator, x):
    system = plant.as_nonlinear_system(actuator)
    point = hc.find_operating_points(actuator, x, 0.2)
    theirs = control.linearize(system, _state(point, 0.2), [x, 0.0])
    family = hc.linearize(actuator, hc.find_operating_points(actuator, [x], 0.2))
    scale = np.diag([BAR, BAR, 1.0])
    ours = np.linalg.solve(scale, family.A[0] @ scale)
    # one-sided step of 1e-6: curvature p'' h/2 ~ 1e-6/(4 dp/bar) of the entry, rounding 1e-16 |rate
    # terms|/1e-6
    np.testing.assert_allclose(theirs.A[:3, :3], ours, rtol=1e-6, atol=1e-6 * np.abs(ours).max())
    np.testing.assert_allclose(
        theirs.B[:3, 0], np.linalg.solve(scale, family.B[0])[:, 0], rtol=1e-6, atol=1e-3
    )
    np.testing.assert_allclose(theirs.B[2, 1], -1.0 / actuator.mass, rtol=1e-6)


def test_signals_are_named_and_a_valve_adds_its_states():
    ideal, soft = plant.as_nonlinear_system(REFERENCE), plant.as_nonlinear_system(SOFT)
    assert (ideal.input_labels, ideal.output_labels) == (
        ["x", "load_force"],
        ["p_a", "p_b", "v", "y"],
    )
    assert ideal.state_labels == ["p_a", "p_b", "v", "y"]
    assert soft.state_labels == ["p_a", "p_b", "v", "y", "spool", "spool_rate"]
    assert (ideal.name, soft.nstates) == ("reference", 6)


def test_its_operating_point_is_ours():
    system = plant.as_nonlinear_system(REFERENCE)
    point = hc.find_operating_points(REFERENCE, 0.3, 0.2)
    start = _state(point, 0.2) * [1.05, 0.95, 1.1, 1.0]
    found = control.find_operating_point(
        system,
        start,
        [0.3, 0.0],
        [0.0, 0.0, 0.0, 0.2],
        input_indices=[0, 1],
        output_indices=[3],
        deriv_indices=[0, 1, 2],
    )[0]
    np.testing.assert_allclose(found[:3], _state(point, 0.2)[:3], rtol=1e-6)


def test_it_stays_at_an_operating_point_and_moves_on_at_its_speed():
    system = plant.as_nonlinear_system(SOFT)
    point = hc.find_operating_points(SOFT, 0.3, 0.2)
    t = np.linspace(0.0, 0.2, 21)
    response = control.input_output_response(
        system,
        t,
        [0.3, 0.0],
        _state(point, 0.2, 0.3, 0.0),
        solve_ivp_kwargs={"rtol": 1e-9, "atol": 1e-9},
    )
    np.testing.assert_allclose(response.states[:3, -1], _state(point, 0.2)[:3], rtol=1e-6)
    np.testing.assert_allclose(response.outputs[3], 0.2 + float(point.v) * t, rtol=1e-6)


def test_it_closes_a_loop_by_interconnect():
    system = plant.as_nonlinear_system(SOFT)
    regulator = control.ss([], [], [], [[8.0]], inputs=["e"], outputs=["x"], name="P")
    error = control.summing_junction(["r", "-y"], "e", name="error")
    loop = control.interconnect(
        [system, regulator, error], inputs=["r", "load_force"], outputs=["y", "p_a", "p_b", "v"]
    )
    start = [160e5 / BAR, 100e5 / BAR, 0.0, 0.4, 0.0, 0.0]
    t = np.linspace(0.0, 1.5, 31)
    y = control.input_output_response(
        loop, t, [0.5, 0.0], start, solve_ivp_kwargs={"method": "LSODA"}
    ).outputs[0]
    assert abs(y[-1] - 0.5) < 0.03 / 8 + 1e-3  # the dead band leaves an error up to dead_band/gain
    assert y.max() < 0.505
