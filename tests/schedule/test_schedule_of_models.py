"""A schedule without a machine: what it has, what is written of it, and what it refuses."""

import json

import jsonschema
import numpy as np
import pytest

import hydroctl as hc
from hydroctl.errors import FailedChecksError, InputError
from hydroctl.proof.margin_verdicts import margin_verdicts
from hydroctl.schedule.document import json_schema
from hydroctl.testing import Disk, assert_margins, assert_poles_in

X, Y = np.array([-1.0, -0.3, 0.3, 1.0]), np.array([0.1, 0.25, 0.4])


@pytest.fixture(scope="module")
def linear(reference):
    return hc.linearize(reference, hc.find_operating_points(reference, X[:, None], Y))


@pytest.fixture(scope="module")
def transfer_functions(linear):
    return {
        (float(x), float(y)): linear[i, j].transfer_function()
        for i, x in enumerate(X)
        for j, y in enumerate(Y)
    }


@pytest.fixture(scope="module", params=["velocity", "position"])
def schedule(request, linear):
    return hc.tune(linear, loop=request.param, structure="pi")


def test_the_limits_are_kept_on_the_models(schedule):
    """Within 0.5 %, which the tuner's grid of frequencies may leave."""
    s = schedule.specification
    assert_margins(schedule, Ms=1.005 * s.Ms, Mt=1.005 * s.Mt)
    assert_poles_in(schedule, Disk(1.0))
    verdicts = margin_verdicts(schedule)
    assert all(verdict.passed for verdict in verdicts)
    assert "unstable loops through hidden coupling" in {verdict.name for verdict in verdicts}
    assert not any("between" in verdict.name for verdict in verdicts)


def test_without_speeds_nothing_is_said_of_hidden_coupling(transfer_functions):
    verdicts = margin_verdicts(hc.tune(transfer_functions, structure="pi"))
    assert verdicts
    assert not any("hidden" in verdict.name for verdict in verdicts)


def test_a_file_of_models_comes_back_to_the_bit(schedule, tmp_path):
    path = schedule.save(tmp_path / "models.json")
    loaded = hc.load_schedule(path)
    assert loaded.actuator is None
    for name in ("kp", "ki", "kd", "design_x", "design_y", "Tt", "speed_offset_retract"):
        np.testing.assert_array_equal(getattr(loaded, name), getattr(schedule, name))
    for name in ("Ms", "Mt", "crossover", "phase_margin"):
        found, own = (getattr(s.margins.margins, name) for s in (loaded, schedule))
        np.testing.assert_array_equal(found, own)
    np.testing.assert_array_equal(
        hc.check_coupling(loaded).pole_size, hc.check_coupling(schedule).pole_size
    )
    assert loaded.save(tmp_path / "again.json").read_bytes() == path.read_bytes()
    jsonschema.Draft202012Validator(json.loads(json_schema())).validate(
        json.loads(path.read_text())
    )


def test_surfaces_are_stored_at_the_points_of_the_margins(reference, tmp_path):
    x, y = np.array([-1.0, -0.6, -0.3, 0.3, 0.6, 1.0]), np.linspace(0.1, 0.4, 5)
    family = hc.linearize(reference, hc.find_operating_points(reference, x[:, None], y))
    surfaces = hc.fit_surfaces(hc.reduce_order(family), basis="volume")
    schedule = hc.tune(surfaces, X, Y, structure="pi")
    loaded = hc.load_schedule(schedule.save(tmp_path / "surfaces.json"))
    assert loaded.margins.designed.sum() < loaded.margins.designed.size
    np.testing.assert_allclose(loaded.margins.margins.Ms, schedule.margins.margins.Ms, rtol=1e-12)


@pytest.mark.parametrize("format", ["json", "c", "st", "mat", "csv"])
def test_what_needs_no_machine_is_exported(schedule, format, tmp_path):
    written = hc.export_schedule(schedule, tmp_path / f"regulator.{format}", format)
    assert all(path.stat().st_size > 100 for path in written)
    if format in ("c", "st", "csv"):
        assert "Machine: not known" in written[0].read_text()


def test_what_needs_the_nonlinear_machine_says_so(schedule, reference, tmp_path):
    with pytest.raises(InputError, match="the nonlinear machine that this needs is not known"):
        hc.export_schedule(schedule, tmp_path / "regulator.fmu", "fmu")
    assert not list(tmp_path.iterdir())
    with pytest.raises(InputError, match="actuator = NoneType: a validation moves the nonlinear"):
        hc.validate(schedule.actuator, schedule)
    with pytest.raises(InputError, match="the nonlinear machine"):
        _ = schedule.machine
    assert hc.validate(reference, schedule).runs


def test_figures_of_a_loop_are_drawn_on_the_models(schedule):
    """The curve of the nominal plant ends where its frequency response does."""
    from hydroctl import plotting

    x, y = float(X[2]), float(Y[1])
    plant, regulator = schedule.sampled_plants([x], [y]), schedule.gains(x, y)
    nyquist = np.pi / schedule.Ts
    expected = (
        plant.frequency_response([nyquist]) * regulator.frequency_response([nyquist])
    ).item()
    curve = plotting.nyquist(schedule, x, y).lines[0]
    np.testing.assert_allclose(curve.get_xdata()[-1], expected.real, rtol=1e-9)
    assert plotting.root_locus(schedule, x, y).get_title().startswith("Root locus")


def test_one_regulator_serves_all_models(transfer_functions):
    fixed = hc.tune_fixed(transfer_functions, structure="pi")
    assert fixed.kp.size == 1
    assert_margins(fixed, Ms=1.005 * fixed.specification.Ms)


def test_a_schedule_is_for_a_machine_or_for_models(schedule, reference):
    from dataclasses import replace

    with pytest.raises(InputError, match="give one of the two"):
        replace(schedule, actuator=reference)
    with pytest.raises(InputError, match="give one of the two"):
        replace(schedule, models=None)


def test_a_limit_that_the_models_miss_stops_the_export(schedule, tmp_path):
    from dataclasses import replace

    too_much = replace(schedule, ki=3.0 * schedule.ki, kp=3.0 * schedule.kp)
    with pytest.raises(FailedChecksError, match="Ms at the design points"):
        hc.export_schedule(too_much, tmp_path / "regulator.c", "c")


@pytest.mark.parametrize(
    ("change", "text"),
    [
        (lambda models: models["A"][0][0][0].pop(), "A is not of the shape"),
        (lambda models: models["x"].reverse(), "x is not strictly ascending"),
        (lambda models: models["C"].append(0.0), "is not of the shape"),
        (lambda models: models.update(unit_of_y="mm"), "unit_of_y"),
        (lambda models: models["steady_speed"].pop(), "steady_speed is not of the shape"),
    ],
)
def test_models_that_do_not_fit_together_are_refused(schedule, tmp_path, change, text):
    path = schedule.save(tmp_path / "models.json")
    data = json.loads(path.read_text())
    change(data["models"])
    path.write_text(json.dumps(data))
    with pytest.raises(InputError, match=text):
        hc.load_schedule(path)


def test_a_file_with_neither_machine_nor_models_is_refused(schedule, tmp_path):
    path = schedule.save(tmp_path / "models.json")
    data = json.loads(path.read_text())
    del data["models"]
    path.write_text(json.dumps(data))
    with pytest.raises(InputError, match="give one of the two"):
        hc.load_schedule(path)
