"""Laws and published numbers of the operating points."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from machines import (
    DIFFERENTIAL,
    LOSSLESS,
    REFERENCE,
    balances,
    dry_machines,
    imbalance,
    inclined_machines,
    machines,
    mirrored,
    paper_closed_form,
    total_load,
)

import hydroctl as hc
from hydroctl.model import chambers, equilibrium, friction, plant, valve
from hydroctl.model.operating_point import compiled_equilibrium, stall_force

OPENINGS = np.concatenate([-np.geomspace(1.0, 1e-4, 60), np.geomspace(1e-4, 1.0, 60)])


@pytest.mark.parametrize("leakage", [0.0, 5e-12])
def test_operating_points_satisfy_the_equations_to_1e_12(leakage):
    actuator = REFERENCE.replace(leakage=leakage)
    points = hc.find_operating_points(actuator, OPENINGS, 0.1)
    assert points.feasible.all()
    assert points.residual.max() <= 1e-12
    for x, p_a, p_b, v in zip(points.x, points.p_a, points.p_b, points.v, strict=True):
        assert imbalance(actuator, x, p_a, p_b, v) <= 1e-12


@pytest.mark.parametrize(
    ("leakage", "x", "p_a", "p_b", "v"),
    [
        (5e-12, 0.1, "1.77028992e7", "2.06013403e7", "1.56126400e-2"),
        (5e-12, 1.0, "1.80316082e7", "2.05320174e7", "1.51457632e-1"),
        (0.0, 0.1, "1.78011963e7", "2.07174885e7", "1.51721560e-2"),
    ],
)
def test_reference_numbers_to_the_printed_digits(leakage, x, p_a, p_b, v):
    point = hc.find_operating_points(REFERENCE.replace(leakage=leakage), x, 0.25)
    assert [f"{float(value):.8e}" for value in (point.p_a, point.p_b, point.v)] == [
        f"{float(value):.8e}" for value in (p_a, p_b, v)
    ]


@pytest.mark.parametrize("x", [1e-4, 0.03, 0.1, 0.5, 1.0])
def test_without_leakage_extending_is_the_closed_form_of_the_paper(x):
    point = hc.find_operating_points(LOSSLESS, x, 0.0)
    expected = paper_closed_form(
        LOSSLESS, x
    )  # its differences of large terms lose about three digits
    np.testing.assert_allclose([point.p_a, point.p_b, point.v], expected, rtol=1e-12)


def test_the_closed_form_of_the_paper_is_no_equilibrium_when_retracting():
    assert imbalance(LOSSLESS, -0.5, *paper_closed_form(LOSSLESS, -0.5)) > 0.1


@pytest.mark.parametrize("actuator", [REFERENCE, DIFFERENTIAL], ids=lambda actuator: actuator.name)
@pytest.mark.parametrize("x", [-1.0, -0.02, 0.02, 0.7])
def test_a_general_root_finder_comes_to_the_same_point(actuator, x):
    from scipy.optimize import root

    supply, speed = (
        actuator.supply_pressure,
        0.3 * actuator.flow_coefficient * np.sqrt(actuator.supply_pressure) / actuator.area_a,
    )

    def scaled(z):
        z = np.asarray(z)
        p_a, p_b, v = z[0] * supply, z[1] * supply, z[2] * abs(x) * speed
        flow_a, flow_b, force = (sum(terms) for terms in balances(actuator, x, p_a, p_b, v))
        return [
            flow_a / (actuator.area_a * speed * abs(x)),
            flow_b / (actuator.area_b * speed * abs(x)),
            force / (actuator.area_a * supply),
        ]

    found = root(scaled, [0.5, 0.5, np.sign(x)], tol=1e-14)
    point = hc.find_operating_points(actuator, x, 0.25)
    assert max(map(abs, scaled(found.x))) < 1e-12
    np.testing.assert_allclose(
        [point.p_a, point.p_b, point.v],
        [found.x[0] * supply, found.x[1] * supply, found.x[2] * abs(x) * speed],
        rtol=1e-9,
    )


def test_pressures_and_speed_do_not_depend_on_the_position():
    points = hc.find_operating_points(
        REFERENCE, np.array([[-1.0], [0.1]]), np.linspace(0.0, 0.5, 7)
    )
    assert points.shape == (2, 7)
    for values in (points.p_a, points.p_b, points.v):
        assert (values == values[:, :1]).all()


@pytest.mark.parametrize("x", [-0.9, -0.1, 0.003, 0.4])
def test_the_mirrored_machine_gives_the_mirrored_point(x):
    loaded = DIFFERENTIAL.replace(load_force=3e4)
    point = hc.find_operating_points(loaded, x, 0.2)
    other = hc.find_operating_points(mirrored(loaded), -x, 0.8)
    np.testing.assert_allclose(
        [other.p_b, other.p_a, -other.v], [point.p_a, point.p_b, point.v], rtol=1e-13
    )


def test_as_the_opening_vanishes_the_pressures_tend_to_the_no_load_pressures_of_each_direction():
    a, supply = LOSSLESS.area_b / LOSSLESS.area_a, LOSSLESS.supply_pressure
    extending, retracting = (hc.find_operating_points(LOSSLESS, [x], 0.1) for x in (1e-12, -1e-12))
    scale = supply / (1 + a**3)
    # friction is B v with v ~ 1e-13 m/s: nothing beside 1e6 N, so rounding alone is left
    np.testing.assert_allclose(
        [extending.p_a[0], extending.p_b[0]], [a**3 * scale, a**2 * scale], rtol=1e-12
    )
    np.testing.assert_allclose(
        [retracting.p_a[0], retracting.p_b[0]], [a * scale, scale], rtol=1e-12
    )
    np.testing.assert_allclose(extending.v / -retracting.v, a**-0.5, rtol=1e-12)


def test_positive_and_negative_zero_are_the_two_one_sided_limits_and_flagged():
    limits = hc.find_operating_points(LOSSLESS, [0.0, -0.0], 0.1)
    near = hc.find_operating_points(LOSSLESS, [1e-12, -1e-12], 0.1)
    assert not limits.feasible.any()
    assert all("closed" in reason for reason in limits.reason)
    np.testing.assert_allclose(limits.p_a, near.p_a, rtol=1e-12)
    np.testing.assert_allclose(limits.p_b, near.p_b, rtol=1e-12)
    assert (limits.v == 0.0).all()


def test_both_pressures_collapse_where_leakage_outweighs_the_valve_flow():
    openings = np.geomspace(1e-7, 1e-1, 7)
    points = hc.find_operating_points(REFERENCE, openings, 0.1)
    assert (np.diff(points.p_a) > 0).all()
    ratio = REFERENCE.area_b / REFERENCE.area_a
    # so small that p_a ~ 0: the whole supply pressure drops over the edge, and all of A_b v leaks
    # back from b to a
    x = 1e-7
    speed = (
        x
        * REFERENCE.flow_coefficient
        * np.sqrt(REFERENCE.supply_pressure)
        / (REFERENCE.area_a - REFERENCE.area_b)
    )
    p_b = REFERENCE.area_b * speed / (REFERENCE.leakage * (1 - ratio))
    point = hc.find_operating_points(REFERENCE, x, 0.1)
    np.testing.assert_allclose(
        [point.p_b, point.p_a],
        [p_b, ratio * p_b],
        rtol=2 * np.sqrt(p_b / REFERENCE.supply_pressure),
    )


@pytest.mark.parametrize(
    ("x", "y", "load_force", "word"),
    [
        (0.0, 0.1, 0.0, "closed"),
        (1.01, 0.1, 0.0, "between -1 and 1"),
        (0.5, 0.51, 0.0, "stroke"),
        (0.5, -1e-6, 0.0, "stroke"),
        (0.5, 0.1, 1.7e6, "stall force of 1.61e+06 N"),
        (-0.5, 0.1, -1.4e6, "stall force of -1.38e+06 N"),
        (0.5, 0.1, -3e6, "cavitates"),
    ],
)
def test_a_point_that_cannot_be_used_is_flagged_in_a_batch_and_raises_alone(x, y, load_force, word):
    batch = hc.find_operating_points(LOSSLESS, [x, 0.5], [y, 0.1], load_force=[load_force, 0.0])
    assert batch.feasible.tolist() == [False, True]
    assert word in batch.reason[0]
    assert batch.reason[1] == ""
    assert all(
        np.isfinite(values).all() for values in (batch.p_a, batch.p_b, batch.v, batch.residual)
    )
    with pytest.raises(hc.OperatingPointError, match="No operating point"):
        hc.find_operating_points(LOSSLESS, x, y, load_force=load_force)


@pytest.mark.parametrize("x", [-1.0, 1.0])
def test_the_speed_falls_to_zero_at_the_stall_force(x):
    stall = float(stall_force(LOSSLESS, x))
    remaining = abs(stall) * np.array([1e-2, 1e-5, 1e-8])
    speeds = np.abs(
        hc.find_operating_points(LOSSLESS, x, 0.1, load_force=stall - np.sign(x) * remaining).v
    )
    assert (speeds > 0).all()
    viscous = (
        remaining / LOSSLESS.viscous_friction
    )  # the speed that viscous friction alone would allow
    assert (speeds < viscous).all()
    np.testing.assert_allclose(
        speeds[-1], viscous[-1], rtol=1e-3
    )  # throttling takes a share of 4 T F / B^2, below 1e-3 here


@pytest.mark.parametrize("viscous_friction", [0.0, 1e3])
@pytest.mark.parametrize("leakage", [0.0, 1e-12])
@pytest.mark.parametrize("breakaway_friction", [0.0, 5e3])
def test_exactly_at_the_stall_force_the_point_is_flagged_and_finite(
    viscous_friction, leakage, breakaway_friction
):
    machine = DIFFERENTIAL.replace(
        viscous_friction=viscous_friction, leakage=leakage, stribeck_speed=0.01
    ).replace(breakaway_friction=breakaway_friction)
    points = hc.find_operating_points(
        machine,
        [-1.0, -0.1, 0.1, 1.0],
        0.5,
        load_force=stall_force(machine, [-1.0, -1.0, 1.0, 1.0]),
    )
    assert not points.feasible.any()
    assert all(
        np.isfinite(values).all() for values in (points.p_a, points.p_b, points.v, points.residual)
    )
    assert (np.abs(points.v) < 1e-2).all()


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        ({"x": np.nan, "y": 0.1}, "x holds a value that is not finite"),
        ({"x": 0.1, "y": [0.1, np.inf]}, "y holds a value that is not finite"),
        ({"x": "wide", "y": 0.1}, "x = 'wide' is not a number"),
        ({"x": 0.1, "y": None}, "y holds a value that is not finite"),
        ({"x": [0.1, 0.2], "y": [0.1, 0.2, 0.3]}, "do not broadcast"),
        ({"x": 0.1, "y": 0.1, "load_force": np.nan}, "load_force holds a value that is not finite"),
    ],
)
def test_bad_input_names_the_field_and_the_way_out(arguments, words):
    with pytest.raises(hc.InputError, match=words):
        hc.find_operating_points(REFERENCE, **arguments)


LOADED = DIFFERENTIAL.replace(load_force=2e4, flow_coefficient_b=5e-7)
DRY = LOADED.replace(coulomb_friction=1500.0, creep_speed=1e-6)


@pytest.mark.parametrize("x", [-1.0, -0.2, 0.2, 1.0])
def test_load_tank_pressure_unequal_edges_and_coulomb_friction_have_a_closed_form(x):
    machine = DRY.replace(leakage=0.0)
    side = np.sign(x)
    areas = np.array([machine.area_a, machine.area_b])[:: int(side)]
    flows = np.array([machine.flow_coefficient, machine.flow_coefficient_b])[:: int(side)] * abs(x)
    supply, tank, viscous = machine.supply_pressure, machine.tank_pressure, machine.viscous_friction
    # A_d p_d - A_r p_r - B w - F_c -+ F = 0 with p_d = p_s - (A_d w/k_d)^2, p_r = p_t + (A_r
    # w/k_r)^2: a quadratic in w
    force = (
        areas[0] * supply - areas[1] * tank - side * machine.load_force - machine.coulomb_friction
    )
    w = max(
        np.roots(
            [-(areas[0] ** 3 / flows[0] ** 2 + areas[1] ** 3 / flows[1] ** 2), -viscous, force]
        )
    )
    pressures = np.array(
        [supply - (areas[0] * w / flows[0]) ** 2, tank + (areas[1] * w / flows[1]) ** 2]
    )[:: int(side)]
    point = hc.find_operating_points(machine, x, 0.5)
    # the smooth sign of v misses Coulomb friction by (v_c/v)^2/2 < 1e-9 of it, and friction is 1 %
    # of the force
    np.testing.assert_allclose([point.p_a, point.p_b, point.v], [*pressures, side * w], rtol=1e-10)


@pytest.mark.parametrize("leakage", [0.0, 5e-12])
@pytest.mark.parametrize("load_force", [-4e5, 0.0, 1.2e6])
def test_points_with_breakaway_friction_satisfy_the_equations_of_the_plant(leakage, load_force):
    machine = REFERENCE.replace(
        leakage=leakage,
        coulomb_friction=2e4,
        breakaway_friction=4e4,
        stribeck_speed=5e-3,
        creep_speed=5e-4,
        load_force=load_force,
    )
    points = hc.find_operating_points(machine, OPENINGS, 0.1)
    p = plant.parameters(machine)
    rates = plant.rates(points.p_a, points.p_b, points.v, points.y, points.x, points.load_force, p)
    stiff = chambers.stiffnesses(0.1, p.chambers)
    flow, force = (
        abs(points.v) * p.chambers.area_a + leakage * p.supply.supply_pressure,
        p.chambers.area_a * p.supply.supply_pressure,
    )
    assert points.feasible.any()
    for rate, scale in zip(
        rates, (stiff[0] * flow, stiff[1] * flow, force * p.load.inverse_mass), strict=True
    ):
        assert (abs(rate) <= 1e-12 * scale)[points.feasible].all()
    assert points.residual[points.feasible].max() <= 1e-12


def test_friction_slows_both_directions():
    openings = np.array([-0.8, -0.1, 0.1, 0.8])
    free = hc.find_operating_points(LOADED, openings, 0.5).v
    held = hc.find_operating_points(LOADED.replace(coulomb_friction=5e3), openings, 0.5).v
    assert (np.sign(held) == np.sign(openings)).all()
    assert (np.abs(held) < np.abs(free)).all()


def test_a_stuck_piston_and_a_creeping_one_are_flagged_with_the_reason():
    stall = float(stall_force(DIFFERENTIAL, 1.0))
    machine = DIFFERENTIAL.replace(
        coulomb_friction=1000.0, breakaway_friction=1500.0, stribeck_speed=0.01, leakage=0.0
    )
    points = hc.find_operating_points(
        machine, 0.5, 0.5, load_force=[stall - 1400.0, stall - 1600.0, stall + 1.0]
    )
    assert "the piston is stuck: the 1400 N" in points.reason[0]
    assert (points.v[0], points.p_a[0], points.p_b[0]) == (
        0.0,
        machine.supply_pressure,
        machine.tank_pressure,
    )
    assert points.feasible[1]
    assert "stall force" in points.reason[2]
    creeping = hc.find_operating_points(machine, [1e-4, 0.1], 0.5)
    assert "creep_speed" in creeping.reason[0]
    assert creeping.feasible[1]


@pytest.mark.parametrize("x", [-0.3, 0.01])
def test_a_stuck_piston_that_leaks_has_the_pressures_at_which_the_valve_feeds_the_leak(x):
    machine = REFERENCE.replace(breakaway_friction=3e6, stribeck_speed=0.01)
    points = hc.find_operating_points(machine, [x], 0.1)
    assert "stuck" in points.reason[0]
    assert points.v[0] == 0.0
    for terms in balances(machine, x, points.p_a[0], points.p_b[0], 0.0)[:2]:
        assert abs(sum(terms)) <= 1e-12 * max(map(abs, terms))


def test_with_a_load_just_short_of_breakaway_the_only_equilibrium_moves():
    machine = DIFFERENTIAL.replace(
        coulomb_friction=200.0,
        breakaway_friction=4000.0,
        stribeck_speed=0.05,
        viscous_friction=0.0,
        leakage=0.0,
    )
    stall = float(stall_force(machine, 1.0))
    point = hc.find_operating_points(machine, 1.0, 0.5, load_force=stall - 4100.0)
    p, speeds = plant.parameters(machine), np.linspace(1e-5, 0.3, 200_001)
    throttle = (
        machine.area_a**3 / machine.flow_coefficient**2
        + machine.area_b**3 / machine.flow_coefficient_b**2
    )
    left = 4100.0 - throttle * speeds**2 - friction.force(speeds, p.friction)
    crossings = speeds[1:][np.diff(np.sign(left)) != 0]
    assert len(crossings) == 1
    assert abs(crossings[0] - float(point.v)) < 2 * (speeds[1] - speeds[0])


def test_within_the_dead_band_the_valve_is_closed_and_beyond_it_the_opening_counts():
    machine = DIFFERENTIAL.replace(dead_band=0.1)
    points = hc.find_operating_points(machine, [-0.1, 0.05, 0.28, -0.28], 0.5)
    assert points.feasible.tolist() == [False, False, True, True]
    assert "within the dead band of 0.1" in points.reason[0]
    ideal = hc.find_operating_points(DIFFERENTIAL, [0.2, -0.2], 0.5)
    np.testing.assert_allclose(points.v[2:], ideal.v, rtol=1e-12)


@settings(max_examples=40, deadline=None)
@given(
    machine=st.one_of(machines(), inclined_machines()),
    x=st.floats(0.01, 1.0),
    side=st.sampled_from([-1.0, 1.0]),
    share=st.floats(0.0, 1.0),
)
def test_random_machines_rest_at_their_points_and_mirror(machine, x, side, share):
    x, y = side * x, share * machine.stroke
    points, other = (
        hc.find_operating_points(machine, [x], y),
        hc.find_operating_points(mirrored(machine), [-x], machine.stroke - y),
    )
    p_a, p_b, v = points.p_a[0], points.p_b[0], points.v[0]
    assert points.feasible[0] or points.reason[0]
    if points.feasible[0]:
        assert points.residual[0] <= 1e-12
        assert (
            imbalance(machine, x, p_a, p_b, v, total_load(machine)) <= 1e-11
        )  # sqrt(p_s - p) of a rounded p
        np.testing.assert_allclose(
            [other.p_b[0], other.p_a[0], -other.v[0]], [p_a, p_b, v], rtol=1e-9
        )
        family = hc.linearize(machine, points)
        assert np.isfinite(family.A).all()
        assert np.isfinite(family.numerator).all()
        assert (family.poles().real <= 1e-12 * np.abs(family.poles())).all()


@settings(max_examples=40, deadline=None)
@given(machine=dry_machines(), x=st.floats(0.01, 1.0), side=st.sampled_from([-1.0, 1.0]))
def test_random_machines_with_dry_friction_rest_at_their_points_and_mirror(machine, x, side):
    x, y = side * x, 0.3 * machine.stroke
    points, other = (
        hc.find_operating_points(machine, [x], y),
        hc.find_operating_points(mirrored(machine), [-x], machine.stroke - y),
    )
    p_a, p_b, v = points.p_a[0], points.p_b[0], points.v[0]
    assert points.feasible[0] == other.feasible[0]
    assert points.feasible[0] or points.reason[0]
    if points.feasible[0]:
        p = plant.parameters(machine)
        rates = plant.rates(
            p_a, p_b, v, y, valve.effective_opening(x, p.valve), machine.load_force, p
        )
        flow, force = (
            max(p.chambers.area_a, p.chambers.area_b) * abs(v)
            + p.chambers.leakage * p.supply.supply_pressure,
            p.chambers.area_a * p.supply.supply_pressure,
        )
        stiff_a, stiff_b = chambers.stiffnesses(y, p.chambers)
        assert abs(rates[0]) <= 1e-11 * stiff_a * flow
        assert abs(rates[1]) <= 1e-11 * stiff_b * flow
        assert abs(rates[2]) <= 1e-12 * force * p.load.inverse_mass
        np.testing.assert_allclose(
            [other.p_b[0], other.p_a[0], -other.v[0]], [p_a, p_b, v], rtol=1e-8
        )
        assert np.isfinite(hc.linearize(machine, points).A).all()


@pytest.mark.parametrize("machine", [REFERENCE, LOSSLESS, hc.load_actuator("crane_80_45")])
@pytest.mark.parametrize("x", [1e-160, -1e-160, 5e-324])
def test_an_opening_whose_square_vanishes_is_flagged_however_many_points_there_are(machine, x):
    with pytest.raises(hc.OperatingPointError, match="No operating point at x="):
        hc.find_operating_points(machine, x, 0.1)
    for count in (1, 100):
        points = hc.find_operating_points(machine, np.full(count, x), 0.1)
        assert not points.feasible.any()
        assert all(text.startswith("No operating point") for text in points.reason)


@pytest.mark.parametrize("name", hc.list_actuators())
def test_the_compiled_equations_do_what_they_do_in_python(name):
    """At stalled, closed, stuck and cavitating points, too."""
    machine = hc.load_actuator(name)
    p, x = (
        plant.parameters(machine),
        np.concatenate([np.linspace(-1.1, 1.1, 23), [0.0, -0.0, 1e-4, -1e-4]]),
    )
    for load in (0.0, 1e4, -3e5, 3e6):
        (found, fault), (expected, expected_fault) = pairs = [
            (np.empty((4, x.size)), np.empty(x.size, dtype=int)) for _ in "12"
        ]
        for solver, pair in zip((compiled_equilibrium(), equilibrium), pairs, strict=True):
            with np.errstate(all="ignore"):
                solver.solve_all(p, x, np.full(x.size, load), *pair)
        assert (fault == expected_fault).all()
        np.testing.assert_allclose(found[:3], expected[:3], rtol=1e-13)
