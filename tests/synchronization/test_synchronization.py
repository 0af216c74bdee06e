"""Several cylinders under one reference: against single loops, against DOP853 with an independent
regulator, and its laws."""

import numpy as np
import pytest
from groups import accurate_group, machines_of, pair, quartet
from loops import schedule

import hydroctl as hc
from hydroctl.errors import InputError, SimulationError
from hydroctl.simulation import Scenario, rest_state
from hydroctl.synchronization import (
    COUPLINGS,
    Coupling,
    Failure,
    MotionLimits,
    MotionProfile,
    RateOverride,
    StopStrategy,
    campaign,
    random_group,
    s_curve,
    synchronize,
)
from hydroctl.synchronization.coupling import coupling_matrix
from hydroctl.synchronization.metrics import measure_group

ACTUATOR = hc.load_actuator("reference")
SOFT = ACTUATOR.replace(mass=800.0, bulk_modulus=1.0e9)
REAL = ACTUATOR.replace(valve_natural_frequency=600.0, valve_damping=0.8, dead_band=0.02)
GIVEN = schedule("position", feed_forward=True)


def coupling(name, count, kc=0.0, ki=0.0):
    return Coupling(name=name, matrix=coupling_matrix(name, count), kc=kc, ki=ki)


def other_schedule(**changes):
    """More nodes, another delay than `schedule`."""
    x, y = np.array([-1.0, -0.5, -0.1, 0.1, 1.0]), np.array([0.0, 0.1, 0.3, 0.5])
    tables = {"kp": np.full((5, 4), 50.0), "ki": np.full((5, 4), 40.0), "kd": np.zeros((5, 4))}
    notch = np.linspace(450.0, 550.0, 20).reshape(5, 4)
    return schedule(
        "position",
        feed_forward=True,
        x=x,
        y=y,
        notch_frequency=notch,
        delay_samples=2,
        **tables | changes,
    )


@pytest.mark.parametrize(
    "machines", [(ACTUATOR, SOFT), (ACTUATOR, REAL, SOFT)], ids=["plain", "one with a real valve"]
)
def test_uncoupled_cylinders_move_bit_for_bit_as_each_alone(machines):
    schedules = [
        GIVEN,
        other_schedule(),
        schedule("position", feed_forward=True, delay_samples=1.4),
    ][: len(machines)]
    profile = s_curve(0.1, 0.13, 0.4, after=0.2)
    load = 1e5 * (profile.t > 0.3)
    loads = [0.0, load, -5e4][: len(machines)]
    found = synchronize(
        machines,
        schedules,
        profile,
        coupling=coupling("independent", len(machines)),
        load_forces=loads,
    )
    assert found.completed
    for trajectory, machine, given, force in zip(
        found.trajectories, machines, schedules, loads, strict=True
    ):
        signals = {
            "reference": profile.position,
            "v_ref": profile.speed,
            "load_force": force,
            "y": 0.1,
        }
        alone = hc.simulate_closed_loop(
            machine, given, Scenario(name="alone", loop="position", Ts=1e-3, **signals)
        )
        for name in ("y", "v", "p_a", "p_b", "spool", "x", "command", "reference"):
            assert np.array_equal(getattr(trajectory, name), getattr(alone, name)), name
        assert trajectory.final == alone.final
        assert trajectory.integrator == alone.integrator


@pytest.mark.parametrize(
    ("name", "kc", "ki"), [("mean", 0.5, 20.0), ("ring", 0.3, 10.0), ("master-slave", 1.0, 0.0)]
)
def test_coupled_motion_agrees_with_dop853_to_a_millionth(name, kc, ki):
    machines, schedules = [ACTUATOR, SOFT, ACTUATOR], [GIVEN, other_schedule(), GIVEN]
    profile = s_curve(0.1, 0.105, 0.1, before=0.01, after=0.04)
    loads = np.array([0.0 * profile.t, 5e4 * (profile.t > 0.05), 3e4 * np.sin(60.0 * profile.t)])
    found = synchronize(
        machines, schedules, profile, coupling=coupling(name, 3, kc, ki), load_forces=loads
    )
    starts = [
        rest_state(machine, 0.1, load_force=load[0])
        for machine, load in zip(machines, loads, strict=True)
    ]
    y, v, _ = accurate_group(machines, schedules, profile, starts, loads, name=name, kc=kc, ki=ki)
    for i, trajectory in enumerate(found.trajectories):
        assert np.abs(trajectory.y - y[i]).max() <= 1e-6 * np.ptp(y[i])
        assert np.abs(trajectory.v - v[i]).max() <= 1e-6 * np.ptp(v[i])


