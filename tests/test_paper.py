"""The paper's tables to the printed digits, and its errata as laws."""

import numpy as np
import pytest

import hydroctl as hc
from hydroctl import paper, reduce_order


def _significant(printed: float) -> str:
    """The printed number with its six digits, as the paper's table formats it."""
    return f"{printed:.6g}"


@pytest.mark.parametrize(
    ("computed", "printed"),
    list(zip(paper.zero_pole_table(), paper.PRINTED_ZEROS_AND_POLES, strict=True)),
)
def test_table_1_to_every_printed_digit(computed, printed):
    parts = [(*row[:4], row[4].real, row[4].imag) for row in (computed, printed)]
    for value, digits in zip(*parts, strict=True):
        assert _significant(value) == _significant(digits)


@pytest.mark.parametrize("side", ["+", "-"])
@pytest.mark.parametrize("name", ["a1", "a2", "b"])
def test_coefficient_table_agrees_with_the_printed_numbers(side, name):
    np.testing.assert_allclose(
        paper.coefficient_table()[side][name], paper.PRINTED_COEFFICIENTS[side][name], rtol=2e-5
    )


def test_the_two_tables_hold_26_numbers():
    assert (
        sum(len(row) for rows in paper.coefficient_table().values() for row in rows.values()) == 26
    )


def test_leading_coefficient_constants_are_the_papers():
    assert paper.leading_coefficient_constant(paper.equilibrium_family("+")) == pytest.approx(
        1.005653, abs=5e-7
    )
    assert paper.leading_coefficient_constant(paper._family_at_the_wrong_point()) == pytest.approx(
        1.099950, abs=5e-7
    )


def test_corrected_half_for_retraction_is_the_independent_computation():
    corrected = paper.corrected_coefficient_table()["-"]
    constant = paper.leading_coefficient_constant(paper.equilibrium_family("-"))
    np.testing.assert_allclose(
        corrected["a1"], [200.823, -8.88525, -11.0646, 4.89676, 22.1361], rtol=5e-5
    )
    np.testing.assert_allclose(corrected["a2"], [363038, -1528.97, -657471, 932593], rtol=5e-6)
    np.testing.assert_allclose(
        np.array(corrected["b"]) / constant, [39363.3, 0.4964, -38218.7, 107219], rtol=2e-4
    )
    assert paper.corrected_coefficient_table()["+"] == paper.coefficient_table()["+"]


def test_the_papers_point_for_retraction_is_no_equilibrium():
    """At its pressures the two chambers ask for speeds that differ by 39 %, in closed form for a
    closing valve."""
    machine, ratio = paper.actuator(), 6.0 / 7.0
    speeds = {}
    for sign in (1.0, -1.0):
        point = hc.find_operating_points(machine, sign * 1e-9, 0.25)
        speeds[sign] = (
            np.sqrt((machine.supply_pressure - point.p_b) / point.p_a)
            * machine.area_a
            / machine.area_b
        )
    assert speeds[-1.0] == pytest.approx(1.0, rel=1e-6)
    assert speeds[1.0] == pytest.approx(
        np.sqrt((1.0 + ratio**3 - ratio**2) / ratio**3) / ratio, rel=1e-6
    )


def test_the_limit_of_a_closing_valve_has_converged(monkeypatch):
    fine = paper.coefficient_table()
    monkeypatch.setattr(paper, "OPENINGS", np.array([1e-6, *paper.OPENINGS[1:]]))
    coarse = paper.coefficient_table()
    for side, name in (("+", "a1"), ("+", "a2"), ("+", "b"), ("-", "a1"), ("-", "a2"), ("-", "b")):
        np.testing.assert_allclose(coarse[side][name], fine[side][name], rtol=2e-5)


def test_one_constant_spoils_the_static_gain_away_from_mid_stroke():
    for side, largest in (("+", 0.15), ("-", 0.30)):
        family = paper.equilibrium_family(side)
        model = paper.quasi_linear_model(paper.PRINTED_COEFFICIENTS)
        points = family.points
        used = np.abs(points.x) >= 0.1
        _, a2, b = model.evaluate(points.x[used], points.y[used])
        wrong = np.abs(b / a2 * points.x[used] / points.v[used] - 1.0)
        assert wrong.max() == pytest.approx(largest, abs=0.05)


def test_pole_and_zero_are_close_in_the_tangent_form_and_apart_in_the_secant_form():
    machine = paper.actuator()
    points = hc.find_operating_points(machine, np.array([[0.1], [1.0]]), np.array([0.1, 0.4]))
    gaps = {
        form: np.abs(reduce_order(hc.linearize(machine, points, form=form)).pole_zero_gap)
        for form in ("tangent", "secant")
    }
    assert gaps["tangent"].max() < 3.1e-4
    assert gaps["secant"].min() > 0.08
