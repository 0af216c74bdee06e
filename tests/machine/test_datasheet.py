"""Shipped machines, makers' data, and data sheets that cannot be used."""

import math

import numpy as np
import pytest
from sheets import MALFORMED, UNREADABLE, written

import hydroctl as hc


def _load(tmp_path, changes: dict) -> hc.Actuator:
    path = tmp_path / "machine.toml"
    path.write_text(written(changes))
    return hc.load_actuator(path)


def test_at_least_six_machines_are_shipped_and_each_says_its_source():
    names = hc.list_actuators()
    assert len(names) >= 6
    for name in names:
        actuator = hc.load_actuator(name)
        assert actuator.name == name
        assert actuator.source
        assert "ASSUMED" in actuator.note


@pytest.mark.parametrize("name", hc.list_actuators())
def test_a_shipped_machine_has_usable_points_and_stable_models(name):
    actuator = hc.load_actuator(name)
    x = np.array([-1.0, -0.5, -0.1, 0.1, 0.5, 1.0])[:, None]
    points = hc.find_operating_points(actuator, x, np.linspace(0.0, actuator.stroke, 5))
    assert points.feasible.all()
    assert points.residual.max() <= 1e-12
    assert (hc.linearize(actuator, points).poles().real < 0).all()


def test_the_shipped_differential_cylinder_has_its_published_dynamics():
    actuator = hc.load_actuator("differential_100_56")
    points = hc.find_operating_points(actuator, [0.5], 0.5)
    family = hc.linearize(actuator, points)
    # 1e-4 relative in flow: the published numbers were computed with the flow coefficient rounded
    # to 8.909e-7
    np.testing.assert_allclose(points.v[0], 0.2250057, rtol=1e-4)
    np.testing.assert_allclose(family.poles()[0, 1], -24.70069 + 432.71317j, rtol=1e-4)


def test_the_symmetric_cylinder_has_the_natural_frequency_of_its_textbook():
    actuator = hc.load_actuator("symmetric_servo")
    textbook = 32.3e-4 * math.sqrt(
        2 * 1200e6 / (819e-6 * 450)
    )  # A sqrt(2 beta/(V M)), V on each side
    pole = hc.linearize(actuator, hc.find_operating_points(actuator, [1e-4], 0.2)).poles()[0, 1]
    # lossless at small openings but for viscous friction, which moves |s| by second order, (B/(2 m
    # w))^2 = 2e-4
    assert abs(pole) == pytest.approx(textbook, rel=2e-4)


def test_makers_data_become_parameters(tmp_path):
    actuator = _load(tmp_path, {})
    assert actuator.area_a == pytest.approx(math.pi / 4 * 0.01, rel=1e-15)
    assert actuator.area_b == pytest.approx(math.pi / 4 * (0.01 - 0.056**2), rel=1e-15)
    assert actuator.volume_a == 2e-4
    assert actuator.volume_b == pytest.approx(2e-4 + actuator.area_b, rel=1e-15)
    assert actuator.flow_coefficient == pytest.approx(0.1 / 60 / math.sqrt(35e5), rel=1e-15)


def test_a_byte_order_mark_and_windows_line_ends_do_no_harm(tmp_path):
    path = tmp_path / "machine.toml"
    path.write_bytes(b"\xef\xbb\xbf" + written({}).replace("\n", "\r\n").encode())
    assert hc.load_actuator(path) == _load(tmp_path, {})


def test_hoses_second_rods_unequal_edges_and_drops_over_the_valve(tmp_path):
    plain = _load(tmp_path, {})
    hoses = _load(tmp_path, {"hose_volume_a": '"0.5 L"', "hose_volume_b": 0.0})
    assert hoses.volume_a - plain.volume_a == pytest.approx(5e-4)
    assert hoses.volume_b == plain.volume_b
    shared = _load(tmp_path, {"hose_volume": '"0.6 L"'})
    assert (shared.volume_a - plain.volume_a, shared.volume_b - plain.volume_b) == pytest.approx(
        (3e-4, 3e-4)
    )
    double = _load(tmp_path, {"rod_diameter_a": '"56 mm"'})
    assert double.area_a == double.area_b == plain.area_b
    valve = _load(
        tmp_path,
        {
            "rated_pressure_drop_per_edge": None,
            "rated_pressure_drop_per_valve": '"70 bar"',
            "rated_flow_b": '"50 L/min"',
        },
    )
    assert valve.flow_coefficient == pytest.approx(plain.flow_coefficient, rel=1e-15)
    assert valve.flow_coefficient_b == pytest.approx(plain.flow_coefficient / 2, rel=1e-15)


