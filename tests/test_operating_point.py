"""Laws and published numbers of the operating points."""

import numpy as np
import pytest
from machines import DIFFERENTIAL, LOSSLESS, REFERENCE, balances, imbalance, mirrored, paper_closed_form

import hydroctl as hc
from hydroctl.operating_point import stall_force

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
    expected = paper_closed_form(LOSSLESS, x)  # its differences of large terms lose about three digits
    np.testing.assert_allclose([point.p_a, point.p_b, point.v], expected, rtol=1e-12)


def test_the_closed_form_of_the_paper_is_no_equilibrium_when_retracting():
    assert imbalance(LOSSLESS, -0.5, *paper_closed_form(LOSSLESS, -0.5)) > 0.1


@pytest.mark.parametrize("actuator", [REFERENCE, DIFFERENTIAL], ids=lambda actuator: actuator.name)
@pytest.mark.parametrize("x", [-1.0, -0.02, 0.02, 0.7])
def test_a_general_root_finder_comes_to_the_same_point(actuator, x):
    from scipy.optimize import root

    supply, speed = actuator.supply_pressure, 0.3 * actuator.flow_coefficient * np.sqrt(actuator.supply_pressure) / actuator.area_a

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
        [point.p_a, point.p_b, point.v], [found.x[0] * supply, found.x[1] * supply, found.x[2] * abs(x) * speed], rtol=1e-9
    )


def test_pressures_and_speed_do_not_depend_on_the_position():
    points = hc.find_operating_points(REFERENCE, np.array([[-1.0], [0.1]]), np.linspace(0.0, 0.5, 7))
    assert points.shape == (2, 7)
    for values in (points.p_a, points.p_b, points.v):
        assert (values == values[:, :1]).all()


@pytest.mark.parametrize("x", [-0.9, -0.1, 0.003, 0.4])
def test_the_mirrored_machine_gives_the_mirrored_point(x):
    loaded = DIFFERENTIAL.replace(load_force=3e4)
    point = hc.find_operating_points(loaded, x, 0.2)
    other = hc.find_operating_points(mirrored(loaded), -x, 0.8)
    np.testing.assert_allclose([other.p_b, other.p_a, -other.v], [point.p_a, point.p_b, point.v], rtol=1e-13)


def test_as_the_opening_vanishes_the_pressures_tend_to_the_no_load_pressures_of_each_direction():
    a, supply = LOSSLESS.area_b / LOSSLESS.area_a, LOSSLESS.supply_pressure
    extending, retracting = (hc.find_operating_points(LOSSLESS, [x], 0.1) for x in (1e-12, -1e-12))
    scale = supply / (1 + a**3)
    # friction is B v with v ~ 1e-13 m/s: nothing beside 1e6 N, so rounding alone is left
    np.testing.assert_allclose([extending.p_a[0], extending.p_b[0]], [a**3 * scale, a**2 * scale], rtol=1e-12)
    np.testing.assert_allclose([retracting.p_a[0], retracting.p_b[0]], [a * scale, scale], rtol=1e-12)
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
    x = 1e-7  # so small that p_a ~ 0: the whole supply pressure drops over the edge, and all of A_b v leaks back from b to a
    speed = x * REFERENCE.flow_coefficient * np.sqrt(REFERENCE.supply_pressure) / (REFERENCE.area_a - REFERENCE.area_b)
    p_b = REFERENCE.area_b * speed / (REFERENCE.leakage * (1 - ratio))
    point = hc.find_operating_points(REFERENCE, x, 0.1)
    np.testing.assert_allclose([point.p_b, point.p_a], [p_b, ratio * p_b], rtol=2 * np.sqrt(p_b / REFERENCE.supply_pressure))


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
    assert all(np.isfinite(values).all() for values in (batch.p_a, batch.p_b, batch.v, batch.residual))
    with pytest.raises(hc.OperatingPointError, match="No operating point"):
        hc.find_operating_points(LOSSLESS, x, y, load_force=load_force)


@pytest.mark.parametrize("x", [-1.0, 1.0])
def test_the_speed_falls_to_zero_at_the_stall_force(x):
    stall = float(stall_force(LOSSLESS, x))
    remaining = abs(stall) * np.array([1e-2, 1e-5, 1e-8])
    speeds = np.abs(hc.find_operating_points(LOSSLESS, x, 0.1, load_force=stall - np.sign(x) * remaining).v)
    assert (speeds > 0).all()
    viscous = remaining / LOSSLESS.viscous_friction  # the speed that viscous friction alone would allow
    assert (speeds < viscous).all()
    np.testing.assert_allclose(speeds[-1], viscous[-1], rtol=1e-3)  # throttling takes a share of 4 T F / B^2, below 1e-3 here


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
