"""Open-loop simulation: against DOP853 at 1e-12, against the operating points, and the laws of the
plant in time."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
from loops import accurate_hold

import hydroctl as hc
from hydroctl.errors import InputError, SimulationError
from hydroctl.model import chambers, plant, valve
from hydroctl.simulation import State, rest_state, simulate
from hydroctl.simulation.trajectory import require_motion

ACTUATOR = hc.load_actuator("reference")
REAL = ACTUATOR.replace(
    valve_natural_frequency=400.0,
    valve_damping=0.8,
    valve_rate_limit=20.0,
    dead_band=0.03,
    coulomb_friction=4e3,
    breakaway_friction=6e3,
    stribeck_speed=5e-3,
    end_stop_stiffness=1e9,
    end_stop_damping=0.5,
)
STAIRCASE = (0.1, -0.3, 0.5, -0.7, 1.0)


def staircase(samples_per_step):
    t = 1e-3 * np.arange(len(STAIRCASE) * samples_per_step + 1)
    return t, np.append(np.repeat(STAIRCASE, samples_per_step), STAIRCASE[-1])


def accurate(t, x, load, start, actuator=ACTUATOR):
    """The states by DOP853 at 1e-12, restarted at every change of x or load."""
    changes = np.flatnonzero(np.diff(x) + 1j * np.diff(load)) + 1
    bounds, rows, state = (
        [0, *changes[changes < t.size - 1], t.size - 1],
        [np.array(start)[:, None]],
        start,
    )
    for first, last in pairwise(bounds):
        times = t[first + 1 : last + 1] - t[first]
        rows.append(accurate_hold(actuator, state, x[first], load[first], times[-1], times))
        state = rows[-1][:, -1]
    return np.concatenate(rows, axis=1)


def errors(trajectory, expected):
    found = np.array([trajectory.p_a, trajectory.p_b, trajectory.v, trajectory.y])
    return np.abs(found - expected[:4]).max(axis=1) / np.ptp(expected[:4], axis=1)


def test_staircase_agrees_with_dop853_and_converges_with_rtol():
    """The pair's local error is held below rtol of each state; with well-damped modes the total is
    a few times that."""
    t, x = staircase(200)
    start = rest_state(ACTUATOR)
    expected = accurate(t, x, np.zeros(t.size), start)
    worst = [
        errors(simulate(ACTUATOR, t, x, rtol=rtol), expected).max() for rtol in (1e-5, 1e-8, 1e-10)
    ]
    assert worst[0] <= 3e-5
    assert worst[1] <= 3e-7
    assert worst[2] <= 3e-9


def test_load_steps_are_steps():
    t = 1e-3 * np.arange(301)
    load = np.where(t < 0.1, 0.0, np.where(t < 0.2, 2e5, -1e5))
    x = np.full(t.size, 0.2)
    trajectory = simulate(ACTUATOR, t, x, load_force=load, rtol=1e-10)
    assert errors(trajectory, accurate(t, x, load, rest_state(ACTUATOR))).max() <= 3e-9


def test_samples_between_long_steps_come_from_the_dense_output():
    """A fine output grid changes no step, and the common samples agree to rounding."""
    t, x = staircase(100)
    fine = np.linspace(0.0, t[-1], 10 * (t.size - 1) + 1)
    coarse, dense = (
        simulate(ACTUATOR, t, x),
        simulate(ACTUATOR, fine, np.append(np.repeat(x[:-1], 10), x[-1])),
    )
    assert coarse.integrator == dense.integrator
    assert dense.y[::10] == pytest.approx(coarse.y, rel=1e-9)
    assert (
        errors(
            dense,
            accurate(
                fine, np.append(np.repeat(x[:-1], 10), x[-1]), 0.0 * fine, rest_state(ACTUATOR)
            ),
        ).max()
        <= 3e-5
    )


@pytest.mark.parametrize("x", [0.1, 1.0, -0.4])
def test_constant_opening_settles_at_the_operating_point(x):
    start = rest_state(ACTUATOR, 0.05 if x > 0 else 0.45)
    trajectory = simulate(ACTUATOR, np.linspace(0.0, 1.5, 1501), x, initial=start, rtol=1e-9)
    point = hc.find_operating_points(ACTUATOR, x, 0.25)
    slow = 6.0 * abs(x)
    assert trajectory.final.v == pytest.approx(
        float(point.v), rel=max(1e-3, 2 * np.exp(-1.5 * slow))
    )


def test_equilibrium_stays():
    """At rest with a closed valve and no leakage nothing moves but the errors that rtol allows in
    each step."""
    rtol, speed_range = (
        1e-12,
        ACTUATOR.flow_coefficient * ACTUATOR.supply_pressure**0.5 / ACTUATOR.area_b,
    )
    tight = ACTUATOR.replace(leakage=0.0)
    for load in (0.0, 3e5, -4e5):
        start = rest_state(tight, 0.1, load_force=load)
        trajectory = simulate(
            tight, np.linspace(0.0, 2.0, 201), 0.0, initial=start, load_force=load, rtol=rtol
        )
        steps = int(trajectory.integrator.split()[-2])
        assert np.abs(trajectory.v).max() <= steps * rtol * 0.01 * speed_range
        assert np.abs(trajectory.p_a / start.p_a - 1.0).max() <= 1e-12


def test_rest_state_is_midway_between_the_two_limits_of_creeping():
    for actuator in (ACTUATOR, ACTUATOR.replace(flow_coefficient_b=0.6e-6, tank_pressure=3e5)):
        limits = hc.find_operating_points(
            actuator.replace(leakage=0.0), [1e-9, -1e-9], 0.1, load_force=2e5
        )
        rest = rest_state(actuator, 0.1, load_force=2e5)
        assert rest.p_a == pytest.approx(limits.p_a.mean(), rel=1e-8)
        assert rest.p_b == pytest.approx(limits.p_b.mean(), rel=1e-8)


def test_mirrored_machine_moves_in_mirror_image():
    """Exchange the chambers, count y from the other end, reverse x, v and the load: the same
    motion."""
    a = ACTUATOR.replace(flow_coefficient_b=0.7e-6, leakage=1e-11)
    swept_a, swept_b = a.area_a * a.stroke, a.area_b * a.stroke
    mirror = a.replace(
        area_a=a.area_b,
        area_b=a.area_a,
        volume_a=a.volume_b - swept_b,
        volume_b=a.volume_a + swept_a,
        flow_coefficient=a.flow_coefficient_b,
        flow_coefficient_b=a.flow_coefficient,
    )
    t, x = staircase(60)
    one, two = (
        simulate(a, t, x, load_force=1e5, rtol=1e-10),
        simulate(mirror, t, -x, load_force=-1e5, rtol=1e-10),
    )
    assert two.v == pytest.approx(-one.v, abs=1e-9)
    assert two.y == pytest.approx(a.stroke - one.y, abs=1e-10)
    assert two.p_a == pytest.approx(one.p_b, rel=1e-7)


def test_energy_balance_closes():
    """Power in at the ports = mechanical power + leakage, and the rest is stored: to 1e-6 of the
    throughput.

    Stored: (V/Ec) p dp in each chamber and m v^2/2; out: load and viscous friction.
    """
    actuator, t = ACTUATOR.replace(leakage=1e-11), np.linspace(0.0, 0.6, 60001)
    x, load = np.where(t < 0.3, 0.6, -0.4), 1e5
    r = simulate(actuator, t, x, load_force=load, rtol=1e-11)
    p = plant.parameters(actuator)
    gain_a, gain_b = valve.flow_gains(r.p_a, r.p_b, x, p.valve, p.supply)
    ports = r.p_a * gain_a * x + r.p_b * gain_b * x
    leak = p.chambers.leakage * (r.p_a - r.p_b) ** 2
    stiff_a, stiff_b = chambers.stiffnesses(r.y, p.chambers)
    dp_a, dp_b, dv = plant.rates(r.p_a, r.p_b, r.v, r.y, x, load, p)
    stored = r.p_a * dp_a / stiff_a + r.p_b * dp_b / stiff_b + actuator.mass * r.v * dv
    out = load * r.v + p.friction.viscous_friction * r.v**2
    assert np.abs(ports - leak - stored - out).max() <= 1e-12 * np.abs(ports).max()
    moving = t <= 0.3 - 1e-9
    kinetic = 0.5 * actuator.mass * r.v[moving][-1] ** 2
    work = np.trapezoid(
        (
            p.chambers.area_a * r.p_a
            - p.chambers.area_b * r.p_b
            - load
            - p.friction.viscous_friction * r.v
        )[moving]
        * r.v[moving],
        t[moving],
    )
    assert kinetic == pytest.approx(work, abs=1e-6 * np.trapezoid(np.abs(ports), t))


def test_final_state_continues_a_motion():
    t, x = staircase(50)
    whole = simulate(ACTUATOR, t, x, rtol=1e-10)
    first = simulate(ACTUATOR, t[:101], x[:101], rtol=1e-10)
    second = simulate(ACTUATOR, t[100:], x[100:], initial=first.final, rtol=1e-10)
    assert second.v == pytest.approx(whole.v[100:], abs=1e-9)


def test_all_faults_of_the_input_are_named_at_once():
    with pytest.raises(InputError) as caught:
        simulate(ACTUATOR, [0.0, 0.1, 0.1], [0.0, 2.0], load_force=np.nan, rtol=1.0)
    text = str(caught.value)
    assert len(caught.value.faults) == 5
    for word in ("rising", "[-1, 1]", "shape (2,)", "load_force holds", "rtol"):
        assert word in text


def test_wrong_starts_are_refused():
    with pytest.raises(InputError, match="outside the stroke"):
        rest_state(ACTUATOR, 0.7)
    with pytest.raises(InputError, match="stall forces"):
        rest_state(ACTUATOR, load_force=1e8)
    with pytest.raises(InputError, match="initial"):
        simulate(ACTUATOR, [0.0, 1.0], 0.1, initial=State(np.nan, 0.0, 0.0, 0.0))
    with pytest.raises(InputError, match="not a number"):
        simulate(ACTUATOR, "soon", 0.1)


def test_a_piston_that_uses_up_a_chamber_stops_with_the_time():
    with pytest.raises(SimulationError, match="stroke"):
        simulate(ACTUATOR, np.linspace(0.0, 20.0, 2001), -1.0)


def test_a_motion_that_is_lost_after_its_last_sample_says_that_time():
    found = simulate(ACTUATOR, np.linspace(0.0, 0.5, 6), 0.1)
    lost = replace(found, final=found.final._replace(p_a=np.nan))
    with pytest.raises(SimulationError, match=r"from t = 0\.5 s on"):
        require_motion(ACTUATOR, lost)


def test_valve_lag_dry_friction_dead_band_and_end_stop_agree_with_dop853():
    """Every real effect at work: out to the upper end stop, then back; speeds cross zero, the spool
    meets its rate limit."""
    t = 1e-3 * np.arange(801)
    x, start = np.where(t < 0.5, 1.0, -0.5), rest_state(REAL, 0.46)
    found = simulate(REAL, t, x, initial=start, rtol=1e-10)
    expected = accurate(t, x, 0.0 * t, start, REAL)
    assert found.y.max() > REAL.stroke
    assert np.abs(np.diff(found.spool)).max() == pytest.approx(20.0 * 1e-3, rel=1e-3)
    assert errors(found, expected).max() <= 1e-7
    assert np.abs(found.spool - expected[4]).max() <= 1e-7