# changes to a good sheet, and the words of each fault that must be told
def test_inclination_and_rating_are_read_in_degrees_and_bar(tmp_path):
    machine = _load(tmp_path, {"inclination": '"30 deg"', "pressure_rating": '"315 bar"'})
    assert (machine.inclination, machine.pressure_rating) == (
        pytest.approx(np.pi / 6, rel=1e-15),
        315e5,
    )
    assert _load(tmp_path, {"inclination": '"-90 deg"'}).inclination == -np.pi / 2
    assert hc.load_actuator(hc.save_actuator(machine, tmp_path / "again.toml")) == machine
    with pytest.raises(hc.InputError, match=r"inclination = 90 rad must be at most 1\.5708"):
        _load(tmp_path, {"inclination": "90"})


@pytest.mark.parametrize(("changes", "words"), MALFORMED, ids=lambda value: ",".join(value)[:40])
def test_a_malformed_sheet_gives_one_message_per_fault(tmp_path, changes, words):
    with pytest.raises(hc.InputError) as caught:
        _load(tmp_path, changes)
    faults = caught.value.faults
    assert len(faults) == len(words), faults
    for word in words:
        assert any(word in fault for fault in faults), (word, faults)
    for fault in faults:
        assert fault.startswith(f"{tmp_path / 'machine.toml'}: ")
        assert fault.endswith((".", "?"))
        assert "\n" not in fault


# keys that a fault between parameters needs sound, changes that bring it about, and its words
BETWEEN = [
    (
        {"supply_pressure", "tank_pressure"},
        {"tank_pressure": '"300 bar"'},
        "tank_pressure = 3e+07 Pa is not below supply_pressure",
    ),
    (
        {"area_a", "bore_diameter", "rod_diameter", "rod_diameter_a", "volume_b"},
        {"rod_diameter": '"0.2 m"'},
        "rod_diameter = 0.2 m is not below bore_diameter",
    ),
    (
        {"valve_natural_frequency", "valve_damping"},
        {"valve_damping": "0.7"},
        "valve_damping = 0.7 needs valve_natural_frequency",
    ),
    (
        {"coulomb_friction", "breakaway_friction"},
        {"coulomb_friction": "9", "breakaway_friction": "8"},
        "breakaway_friction = 8 N is below",
    ),
    (
        {"hose_volume", "hose_volume_a", "volume_b"},
        {"hose_volume": "1e-4", "hose_volume_b": "1e-4"},
        "hose_volume is given in all and per side",
    ),
    ({"name"}, {"name": "7"}, "name = 7 is not a text"),
]


@pytest.mark.parametrize(
    ("changes", "words"), MALFORMED[:-1], ids=lambda value: ",".join(value)[:40]
)
def test_no_fault_hides_another(tmp_path, changes, words):
    beside = [(more, word) for needed, more, word in BETWEEN if not needed & changes.keys()]
    for more, word in beside:
        changes, words = changes | more, [*words, word]
    test_a_malformed_sheet_gives_one_message_per_fault(tmp_path, changes, words)


def test_a_volume_that_is_used_up_is_told_beside_other_faults(tmp_path):
    volumes = {
        "dead_volume_a": None,
        "dead_volume_b": None,
        "volume_a": '"0.2 L"',
        "volume_b": '"0.2 L"',
    }
    words = ["volume_b = 0.0002 m^3 is used up", "mass = -1 kg", "colour"]
    test_a_malformed_sheet_gives_one_message_per_fault(
        tmp_path, volumes | {"mass": "-1", "colour": "1"}, words
    )


@pytest.mark.parametrize("kind", UNREADABLE)
def test_a_file_that_is_no_data_sheet_is_refused_in_a_sentence(tmp_path, kind):
    data, words = UNREADABLE[kind]
    path = tmp_path / "machine.toml"
    path.write_bytes(data)
    with pytest.raises(hc.InputError, match=r"machine\.toml") as caught:
        hc.load_actuator(path)
    assert words in str(caught.value)
    assert max(map(len, caught.value.faults)) < 1000


def test_a_directory_a_missing_file_and_an_unknown_name_are_refused(tmp_path):
    with pytest.raises(hc.InputError, match="cannot be read"):
        hc.load_actuator(tmp_path)
    with pytest.raises(
        hc.InputError, match=r"nothere\.toml: cannot be read \(No such file or directory\)"
    ):
        hc.load_actuator(tmp_path / "nothere.toml")
    with pytest.raises(
        hc.InputError, match="actuator 'referense' is unknown; did you mean 'reference'"
    ):
        hc.load_actuator("referense")
    with pytest.raises(hc.InputError, match="cannot be read"):
        hc.load_actuator("machine\x00.toml")


def test_a_sheet_is_written_whole_or_not_at_all(tmp_path):
    with pytest.raises(hc.InputError, match="cannot be written"):
        hc.save_actuator(hc.load_actuator("reference"), tmp_path / "no" / "machine.toml")
    assert list(tmp_path.iterdir()) == []
