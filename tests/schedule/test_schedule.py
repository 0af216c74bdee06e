"""The schedule's lookup, its file, and what the file's reader refuses."""

import json

import numpy as np
import pytest
from machines import DIFFERENTIAL

import hydroctl as hc
from hydroctl.loop.machine_plants import machine_plants
from hydroctl.loop.margins import MARGIN_UNITS
from hydroctl.regulator import compensation
from hydroctl.regulator.vectors import law_of
from hydroctl.schedule.schedule import check_margins


@pytest.fixture(scope="module")
def schedule(reference):
    corners = hc.Specification(uncertainty="corners")
    return hc.tune(
        reference,
        [-1.0, -0.02, 0.02, 1.0],
        [0.0, 0.25, 0.5],
        loop="position",
        specification=corners,
    )


@pytest.fixture(scope="module")
def saved(schedule, tmp_path_factory):
    return schedule.save(tmp_path_factory.mktemp("schedule") / "schedule.json")


def test_lookup_returns_the_table_at_its_nodes(schedule):
    found = schedule.gains(schedule.x[:, None], schedule.y)
    for name in ("kp", "ki", "kd", "notch_frequency"):
        np.testing.assert_allclose(getattr(found, name), getattr(schedule, name), rtol=1e-15)


def test_lookup_is_bilinear_on_each_side(schedule):
    found = schedule.gains(0.02 + 0.98 * 0.3, schedule.y[1] * 0.4)
    corner = schedule.ki[2:4, 0:2]
    assert found.ki == pytest.approx([0.7, 0.3] @ corner @ [0.6, 0.4], rel=1e-12)


def test_lookup_is_clipped_and_never_crosses_zero(schedule):
    np.testing.assert_array_equal(schedule.gains([0.0, 1e-6, 0.01], -1.0).ki, schedule.ki[2, 0])
    np.testing.assert_array_equal(schedule.gains([-1e-6, -0.01], 9.0).ki, schedule.ki[1, -1])
    np.testing.assert_array_equal(schedule.gains([5.0], schedule.y[1]).ki, schedule.ki[3, 1])


def test_a_schedule_with_nodes_on_one_side_serves_both(reference):
    single = hc.tune(
        reference, [0.1], [0.25], specification=hc.Specification(uncertainty="nominal")
    )
    np.testing.assert_array_equal(single.gains([-1.0, 0.0, 1.0], 0.3).ki, single.ki[0, 0])


def test_the_margins_cover_nodes_and_midpoints_of_every_variant(schedule):
    variants, openings = 5, 4
    assert schedule.margins.margins.Ms.shape == (
        variants,
        2 * openings - 2,
        2 * schedule.design_y.size - 1,
    )
    assert schedule.margins.designed.sum() == schedule.x.size * schedule.y.size
    assert 0.0 not in schedule.margins.x


@pytest.mark.parametrize("name", [*MARGIN_UNITS, "disk_margin"])
def test_the_worst_point_is_where_the_margin_is_worst(schedule, name):
    """The largest peak of a sensitivity and the largest factor below 1 that unsettles, the smallest
    of every other margin."""
    worst, values = schedule.margins.worst(name), getattr(schedule.margins.margins, name)
    i, j = np.argmax(schedule.margins.x == worst.x), np.argmax(schedule.margins.y == worst.y)
    k = schedule.margins.variants.index(worst.variant)
    assert values[k, i, j] == worst.value
    assert worst.value == (
        values.max() if name in ("Ms", "Mt", "gain_reduction_margin") else values.min()
    )
    assert values.min() < values.max()


def test_a_file_reads_back_to_the_same_bits(schedule, saved):
    again = hc.load_schedule(saved)
    for name in ("x", "y", "design_x", "design_y", "kp", "ki", "kd", "notch_frequency"):
        np.testing.assert_array_equal(getattr(again, name), getattr(schedule, name))
    for name in (
        "loop",
        "structure",
        "zz",
        "zp",
        "Tt",
        "Ts",
        "Tf",
        "delay_samples",
        "feed_forward",
        "actuator",
        "specification",
    ):
        assert getattr(again, name) == getattr(schedule, name)
    assert again.save(saved.with_name("again.json")).read_bytes() == saved.read_bytes()


@pytest.mark.parametrize("loop", ["velocity", "position"])
@pytest.mark.parametrize("structure", ["p", "pid", "pi+notch"])
def test_schedules_of_other_structures_are_saved_too(reference, tmp_path, loop, structure):
    nominal = hc.Specification(uncertainty="nominal")
    made = hc.tune(
        reference, [-0.5, 0.5], [0.2], loop=loop, structure=structure, specification=nominal
    )
    again = hc.load_schedule(made.save(tmp_path / "schedule.json"))
    for name in ("kp", "ki", "kd", "notch_frequency"):
        np.testing.assert_array_equal(getattr(again, name), getattr(made, name))