def test_slowed_motion_agrees_with_dop853_to_a_millionth():
    """A speed that the second cylinder cannot reach."""
    machines, schedules = [ACTUATOR, SOFT], [GIVEN, other_schedule()]
    profile = s_curve(0.1, 0.12, 0.15, before=0.01, after=0.03)
    override = RateOverride(free=2e-4, limit=2e-3, time_constant=5e-3)
    found = synchronize(
        machines,
        schedules,
        profile,
        coupling=coupling("mean", 2, 0.3, 10.0),
        load_forces=[0.0, 7e5],
        override=override,
    )
    loads = np.broadcast_to([[0.0], [7e5]], (2, found.t.size + 5))
    starts = [
        rest_state(machine, 0.1, load_force=load[0])
        for machine, load in zip(machines, loads, strict=True)
    ]
    y, _, rates = accurate_group(
        machines, schedules, profile, starts, loads, name="mean", kc=0.3, ki=10.0, override=override
    )
    assert found.completed
    assert found.rate.min() < 0.9
    assert y.shape == found.y.shape
    assert np.abs(found.y - y).max() <= 1e-6 * np.ptp(y)
    assert np.abs(found.rate - rates).max() <= 1e-6


def test_equal_cylinders_under_equal_loads_do_not_feel_a_coupling():
    profile = s_curve(0.1, 0.12, 0.3, after=0.1)
    runs = [
        synchronize(
            [ACTUATOR] * 3,
            [GIVEN] * 3,
            profile,
            coupling=coupling(name, 3, 0.5, 20.0),
            load_forces=[1e5] * 3,
        )
        for name in ("independent", "mean", "ring")
    ]
    for run in runs[1:]:
        assert np.abs(run.y - runs[0].y).max() <= 1e-12
        assert run.error.max() <= 1e-12


def test_a_ring_of_two_is_a_mean_with_twice_the_gains():
    profile = s_curve(0.1, 0.12, 0.3, after=0.1)
    ring, mean = (
        synchronize(
            [ACTUATOR, SOFT],
            [GIVEN] * 2,
            profile,
            coupling=coupling(name, 2, kc, ki),
            load_forces=[0.0, 2e5],
        )
        for name, kc, ki in (("ring", 0.2, 5.0), ("mean", 0.4, 10.0))
    )
    assert np.abs(ring.y - mean.y).max() <= 1e-12


def test_the_order_of_the_cylinders_does_not_matter_to_a_mean():
    profile = s_curve(0.1, 0.12, 0.3, after=0.1)
    machines, loads = [ACTUATOR, SOFT, ACTUATOR], [0.0, 2e5, -1e5]
    order = [2, 0, 1]
    first, second = (
        synchronize(
            [machines[i] for i in o],
            [GIVEN] * 3,
            profile,
            coupling=coupling("mean", 3, 0.5, 20.0),
            load_forces=[loads[i] for i in o],
        )
        for o in ([0, 1, 2], order)
    )
    assert np.abs(first.y[order] - second.y).max() <= 1e-12


TWO_LOADS = (0.0, lambda t: 1e5 + 1.5e5 * (t >= 1.7))
FOUR_LOADS = (
    0.0,
    2e5,
    lambda t: 1.5e5 * (t >= 1.7),
    lambda t: -1e5 + 5e4 * np.sin(2.0 * np.pi * 3.0 * t),
)


