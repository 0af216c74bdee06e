"""Laws of equation (1) and of its Jacobian."""

import numpy as np
import pytest
from machines import DIFFERENTIAL, LOSSLESS, REFERENCE, mirrored

import hydroctl as hc
from hydroctl.model import end_stops, friction, plant, spool, valve

STEP = 1e-30


def _complex_step(p, p_a, p_b, v, y, x):
    """(A, b) by complex steps through `plant.rates`; the real functions know nothing of it."""
    states = (p_a, p_b, v)
    columns = [
        np.imag(
            plant.rates(*(s + 1j * STEP * (i == k) for i, s in enumerate(states)), y, x, 0.0, p)
        )
        / STEP
        for k in range(3)
    ]
    b = np.imag(plant.rates(*states, y, x + 1j * STEP, 0.0, p)) / STEP
    return np.array(columns).T, b


@pytest.mark.parametrize(
    "actuator", [REFERENCE, LOSSLESS, DIFFERENTIAL, DIFFERENTIAL.replace(flow_coefficient_b=4e-7)]
)
@pytest.mark.parametrize("x", [-1.0, -0.3, -1e-4, 1e-4, 0.1, 1.0])
@pytest.mark.parametrize("y", [0.0, 0.4])
def test_the_jacobian_is_the_complex_step_derivative_entry_by_entry(actuator, x, y):
    p = plant.parameters(actuator)
    point = hc.find_operating_points(actuator, [x], y)
    p_a, p_b, v = (np.complex128(value[0]) for value in (point.p_a, point.p_b, point.v))
    A, b = plant.jacobian(p_a.real, p_b.real, v.real, y, x, p)
    A_step, b_step = _complex_step(p, p_a, p_b, v, y, np.complex128(x))
    np.testing.assert_allclose(A, A_step, rtol=1e-12, atol=0.0)
    np.testing.assert_allclose(b[:, 0], b_step, rtol=1e-12, atol=0.0)


def test_the_flow_turns_with_the_pressure_drop():
    p = plant.parameters(REFERENCE)
    above, below = REFERENCE.supply_pressure + 1e5, REFERENCE.supply_pressure - 1e5
    assert (
        valve.flow_gains(above, 1e7, 0.5, p.valve, p.supply)[0]
        == -valve.flow_gains(below, 1e7, 0.5, p.valve, p.supply)[0]
        < 0.0
    )


def test_within_tank_and_supply_the_rates_are_the_equations_of_the_paper():
    a, p = REFERENCE, plant.parameters(REFERENCE)
    rng = np.random.default_rng(7)
    for x in (-0.8, 0.35):
        p_1, p_2 = rng.uniform(0, a.supply_pressure, 2)
        v, y = rng.uniform(-0.2, 0.2), rng.uniform(0, 0.5)
        step, back = float(x >= 0), float(x < 0)
        q_1 = (
            a.flow_coefficient
            * x
            * (np.sqrt(abs(a.supply_pressure - p_1)) * step + np.sqrt(abs(p_1)) * back)
        )
        q_4 = (
            -a.flow_coefficient
            * x
            * (np.sqrt(abs(p_2)) * step + np.sqrt(abs(a.supply_pressure - p_2)) * back)
        )
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


REAL = DIFFERENTIAL.replace(
    coulomb_friction=600.0,
    breakaway_friction=1000.0,
    stribeck_speed=0.02,
    creep_speed=1e-3,
    end_stop_stiffness=1e8,
    end_stop_damping=2.0,
    valve_natural_frequency=300.0,
    valve_damping=0.7,
    dead_band=0.05,
)


def test_every_added_effect_vanishes_exactly_with_its_parameter():
    bare, p = REFERENCE.parameters(), plant.parameters(REFERENCE)
    v, y = np.linspace(-0.3, 0.3, 13), np.linspace(-0.1, 0.6, 13)
    assert (friction.force(v, p.friction) == bare["viscous_friction"] * v).all()
    assert (friction.slope(v, p.friction) == bare["viscous_friction"]).all()
    assert (end_stops.force(y, v, p.end_stops) == 0.0).all()
    assert (
        valve.effective_opening(np.linspace(-1, 1, 13), p.valve) == np.linspace(-1, 1, 13)
    ).all()
    assert p.spool.valve_natural_frequency == 0.0


def test_friction_opposes_the_motion_and_has_its_breakaway_coulomb_and_viscous_parts():
    p = plant.parameters(REAL)
    v = np.array([1e-4, 1e-3, 1e-2, 0.1, 1.0, 10.0])
    assert (friction.force(-v, p.friction) == -friction.force(v, p.friction)).all()
    assert (friction.force(v, p.friction) > 0).all()
    dry = friction.force(v, p.friction) - REAL.viscous_friction * v
    assert dry.max() <= REAL.breakaway_friction
    # at 10 m/s the Lorentzian is (v_s/v)^2 = 4e-6 of 400 N, the sign factor 5e-9 short of 1, the
    # subtraction loses 1e-11
    np.testing.assert_allclose(dry[-1], 600.0, rtol=3e-6)
    sharp = plant.parameters(REAL.replace(creep_speed=1e-9))
    np.testing.assert_allclose(
        friction.force(0.02, sharp.friction) - 4000.0 * 0.02, 800.0, rtol=1e-12
    )


