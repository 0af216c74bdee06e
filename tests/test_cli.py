"""The command line: exit codes, messages, and what is left behind."""

import json
import re
import subprocess
import sys

import numpy as np
import pytest
from sheets import MALFORMED, UNREADABLE, written

import hydroctl as hc

SHEET = """
area_a = "20 cm^2"
area_b = "15 cm^2"
volume_a = "0.5 L"
volume_b = "1.5 L"
stroke = "0.5 m"
bulk_modulus = "1.2 GPa"
flow_coefficient = 3e-7
supply_pressure = "160 bar"
mass = "100 kg"
viscous_friction = 2000
"""


@pytest.fixture
def sheet(tmp_path):
    def write(*changes):
        text = SHEET
        for old, new in changes:
            assert old in text
            text = text.replace(old, new)
        path = tmp_path / "machine.toml"
        path.write_text(text)
        return path

    return write


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('mass = "100 kg"', 'mas = "100 kg"'), "'mas' is unknown; did you mean 'mass'"),
        (('mass = "100 kg"', "mass = -5"), "mass = -5 kg must be above 0"),
        (('mass = "100 kg"', 'mass = "heavy"'), "mass = 'heavy' is not one number with one unit"),
        (
            (
                'area_a = "20 cm^2"\narea_b = "15 cm^2"',
                'bore_diameter = "50 mm"\nrod_diameter = "60 mm"',
            ),
            "rod_diameter",
        ),
    ],
)
def test_a_bad_data_sheet_is_one_message_and_code_2_and_leaves_nothing(
    command, sheet, tmp_path, change, message
):
    out = tmp_path / "out"
    code, stdout, stderr = command("design", sheet(change), "-o", out)
    assert (code, stdout) == (2, "")
    assert message in stderr
    assert "Traceback" not in stderr
    assert not out.exists()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (("design", "missing.toml"), "cannot be read"),
        (("design", "referense"), "did you mean 'reference'"),
        (("design", "reference", "--structure", "pidd"), "did you mean 'pid'"),
        (("design", "reference", "--Ms", "0.5"), "Ms = 0.5"),
        (("design", "reference", "--delay", "-0.5"), "delay_samples = -0.5"),
        (("actuators", "nothing"), "is unknown"),
        (("actuators", "a" * 5000), "is unknown"),
    ],
)
def test_bad_arguments_are_one_message_and_code_2(
    command, monkeypatch, tmp_path, arguments, message
):
    monkeypatch.chdir(tmp_path)
    code, stdout, stderr = command(*arguments)
    assert (code, stdout) == (2, "")
    assert message in stderr
    assert list(tmp_path.iterdir()) == []


WAY_OUT = re.compile(
    r"[;,] (write|give|add|keep|leave|raise|save|name|so raise|did you mean|known:) ?|must be"
    r" (above|at least|below) \d"
)


def _refused(command, path, name):
    """The messages of `hydroctl name path`, one a line, after what holds for every refused data
    sheet."""
    code, stdout, stderr = command(
        name, path, *(("-o", path.parent / "out") if name == "design" else ())
    )
    assert (code, stdout) == (2, "")
    lines = stderr.removeprefix("hydroctl: ").splitlines()
    for line in lines:
        assert line.startswith(f"{path}: "), line
        assert WAY_OUT.search(line), line
        assert len(line) < 1000
    assert list(path.parent.iterdir()) == [path]
    return lines


@pytest.mark.parametrize("name", ["actuators", "design"])
@pytest.mark.parametrize(("changes", "words"), MALFORMED, ids=lambda value: ",".join(value)[:40])
def test_a_malformed_data_sheet_is_code_2_with_a_line_per_fault(
    command, tmp_path, changes, words, name
):
    path = tmp_path / "machine.toml"
    path.write_text(written(changes))
    lines = _refused(command, path, name)
    assert len(lines) == len(words)
    assert all(any(word in line for line in lines) for word in words)