@pytest.mark.parametrize(
    ("group", "loads", "limit"),
    [(pair, TWO_LOADS, 0.012e-3), (quartet, FOUR_LOADS, 0.025e-3)],
    ids=["two", "four"],
)
def test_cylinders_stay_together_under_different_loads(group, loads, limit):
    """The published figures hold outside the 0.2 s after the load step, in which the oil gives way;
    there the bound is mechanics: the static give is the load step over the stiffness of the oil,
    and an oscillator overshoots it by less than its double."""
    schedules = group()
    profile = s_curve(0.1, 0.3, 3.2)
    forces = [load(profile.t) if callable(load) else load for load in loads]
    runs = {
        name: synchronize(
            machines_of(schedules), schedules, profile, coupling=name, load_forces=forces
        )
        for name in COUPLINGS
    }
    mean = runs["mean"]
    assert mean.completed
    assert mean.coupling.evidence.kept
    assert mean.metrics.rms <= limit
    assert mean.metrics.rms_of_all < 0.95 * min(
        runs[name].metrics.rms_of_all for name in ("independent", "master-slave")
    )
    step = int(np.flatnonzero(mean.load_steps)[0])
    assert profile.t[step] == pytest.approx(1.7)
    a, y = schedules[1 if len(schedules) == 2 else 2].actuator, profile.position[step]
    stiffness = a.bulk_modulus * (
        a.area_a**2 / (a.volume_a + a.area_a * y) + a.area_b**2 / (a.volume_b - a.area_b * y)
    )
    give = 1.5e5 / stiffness
    assert give < runs["independent"].metrics.peak_after_load_steps < 2.0 * give


@pytest.mark.parametrize("group", [pair, quartet], ids=["two", "four"])
def test_a_saturated_cylinder_keeps_up_only_where_the_reference_slows_down(group):
    schedules = group()
    profile, loads = s_curve(0.1, 0.4, 2.4), [0.0] * (len(schedules) - 1) + [7e5]
    for name in COUPLINGS:
        alone = synchronize(
            machines_of(schedules), schedules, profile, coupling=name, load_forces=loads
        )
        slowed = synchronize(
            machines_of(schedules),
            schedules,
            profile,
            coupling=name,
            load_forces=loads,
            override=RateOverride(),
        )
        assert alone.metrics.rms > 30e-3
        assert slowed.completed
        assert slowed.metrics.peak <= 1e-3
        assert slowed.metrics.duration > alone.metrics.duration
        assert np.abs(slowed.y[:, -1] - 0.4).max() <= 1e-5


def test_limits_of_each_cylinder_and_of_the_shared_supply_are_kept():
    schedules, profile = pair(), s_curve(0.1, 0.3, 1.5)
    machines = machines_of(schedules)
    area = sum(machine.area_a for machine in machines)
    for limits, highest in (
        (MotionLimits(speed=[0.2, 0.08]), 0.08),
        (MotionLimits(flow=area * 0.06), 0.06),
    ):
        found = synchronize(machines, schedules, profile, coupling="mean", limits=limits)
        assert found.completed
        assert found.v_ref.max() == pytest.approx(highest, rel=1e-4)
        even = np.flatnonzero(found.v_ref > 0.9999 * highest)[300:-100]
        assert even.size > 500
        flow = sum(
            machine.area_a * t.v for machine, t in zip(machines, found.trajectories, strict=True)
        )
        assert flow[even] == pytest.approx(area * highest, rel=2e-3)


@pytest.mark.parametrize("name", COUPLINGS)
@pytest.mark.parametrize(
    ("kind", "time"), [("sensor", 1.0), ("sensor", 1.7), ("valve", 1.0), ("valve", 1.7)]
)
def test_after_a_failure_all_halt_within_the_stated_distance(name, kind, time):
    schedules = quartet()
    stop = StopStrategy(distance=2e-3, largest_lag=5e-3)
    failure = Failure(cylinder=2, time=time, kind=kind)
    found = synchronize(
        machines_of(schedules),
        schedules,
        s_curve(0.1, 0.3, 3.2),
        coupling=coupling(name, 4, 0.3 if name == "mean" else 0.1, 10.0),
        stop=stop,
        failure=failure,
    )
    assert not found.completed
    assert found.stop.cylinder == 2
    assert found.stop.time == time if kind == "sensor" else found.stop.time > time
    assert (found.stop.distance > 0.0).all()
    assert found.stop.distance.max() <= stop.distance
    assert max(np.abs(t.v[-100:]).max() for t in found.trajectories) <= 1e-3
    if kind == "valve":
        first = found.t < found.stop.time
        assert np.abs(found.reference - found.y)[:, first].max() <= stop.largest_lag


