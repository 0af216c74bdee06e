"""Weight: an inclined machine's load follows its mass, and a load that assists is as good as one
that resists.

The operating points stand here by hand, from the flows through the two edges of an ideal valve
without leakage and friction.
"""

import math
from dataclasses import astuple

import numpy as np
import pytest
from loops import schedule
from machines import mirrored, total_load

import hydroctl as hc
from hydroctl.machine.variants import variants
from hydroctl.model import plant
from hydroctl.simulation import Scenario, rest_state, simulate, simulate_closed_loop
from hydroctl.simulation.modes import fastest_mode
from hydroctl.synchronization import Coupling, random_group, s_curve
from hydroctl.synchronization.coupling import coupling_matrix
from hydroctl.validation import tracking_scenarios
from hydroctl.validation.campaigns import campaign, replay
from hydroctl.validation.metrics import measure
from hydroctl.validation.plants import plants_of
from hydroctl.validation.scale import scale_of

BORE, ROD, SUPPLY, TANK = 0.063, 0.036, 160e5, 2e5
AREA_A, AREA_B = math.pi / 4 * BORE**2, math.pi / 4 * (BORE**2 - ROD**2)
EDGE = 60.0 / 60e3 / math.sqrt(35e5)  # 60 L/min at 35 bar
WEIGHTS = [500.0, 1200.0, 2400.0]  # kg
SPOOLS = {"symmetric": EDGE, "2:1": EDGE / 2}
INCLINATIONS = [-90.0, 30.0, 90.0]  # degrees
LIFT = hc.Actuator(
    name="lift",
    area_a=AREA_A,
    area_b=AREA_B,
    volume_a=0.3e-3,
    volume_b=0.3e-3 + AREA_B * 0.5,
    stroke=0.5,
    bulk_modulus=1.2e9,
    flow_coefficient=EDGE,
    flow_coefficient_b=EDGE / 2,
    supply_pressure=SUPPLY,
    tank_pressure=TANK,
    mass=1200.0,
    inclination=math.pi / 2,
)


def by_hand(x, edge_b, force):
    """(p_a, p_b, v): the speed at which the two throttles take what supply, tank and load leave of
    the force."""
    narrow_a, narrow_b = (AREA_A / (abs(x) * EDGE)) ** 2, (AREA_B / (abs(x) * edge_b)) ** 2
    if x > 0:
        square = (AREA_A * SUPPLY - AREA_B * TANK - force) / (AREA_A * narrow_a + AREA_B * narrow_b)
        return SUPPLY - narrow_a * square, TANK + narrow_b * square, math.sqrt(square)
    square = (AREA_B * SUPPLY - AREA_A * TANK + force) / (AREA_A * narrow_a + AREA_B * narrow_b)
    return TANK + narrow_a * square, SUPPLY - narrow_b * square, -math.sqrt(square)


@pytest.mark.parametrize("mass", WEIGHTS)
@pytest.mark.parametrize("spool", SPOOLS)
@pytest.mark.parametrize("inclination", INCLINATIONS)
@pytest.mark.parametrize("x", [-1.0, -0.3, 0.3, 1.0])
def test_weights_on_inclined_machines_rest_at_the_points_of_the_flow_equations(
    mass, spool, inclination, x
):
    edge_b, angle = SPOOLS[spool], inclination * math.pi / 180
    machine = LIFT.replace(
        mass=mass, inclination=angle, flow_coefficient_b=edge_b, load_force=1500.0
    )
    p_a, p_b, v = by_hand(x, edge_b, 1500.0 + mass * 9.80665 * math.sin(angle))
    points = hc.find_operating_points(machine, [x], 0.2)
    assert points.p_a[0] == pytest.approx(p_a, rel=1e-9)
    assert points.p_b[0] == pytest.approx(p_b, rel=1e-9)
    assert points.v[0] == pytest.approx(v, rel=1e-9)
    assert points.feasible[0] == (min(p_a, p_b) >= TANK)
    assert points.feasible[0] or "cavitates" in points.reason[0]