def test_every_setting_of_the_law_reads_back(reference, tmp_path):
    machine = reference.replace(dead_band=0.05)
    settings = {
        "lead_lag": ((0.4, 2.5), (0.05, 0.02)),
        "measurement_filter": 3e-4,
        "derivative_on": "measurement",
        "set_point_weight": 0.7,
        "pressure_compensation": True,
        "dead_band_inverse": 0.85,
    }
    asked = hc.Specification(
        uncertainty="nominal", notch_damping=(0.25, 0.7), notch_ratio=0.95, **settings
    )
    made = hc.tune(machine, [-0.5, 0.5], [0.2], structure="pid+lead+notch", specification=asked)
    again = hc.load_schedule(made.save(tmp_path / "schedule.json"))
    assert again.specification == asked
    assert again.sections == made.sections == ((0.4, 2.5),)
    np.testing.assert_array_equal(again.pressure_drops, made.pressure_drops)
    assert (made.pressure_drops > 0.0).all()


@pytest.mark.parametrize("structure", ["p+lead", "pi"])
@pytest.mark.parametrize("ratio", [None, 0.8])
def test_where_the_sections_stand_reads_back_without_a_notch(reference, tmp_path, structure, ratio):
    asked = hc.Specification(uncertainty="nominal", notch_ratio=ratio)
    made = hc.tune(
        reference, [-0.5, 0.5], [0.2], loop="position", structure=structure, specification=asked
    )
    again = hc.load_schedule(made.save(tmp_path / "schedule.json"))
    assert again.specification == made.specification == asked


def test_every_quantity_in_the_file_has_a_unit(saved):
    document = json.loads(saved.read_text())
    tables = document["scheduling"]["tables"].items()
    assert {name: table["unit"] for name, table in tables} == {
        "kp": "1/m",
        "ki": "1/(m*s)",
        "kd": "s/m",
        "notch_frequency": "rad/s",
    }
    assert document["actuator"]["parameters"]["leakage"] == {"value": 5e-12, "unit": "m^3/s/Pa"}


def _every_field(node, path=()):
    if isinstance(node, dict):
        for key, value in node.items():
            yield (*path, key)
            yield from _every_field(value, (*path, key))
    elif isinstance(node, list) and node and isinstance(node[0], dict):
        for i, value in enumerate(node):
            yield from _every_field(value, (*path, i))


def _at(document, path):
    for key in path:
        document = document[key]
    return document


@pytest.mark.parametrize("change", ["remove", "mistype", "nan"])
def test_a_file_with_any_one_field_spoilt_is_refused(saved, tmp_path, change):
    text = saved.read_text()
    for path in _every_field(json.loads(text)):
        document = json.loads(text)
        holder = _at(document, path[:-1])
        if change == "remove":
            del holder[path[-1]]
        else:
            holder[path[-1]] = {"mistype": [["?"]], "nan": float("nan")}[change]
        file = tmp_path / "spoilt.json"
        file.write_text(json.dumps(document))
        with pytest.raises(hc.InputError, match=r"spoilt\.json"):
            hc.load_schedule(file)


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (("version",), 5, "version 5 is unknown"),
        (("schema",), "other", "not a gain schedule"),
        (("scheduling", "x", "nodes"), [-1.0, 0.02, -0.02, 1.0], "not strictly ascending"),
        (("scheduling", "y", "nodes"), [0.0, 0.25, 0.25], "not strictly ascending"),
        (("scheduling", "x", "nodes"), [-1.0, 0.0, 0.02, 1.0], "must not have a node at 0"),
        (
            ("scheduling", "tables", "ki", "values"),
            [[1.0, 2.0, 3.0]],
            "table ki is not 4 rows of 4 values",
        ),
        (("actuator", "parameters", "mass", "value"), 400.0, "does not belong to"),
        (("actuator", "parameters", "mass", "value"), -400.0, "mass = -400 kg must be above 0"),
        (("actuator", "parameters", "mass", "unit"), "g", "unit"),
        (("controller", "sample_time", "unit"), "ms", "unit"),
        (("structure",), "pie", "did you mean 'pi'"),
        (("structure",), "p", "table ki is not zero, but structure 'p' has no ki"),
        (("design", "y"), [0.5, 0.25, 0.0], "design.y is not strictly ascending"),
        (("feed_forward", "gain_extend", "value"), 0.0, "greater than 0"),
    ],
)
def test_what_a_reader_must_notice(saved, tmp_path, path, value, message):
    document = json.loads(saved.read_text())
    _at(document, path[:-1])[path[-1]] = value
    file = tmp_path / "changed.json"
    file.write_text(json.dumps(document))
    with pytest.raises(hc.InputError, match=message):
        hc.load_schedule(file)


