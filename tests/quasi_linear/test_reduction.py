"""Second-order models: what they keep exactly, and that their stated error is the error."""

import numpy as np
import pytest
from scipy.optimize import least_squares

import hydroctl as hc
from hydroctl import reduce_order

METHODS = ("matched", "least-squares", "paper")


def fast_machine() -> hc.Actuator:
    """A small cylinder on a large valve, whose slow pole is not slow: the reduction fails at large
    openings."""
    return hc.load_actuator("fast_50_28")


def family(
    actuator, *, form="tangent", openings=(0.05, 0.2, 0.5, 1.0), y=(0.02, 0.1, 0.25, 0.4, 0.48)
):
    x = np.array([-value for value in openings[::-1]] + list(openings))
    return hc.linearize(
        actuator, hc.find_operating_points(actuator, x[:, None], np.array(y)), form=form
    )


@pytest.mark.parametrize("form", ["tangent", "secant"])
def test_matched_keeps_two_poles_and_the_static_gain(form):
    models = family(fast_machine(), form=form)
    reduced = reduce_order(models)
    pair = models.poles()[..., 1:]
    np.testing.assert_allclose(reduced.a1, -pair.sum(axis=-1).real, rtol=1e-10)
    np.testing.assert_allclose(reduced.a2, pair.prod(axis=-1).real, rtol=1e-10)
    np.testing.assert_allclose(reduced.static_gain(), models.static_gain(), rtol=1e-14)


@pytest.mark.parametrize("method", ["least-squares", "paper"])
def test_static_gain_is_kept_by_least_squares_and_only_near_mid_stroke_by_the_paper(method):
    models = family(hc.load_actuator("reference"), form="secant", openings=(0.1, 0.5))
    ratio = reduce_order(models, method=method).static_gain() / models.static_gain()
    if method == "least-squares":
        np.testing.assert_allclose(ratio, 1.0, rtol=1e-14)
    else:
        np.testing.assert_allclose(ratio[np.abs(models.points.x[:, 2]) == 0.1, 2], 1.0, rtol=1e-12)
        assert np.ptp(ratio) > 0.25


@pytest.mark.parametrize("form", ["tangent", "secant"])
@pytest.mark.parametrize("method", METHODS)
def test_stated_error_is_the_largest_of_a_dense_frequency_grid(method, form):
    reduced = reduce_order(family(fast_machine(), form=form), method=method)
    omega = reduced.band[..., None] * np.linspace(0.0, 1.0, 20_001)
    third = reduced.family.numerator, reduced.family.denominator
    s = 1j * omega
    (n1, n0), (_, d2, d1, d0) = (np.moveaxis(c, -1, 0)[..., None] for c in third)
    a1, a2, b = (c[..., None] for c in (reduced.a1, reduced.a2, reduced.b))
    error = np.abs(
        b / (s**2 + a1 * s + a2) * (s**3 + d2 * s**2 + d1 * s + d0) / (n1 * s + n0) - 1.0
    )
    largest = error.max(axis=-1)
    assert (reduced.error >= largest - 1e-12).all()
    np.testing.assert_allclose(
        reduced.error,
        largest,
        rtol=1e-4,
        err_msg="between two grid frequencies 0.01 % of the band apart",
    )
    there = np.abs(reduced.relative_error(reduced.error_frequency[..., None]))[..., 0]
    np.testing.assert_array_equal(reduced.error, there)


def test_error_of_cancelling_on_a_fast_machine_grows_to_62_per_cent():
    reduced = reduce_order(family(fast_machine()), omega_max=1e5)
    worst = {
        opening: reduced.error[np.abs(reduced.points.x) == opening].max()
        for opening in (0.2, 0.5, 1.0)
    }
    assert worst == pytest.approx({0.2: 0.01, 0.5: 0.12, 1.0: 0.62}, rel=0.1)


def test_least_squares_reduction_of_a_fast_machine_is_8_per_cent_off_at_half_opening():
    reduced = reduce_order(family(fast_machine()), method="least-squares")
    assert reduced.error[np.abs(reduced.points.x) == 0.5].max() == pytest.approx(0.08, abs=0.005)


def test_least_squares_agrees_with_a_general_solver():
    reduced = reduce_order(family(fast_machine()), method="least-squares")
    matched = reduce_order(reduced.family)
    gain, natural = reduced.family.static_gain(), matched.natural_frequency
    for index in np.ndindex(reduced.shape):
        omega = natural[index] * np.geomspace(0.1, 3.0, 61)
        third = reduced.family.frequency_response(omega[None])[index].ravel()

        def residual(theta, index=index, omega=omega, third=third):
            a1, a2 = theta[0] * natural[index], theta[1] * natural[index] ** 2
            error = gain[index] * a2 / (a2 - omega**2 + 1j * a1 * omega) / third - 1.0
            return np.concatenate([error.real, error.imag])

        a1, a2 = least_squares(residual, [0.5, 1.0], xtol=1e-14, ftol=1e-14, gtol=1e-14).x
        assert reduced.a1[index] / natural[index] == pytest.approx(a1, rel=1e-6)
        assert reduced.a2[index] / natural[index] ** 2 == pytest.approx(a2, rel=1e-6)


def test_points_above_the_tolerance_are_refused_with_frequency_and_way_out():
    reduced = reduce_order(family(fast_machine()), tolerance=0.05)
    assert reduced.accepted[np.abs(reduced.points.x) <= 0.2].all()
    assert not reduced.accepted[0, -1]
    assert (reduced.accepted == (reduced.error <= 0.05)).all()
    assert "above the tolerance of 5%. Use the third-order model" in reduced.reason[0, -1]
    assert (reduced.reason[reduced.accepted] == "").all()


@pytest.mark.parametrize("method", METHODS)
def test_an_infeasible_point_is_flagged_and_does_not_spoil_its_neighbours(method):
    actuator = hc.load_actuator("reference")
    points = hc.find_operating_points(actuator, np.array([0.1, 0.0, 0.5]), 0.2)
    reduced = reduce_order(hc.linearize(actuator, points), method=method)
    np.testing.assert_array_equal(reduced.accepted, [True, False, True])
    assert np.isnan(reduced.a2[1])
    assert np.isnan(reduced.error[1])
    assert "valve is closed" in reduced.reason[1]


def test_symmetric_cylinder_at_mid_stroke_loses_nothing():
    actuator = hc.load_actuator("reference").replace(
        leakage=0.0, area_b=0.035, volume_a=0.01, volume_b=0.01 + 0.035 * 0.5
    )
    reduced = reduce_order(
        hc.linearize(actuator, hc.find_operating_points(actuator, np.array([-0.7, 0.3]), 0.25))
    )
    np.testing.assert_allclose(reduced.error, 0.0, atol=1e-10)


def test_a_machine_with_three_real_poles_is_reduced_to_the_two_fast_ones():
    actuator = fast_machine().replace(viscous_friction=1e6)
    reduced = reduce_order(
        hc.linearize(actuator, hc.find_operating_points(actuator, np.array([0.01]), 0.2))
    )
    assert (reduced.damping > 1.0).all()
    assert (reduced.error < 0.01).all()


def test_every_bad_argument_is_named_at_once():
    with pytest.raises(hc.InputError) as caught:
        reduce_order(family(fast_machine()), method="match", tolerance=-1.0, omega_max=0.0)
    assert len(caught.value.faults) == 3
    assert "did you mean 'matched'" in caught.value.faults[0]
