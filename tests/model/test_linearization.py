"""Equation (2): published poles and zeros, python-control as the second route, flags."""

import numpy as np
import pytest
from machines import DIFFERENTIAL, LOSSLESS, REFERENCE, mirrored

import hydroctl as hc
from hydroctl.model import plant
from hydroctl.model.cubic_roots import cubic_roots

OVERLAPPED = DIFFERENTIAL.replace(name="overlapped", dead_band=0.05)
REAL = OVERLAPPED.replace(
    name="real",
    coulomb_friction=1000.0,
    breakaway_friction=1500.0,
    stribeck_speed=0.02,
    load_force=2e4,
)
GRID_X = np.array([-1.0, -0.1, 0.02, 0.1, 1.0])[:, None]
GRID_Y = np.array([0.0, 0.2, 0.5])
# x, y, slow pole, complex pair, secant zero, tangent zero: zero leakage; the first five are Table 1
# of the source paper
PUBLISHED = [
    (0.1, 0.1, "-0.602292", "-100.373", "540.126", "-0.553428", "-0.602306"),
    (0.1, 0.4, "-0.624809", "-100.316", "491.445", "-0.696633", "-0.624829"),
    (1.0, 0.1, "-6.04729", "-103.749", "540.736", "-5.55590", "-6.04867"),
    (1.0, 0.4, "-6.27291", "-103.179", "492.015", "-6.99936", "-6.27485"),
]


def _family(actuator, form="tangent", x=GRID_X, y=GRID_Y):
    return hc.linearize(actuator, hc.find_operating_points(actuator, x, y), form=form)


def _as_printed(value: float, like: str) -> str:
    return f"{value:.{len(like.partition('.')[2])}f}"


@pytest.mark.parametrize(("x", "y", "slow", "real", "imaginary", "secant", "tangent"), PUBLISHED)
def test_poles_and_zeros_to_the_printed_digits(x, y, slow, real, imaginary, secant, tangent):
    families = {form: _family(LOSSLESS, form, [x], y) for form in ("secant", "tangent")}
    for form, zero in (("secant", secant), ("tangent", tangent)):
        poles = families[form].poles()[0]
        assert _as_printed(poles[0].real, slow) == slow
        assert _as_printed(poles[1].real, real) == real
        assert _as_printed(poles[1].imag, imaginary) == imaginary
        assert poles[2] == np.conj(poles[1])
        assert _as_printed(families[form].zeros()[0, 0], zero) == zero


def test_poles_and_zero_with_leakage_to_the_printed_digits():
    family = _family(REFERENCE, "secant", [0.1], 0.1)
    assert _as_printed(family.zeros()[0, 0], "-0.574020") == "-0.574020"
    poles = family.poles()[0]
    assert (_as_printed(poles[0].real, "-0.606369"), _as_printed(poles[1].real, "-100.709975")) == (
        "-0.606369",
        "-100.709975",
    )
    assert _as_printed(poles[1].imag, "540.187703") == "540.187703"


def test_the_differential_cylinder_has_its_published_dynamics():
    family = _family(DIFFERENTIAL, "tangent", [0.5], 0.5)
    assert abs(family.points.v[0] - 0.2250057) < 1e-6
    poles = family.poles()[0]
    np.testing.assert_allclose(
        [poles[0].real, poles[1].real, poles[1].imag], [-33.57282, -24.70069, 432.71317], rtol=1e-6
    )
    np.testing.assert_allclose(family.zeros()[0, 0], -33.56498, rtol=1e-6)


def test_symmetric_cylinder_at_mid_stroke_cancels_exactly():
    symmetric = DIFFERENTIAL.replace(
        area_b=DIFFERENTIAL.area_a,
        volume_b=2e-4 + DIFFERENTIAL.area_a,
        leakage=0.0,
        tank_pressure=0.0,
    )
    family = _family(symmetric, "tangent", np.array([-1.0, -0.1, 0.3]), 0.5)
    np.testing.assert_allclose(family.zeros()[:, 0], family.poles()[:, 0].real, rtol=1e-12)


