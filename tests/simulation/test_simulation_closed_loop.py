"""The sampled closed loop on the nonlinear plant: against DOP853 with an independent regulator, and
its laws."""

import dataclasses
import subprocess
import sys

import numpy as np
import pytest
from loops import accurate_closed_loop, schedule

import hydroctl as hc
from hydroctl.errors import InputError, SimulationError
from hydroctl.model import plant
from hydroctl.regulator.prepared import regulator_of
from hydroctl.simulation import Scenario, Sensors, rest_state, simulate_closed_loop
from hydroctl.simulation.kernels.builds import (
    ALL_COMPONENTS,
    Loop,
    law_build,
    loop_for,
    motion_build,
    motion_for,
)
from hydroctl.simulation.modes import fastest_mode, substeps
from hydroctl.validation import tracking_scenarios

ACTUATOR = hc.load_actuator("reference")
FAST = ACTUATOR.replace(bulk_modulus=1.3 * ACTUATOR.bulk_modulus, mass=0.5 * ACTUATOR.mass)


def scenario(loop="velocity", samples=150, **changes):
    k = np.arange(samples)
    if loop == "velocity":
        reference = np.select([k < 10, k < 90], [0.0, 0.05], -0.03)
    else:
        reference = 0.25 + np.select([k < 10, k < 90], [0.0, 0.005], -0.01)
    return Scenario(
        **{"name": "test", "loop": loop, "Ts": 1e-3, "reference": reference, "y": 0.25} | changes
    )


@pytest.mark.parametrize("actuator", [ACTUATOR, FAST], ids=["nominal", "stiff and light"])
@pytest.mark.parametrize("loop", ["velocity", "position"])
def test_closed_loop_agrees_with_dop853_to_a_millionth(actuator, loop):
    given = schedule(loop, feed_forward=True)
    load = np.where(np.arange(150) < 60, 0.0, 1e5)
    v_ref = np.gradient(np.sin(0.05 * np.arange(150))) if loop == "position" else None
    asked = scenario(loop, load_force=load, v_ref=v_ref)
    start = rest_state(actuator, 0.25)
    expected = accurate_closed_loop(actuator, given, asked, start)
    found = simulate_closed_loop(actuator, given, asked)
    for name, row in zip(("p_a", "p_b", "v", "y"), expected[:4], strict=True):
        assert np.abs(getattr(found, name) - row).max() <= 1e-6 * np.ptp(row), name


def test_substeps_follow_the_fastest_mode():
    """sqrt((Ec/m)(A_a^2/V_a + A_b^2/V_b)) at the end of the stroke where it is highest; damping
    moves |s| by under 0.1 %."""
    y = np.array([0.0, ACTUATOR.stroke])
    a = ACTUATOR
    hydraulic = np.sqrt(
        a.bulk_modulus
        / a.mass
        * (a.area_a**2 / (a.volume_a + a.area_a * y) + a.area_b**2 / (a.volume_b - a.area_b * y))
    ).max()
    assert fastest_mode(a) == pytest.approx(hydraulic, rel=0.03)
    assert fastest_mode(FAST) == pytest.approx(fastest_mode(a) * np.sqrt(1.3 / 0.5), rel=0.03)
    assert substeps(FAST, 2e-3) > substeps(a, 1.5e-3) == 1
    found = simulate_closed_loop(a, schedule(), scenario())
    assert f"{substeps(a, 1e-3)} substeps" in found.integrator


def test_zero_reference_at_rest_stays_at_rest():
    tight = ACTUATOR.replace(leakage=0.0)
    for loop, reference in (("velocity", 0.0), ("position", 0.25)):
        found = simulate_closed_loop(
            tight, schedule(loop), scenario(loop, reference=np.full(300, reference))
        )
        assert (found.command == 0.0).all()
        assert np.abs(found.v).max() <= 1e-12


@pytest.mark.parametrize("delay", [0, 1, 3])
def test_command_takes_effect_after_the_delay(delay):
    found = simulate_closed_loop(ACTUATOR, schedule(delay_samples=delay), scenario())
    assert (found.x[delay:] == found.command[: found.x.size - delay]).all()
    assert (found.x[:delay] == 0.0).all()