@pytest.mark.parametrize(("load", "x"), [(-20e3, 0.2), (-20e3, 1.0), (55e3, -0.2), (55e3, -1.0)])
def test_a_load_that_assists_may_lift_the_outlet_above_supply_pressure(load, x):
    """Extending with a pull it is the rod side behind a 2:1 spool, retracting under a push the cap
    side behind a 1:3 spool."""
    edge_b = EDGE / 2 if x > 0 else 3 * EDGE
    machine = LIFT.replace(
        inclination=0.0, load_force=load, flow_coefficient_b=edge_b, supply_pressure=SUPPLY
    )
    p_a, p_b, v = by_hand(x, edge_b, load)
    assert max(p_a, p_b) > SUPPLY
    assert min(p_a, p_b) > TANK
    points = hc.find_operating_points(machine, [x], [0.1, 0.4])
    assert points.feasible.all()
    np.testing.assert_allclose(
        [points.p_a[0], points.p_b[0], points.v[0]], [p_a, p_b, v], rtol=1e-9
    )
    assert np.isfinite(hc.linearize(machine, points).A).all()


def test_the_model_at_a_chamber_above_supply_pressure_is_the_derivative_of_the_equations():
    """By complex steps through the rates, entry by entry, and stable."""
    machine = LIFT.replace(
        inclination=-math.pi / 2, mass=2000.0, leakage=1e-13, viscous_friction=3000.0
    )
    points = hc.find_operating_points(machine, [0.4], 0.2)
    assert points.p_b[0] > SUPPLY
    family, p, step = hc.linearize(machine, points), plant.parameters(machine), 1e-30
    at = np.array([points.p_a[0], points.p_b[0], points.v[0], 0.4], complex)
    for k in range(4):
        moved = at + 1j * step * (np.arange(4) == k)
        column = np.imag(plant.rates(*moved[:3], 0.2, moved[3], total_load(machine), p)) / step
        np.testing.assert_allclose(
            np.concatenate([family.A[0], family.B[0]], axis=1)[:, k], column, rtol=1e-12
        )
    assert (family.poles().real < 0.0).all()


def test_a_point_whose_flow_turns_back_is_refused_with_the_reason():
    """At a nearly closed valve the load presses more through the leak than the edges pass."""
    machine = LIFT.replace(inclination=0.0, load_force=20e3, leakage=1e-11)
    points = hc.find_operating_points(machine, [1e-3, -1e-3, 0.5, -0.5], 0.2)
    assert points.feasible.tolist() == [False, False, True, True]
    assert points.p_a[0] > SUPPLY  # extending, chamber a is at the supply
    assert points.p_b[1] > SUPPLY  # retracting, chamber b is
    assert all("flow back through an open edge" in reason for reason in points.reason[:2])
    assert all("larger |x|" in reason for reason in points.reason[:2])


def test_a_chamber_above_its_rating_is_told_and_not_refused():
    points = hc.find_operating_points(
        LIFT.replace(mass=2000.0, pressure_rating=100e5), [-1.0, 0.3, 1.0], [0.1, 0.4, 0.3]
    )
    assert points.feasible.all()
    assert points.above_rating.tolist() == (np.maximum(points.p_a, points.p_b) > 100e5).tolist()
    assert 0 < np.count_nonzero(points.above_rating) < 3
    assert not hc.find_operating_points(LIFT, [-1.0, 1.0], 0.1).above_rating.any()


@pytest.mark.parametrize("x", [-0.1, 0.1])
def test_a_simulated_lift_comes_to_the_speed_and_the_pressures_of_its_operating_point(x):
    """Slow motions along the stroke are equilibria, for the volumes only multiply the rates of the
    pressures."""
    p_a, p_b, v = by_hand(x, EDGE / 2, 1200.0 * 9.80665)
    motion = simulate(LIFT, np.linspace(0.0, 3.0, 301), x, rtol=1e-10)
    assert (motion.p_a[-1], motion.p_b[-1], motion.v[-1]) == pytest.approx((p_a, p_b, v), rel=1e-6)


