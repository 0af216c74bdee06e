"""Derived quantities and maps, against closed forms."""

import numpy as np
import pytest
from hypothesis import given, settings
from machines import DIFFERENTIAL, LOSSLESS, REFERENCE, machines

import hydroctl as hc
from hydroctl.model.characteristics import (
    equilibrium_map,
    oil_column_frequency,
    resonance,
    softest_position,
)


def test_the_lowest_frequency_is_where_the_closed_form_puts_it():
    # with end volumes V01, V02: (L/sqrt(A2) + V02/A2^1.5 - V01/A1^1.5)/(1/sqrt(A1) + 1/sqrt(A2))
    a1, a2, length = DIFFERENTIAL.area_a, DIFFERENTIAL.area_b, DIFFERENTIAL.stroke
    expected = (length / a2**0.5 + 2e-4 / a2**1.5 - 2e-4 / a1**1.5) / (a1**-0.5 + a2**-0.5)
    assert softest_position(DIFFERENTIAL) == pytest.approx(expected, rel=1e-13)


@settings(max_examples=50, deadline=None)
@given(machine=machines())
def test_no_position_is_softer_than_the_softest(machine):
    y = np.linspace(0.0, machine.stroke, 301)
    assert oil_column_frequency(machine, softest_position(machine)) <= oil_column_frequency(
        machine, y
    ).min() * (1 + 1e-14)


def test_the_resonance_of_the_linear_model_tends_to_the_oil_column_as_the_valve_closes():
    bare = LOSSLESS.replace(viscous_friction=0.0)
    y = np.array([0.0, 0.2, 0.5])
    family = hc.linearize(bare, hc.find_operating_points(bare, np.array([[-1e-5], [1e-5]]), y))
    frequency, damping = resonance(family)
    np.testing.assert_allclose(
        frequency, np.broadcast_to(oil_column_frequency(bare, y), (2, 3)), rtol=1e-9
    )
    assert (np.abs(damping) < 1e-5).all()


def test_the_resonance_of_two_real_poles_keeps_their_product_and_sum():
    crane = hc.load_actuator("crane_80_45").replace(viscous_friction=2e6)
    family = hc.linearize(crane, hc.find_operating_points(crane, [0.3], 0.4))
    s2, s3 = family.poles()[0, 1:]
    assert s2.imag == s3.imag == 0.0
    frequency, damping = resonance(family)
    np.testing.assert_allclose(
        [frequency[0] ** 2, 2 * damping[0] * frequency[0]],
        [(s2 * s3).real, -(s2 + s3).real],
        rtol=1e-12,
    )
    assert damping[0] > 1.0


def test_forces_speeds_and_jump_of_the_reference_actuator():
    result = hc.characterize(REFERENCE)
    a, supply = REFERENCE.area_b / REFERENCE.area_a, REFERENCE.supply_pressure
    assert result.area_ratio == a
    assert (result.stall_force_extending, result.stall_force_retracting) == (
        REFERENCE.area_a * supply,
        -REFERENCE.area_b * supply,
    )
    assert f"{result.speed_extending:.8e}" == "1.51457632e-01"
    assert (
        -result.speed_extending / a**0.5 * 1.01
        < result.speed_retracting
        < -result.speed_extending * 0.9
    )
    # extending a^3 p0/(1+a^3), a^2 p0/(1+a^3); retracting a p0/(1+a^3), p0/(1+a^3)
    np.testing.assert_allclose(result.pressure_jump_a, (a - a**3) / (1 + a**3) * supply, rtol=1e-12)
    np.testing.assert_allclose(result.pressure_jump_b, (1 - a**2) / (1 + a**3) * supply, rtol=1e-12)
    np.testing.assert_allclose(
        result.lowest_frequency, result.natural_frequency.min(), rtol=1e-4
    )  # grid of 1 % of the stroke
    assert result.y[[0, -1]].tolist() == [0.0, 0.5]


def test_a_speed_that_does_not_exist_is_not_a_number():
    result = hc.characterize(REFERENCE.replace(load_force=1.7e6))
    assert np.isnan(result.speed_extending)


def test_the_equilibrium_map_has_a_row_for_each_load_and_load_slows_extension():
    points = equilibrium_map(DIFFERENTIAL, np.linspace(0.1, 1.0, 5), [0.0, 3e4, 6e4])
    assert points.shape == (3, 5)
    assert (np.diff(points.v, axis=0) < 0).all()
    assert (np.diff(points.v, axis=1) > 0).all()
    assert (np.diff(points.p_a, axis=0) > 0).all()