@pytest.mark.parametrize("form", ["tangent", "secant"])
@pytest.mark.parametrize(
    "actuator", [REFERENCE, LOSSLESS, DIFFERENTIAL], ids=lambda actuator: actuator.name
)
def test_coefficients_and_poles_agree_with_python_control(actuator, form):
    import control

    family = _family(actuator, form)
    omega = np.geomspace(0.1, 2000.0, 40)
    scale = np.diag(
        [1e5, 1e5, 1e-2]
    )  # pressures in bar, speed in cm/s: without it the conversions of python-control lose digits
    for index in np.ndindex(family.shape):
        A, B = (
            np.linalg.solve(scale, family.A[index] @ scale),
            np.linalg.solve(scale, family.B[index]),
        )
        poles = np.sort_complex(np.linalg.eigvals(A))
        np.testing.assert_allclose(np.sort_complex(family.poles()[index]), poles, rtol=1e-9)
        scaled = control.ss(A, B, family.C @ scale, family.D)
        np.testing.assert_allclose(
            family.frequency_response(omega)[index], scaled(1j * omega), rtol=1e-9
        )
        zeros = scaled.zeros()
        np.testing.assert_allclose(
            family.zeros()[index][0], zeros[np.argmin(np.abs(zeros))].real, rtol=1e-8
        )
        model = family[index]
        np.testing.assert_allclose(
            model.transfer_function()(1j * omega), scaled(1j * omega), rtol=1e-9
        )
        np.testing.assert_allclose(model.state_space().A, family.A[index], rtol=0)


@pytest.mark.parametrize("actuator", [REFERENCE, DIFFERENTIAL], ids=lambda actuator: actuator.name)
def test_coefficients_are_those_of_complex_step_derivatives_to_1e_10(actuator):
    family, p, step = _family(actuator), plant.parameters(actuator), 1e-30
    scale = np.diag([1e5, 1e5, 1e-2])
    for index in np.ndindex(family.shape):
        z = np.array([family.points.p_a[index], family.points.p_b[index], family.points.v[index]])
        x, y = np.complex128(family.points.x[index]), family.points.y[index]
        slopes = [
            np.imag(plant.rates(*(z + 1j * step * unit), y, x, 0.0, p)) / step for unit in np.eye(3)
        ]
        b = np.linalg.solve(scale, np.imag(plant.rates(*z, y, x + 1j * step, 0.0, p)) / step)
        A = np.linalg.solve(scale, np.array(slopes).T @ scale)
        np.testing.assert_allclose(family.denominator[index], np.poly(A), rtol=1e-10)
        b_v = np.array([0.0, 0.0, scale[2, 2]])
        numerator = [b_v @ b, b_v @ (A - np.trace(A) * np.eye(3)) @ b, b_v @ _adjugate(A) @ b]
        np.testing.assert_allclose(family.numerator[index], numerator[1:], rtol=1e-10)
        assert numerator[0] == 0.0


def _adjugate(A):
    """det(A) A^-1; c (s I - A)^-1 b det(s I - A) = c (s^2 + s (A - tr A) + adj A) b."""
    return np.linalg.det(A) * np.linalg.inv(A)


def test_members_carry_named_signals():
    model = _family(REFERENCE)[0, 1]
    system, transfer = model.state_space(), model.transfer_function()
    assert (system.input_labels, system.output_labels, system.state_labels) == (
        ["x"],
        ["v"],
        ["p_a", "p_b", "v"],
    )
    assert (transfer.input_labels, transfer.output_labels) == (["x"], ["v"])
    assert len(transfer.num[0][0]) == 2
    assert len(transfer.den[0][0]) == 4


@pytest.mark.parametrize(
    "actuator", [REFERENCE, LOSSLESS, DIFFERENTIAL, OVERLAPPED], ids=lambda actuator: actuator.name
)
def test_the_secant_gain_is_speed_over_opening(actuator):
    family = _family(actuator, "secant", np.array([-1.0, -0.1, 0.1, 0.7]), 0.2)
    np.testing.assert_allclose(family.static_gain(), family.points.v / family.points.x, rtol=1e-10)


@pytest.mark.parametrize(
    "actuator", [REFERENCE, DIFFERENTIAL, OVERLAPPED, REAL], ids=lambda actuator: actuator.name
)
def test_the_tangent_gain_is_the_slope_of_speed_over_opening(actuator):
    x, step = np.array([-0.8, -0.1, 0.1, 0.8]), 1e-3
    shifts = np.array([-2.0, -1.0, 1.0, 2.0])[:, None] * step * np.abs(x)
    far, near, next_, last = hc.find_operating_points(actuator, x + shifts, 0.2).v
    slope = (far - 8 * near + 8 * next_ - last) / (
        12 * step * np.abs(x)
    )  # error of order step^4 = 1e-12, rounding 1e-16/step
    np.testing.assert_allclose(
        _family(actuator, "tangent", x, 0.2).static_gain(), slope, rtol=1e-10
    )


def test_both_forms_have_the_same_poles():
    tangent, secant = (_family(REFERENCE, form).poles() for form in ("tangent", "secant"))
    np.testing.assert_allclose(
        np.sort_complex(tangent), np.sort_complex(secant), rtol=1e-14
    )  # the search starts at the zero