def test_a_lift_at_rest_holds_its_weight_and_stays():
    rest = rest_state(LIFT, 0.2, load_force=1500.0)
    assert AREA_A * rest.p_a - AREA_B * rest.p_b == pytest.approx(
        1200.0 * 9.80665 + 1500.0, rel=1e-12
    )
    motion = simulate(
        LIFT, np.linspace(0.0, 1.0, 11), 0.0, initial=rest, load_force=1500.0, rtol=1e-10
    )
    assert np.abs(motion.y - 0.2).max() <= 1e-9


LIFTED = LIFT.replace(viscous_friction=8000.0, inclination=0.7, load_force=-3000.0)
LEVEL = LIFTED.replace(inclination=0.0, load_force=-3000.0 + 1200.0 * 9.80665 * math.sin(0.7))
"""The same motion: the weight of LIFTED as a load without inclination."""
SLOW = schedule("position", kp=np.full((4, 3), 8.0), ki=np.full((4, 3), 8.0))
SINE = 0.2 + 0.02 * np.sin(0.02 * np.arange(300))
GRID = np.array([-1.0, -0.3, -0.1, 0.1, 0.3, 1.0])[:, None], np.linspace(0.0, 0.5, 6)


def points(machine):
    return hc.find_operating_points(machine, *GRID, load_force=500.0)


def reduced(machine, method="matched"):
    return hc.reduce_order(hc.linearize(machine, points(machine)), method=method, tolerance=10.0)


def synchronized(machine):
    path = s_curve(0.1, 0.12, 0.3)
    return hc.synchronize(
        [machine] * 2, [SLOW] * 2, path, coupling=INDEPENDENT, load_forces=[0.0, 500.0]
    )


def tuned(machine):
    found = hc.tune(
        machine,
        [-0.5, 0.5],
        [0.25],
        loop="position",
        specification=hc.Specification(uncertainty="nominal"),
    )
    return [*found.ki.ravel(), found.speed_gain_extend, found.speed_offset_retract]


SAME_BY_ANOTHER_LOAD = {
    "operating points": lambda machine: [points(machine).p_a, points(machine).p_b],
    "whole loads": lambda machine: points(machine).load_force,
    "linear models": lambda machine: hc.linearize(machine, points(machine)).A,
    "the paper's reduction": lambda machine: reduced(machine, "paper").b,
    "errors of surfaces": lambda machine: astuple(
        hc.fit_surfaces(reduced(machine)).surfaces["+"].fit_error["b"]
    ),
    "characteristics": lambda machine: [
        getattr(hc.characterize(machine), name) for name in ("speed_extending", "pressure_jump_a")
    ],
    "fastest mode": lambda machine: fastest_mode(machine),
    "rest": lambda machine: rest_state(machine, 0.2, load_force=500.0),
    "low and high rest": lambda machine: [
        s.initial[:2] for s in tracking_scenarios(machine, "velocity") if s.initial
    ],
    "open loop": lambda machine: (
        simulate(machine, np.linspace(0.0, 1.0, 101), 0.1, load_force=500.0).p_b
    ),
    "closed loop": lambda machine: (
        simulate_closed_loop(machine, SLOW, Scenario(reference=SINE, y=0.2, **POSITION)).p_b
    ),
    "several cylinders": lambda machine: synchronized(machine).trajectories[1].p_b,
    "python-control": lambda machine: plant.as_nonlinear_system(machine).dynamics(
        0.0, [50.0, 60.0, 0.1, 0.2], [0.3, 500.0]
    ),
    "a tuned schedule": tuned,
    "scale": lambda machine: scale_of(machine, "position").extend_speed,
}
INDEPENDENT = Coupling(name="independent", matrix=coupling_matrix("independent", 2), kc=0.0, ki=0.0)
POSITION = {"name": "sine", "loop": "position", "Ts": 1e-3}


