"""Margins against published loops, python-control and closed forms."""

from dataclasses import dataclass, replace

import control
import numpy as np
import pytest

from hydroctl.loop.margins import Loop, analyse
from hydroctl.loop.sampled_plant import sample
from hydroctl.regulator.forms import StandardForm
from hydroctl.regulator.linear import series
from hydroctl.regulator.structures import Regulators

TS = 1e-3


@dataclass
class Published:
    """Continuous loops given as transfer functions, in the shape that `analyse` reads."""

    loops: list

    @property
    def shape(self):
        return (len(self.loops),)

    def frequency_response(self, omega):
        return np.array(
            [
                loop(1j * np.broadcast_to(omega, (len(self.loops), np.shape(omega)[-1]))[i])
                for i, loop in enumerate(self.loops)
            ]
        )

    def take(self, indices):
        return Published([self.loops[i] for i in indices])

    def poles(self):
        return np.exp(np.array([control.feedback(loop, 1).poles() for loop in self.loops]))


@pytest.fixture(scope="module")
def regulated(family):
    plant = sample(family, loop="velocity", sample_time=TS, delay_samples=1)
    gain = np.ones(plant.shape)
    return Loop(
        plant,
        Regulators(
            TS, 0.3 * gain, 300.0 * gain, 1e-3 * gain, plant.resonance[..., 0], 5e-4, 0.3, 0.8
        ),
    )


def test_three_equal_lags():
    s = control.tf("s")
    found = analyse(Published([3 / (s + 1) ** 3]), np.geomspace(1e-3, 1e2, 400))
    assert found.gain_margin[0] == pytest.approx(8 / 3, rel=1e-12)
    assert found.phase_crossings.omega[0] == pytest.approx(np.sqrt(3), rel=1e-12)
    assert np.degrees(found.phase_margin[0]) == pytest.approx(41.690, abs=5e-4)
    assert found.stable.all()


def test_a_resonant_loop_has_three_gain_crossings():
    s = control.tf("s")
    loop = (
        8.75
        * (4 * s**2 + 0.4 * s + 1)
        / ((100 * s + 1) * (s**2 + 0.22 * s + 1) * (s**2 / 100 + 0.008 * s + 1))
    )
    found = analyse(Published([loop]), np.geomspace(1e-3, 1e2, 4000))
    np.testing.assert_allclose(
        np.degrees(found.gain_crossings.phase_margins()), [97.594, -157.785, 134.733], atol=1e-3
    )
    upward = np.abs(found.phase_crossings.response) < 1
    assert 1 / np.abs(found.phase_crossings.response[upward]) == pytest.approx(2.2716, abs=5e-5)
    assert found.phase_crossings.omega[upward] == pytest.approx(10.005, abs=5e-4)


@pytest.mark.parametrize("k", [0.7, 2.0, 6.0])
def test_the_resonance_peak_of_a_second_order_loop_is_the_textbook_one(k):
    """L = k/(s (s + 1)) closes to k/(s^2 + s + k) with zeta = 1/(2 sqrt(k)): Mt is
    1/(2 zeta sqrt(1 - zeta^2)), at w = sqrt(k (1 - 2 zeta^2))."""
    s, zeta = control.tf("s"), 0.5 / np.sqrt(k)
    found = analyse(Published([k / (s * (s + 1))]), np.geomspace(1e-3, 1e2, 400))
    assert found.Mt[0] == pytest.approx(0.5 / (zeta * np.sqrt(1.0 - zeta**2)), rel=1e-9)
    assert found.Mt_frequency[0] == pytest.approx(np.sqrt(k * (1.0 - 2.0 * zeta**2)), rel=1e-3)


def test_a_loop_that_lower_gain_unsettles_has_no_gain_margin_above_one():
    """L = 2 (s + 1)^2/s^3 crosses -180 degrees once, at w = 1, where it is -4: a quarter
    of the gain is the least, and there is no largest."""
    s = control.tf("s")
    found = analyse(Published([2 * (s + 1) ** 2 / s**3]), np.geomspace(1e-3, 1e2, 400))
    assert found.stable.all()
    assert found.phase_crossings.response.real == pytest.approx([-4.0], rel=1e-9)
    assert found.gain_margin[0] == np.inf


