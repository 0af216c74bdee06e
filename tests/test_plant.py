"""Laws of equation (1) and of its Jacobian."""

import numpy as np
import pytest
from machines import DIFFERENTIAL, LOSSLESS, REFERENCE, mirrored

import hydroctl as hc
from hydroctl import plant

STEP = 1e-30


def _complex_step(p, p_a, p_b, v, y, x):
    """(A, b) by complex steps through `plant.rates`; the real functions know nothing of it."""
    states = (p_a, p_b, v)
    columns = [
        np.imag(plant.rates(*(s + 1j * STEP * (i == k) for i, s in enumerate(states)), y, x, 0.0, p)) / STEP for k in range(3)
    ]
    b = np.imag(plant.rates(*states, y, x + 1j * STEP, 0.0, p)) / STEP
    return np.array(columns).T, b


@pytest.mark.parametrize("actuator", [REFERENCE, LOSSLESS, DIFFERENTIAL, DIFFERENTIAL.replace(flow_coefficient_b=4e-7)])
@pytest.mark.parametrize("x", [-1.0, -0.3, -1e-4, 1e-4, 0.1, 1.0])
@pytest.mark.parametrize("y", [0.0, 0.4])
def test_the_jacobian_is_the_complex_step_derivative_entry_by_entry(actuator, x, y):
    p = plant.parameters(actuator)
    point = hc.find_operating_points(actuator, [x], y)
    p_a, p_b, v = (np.complex128(value[0]) for value in (point.p_a, point.p_b, point.v))
    A, b = plant.jacobian(p_a.real, p_b.real, y, x, p)
    A_step, b_step = _complex_step(p, p_a, p_b, v, y, np.complex128(x))
    np.testing.assert_allclose(A, A_step, rtol=1e-12, atol=0.0)
    np.testing.assert_allclose(b[:, 0], b_step, rtol=1e-12, atol=0.0)


def test_the_flow_turns_with_the_pressure_drop():
    p = plant.parameters(REFERENCE)
    above, below = REFERENCE.supply_pressure + 1e5, REFERENCE.supply_pressure - 1e5
    assert plant.flow_gains(above, 1e7, 0.5, p)[0] == -plant.flow_gains(below, 1e7, 0.5, p)[0] < 0.0


def test_within_tank_and_supply_the_rates_are_the_equations_of_the_paper():
    a, p = REFERENCE, plant.parameters(REFERENCE)
    rng = np.random.default_rng(7)
    for x in (-0.8, 0.35):
        p_1, p_2 = rng.uniform(0, a.supply_pressure, 2)
        v, y = rng.uniform(-0.2, 0.2), rng.uniform(0, 0.5)
        step, back = float(x >= 0), float(x < 0)
        q_1 = a.flow_coefficient * x * (np.sqrt(abs(a.supply_pressure - p_1)) * step + np.sqrt(abs(p_1)) * back)
        q_4 = -a.flow_coefficient * x * (np.sqrt(abs(p_2)) * step + np.sqrt(abs(a.supply_pressure - p_2)) * back)
        leak = a.leakage * (p_1 - p_2)
        expected = (
            a.bulk_modulus / (a.volume_a + a.area_a * y) * (q_1 - a.area_a * v - leak),
            a.bulk_modulus / (a.volume_b - a.area_b * y) * (q_4 + a.area_b * v + leak),
            (a.area_a * p_1 - a.area_b * p_2 - a.viscous_friction * v) / a.mass,
        )
        np.testing.assert_allclose(plant.rates(p_1, p_2, v, y, x, 0.0, p), expected, rtol=1e-12)


def test_the_mirrored_machine_moves_the_mirrored_way():
    p, m = plant.parameters(DIFFERENTIAL), plant.parameters(mirrored(DIFFERENTIAL))
    rng = np.random.default_rng(3)
    p_a, p_b = rng.uniform(1e5, 210e5, (2, 20))
    v, y, x = rng.uniform(-0.3, 0.3, 20), rng.uniform(0, 1, 20), rng.uniform(-1, 1, 20)
    there = plant.rates(p_a, p_b, v, y, x, 1e4, p)
    back = plant.rates(p_b, p_a, -v, 1.0 - y, -x, -1e4, m)
    np.testing.assert_allclose([back[1], back[0], -back[2]], there, rtol=1e-11)


def test_the_functions_give_one_array_element_what_they_give_a_float():
    p = plant.parameters(REFERENCE)
    x = np.array([-0.5, 0.0, 0.5])
    together = plant.rates(1e7, 2e7, 0.01, 0.2, x, 1e3, p)
    for k, opening in enumerate(x):
        alone = plant.rates(1e7, 2e7, 0.01, 0.2, float(opening), 1e3, p)
        assert [np.broadcast_to(rate, 3)[k] for rate in together] == [float(rate) for rate in alone]