@pytest.mark.parametrize(
    "data", [b"", b"{", b"[]", b"\xff\xfe", b'{"schema": 1, "schema": 2}', b"[" * 100_000]
)
def test_what_is_no_schedule_at_all(tmp_path, data):
    file = tmp_path / "file.json"
    file.write_bytes(data)
    with pytest.raises(hc.InputError, match=r"file\.json"):
        hc.load_schedule(file)
    with pytest.raises(hc.InputError, match="cannot be read"):
        hc.load_schedule(tmp_path / "missing.json")


def test_a_directory_that_cannot_be_written_leaves_nothing(schedule, tmp_path):
    with pytest.raises(hc.InputError, match="cannot be written"):
        schedule.save(tmp_path / "missing" / "schedule.json")
    assert list(tmp_path.iterdir()) == []


def test_margins_of_the_nodes_alone_are_those_of_the_nodes(schedule):
    nodes = check_margins(schedule, schedule.x, schedule.y)
    assert nodes.worst("Ms").value == pytest.approx(
        schedule.margins.worst("Ms", where=schedule.margins.designed).value, rel=1e-12
    )


LOADED = DIFFERENTIAL.replace(leakage=0.0, load_force=3e4, flow_coefficient_b=6e-7)
"""areas 1.46:1, edges 1.48:1, a load that holds against extension"""


def _drops_by_hand(machine, x):
    """(drop over the open edge at A, at B) in Pa for a steady motion without leakage.

    Each flow is c |x| sqrt(drop) = A |v|. Extending, A is supplied and B drains:
    A_a (p_s - d_a) - A_b (p_t + d_b) = B |v| + F; retracting they change places:
    A_a (p_t + d_a) - A_b (p_s - d_b) = -B |v| + F. Either is a quadratic in |v|.
    """
    area_a, area_b = machine.area_a, machine.area_b
    supply, tank = machine.supply_pressure, machine.tank_pressure
    if x > 0.0:
        drive = area_a * supply - area_b * tank - machine.load_force
    else:
        drive = area_b * supply - area_a * tank + machine.load_force
    edges = (area_a, machine.flow_coefficient), (area_b, machine.flow_coefficient_b)
    per_square = [(area / (c * x)) ** 2 for area, c in edges]
    throttle = area_a * per_square[0] + area_b * per_square[1]
    speed = max(np.roots([throttle, machine.viscous_friction, -drive]))
    return [speed**2 * share for share in per_square]


@pytest.mark.parametrize("load", [3e4, -5e4])
@pytest.mark.parametrize(
    ("x", "middles"),
    [
        ([-1.0, -0.4, -0.1, 0.2, 0.5], (-0.4, 0.35)),
        ([0.3, 0.7], (-1.0, 0.5)),
        ([-0.2], (-0.2, 1.0)),
    ],
    ids=["both sides", "extending alone", "retracting alone"],
)
def test_the_designs_pressure_drops_are_those_over_the_edges_that_are_open(x, middles, load):
    """At the median opening of each side, at full opening on a side without any; row 0 retracts,
    row 1 extends; A, then B."""
    machine = LOADED.replace(load_force=load)
    expected = [_drops_by_hand(machine, middle) for middle in middles]
    assert abs(expected[0][0] / expected[1][0] - 1.0) > 0.05
    np.testing.assert_allclose(machine_plants(machine).pressure_drops(x), expected, rtol=1e-9)


def test_the_pressure_ratio_is_one_in_the_motions_that_the_design_counts_on():
    """Both directions and both chambers of an asymmetric machine under load, through the tuner and
    the law's own constants."""
    asked = hc.Specification(uncertainty="nominal", pressure_compensation=True)
    made = hc.tune(LOADED, [-0.6, 0.3], [0.2, 0.8], specification=asked)
    points = hc.find_operating_points(LOADED, [-0.6, 0.3], 0.5)
    for x, p_a, p_b in zip(points.x, points.p_a, points.p_b, strict=True):
        for y in (0.1, 0.9):
            assert compensation.step(x, y, p_a, p_b, law_of(made.regulator)) == pytest.approx(
                1.0, rel=1e-9
            )