@pytest.mark.parametrize("name", ["actuators", "design"])
@pytest.mark.parametrize("kind", [*UNREADABLE, "directory"])
def test_a_file_that_is_no_data_sheet_is_code_2_with_a_line_per_fault(
    command, tmp_path, kind, name
):
    path = tmp_path / "machine.toml"
    data, words = UNREADABLE.get(kind, (None, "cannot be read"))
    path.mkdir() if data is None else path.write_bytes(data)
    lines = _refused(command, path, name)
    assert any(words in line for line in lines)


def test_a_process_of_its_own_ends_with_code_2(tmp_path):
    (tmp_path / "machine.toml").write_text(
        written({"mass": '"-1 kg"', "tank_pressure": '"300 bar"'})
    )
    command = [sys.executable, "-m", "hydroctl.cli", "design", "machine.toml"]
    ended = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert (ended.returncode, ended.stdout, len(ended.stderr.splitlines())) == (2, "", 2)
    assert [entry.name for entry in tmp_path.iterdir()] == ["machine.toml"]


def test_at_least_forty_malformed_files_are_tried():
    assert len({written(changes) for changes, _ in MALFORMED}) + len(UNREADABLE) >= 40


def test_an_output_directory_that_cannot_be_made_is_code_2(command, tmp_path):
    (tmp_path / "file").write_text("")
    code, _, stderr = command("design", "reference", "-o", tmp_path / "file" / "out")
    assert code == 2
    assert "cannot be written" in stderr


def test_actuators_are_listed_and_described(command):
    code, stdout, _ = command("actuators")
    assert code == 0
    assert stdout.split() == hc.list_actuators()
    code, stdout, _ = command("actuators", "reference")
    assert code == 0
    for part in ("area_a", "bulk_modulus", "natural frequency", "stall force", "ASSUMED"):
        assert part in stdout
    code, stdout, _ = command("actuators", "reference", "--json")
    assert json.loads(stdout)["parameters"]["mass"] == 500.0


@pytest.fixture(scope="module")
def schedule(reference, tmp_path_factory):
    path = tmp_path_factory.mktemp("cli") / "schedule.json"
    corners = hc.Specification(uncertainty="corners")
    return hc.tune(reference, [-1.0, -0.1, 0.1, 1.0], [0.0, 0.25, 0.5], specification=corners).save(
        path
    )


def test_a_saved_schedule_is_validated_and_its_random_cases_replayed(command, schedule):
    code, stdout, _ = command("validate", schedule)
    assert code == 0
    assert "every requirement is met" in stdout
    code, stdout, _ = command("validate", schedule, "--count", 70, "--seed", 3)
    assert stdout.startswith("70 random cases, seed 3")
    assert code == (0 if "FAIL" not in stdout else 1)
    seed = stdout.split("; seed ")[1].split(")")[0]
    code, stdout, _ = command("validate", schedule, "--replay", seed)
    assert code == 0
    assert "settling_time" in stdout


def test_a_record_is_identified_with_its_own_column_names_and_units(command, reference, tmp_path):
    t = np.arange(0.0, 4.0, 1e-3)
    x = np.where(np.sin(2.0 * np.pi * 3.0 * t) + np.sin(2.0 * np.pi * 11.0 * t) > 0.0, 0.12, 0.08)
    motion = hc.simulate(reference, t, x)
    rows = zip(t, x, 1e3 * motion.v, motion.y, strict=True)
    path = tmp_path / "record.csv"
    path.write_text(
        "time,valve,speed,y\n"
        + "\n".join(",".join(f"{value:.9g}" for value in row) for row in rows)
        + "\n"
    )
    options = (
        "--column",
        "t=time",
        "--column",
        "x=valve",
        "--column",
        "v=speed",
        "--unit",
        "v=mm/s",
    )
    code, stdout, _ = command("identify", path, "--basis", "constant", *options)
    assert code == 0
    assert "held out" in stdout
    code, _, stderr = command("identify", path, "--basis", "constant", "--column", "t")
    assert (code, "form name=value" in stderr) == (2, True)


def test_help_loads_nothing_heavy():
    code = (
        "import sys, hydroctl.cli; print([m for m in ('numpy', 'scipy', 'control', 'matplotlib',"
        " 'numba') if m in sys.modules])"
    )
    loaded = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, check=True
    )
    assert loaded.stdout.strip() == "[]"