def test_phase_margins_may_be_negative_and_the_delay_margin_goes_the_long_way_round():
    """L = -a/(s^2 + 2 zeta s + 1), a < 1, is stable. It crosses |L| = 1 where
    (1 - w^2)^2 + (2 zeta w)^2 = a^2, twice, with -L lagging by phi = atan2(2 zeta w, 1 - w^2): less
    lag by phi leads to -1, and so does more by 2 pi - phi."""
    a, zeta, s = 0.8, 0.1, control.tf("s")
    half, root = 1.0 - 2.0 * zeta**2, np.sqrt((1.0 - 2.0 * zeta**2) ** 2 - 1.0 + a**2)
    omega = np.sqrt([half - root, half + root])
    lag = np.arctan2(2.0 * zeta * omega, 1.0 - omega**2)
    found = analyse(Published([-a / (s**2 + 2 * zeta * s + 1)]), np.geomspace(1e-3, 1e2, 4000))
    assert found.stable.all()
    np.testing.assert_allclose(found.gain_crossings.phase_margins(), -lag, rtol=1e-9)
    assert found.phase_margin[0] == pytest.approx(lag.min(), rel=1e-9)
    assert found.delay_margin[0] == pytest.approx(((2.0 * np.pi - lag) / omega).min(), rel=1e-9)
    assert found.crossover[0] == pytest.approx(omega.max(), rel=1e-9)
    for factor, stable in ((0.98, True), (1.02, False)):
        delayed = (
            -a
            / (s**2 + 2 * zeta * s + 1)
            * control.tf(*control.pade(factor * found.delay_margin[0], 12))
        )
        assert (control.feedback(delayed, 1).poles().real.max() < 0.0) == stable


@dataclass
class DelayedLag(Published):
    """A regulator on e^{-s}/(s + 1); the poles are those with the delay as a Pade fraction of order
    12."""

    regulator: StandardForm

    def take(self, indices):
        return replace(self, loops=[self.loops[i] for i in indices])

    def poles(self):
        K, Ti, Td = self.regulator.K, self.regulator.Ti, self.regulator.Td
        law = control.tf([K * Ti * Td, K * Ti, K], [Ti, 0.0])
        loop = law * control.tf(*control.pade(1.0, 12)) * control.tf([1.0], [1.0, 1.0])
        return np.exp([control.feedback(loop, 1).poles()] * len(self.loops))


def test_amigo_rules_reach_their_published_sensitivity_on_a_delayed_lag():
    """Astrom and Hagglund (2004): K = (0.2 + 0.45 T/L)/Kp, Ti = L (0.4 L + 0.8 T)/(L + 0.1 T), Td =
    0.5 L T/(0.3 L + T) with L = T = 1."""
    regulator = StandardForm(K=0.65, Ti=1.2 / 1.1, Td=0.5 / 1.3)
    assert (regulator.Ti, regulator.Td) == pytest.approx((1.09091, 0.38462), abs=5e-6)
    loop = DelayedLag(
        [lambda s: regulator.frequency_response(s.imag) * np.exp(-s) / (s + 1)], regulator
    )
    found = analyse(loop, np.geomspace(1e-3, 1e2, 2000))
    assert found.Ms[0] == pytest.approx(1.3979, abs=5e-5)
    assert found.stable.all()


def test_sampled_loops_agree_with_python_control(regulated):
    found = analyse(regulated)
    for index in ((0, 0), (2, 1)):
        flat = np.ravel_multi_index(index, regulated.shape)
        omega = np.geomspace(20.0, np.pi / TS, 1501)
        response = regulated.take([flat]).frequency_response(omega)[0]
        gm, pm, _, wpc, wgc, _ = control.stability_margins(control.frd(response, omega))
        assert found.gain_margin[index] == pytest.approx(gm, rel=1e-4)
        assert np.degrees(found.phase_margin[index]) == pytest.approx(pm, rel=1e-4)
        assert found.crossover[index] == pytest.approx(wgc, rel=1e-4)
        assert found.phase_crossings.omega[
            found.phase_crossings.index == flat
        ].min() == pytest.approx(wpc, rel=1e-4)


def test_peaks_are_found_between_grid_frequencies(regulated):
    found = analyse(regulated)
    flat = regulated.take(np.arange(12))
    near = found.Ms_frequency.reshape(-1, 1) * np.linspace(0.97, 1.03, 2001)
    dense = (1 / np.abs(1 + flat.frequency_response(near))).max(axis=-1)
    np.testing.assert_allclose(found.Ms.ravel(), dense, rtol=1e-8)


def test_closed_loop_poles_agree_with_python_control(regulated):
    A, B, C = (part[1, 2] if part.ndim > 2 else part for part in regulated.plant.state_space())
    law = control.ss(*(part[1, 2] for part in regulated.regulators.state_space()), TS)
    closed = control.feedback(control.ss(A, B, C, 0, TS) * law, 1)
    np.testing.assert_allclose(
        np.sort_complex(regulated.poles()[1, 2]), np.sort_complex(closed.poles()), atol=1e-7
    )


@pytest.mark.parametrize(("factor", "stable"), [(0.999, True), (1.001, False)])
def test_the_gain_margin_is_where_stability_ends(regulated, factor, stable):
    law, margin = regulated.regulators, factor * analyse(regulated).gain_margin
    scaled = replace(law, kp=margin * law.kp, ki=margin * law.ki, kd=margin * law.kd)
    assert np.all(analyse(Loop(regulated.plant, scaled)).stable == stable)


