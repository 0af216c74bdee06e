"""The sampled plant against python-control, and its two descriptions against each other."""

from dataclasses import replace

import control
import numpy as np
import pytest
from scipy.linalg import expm

import hydroctl as hc
from hydroctl.loop.sampled_plant import frequency_grid, sample

TS = 1e-3
OMEGA = np.array([1.0, 60.0, 550.0, 2500.0])


def _balanced(model, loop):
    """The continuous model with pressures in MPa, behind an integrator in the position loop."""
    T = np.diag([1e-6, 1e-6, 1.0])
    A, B = T @ model.A @ np.linalg.inv(T), T @ model.B
    if loop == "position":
        A = np.block([[A, np.zeros((3, 1))], [np.array([[0.0, 0.0, 1.0, 0.0]])]])
        B = np.vstack([B, [[0.0]]])
    return A, B, np.eye(A.shape[0])[-1:]


@pytest.mark.parametrize("loop", ["velocity", "position"])
def test_zero_order_hold_agrees_with_python_control(family, loop):
    plant = sample(family, loop=loop, sample_time=TS, delay_samples=2)
    held = control.c2d(control.ss(*_balanced(family[1, 2], loop), 0), TS)
    expected = held(np.exp(1j * OMEGA * TS)) * np.exp(-2j * OMEGA * TS)
    np.testing.assert_allclose(plant.frequency_response(OMEGA)[1, 2], expected, rtol=1e-9)


@pytest.mark.parametrize("loop", ["velocity", "position"])
def test_a_fraction_of_a_sample_of_delay_is_a_command_that_changes_within_the_sample(family, loop):
    A, B, C = _balanced(family[0, 1], loop)
    n, z = A.shape[0], np.exp(1j * OMEGA * TS)
    part = expm(np.block([[A, B], [np.zeros((1, n + 1))]]) * TS / 4)
    step, entry = part[:n, :n], part[:n, n:]
    old = step @ step @ step @ entry
    new = (step @ step + step + np.eye(n)) @ entry
    whole = np.linalg.matrix_power(step, 4)
    expected = [
        (C @ np.linalg.solve(zi * np.eye(n) - whole, new + old / zi))[0, 0] / zi for zi in z
    ]
    plant = sample(family, loop=loop, sample_time=TS, delay_samples=1.25)
    np.testing.assert_allclose(plant.frequency_response(OMEGA)[0, 1], expected, rtol=1e-9)


@pytest.mark.parametrize("delay", [0, 0.4, 1, 2.3])
def test_state_space_and_frequency_response_are_the_same_system(family, delay):
    plant = sample(family, loop="position", sample_time=TS, delay_samples=delay)
    A, B, C = plant.state_space()
    z = np.exp(1j * OMEGA * TS)[:, None, None]
    response = [
        (C @ np.linalg.solve(zi * np.eye(A.shape[-1]) - A[3, 0], B[3, 0]))[0, 0]
        for zi in z[:, 0, 0]
    ]
    np.testing.assert_allclose(plant.frequency_response(OMEGA)[3, 0], response, rtol=1e-9)


@pytest.mark.parametrize("loop", ["velocity", "position"])
def test_a_stated_valve_lag_stands_before_the_plant(reference, loop):
    slow = reference.replace(valve_natural_frequency=628.0, valve_damping=0.7)
    points = hc.find_operating_points(slow, np.array([0.3, 0.6]), 0.2)
    model = hc.linearize(slow, points)[0]
    valve = control.ss(
        [[0.0, 1.0], [-(628.0**2), -2 * 0.7 * 628.0]], [[0.0], [628.0**2]], [[1.0, 0.0]], 0
    )
    held = control.c2d(control.ss(*_balanced(model, loop), 0) * valve, TS)
    plant = sample(hc.linearize(slow, points), loop=loop, sample_time=TS)
    np.testing.assert_allclose(
        plant.frequency_response(OMEGA)[0], held(np.exp(1j * OMEGA * TS)), rtol=1e-8
    )


def test_models_with_parallel_eigenvectors_are_solved_directly(family):
    plant = sample(family, loop="position", sample_time=TS, delay_samples=0.5)
    without = replace(plant, residues=np.full_like(plant.residues, np.nan))
    np.testing.assert_allclose(
        without.frequency_response(OMEGA), plant.frequency_response(OMEGA), rtol=1e-9
    )


@pytest.mark.parametrize("delay", [1, 0.4])
@pytest.mark.parametrize("loop", ["velocity", "position"])
def test_the_hold_is_the_same_by_eigenvectors_and_by_the_matrix_exponential(
    family, monkeypatch, loop, delay
):
    by_vectors = sample(family, loop=loop, sample_time=TS, delay_samples=delay)
    monkeypatch.setattr("hydroctl.loop.sampled_plant._WORST_CONDITION", 0.0)
    by_exponential = sample(family, loop=loop, sample_time=TS, delay_samples=delay)
    assert np.isnan(by_exponential.residues).all()
    for name in ("transition", "entry"):
        size = np.abs(getattr(by_exponential, name)).max(axis=(0, 1))
        difference = np.abs(getattr(by_vectors, name) - getattr(by_exponential, name)).max(
            axis=(0, 1)
        )
        assert np.all(difference <= 1e-12 * size)
    np.testing.assert_allclose(
        by_vectors.frequency_response(OMEGA), by_exponential.frequency_response(OMEGA), rtol=1e-9
    )


def test_take_selects_members_by_flat_index(family):
    plant = sample(family, loop="velocity", sample_time=TS, delay_samples=1)
    np.testing.assert_array_equal(
        plant.take([7]).frequency_response(OMEGA)[0], plant.frequency_response(OMEGA)[2, 1]
    )


def test_the_grid_reaches_nyquist_and_is_dense_at_every_resonance(family):
    plant = sample(family, loop="velocity", sample_time=TS)
    omega = frequency_grid(plant)
    assert np.all(np.diff(omega, axis=-1) >= 0.0)
    np.testing.assert_allclose(omega[..., -1], np.pi / TS)
    natural, damping = plant.resonance[2, 1]
    inside = np.count_nonzero(np.abs(omega[2, 1] - natural) < natural * damping)
    assert inside >= 20, "about 20 points across the half-power width"


def test_a_point_without_a_linear_model_is_refused_with_its_reason(reference):
    points = hc.find_operating_points(reference, np.array([0.0, 0.5]), 0.1)
    with pytest.raises(hc.InputError, match="the valve is closed"):
        sample(hc.linearize(reference, points), loop="velocity", sample_time=TS)


def test_an_unknown_loop_is_named(family):
    with pytest.raises(hc.InputError, match="'speed' is unknown"):
        sample(family, loop="speed", sample_time=TS)
