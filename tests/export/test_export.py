"""Exports as a whole: what is refused, what is recorded, and that the same schedule gives the same
bytes."""

import json
import shutil
from dataclasses import replace

import numpy as np
import pytest
from exports import HOSTILE, REFERENCE, exported
from scipy.io import loadmat

import hydroctl as hc
from hydroctl.export import FORMATS as ALL_FORMATS

COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
FORMATS = [f for f in ALL_FORMATS if f != "fmu" or COMPILER]
FORCED = "WRITTEN BY FORCE"


@pytest.fixture(scope="module")
def schedule():
    return exported()


@pytest.fixture(scope="module")
def failing(schedule):
    """The same, held to limits that it does not meet."""
    return replace(schedule, specification=hc.Specification(uncertainty="nominal", Ms=1.01))


@pytest.mark.parametrize("format", FORMATS)
def test_the_same_schedule_gives_the_same_bytes_and_nothing_else(schedule, tmp_path, format):
    for name in ("one", "two"):
        (tmp_path / name).mkdir()
        written = hc.export_schedule(schedule, tmp_path / name / f"press.{format}", format)
        assert sorted(written) == sorted((tmp_path / name).iterdir())
    for path in (tmp_path / "one").iterdir():
        assert path.read_bytes() == (tmp_path / "two" / path.name).read_bytes()


@pytest.mark.parametrize("format", FORMATS)
def test_a_schedule_that_fails_its_checks_is_refused_unless_forced_which_is_recorded(
    failing, tmp_path, format
):
    path = tmp_path / f"press.{format}"
    with pytest.raises(
        hc.FailedChecksError, match=r"fails its own checks.*\n.*FAIL  Ms at the design points"
    ):
        hc.export_schedule(failing, path, format)
    assert list(tmp_path.iterdir()) == []
    for written in hc.export_schedule(failing, path, format, force=True):
        assert b"FAIL" in written.read_bytes() or "plant" in written.name


@pytest.mark.parametrize("format", FORMATS)
def test_hostile_names_are_exported(schedule, tmp_path, format):
    machine = REFERENCE.replace(name=HOSTILE, note=HOSTILE)
    hc.export_schedule(replace(schedule, actuator=machine), tmp_path / f"press.{format}", format)


def test_a_place_that_cannot_be_written_is_named(schedule, tmp_path):
    with pytest.raises(hc.InputError, match="cannot be written"):
        hc.export_schedule(schedule, tmp_path / "missing" / "press.c", "c")


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"format": "cpp"}, "format 'cpp' is unknown"),
        ({"format": "c", "real": "half"}, "real 'half' is unknown"),
        ({"format": "mat", "real": "float"}, "is for generated code"),
    ],
)
def test_what_cannot_be_exported_is_said(schedule, tmp_path, arguments, message):
    with pytest.raises(hc.InputError, match=message):
        hc.export_schedule(schedule, tmp_path / "press.c", **arguments)


def test_csv_holds_every_node_to_the_last_bit(schedule, tmp_path):
    (path,) = hc.export_schedule(schedule, tmp_path / "press.csv", "csv")
    rows = np.genfromtxt(path, delimiter=",", skip_header=1 + path.read_text().count("# "))
    grid = np.meshgrid(schedule.x, schedule.y, indexing="ij")
    tables = (*grid, schedule.kp, schedule.ki, schedule.kd, schedule.notch_frequency)
    np.testing.assert_array_equal(rows, np.stack([np.ravel(table) for table in tables], axis=-1))


def test_mat_holds_tables_settings_names_and_units(schedule, tmp_path):
    machine = REFERENCE.replace(name="Pressé */")
    (path,) = hc.export_schedule(replace(schedule, actuator=machine), tmp_path / "press.mat", "mat")
    read = loadmat(path, simplify_cells=True)["schedule"]
    for name in ("x", "y", "kp", "ki", "kd", "notch_frequency"):
        np.testing.assert_array_equal(read[name], getattr(schedule, name))
    assert read["units"]["ki"] == "1/m"
    assert read["machine"] == machine.name
    assert read["settings"]["Ts"] == schedule.Ts


def test_every_target_names_the_schedule_file_that_it_comes_from(schedule, tmp_path):
    (path,) = hc.export_schedule(schedule, tmp_path / "press.json", "json")
    assert path.read_bytes() == schedule.save(tmp_path / "saved.json").read_bytes()
    fingerprint = json.loads(path.read_text())["fingerprint"]
    for format in ("c", "st", "mat", "csv"):
        written = hc.export_schedule(schedule, tmp_path / f"press.{format}", format)
        assert all(
            fingerprint.encode() in file.read_bytes().replace(b"\x00", b"") for file in written
        )


def test_the_command_line_exports_and_refuses(command, schedule, failing, tmp_path):
    saved, out = schedule.save(tmp_path / "press.json"), tmp_path / "out"
    code, stdout, _ = command("export", saved, "--to", "c", "--float", "-o", out)
    assert (code, stdout.split()) == (0, [str(out / "press.h"), str(out / "press.c")])
    assert "typedef float press_real;" in (out / "press.h").read_text()
    saved = failing.save(tmp_path / "failing.json")
    code, stdout, stderr = command("export", saved, "--to", "st", "-o", out)
    assert (code, stdout) == (1, "")
    assert "or force the export" in stderr
    code, _, _ = command("export", saved, "--to", "st", "-o", out, "--force")
    assert code == 0
    assert FORCED in (out / "failing.st").read_text()
    assert json.loads(saved.read_text())["version"]