@pytest.mark.parametrize(("factor", "stable"), [(0.98, True), (1.02, False)])
def test_the_delay_margin_is_where_stability_ends(family, factor, stable):
    plant = sample(family, loop="position", sample_time=TS, delay_samples=1)
    gain = np.ones(plant.shape)
    law = Regulators(TS, 300.0 * gain, 0.0 * gain, 0.0 * gain, gain, 5e-4, 1.0, 1.0)
    margin = analyse(Loop(plant, law)).delay_margin
    later = sample(
        family, loop="position", sample_time=TS, delay_samples=1 + factor * margin.min() / TS
    )
    worst = np.unravel_index(np.argmin(margin), margin.shape)
    assert analyse(Loop(later, law)).stable[worst] == stable


def test_the_disk_margin_is_never_better_than_gain_and_phase_margin(regulated):
    found = analyse(regulated)
    d = found.disk_margin
    assert np.all((2 + d) / (2 - d) <= found.gain_margin * (1 + 1e-9))
    assert np.all(2 * np.arctan(d / 2) <= found.phase_margin * (1 + 1e-9))


@pytest.mark.parametrize("k", [0.05, 0.5, 2.0, 6.0])
def test_the_disk_margin_of_a_lagging_integrator_is_its_closed_form(k):
    """L = k/(s (s + 1)): 4 |1 + L|^2/|1 - L|^2 = 4 - 16 k w^2/((k + w^2)^2 + w^2) is least at w^2 =
    k, where it is 4/(1 + 4 k)."""
    s = control.tf("s")
    found = analyse(Published([k / (s * (s + 1))]), np.geomspace(1e-3, 1e2, 4000))
    assert found.disk_margin[0] == pytest.approx(2.0 / np.sqrt(1.0 + 4.0 * k), rel=1e-9)


def test_the_disk_margin_of_an_integrator_is_that_of_any_positive_gain_and_a_right_angle():
    """|1 + k/(jw)| = |1 - k/(jw)|: the disk is the whole right half-plane, d = 2."""
    s = control.tf("s")
    found = analyse(Published([3.0 / s]), np.geomspace(1e-2, 1e3, 500))
    assert found.disk_margin[0] == pytest.approx(2.0, rel=1e-12)


def _turned(d, count=360):
    """The factors (2 + delta)/(2 - delta) with |delta| = d: the border of the disk, gain and phase
    at once."""
    delta = d * np.exp(2j * np.pi * np.arange(count) / count)
    return (2.0 + delta) / (2.0 - delta)


@pytest.mark.parametrize(("share", "stable"), [(0.999, True), (1.001, False)])
def test_no_factor_within_the_disk_margin_unsettles_a_loop_and_one_beyond_does(share, stable):
    """By the roots of s (s + 1) + f k, whose coefficients may be complex. The pure gain and the
    pure phase that a disk margin d stands for lie on the border."""
    k = 2.0
    s = control.tf("s")
    found = analyse(Published([k / (s * (s + 1))]), np.geomspace(1e-3, 1e2, 4000))
    d = share * found.disk_margin[0]
    factors = _turned(d)
    assert factors[0] == pytest.approx((2.0 + d) / (2.0 - d), rel=1e-12)
    assert np.angle(factors[90]) == pytest.approx(2.0 * np.arctan(d / 2.0), rel=1e-12)
    assert all(np.roots([1.0, 1.0, factor * k]).real.max() < 0.0 for factor in factors) == stable


@pytest.mark.parametrize(("share", "stable"), [(0.99, True), (1.01, False)])
def test_sampled_loops_bear_every_factor_within_their_disk_margin_and_not_beyond(
    regulated, share, stable
):
    plant = *regulated.plant.state_space(), np.zeros((1, 1))
    A, B, C, _ = series(regulated.regulators.state_space(), plant)
    factors = _turned(share * analyse(regulated).disk_margin[..., None])[..., None, None]
    poles = np.linalg.eigvals(A[..., None, :, :] - factors * (B @ C)[..., None, :, :])
    assert np.all((np.abs(poles).max(axis=(-2, -1)) < 1.0) == stable)


class Rounded(Published):
    """Loops whose response is another in the last digit where one frequency a loop is asked for, as
    another order of sums gives."""

    def frequency_response(self, omega):
        response = super().frequency_response(omega)
        return response * (1.0 + 4.0 * np.finfo(float).eps) if response.shape[-1] == 1 else response

    def take(self, indices):
        return Rounded([self.loops[i] for i in indices])


def test_a_grid_frequency_that_is_a_crossing_to_within_rounding_is_the_crossing():
    """On the grid |L| falls just below 1 at its last but one frequency, and nowhere when it is
    evaluated alone."""
    s = control.tf("s")
    first = 3.0 * (1.0 + 2.0 * np.finfo(float).eps)
    found = analyse(
        Rounded([3 / s]), np.array([1.0, 2.0, first, 3.0 * (1.0 + 3.0 * np.finfo(float).eps), 6.0])
    )
    assert found.crossover[0] == pytest.approx(3.0, rel=1e-14)
    assert np.degrees(found.phase_margin[0]) == pytest.approx(90.0, rel=1e-12)