@pytest.mark.parametrize("share", [0.1, 0.5])
def test_a_piston_held_by_dry_friction_creeps_at_the_stated_speed(share):
    machine = REAL.replace(viscous_friction=0.0, breakaway_friction=600.0)
    creep = machine.creep_speed * share / np.sqrt(1 - share**2)
    np.testing.assert_allclose(
        friction.force(creep, plant.parameters(machine).friction), share * 600.0, rtol=1e-12
    )


@pytest.mark.parametrize("v", [-0.3, -2e-3, 0.0, 5e-4, 0.02, 0.5])
def test_the_friction_slope_is_the_complex_step_derivative(v):
    p = plant.parameters(REAL)
    step = np.imag(friction.force(np.complex128(v + 1j * STEP), p.friction)) / STEP
    largest = p.friction.breakaway_friction / p.friction.creep_speed
    assert abs(friction.slope(v, p.friction) - step) <= 1e-14 * largest


def test_the_jacobian_includes_the_slope_of_the_friction_law():
    p = plant.parameters(REAL)
    for v in (-0.01, 0.003, 0.2):
        A, b = plant.jacobian(8e6, 1.1e7, v, 0.3, 0.4, p)
        A_step, b_step = _complex_step(
            p, np.complex128(8e6), np.complex128(1.1e7), np.complex128(v), 0.3, np.complex128(0.4)
        )
        np.testing.assert_allclose(A, A_step, rtol=1e-12, atol=0.0)
        np.testing.assert_allclose(b[:, 0], b_step, rtol=1e-12, atol=0.0)


def test_end_stops_only_push_are_continuous_at_contact_and_take_energy():
    p = plant.parameters(REAL)
    depth, v = np.linspace(-0.01, 0.01, 41)[:, None], np.linspace(-2.0, 2.0, 41)
    lower, upper = (
        end_stops.force(-depth, v, p.end_stops),
        end_stops.force(1.0 + depth, v, p.end_stops),
    )
    assert (lower >= 0).all()
    assert (upper <= 0).all()
    assert (lower[depth[:, 0] <= 0] == 0).all()
    np.testing.assert_allclose(
        upper, -lower[:, ::-1], rtol=0, atol=1e-6 * np.abs(lower).max()
    )  # 1 + depth rounds depth
    approach, departure = (
        end_stops.force(-0.001, -0.2, p.end_stops),
        end_stops.force(-0.001, 0.2, p.end_stops),
    )
    assert approach > p.end_stops.end_stop_stiffness * 0.001 > departure > 0
    assert end_stops.force(-0.001, 5.0, p.end_stops) == 0.0


def test_the_dead_band_closes_the_valve_and_full_command_still_opens_it_fully():
    p = plant.parameters(REAL)
    x = np.array([-1.2, -1.0, -0.525, -0.05, -0.02, 0.0, 0.05, 0.525, 1.0])
    np.testing.assert_allclose(
        valve.effective_opening(x, p.valve), [-1, -1, -0.5, 0, 0, 0, 0, 0.5, 1], atol=1e-15
    )
    assert valve.opening_slope(np.array([-0.6, 0.02, 1.0]), p.valve).tolist() == [
        1 / 0.95,
        0.0,
        1 / 0.95,
    ]


def _spool(actuator, command, t):
    from scipy.integrate import solve_ivp

    p = plant.parameters(actuator)
    return solve_ivp(
        lambda t, s: spool.rates(*s, command, p.spool),
        (0, t[-1]),
        [0, 0],
        t_eval=t,
        method="DOP853",
        rtol=1e-9,
        atol=1e-10,
    ).y


def test_without_a_rate_limit_the_valve_is_the_second_order_lag():
    t, w, damping = np.linspace(0, 0.03, 31), 300.0, 0.7
    decay, swing = damping * w, w * np.sqrt(1 - damping**2)
    step = 1 - np.exp(-decay * t) * (np.cos(swing * t) + decay / swing * np.sin(swing * t))
    np.testing.assert_allclose(_spool(REAL, 0.6, t)[0], 0.6 * step, atol=1e-8)


def test_the_rate_limit_bounds_the_spool_speed_and_commands_saturate():
    spool, rate = _spool(REAL.replace(valve_rate_limit=40.0), 1.7, np.linspace(0, 0.2, 400))
    assert np.abs(rate).max() <= 40.0 * (1 + 1e-9)
    assert np.abs(rate).max() > 0.99 * 40.0
    assert abs(spool[-1] - 1.0) < 1e-6


def test_compiled_the_same_lines_give_the_same_numbers():
    from hydroctl.simulation.kernels.builds import ALL_COMPONENTS, motion_build

    compiled = motion_build(ALL_COMPONENTS).motion
    p = plant.parameters(REAL)
    for state in ((8e6, 1.1e7, 0.12, 1.0005, -0.3, 1e3), (2e5, 2.2e7, -3e-4, -0.001, 0.7, 0.0)):
        np.testing.assert_allclose(
            compiled.plant.rates(*state, p),
            [float(rate) for rate in plant.rates(*state, p)],
            rtol=1e-13,
        )
    for x in (-0.3, 0.02, 1.1):
        np.testing.assert_allclose(
            compiled.spool.rates(x, 2.0, -0.4, p.spool),
            spool.rates(x, 2.0, -0.4, p.spool),
            rtol=1e-13,
        )
        opening = compiled.valve.effective_opening(x, p.valve)
        assert opening == valve.effective_opening(x, p.valve)