@pytest.mark.parametrize("delay", [0.4, 1.7])
@pytest.mark.parametrize(
    "actuator",
    [ACTUATOR, hc.load_actuator("differential_100_56")],
    ids=["ideal valve", "valve with lag"],
)
def test_a_fraction_of_a_sample_of_delay_splits_the_sample(actuator, delay):
    """The command acts k + f samples after its measurement: against DOP853 that stops and goes on
    there."""
    asked = scenario(samples=60, reference=0.02 * (np.arange(60) >= 5))
    given = schedule(delay_samples=delay, kp=np.full((4, 3), 0.3), ki=np.full((4, 3), 100.0))
    start = rest_state(actuator, 0.25)
    expected = accurate_closed_loop(actuator, given, asked, start)
    found = simulate_closed_loop(actuator, given, asked)
    for name, row in zip(("p_a", "p_b", "v", "y"), expected[:4], strict=True):
        assert np.abs(getattr(found, name) - row).max() <= 1e-6 * np.ptp(row), name
    whole = int(delay)
    assert (found.x[whole:] == found.command[: found.x.size - whole]).all()


def test_a_delay_close_to_a_whole_sample_acts_like_it():
    """The motion is continuous in the delay, at both ends of the fraction."""
    found = [
        simulate_closed_loop(ACTUATOR, schedule(delay_samples=delay), scenario()).v
        for delay in (1.0, 1.0 + 1e-9, 2.0 - 1e-9, 2.0)
    ]
    assert np.abs(found[1] - found[0]).max() <= 1e-6 * np.ptp(found[0])
    assert np.abs(found[2] - found[3]).max() <= 1e-6 * np.ptp(found[3])
    assert np.abs(found[0] - found[3]).max() >= 1e-3 * np.ptp(found[0])


def test_the_regulator_sees_what_the_sensors_show():
    """Noise and quantization reach the command and nothing else: against the plain route, fed with
    the same readings."""
    sensors = Sensors(v_noise=2e-4, v_resolution=1e-3, y_noise=1e-5, y_resolution=1e-4, seed=3)
    asked = scenario(sensors=sensors, samples=80)
    expected = accurate_closed_loop(ACTUATOR, schedule(), asked, rest_state(ACTUATOR, 0.25))
    found = simulate_closed_loop(ACTUATOR, schedule(), asked)
    for name, row in zip(("p_a", "p_b", "v", "y"), expected[:4], strict=True):
        assert np.abs(getattr(found, name) - row).max() <= 1e-6 * np.ptp(row), name
    assert np.array_equal(found.v, simulate_closed_loop(ACTUATOR, schedule(), asked).v)
    other = dataclasses.replace(asked, sensors=dataclasses.replace(sensors, seed=4))
    assert not np.array_equal(found.v, simulate_closed_loop(ACTUATOR, schedule(), other).v)
    ideal = dataclasses.replace(asked, sensors=Sensors())
    exact = dataclasses.replace(asked, sensors=None)
    assert np.array_equal(
        *(simulate_closed_loop(ACTUATOR, schedule(), given).v for given in (ideal, exact))
    )


def test_quantization_keeps_the_position_within_a_step_of_its_reference():
    """A proportional regulator cannot see an error below half a step of the sensor, and stays
    there."""
    step, k = 1e-3, np.arange(600)
    tight = ACTUATOR.replace(leakage=0.0)
    given = schedule("position", ki=np.zeros((4, 3)))
    asked = scenario(
        "position",
        samples=600,
        reference=0.25 + 0.0101 * (k >= 10),
        sensors=Sensors(y_resolution=step),
    )
    found = simulate_closed_loop(tight, given, asked)
    assert np.abs(found.y[-100:] - 0.2601).max() <= step
    assert np.abs(found.y[-100:] - 0.2601).max() >= 1e-6


def test_sensors_and_substeps_are_checked():
    with pytest.raises(InputError) as caught:
        Sensors(v_noise=-1.0, y_resolution="fine", seed=0.5)
    assert len(caught.value.faults) == 3
    with pytest.raises(InputError, match="substeps = 0"):
        simulate_closed_loop(ACTUATOR, schedule(), scenario(), substeps=0)
    with pytest.raises(InputError, match="sensors"):
        scenario(sensors=1e-3)


def test_opening_stays_in_the_valves_range_and_anti_windup_lets_it_leave_the_limit():
    """A speed that the supply cannot give for 1 s, then one that it can: with back-calculation the
    loop recovers, without not."""
    k = np.arange(1500)
    asked = scenario(reference=np.where(k < 1000, 0.25, 0.05), y=0.05)
    with_it = simulate_closed_loop(ACTUATOR, schedule(), asked)
    without = simulate_closed_loop(ACTUATOR, schedule(Tt=np.inf), asked)
    for found in (with_it, without):
        assert np.abs(found.x).max() == 1.0
    assert np.abs(with_it.v[1200:] - 0.05).max() <= 0.02 * 0.05
    assert np.abs(without.v[1200:] - 0.05).max() >= 0.5 * 0.05