@pytest.mark.filterwarnings("ignore::hydroctl.quasi_linear.PoorFitWarning")
@pytest.mark.parametrize("what", SAME_BY_ANOTHER_LOAD)
def test_an_inclined_machine_is_the_level_one_with_its_weight_as_load(what):
    """At 1e-9: the two loads differ by rounding."""
    found, expected = (
        np.array(SAME_BY_ANOTHER_LOAD[what](machine), dtype=float) for machine in (LIFTED, LEVEL)
    )
    np.testing.assert_allclose(found, expected, rtol=1e-9)
    lighter = np.array(SAME_BY_ANOTHER_LOAD[what](LEVEL.replace(load_force=-3000.0)), dtype=float)
    assert not np.allclose(found, lighter, rtol=1e-6, equal_nan=True)


def test_weight_follows_the_mass_of_every_variant():
    hanging = LIFT.replace(mass=3000.0, inclination=math.pi / 2)
    corners = [*variants(hanging, "corners").values(), *plants_of(hanging, SLOW, "box").values()]
    assert {round(plant.mass) for plant in corners} == {1500, 3000, 4500}
    for machine in corners:
        found = hc.find_operating_points(machine, [0.5], 0.2)
        held = AREA_A * found.p_a[0] - AREA_B * found.p_b[0]
        assert held == pytest.approx(machine.mass * 9.80665, rel=1e-9)


def test_a_variant_that_cannot_hold_its_own_weight_is_named():
    """1.5 times 3200 kg weigh 47 kN; at 0.8 times the supply the cylinder holds 40 kN."""
    heavy = LIFT.replace(mass=3200.0)
    still = Scenario(reference=np.full(10, 0.2), y=0.2, **POSITION)
    words = r"mass \+50 %, supply_pressure -20 % plant: the load of 47071.9 N cannot be held"
    with pytest.raises(hc.InputError, match=words):
        hc.validate(heavy, SLOW, scenarios=[still], variants="box", requirements=())


def test_weight_follows_the_mass_of_every_case_of_a_campaign():
    """Against a level machine that carries the case's own weight as its load."""
    k = np.arange(300)
    step = Scenario(
        reference=np.where(k < 10, 0.2, 0.21), y=0.2, kind="step", settle_by=0.2, **POSITION
    )
    result = campaign(LIFTED, SLOW, count=40, seed=5, scenarios=[step])
    assert not result.failed.any()
    for case in (0, 17, 39):
        own = {name: values[case] for name, values in result.parameters.items()}
        load = own.pop("load_force") - 3000.0 + own["mass"] * 9.80665 * math.sin(0.7)
        machine = LIFTED.replace(inclination=0.0, load_force=load, **own)
        expected = measure(
            machine, step, simulate_closed_loop(machine, SLOW, step, substeps=result.substeps)
        )
        for name in ("peak_pressure", "lowest_pressure", "iae", "total_variation"):
            assert result.metrics[name][case] == pytest.approx(getattr(expected, name), rel=1e-9), (
                name
            )
        replayed, _, motion = replay(LIFTED, SLOW, result.case_seed(case), scenarios=[step])
        assert total_load(replayed) == pytest.approx(load, rel=1e-12)
        assert motion.p_a[0] == pytest.approx(rest_state(machine, 0.2).p_a, rel=1e-12)


def test_weight_follows_the_mass_of_every_cylinder_of_a_random_group():
    varied, _ = random_group([LIFT, LIFT], seed=3, case=1)
    assert varied[0].mass != varied[1].mass
    for machine in varied:
        rest = rest_state(machine, 0.2)
        assert AREA_A * rest.p_a - AREA_B * rest.p_b == pytest.approx(
            machine.mass * 9.80665, rel=1e-9
        )


def test_the_mirrored_lift_gives_the_mirrored_point():
    one, other = (
        hc.find_operating_points(LIFTED, [0.4], 0.2),
        hc.find_operating_points(mirrored(LIFTED), [-0.4], 0.3),
    )
    np.testing.assert_allclose(
        [other.p_b, other.p_a, -other.v], [one.p_a, one.p_b, one.v], rtol=1e-12
    )