def test_a_stopping_reference_is_decelerated_evenly_over_the_distance():
    found = synchronize(
        [ACTUATOR] * 2,
        [GIVEN] * 2,
        s_curve(0.1, 0.2, 1.0),
        coupling=coupling("mean", 2),
        stop=StopStrategy(distance=1e-3, largest_lag=0.05),
        failure=Failure(cylinder=1, time=0.6),
    )
    k = round(found.stop.time / 1e-3) - 1
    assert found.reference[-1] - found.reference[k] == pytest.approx(1e-3, rel=1e-9)
    moving = found.v_ref[k:][found.v_ref[k:] > 0.0]
    assert np.diff(moving, 2) == pytest.approx(0.0, abs=1e-12)
    assert found.v_ref[-1] == 0.0


def test_a_group_does_not_stop_without_a_reason():
    profile = s_curve(0.1, 0.15, 0.6)
    runs = [
        synchronize(
            [ACTUATOR, SOFT],
            [GIVEN] * 2,
            profile,
            coupling=coupling("mean", 2, 0.3, 10.0),
            stop=stop,
        )
        for stop in (None, StopStrategy(largest_lag=0.02))
    ]
    assert runs[1].stop is None
    assert np.array_equal(runs[0].y, runs[1].y)


def test_metrics_are_those_of_their_definitions():
    """1 mm apart for 0.2 s after a load step, 0.1 mm else."""
    k = np.arange(1000)
    error = np.where((k >= 300) & (k < 500), 1e-3, 1e-4)
    commands, lags = np.where(k < 50, 1.0, 0.1)[None, :], np.where(k == 7, -2e-3, 0.0)[None, :]
    found = measure_group(error, lags, commands, k == 300, 1e-3)
    assert found.rms == pytest.approx(1e-4)
    assert found.peak == 1e-4
    assert found.rms_after_load_steps == found.peak_after_load_steps == pytest.approx(1e-3)
    assert found.rms_of_all == pytest.approx(np.sqrt(0.2e-6 + 0.8e-8))
    assert found.tracking_error == 2e-3
    assert found.saturation_time == pytest.approx(0.05)
    assert found.duration == 1.0
    assert np.isnan(measure_group(error, lags, commands, k < 0, 1e-3).rms_after_load_steps)


def test_s_curve_is_the_integral_of_its_speed_and_of_least_jerk():
    profile = s_curve(0.1, 0.4, 2.0, Ts=1e-3, before=0.2, after=0.3)
    assert profile.position[0] == 0.1
    assert profile.position[-1] == pytest.approx(0.4, abs=1e-15)
    assert profile.t[-1] == pytest.approx(2.5)
    travelled = 0.1 + 1e-3 * np.cumsum(np.r_[0.0, 0.5 * (profile.speed[1:] + profile.speed[:-1])])
    assert travelled == pytest.approx(profile.position, abs=0.3 / 12 * 60 / 2.0**3 * 1e-6)
    assert profile.speed.max() == pytest.approx(1.875 * 0.15, rel=1e-6)


def test_the_same_case_in_a_campaign_and_alone_gives_the_same_numbers():
    schedules, profile = pair(), s_curve(0.1, 0.15, 0.6)
    machines, given = machines_of(schedules), coupling("mean", 2, 0.3, 20.0)
    loads = [0.0, 1e5 * (profile.t > 0.4)]
    settings = {"coupling": given, "load_forces": loads, "seed": 7}
    long, short = (
        campaign(machines, schedules, profile, count=count, **settings) for count in (6, 3)
    )
    assert long.completed.all()
    for name, values in long.metrics.items():
        assert np.array_equal(values[:3], short.metrics[name]), name
    case = long.worst("rms")
    assert long.metrics["rms"][case] == long.metrics["rms"].max()
    varied, further = random_group(machines, 7, case)
    alone = synchronize(
        varied,
        schedules,
        profile,
        coupling=given,
        load_forces=[load + more for load, more in zip(loads, further, strict=True)],
    )
    assert alone.metrics.rms == long.metrics["rms"][case]
    assert varied[0].supply_pressure == varied[1].supply_pressure != machines[0].supply_pressure
    assert varied[0].mass / machines[0].mass != varied[1].mass / machines[1].mass


def backwards():
    """A schedule that drives away from the reference."""
    return schedule("position", kp=np.full((4, 3), -200.0))