def test_schedule_and_scenario_must_fit():
    with pytest.raises(InputError) as caught:
        simulate_closed_loop(ACTUATOR, schedule("position", Ts=2e-3), scenario())
    assert len(caught.value.faults) == 2


def test_scenario_names_all_faults_at_once():
    with pytest.raises(InputError) as caught:
        Scenario(
            name="bad",
            loop="speed",
            Ts=0.0,
            reference=[[1.0]],
            y=np.nan,
            v_ref=[1.0, 2.0],
            load_force=np.inf,
        )
    assert len(caught.value.faults) == 6


def test_a_loop_that_leaves_the_numbers_says_when():
    k = np.arange(8000)
    with pytest.raises(SimulationError, match="its stroke"):
        simulate_closed_loop(ACTUATOR, schedule(), scenario(reference=0.1 + 0.0 * k))


def test_leaving_out_absent_effects_changes_no_bit():
    """A machine without them run by the full kernels and by those that leave their lines out."""
    p, asked = plant.parameters(ACTUATOR), scenario()
    outs = []
    regulator = regulator_of(schedule().regulator)
    full, plain = (
        Loop(motion_build(components), law_build("notched"), "notched")
        for components in (ALL_COMPONENTS, frozenset())
    )
    for kernels in (full, plain):
        out = np.empty((7, asked.reference.size))
        kernels.sampled.run(
            tuple(rest_state(ACTUATOR, 0.25)),
            asked.reference,
            asked.v_ref,
            asked.load_force,
            None,
            regulator,
            p,
            2,
            out,
        )
        outs.append(out)
    assert np.array_equal(*outs)
    assert motion_for(ACTUATOR) is motion_build(frozenset())
    assert motion_for(ACTUATOR.replace(dead_band=0.01)) is motion_build(frozenset({"valve"}))
    assert loop_for(ACTUATOR, regulator).law is law_build("notched")


@pytest.mark.parametrize("name", ["differential_100_56", "fast_50_28"])
@pytest.mark.parametrize("index", [2, 4, 6], ids=["sine", "load step", "start at other pressures"])
def test_tracking_scenarios_of_other_machines_agree_with_dop853_to_a_millionth(name, index):
    actuator = hc.load_actuator(name)
    asked = tracking_scenarios(actuator, "velocity")[index]
    first = int(0.2 * asked.reference.size) - 20 if index == 4 else 0
    part = slice(first, first + 80)
    changes = {key: getattr(asked, key)[part] for key in ("reference", "v_ref", "load_force")}
    asked = dataclasses.replace(asked, **changes, settle_by=None)
    given = schedule(
        kp=np.full((4, 3), 0.02), ki=np.full((4, 3), 20.0), y=np.array([0.0, 0.2, 0.5])
    )
    start = asked.initial or rest_state(actuator, asked.y, load_force=float(asked.load_force[0]))
    expected = accurate_closed_loop(actuator, given, asked, start)
    found = simulate_closed_loop(actuator, given, asked)
    for key, row in zip(("p_a", "p_b", "v", "y"), expected[:4], strict=True):
        assert np.abs(getattr(found, key) - row).max() <= 1e-6 * np.ptp(row), key


def test_threads_that_ask_for_kernels_at_once_get_the_same_ones():
    """In a fresh process: machine code is kept in one place, whichever thread made it."""
    code = """
import re
from concurrent.futures import ThreadPoolExecutor
import hydroctl, numba
from hydroctl.compilation.compiling import cache_directory, functions
from hydroctl.simulation.kernels.builds import motion_for
machine = hydroctl.load_actuator("reference")
with ThreadPoolExecutor(8) as pool:
    found = list(pool.map(lambda _: motion_for(machine), range(8)))
directory = cache_directory(vars(found[0].runge_kutta))
places = {function._cache.cache_path for function in functions(found[0].runge_kutta).values()}
print(all(each is found[0] for each in found), any(place.startswith(directory) for place in places))
print(max(len(re.findall("/[0-9a-f]{16}(?=/|$)", place)) for place in places))
"""
    told = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    ).stdout.split()
    assert told == ["True", "True", "1"]
