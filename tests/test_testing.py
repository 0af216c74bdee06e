"""What users call in their own tests: it passes where the law holds and names the worst point where
it does not."""

import numpy as np
import pytest

import hydroctl as hc
from hydroctl.testing import DampingCone, Disk, HalfPlane, assert_margins, assert_poles_in


@pytest.fixture(scope="module")
def schedule(reference):
    return hc.tune(
        reference,
        [-1.0, 1.0],
        [0.0, 0.25, 0.5],
        specification=hc.Specification(uncertainty="corners"),
    )


def test_poles_of_the_plant_lie_left_of_their_slowest_and_not_left_of_half_of_it(family):
    slowest = family.poles().real.max()
    assert_poles_in(family, HalfPlane(slowest * 0.999))
    with pytest.raises(AssertionError, match=r"x=-?0\.1, y=0\.\d+ m: pole -0\.\d+.*off by"):
        assert_poles_in(family, HalfPlane(2.0 * slowest))


def test_the_damping_cone_is_the_damping_ratio_of_the_worst_pair(family):
    poles = family.poles()
    least = (-poles.real / np.abs(poles)).min()
    assert_poles_in(family, DampingCone(least * 0.9999))
    with pytest.raises(AssertionError, match="off by"):
        assert_poles_in(family, DampingCone(least * 1.01))


def test_flagged_points_of_a_family_do_not_count(reference):
    points = hc.find_operating_points(reference, np.array([0.0, 0.5]), 0.2)
    assert_poles_in(hc.linearize(reference, points), HalfPlane())


def test_sampled_loops_of_a_schedule_lie_in_the_unit_disk(schedule):
    assert_poles_in(schedule, Disk(1.0))
    count = 5 * schedule.design_x.size * schedule.design_y.size
    with pytest.raises(
        AssertionError, match=rf"of {count} points.*x=-?1, y=0.* m, (nominal|bulk_modulus)"
    ):
        assert_poles_in(schedule, Disk(0.5))


def test_margins_that_hold_pass(schedule):
    assert_margins(schedule, Ms=1.62, Mt=1.3, gain_margin=2.0, phase_margin=np.radians(60))


def test_every_margin_that_is_missed_is_named_with_its_place(schedule):
    with pytest.raises(
        AssertionError, match=r"Ms is 1\.6\d+ at x=.* y=.* limit 1\.5, off by 0\.1.*; crossover is"
    ) as caught:
        assert_margins(schedule, Ms=1.5, crossover=1e4, Mt=1.3)
    assert "Mt" not in str(caught.value)


def test_an_unknown_margin_is_a_type_error(schedule):
    with pytest.raises(TypeError, match="unknown margin MS"):
        assert_margins(schedule, MS=2.0)
