"""PID forms: textbook conversions, round trips, and the response that no conversion may change."""

import math

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hydroctl as hc
from hydroctl.regulator.forms import (
    ParallelForm,
    SeriesForm,
    StandardForm,
    to_parallel,
    to_series,
    to_standard,
)

OMEGA = np.geomspace(1e-3, 1e4, 200)
GAIN = st.floats(1e-3, 1e3) | st.floats(-1e3, -1e-3)
TIME = st.floats(1e-3, 1e3)
SHORT = st.just(0.0) | st.floats(1e-6, 0.999)


def _agree(one, other):
    np.testing.assert_allclose(
        one.frequency_response(OMEGA), other.frequency_response(OMEGA), rtol=1e-9
    )


def test_the_standard_form_of_a_textbook_in_parallel():
    assert to_parallel(StandardForm(2.0, 3.0, 0.5)) == ParallelForm(2.0, 2.0 / 3.0, 1.0)
    assert to_standard(ParallelForm(2.0, 2.0 / 3.0, 1.0)) == StandardForm(2.0, 3.0, 0.5)


def test_equal_zeros_are_the_last_series_form():
    """(s + 1)^2/s: Ti = 4 Td exactly."""
    assert to_series(StandardForm(2.0, 2.0, 0.5)) == SeriesForm(1.0, 1.0, 1.0)
    with pytest.raises(hc.InputError, match=r"Ti = 1 s, Td = 0.5 s.*at least 4 Td = 2 s"):
        to_series(StandardForm(2.0, 1.0, 0.5))


def test_the_least_integral_time_that_the_message_names_is_the_border():
    with pytest.raises(hc.InputError, match="which has real zeros only") as caught:
        to_series(StandardForm(2.0, 1.0, 0.5, Tf=0.1))
    least = float(str(caught.value).split("at least ")[1].split(" s")[0])
    to_series(StandardForm(2.0, least * 1.00001, 0.5, Tf=0.1))
    with pytest.raises(hc.InputError):
        to_series(StandardForm(2.0, least * 0.99999, 0.5, Tf=0.1))


@given(GAIN, TIME, TIME, SHORT)
def test_standard_to_parallel_and_back(K, Ti, Td, Tf):
    form = StandardForm(K, Ti, Td, Tf)
    again = to_standard(to_parallel(form))
    assert (again.K, again.Ti, again.Td, again.Tf) == pytest.approx((K, Ti, Td, Tf), rel=1e-14)
    _agree(form, to_parallel(form))


@given(GAIN, TIME, SHORT, SHORT)
def test_series_to_parallel_keeps_the_response(K, Ti, Td, Tf):
    form = SeriesForm(K, Ti, Td, Tf)
    _agree(form, to_parallel(form))


@given(GAIN, TIME, st.floats(0.0, 0.9), st.floats(0.0, 0.9))
def test_series_to_standard_and_back(K, Ti, lead, short):
    """Td + Tf is the shorter of the two zeros' times, as the inverse assumes."""
    Tf = short * Ti
    form = SeriesForm(K, Ti, lead * (Ti - Tf), Tf)
    again = to_series(to_standard(form))
    assert (again.K, again.Ti, again.Td, again.Tf) == pytest.approx(
        (form.K, form.Ti, form.Td, form.Tf), rel=1e-9, abs=1e-12 * Ti
    )
    _agree(form, again)


@given(GAIN, TIME, st.floats(0.0, 0.999), SHORT)
def test_standard_to_series_keeps_the_response(K, Ti, fraction, short):
    Tf = short * Ti
    form = StandardForm(K, Ti, fraction * (Ti - Tf) ** 2 / (4.0 * Ti), Tf)
    _agree(form, to_series(form))


def test_without_an_integral_every_form_is_the_same():
    form = StandardForm(2.0, math.inf, 0.5, 0.01)
    assert to_parallel(form) == ParallelForm(2.0, 0.0, 1.0, 0.01)
    assert to_series(form) == SeriesForm(2.0, math.inf, 0.5, 0.01)
    assert to_standard(to_parallel(form)) == form


def test_a_form_converts_to_itself_even_where_others_cannot():
    integral = ParallelForm(0.0, 1.0)
    assert to_parallel(integral) is integral
    with pytest.raises(hc.InputError, match="kp = 0"):
        to_standard(integral)


@pytest.mark.parametrize(
    "form",
    [ParallelForm(1.0, -1.0), ParallelForm(-1.0, 0.0, 1.0), SeriesForm(1.0, 1.0, 0.5, Tf=2.0)],
)
def test_gains_of_different_sign_have_no_standard_form(form):
    with pytest.raises(hc.InputError, match="differ in sign"):
        to_standard(form)


def test_gains_of_different_sign_have_no_series_form():
    with pytest.raises(hc.InputError, match="differ in sign"):
        to_series(ParallelForm(1.0, -1.0))


def test_all_faults_are_told_at_once():
    for make in (StandardForm, SeriesForm):
        with pytest.raises(hc.InputError) as caught:
            make(0.0, -1.0, math.nan, -1.0)
        assert [fault.split(" = ")[0] for fault in caught.value.faults] == ["K", "Ti", "Td", "Tf"]
    with pytest.raises(hc.InputError) as caught:
        ParallelForm(math.nan, math.inf, 1.0, -1.0)
    assert [fault.split(" = ")[0] for fault in caught.value.faults] == ["kp", "ki", "Tf"]


def test_values_that_are_no_numbers_are_told_by_name():
    with pytest.raises(hc.InputError) as caught:
        hc.StandardForm("2", Ti="3", Td=None, Tf=True)
    assert [fault.split(" = ")[0] for fault in caught.value.faults] == ["K", "Ti", "Td", "Tf"]