def test_a_failed_case_is_flagged_with_its_reason():
    machines, profile = [ACTUATOR] * 2, s_curve(0.4, 0.35, 0.5, after=9.0)
    found = campaign(
        machines,
        [GIVEN, backwards()],
        profile,
        count=3,
        seed=1,
        coupling=coupling("independent", 2),
    )
    assert not found.completed.all()
    for case, completed in enumerate(found.completed):
        assert ("has no meaning from" in found.reasons[case]) == (not completed)
        assert np.isnan([values[case] for values in found.metrics.values()]).all() == (
            not completed
        )
    assert not found.completed[found.worst()]


def test_sixteen_cylinders_move_and_seventeen_do_not():
    profile = s_curve(0.1, 0.11, 0.2, after=0.05)
    found = synchronize(
        [ACTUATOR] * 16,
        [GIVEN] * 16,
        profile,
        coupling=coupling("mean", 16, 0.3, 10.0),
        load_forces=list(np.linspace(-2e5, 2e5, 16)),
    )
    assert found.y.shape == (16, profile.t.size)
    with pytest.raises(InputError, match="17 cylinders are too many; give at most 16"):
        synchronize([ACTUATOR] * 17, [GIVEN] * 17, profile)


@pytest.mark.parametrize(
    ("count", "words"),
    [(0, "actuators is empty; give 2 to 16"), (1, "one cylinder has none to follow")],
)
def test_fewer_than_two_cylinders_are_no_group(count, words):
    with pytest.raises(InputError, match=words):
        synchronize([ACTUATOR] * count, [GIVEN] * count, s_curve(0.1, 0.2, 1.0))


def test_all_faults_of_a_group_come_at_once():
    short = ACTUATOR.replace(stroke=0.4)
    schedules = [GIVEN, schedule("velocity", Ts=2e-3), GIVEN]
    with pytest.raises(InputError) as caught:
        synchronize(
            [ACTUATOR, short],
            schedules,
            s_curve(0.1, 0.45, 1.0),
            load_forces=[np.zeros(3), np.inf],
            limits=MotionLimits(speed=[1.0, 1.0, 1.0]),
            failure=Failure(cylinder=2, time=9.0),
            longest=0.1,
            coupling=coupling("mean", 3),
        )
    words = (
        "load of cylinder 1",
        "load of cylinder 2",
        "3 schedules for 2 cylinders",
        "for the velocity loop",
        "schedules are sampled every 0.001, 0.002 s",
        "strokes are 0.4, 0.5 m",
        "the reference is sampled every 0.001 s, schedules every 0.002 s",
        "cylinder 2 from 0 to 0.4 m",
        "limits.speed has 3 values",
        "needs a stop strategy",
        "failure.cylinder = 2",
        "failure.time = 9",
        "longest = 0.1",
        "for 3 cylinders",
    )
    assert len(caught.value.faults) == len(words)
    for word in words:
        assert any(word in fault for fault in caught.value.faults), word


def test_rules_and_profiles_name_all_their_faults():
    for make, count in (
        (lambda: RateOverride(free=2e-3, limit=1e-3, time_constant=-1.0, least=0.0), 3),
        (lambda: MotionLimits(speed=[0.1, 0.0], flow=0.0), 2),
        (lambda: StopStrategy(distance=0.0, largest_lag=-1.0), 2),
        (lambda: Failure(cylinder=0, time=-1.0, kind="rust"), 2),
        (lambda: MotionProfile(Ts=0.0, position=[0.1], speed=[0.0, np.nan]), 4),
        (lambda: s_curve(np.inf, 0.2, 0.0, before=-1.0), 3),
        (
            lambda: campaign(
                [ACTUATOR],
                [GIVEN],
                s_curve(0.1, 0.2, 1.0),
                count=0,
                seed=-1,
                spread={"color": 0.1, "mass": 2.0},
            ),
            5,
        ),
    ):
        with pytest.raises(InputError) as caught:
            make()
        assert len(caught.value.faults) == count


def test_a_group_that_leaves_the_numbers_says_so():
    with pytest.raises(SimulationError, match="has no meaning from"):
        synchronize(
            [ACTUATOR] * 2,
            [GIVEN, backwards()],
            s_curve(0.4, 0.35, 0.5, after=9.0),
            coupling=coupling("independent", 2),
        )
