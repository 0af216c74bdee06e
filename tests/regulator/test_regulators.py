"""Regulator structures: three descriptions of one law, and the law of the notch."""

import control
import numpy as np
import pytest

import hydroctl as hc
from hydroctl.regulator.structures import STRUCTURES, Regulators, require_structure, section_count

TS = 1e-3
OMEGA = np.array([0.5, 40.0, 540.0, 1500.0])
Z = np.exp(1j * OMEGA * TS)


def _regulators(structure):
    rng = np.random.default_rng(5)
    used = STRUCTURES[structure]
    gains = {name: rng.uniform(0.5, 2.0, (2, 3)) * (name in used) for name in ("kp", "ki", "kd")}
    zz = 0.2 if "notch" in structure else 0.8
    sections = ((0.5, 3.0), (0.05, 0.02))[: section_count(structure)]
    return Regulators(
        TS,
        **gains,
        notch_frequency=np.full((2, 3), 540.0),
        Tf=5e-4,
        zz=zz,
        zp=0.8,
        sections=sections,
        Tm=2e-3,
    )


def _by_hand(regulators, index):
    """C(z) written out from the difference equations."""
    r = regulators[index]
    s = r.notch_frequency / np.tan(r.notch_frequency * TS / 2) * (Z - 1) / (Z + 1)
    wn = r.notch_frequency
    notch = (s**2 + 2 * r.zz * wn * s + wn**2) / (s**2 + 2 * r.zp * wn * s + wn**2)
    led = np.prod(
        [(s / (zero * wn) + 1) / (s / (pole * wn) + 1) for zero, pole in r.sections], axis=0
    )
    filtered = TS / (TS + r.Tm * (1 - 1 / Z))
    return (
        (r.kp + r.ki * TS / (Z - 1) + r.kd * (1 - 1 / Z) / (r.Tf * (1 - 1 / Z) + TS))
        * notch
        * led
        * filtered
    )


@pytest.mark.parametrize("structure", STRUCTURES)
def test_response_transfer_function_and_states_are_the_same_law(structure):
    regulators = _regulators(structure)
    expected = _by_hand(regulators, (1, 2))
    np.testing.assert_allclose(regulators.frequency_response(OMEGA)[1, 2], expected, rtol=1e-10)
    polynomials = regulators[1, 2].transfer_function()(
        Z
    )  # their rounding grows towards z = 1, where up to six poles lie
    np.testing.assert_allclose(polynomials[0], expected[0], rtol=1e-5)
    np.testing.assert_allclose(polynomials[1:], expected[1:], rtol=1e-8)
    A, B, C, D = (part[1, 2] for part in regulators.state_space())
    states = (
        [(C @ np.linalg.solve(z * np.eye(A.shape[0]) - A, B) + D)[0, 0] for z in Z]
        if A.size
        else D[0, 0]
    )
    np.testing.assert_allclose(states, expected, rtol=1e-10)


def test_the_transfer_function_carries_sample_time_and_signal_names():
    law = _regulators("pi")[0, 0].transfer_function()
    assert isinstance(law, control.TransferFunction)
    assert (law.dt, law.input_labels, law.output_labels) == (TS, ["e"], ["x"])


def test_the_notch_is_as_deep_as_its_dampings_say_at_its_own_frequency():
    plain, notched = _regulators("p"), _regulators("p+notch")
    ratio = notched.frequency_response([540.0]) / plain.frequency_response([540.0])
    np.testing.assert_allclose(ratio, 0.2 / 0.8, rtol=1e-12)


def test_a_lead_raises_the_phase_and_a_lag_the_gain_below_it():
    lead = _regulators("p+lead").frequency_response(OMEGA) / _regulators("p").frequency_response(
        OMEGA
    )
    assert (np.angle(lead) > 0.0).all()
    both = _regulators("p+lead-lag").frequency_response([0.01, 540.0]) / _regulators(
        "p"
    ).frequency_response([0.01, 540.0])
    lag = both / (
        _regulators("p+lead").frequency_response([0.01, 540.0])
        / _regulators("p").frequency_response([0.01, 540.0])
    )
    np.testing.assert_allclose(np.abs(lag), np.broadcast_to([1.0, 0.4], (2, 3, 2)), rtol=2e-3)


def test_a_transfer_function_of_several_regulators_is_refused():
    with pytest.raises(hc.InputError, match="select one regulator"):
        _regulators("pi").transfer_function()


def test_an_unknown_structure_names_the_nearest():
    with pytest.raises(hc.InputError, match=r"'pi\+notsh' is unknown; did you mean 'pi\+notch'"):
        require_structure("pi+notsh")