def test_all_poles_are_stable_and_one_pair_is_lightly_damped():
    poles = _family(REFERENCE).poles()
    assert (poles.real < 0).all()
    damping = -poles[..., 1].real / np.abs(poles[..., 1])
    assert ((damping > 0.16) & (damping < 0.21)).all()


def test_the_mirrored_machine_has_the_same_model():
    there, back = (
        _family(DIFFERENTIAL, x=[[-0.6], [0.2]], y=[0.1, 0.7]),
        _family(mirrored(DIFFERENTIAL), x=[[0.6], [-0.2]], y=[0.9, 0.3]),
    )
    np.testing.assert_allclose(there.numerator, back.numerator, rtol=1e-12)
    np.testing.assert_allclose(there.denominator, back.denominator, rtol=1e-12)


def test_a_flagged_point_holds_nan_and_raises_its_reason_when_taken():
    family = _family(REFERENCE, x=[0.0, 0.5], y=0.1)
    assert np.isnan(family.A[0]).all()
    assert np.isnan(family.poles()[0]).all()
    assert np.isfinite(family.A[1]).all()
    with pytest.raises(hc.OperatingPointError, match="closed"):
        family[0]
    with pytest.raises(hc.InputError, match="one index per axis"):
        _family(REFERENCE)[0]


def test_bad_input_names_the_way_out():
    points = hc.find_operating_points(REFERENCE, 0.1, 0.1)
    with pytest.raises(hc.InputError, match="'tangential' is unknown; did you mean 'tangent'"):
        hc.linearize(REFERENCE, points, form="tangential")
    with pytest.raises(hc.InputError, match="another actuator"):
        hc.linearize(DIFFERENTIAL, points)


ROOTS = [
    (-1.0, -2.0, -3.0),
    (-0.6, -100 + 540j, -100 - 540j),
    (-5.0, -5.0, -5.0),
    (1 / 3, 1 / 3, 1 / 3),
    (-0.1, -0.1, -0.1),
    (-1.0, -1.0, -4.0),
    (-1e-6, -300 + 1j, -300 - 1j),
    (0.0, -1.0 + 2j, -1.0 - 2j),
    (3.0, -2.0, 1e4),
]


@pytest.mark.parametrize("near", [-0.59, 0.0, 1e7, -1.5])
@pytest.mark.parametrize("roots", ROOTS)
def test_cubic_roots_rebuild_the_polynomial_with_the_real_root_nearest_to_the_hint_first(
    roots, near
):
    coefficients = np.poly(roots).real[1:]
    found = cubic_roots(coefficients, near)
    scale = np.abs(np.poly(-np.abs(roots))[1:])
    assert (np.abs(np.poly(found)[1:] - coefficients) <= 1e-13 * scale).all()
    assert found[0].imag == 0.0
    real = [root for root in roots if np.imag(root) == 0.0]
    separation = (
        min(abs(a - b) for a in roots for b in roots if a != b) if len(set(roots)) > 1 else 0.0
    )
    distance = abs(found[0] - min(real, key=lambda root: abs(root - near)))
    assert (
        distance <= max(1e-9 * abs(found[0]), 1e-4 * (len(set(roots)) < 3))
        or abs(abs(near - found[0]) - distance) > separation
    )


@pytest.mark.parametrize("near", [1.0, -5.0, np.nan, np.inf])
def test_cubic_roots_are_numbers_where_their_powers_vanish(near):
    np.testing.assert_allclose(
        cubic_roots(np.array([0.0, 1e-120, 0.0]), near), [0.0, 1e-60j, -1e-60j], atol=1e-70
    )


def test_cubic_roots_of_many_are_those_of_each_and_not_a_number_stays_so():
    rng = np.random.default_rng(5)
    roots = np.stack(
        [
            -rng.uniform(0.01, 900, 400),
            *(-rng.uniform(1, 400, 400) + s * 1j * rng.uniform(1, 600, 400) for s in (1, -1)),
        ],
        -1,
    )
    roots[:, 2] = np.conj(roots[:, 1])
    roots[::7] = -rng.uniform(0.1, 500, (58, 3))
    coefficients = np.array([np.poly(row).real[1:] for row in roots])
    coefficients[3] = np.nan
    near = roots[:, 0].real * rng.uniform(0.9, 1.1, 400)
    together = cubic_roots(coefficients.reshape(20, 20, 3), near.reshape(20, 20)).reshape(400, 3)
    assert np.isnan(together[3]).all()
    for k in set(range(400)) - {3}:
        np.testing.assert_allclose(
            together[k], cubic_roots(coefficients[k], near[k]), rtol=1e-11
        )  # close real roots magnify rounding
        np.testing.assert_allclose(
            np.sort_complex(together[k]),
            np.sort_complex(np.roots([1, *coefficients[k]])),
            rtol=1e-7,
        )
