"""Type checkers find no error in the package, and find those in a user's file."""

import json
import subprocess
import sys
from pathlib import Path

import pytest
from make_stub import STUB, stub

ROOT = Path(__file__).parents[1]
FILE = """\
import hydroctl as hc

a = hc.load_actuator("reference")
hc.tune(a, [0.1], [0.2], lop="position")
hc.Specification(Mss=1.6)
reveal_type(hc.design(a))
hc.tune(a, [0.1], [0.2], loop="position")
hc.Specification(Ms=1.6)
"""
TUNE, SPECIFICATION, REVEALED = 4, 5, 6
"""lines of FILE: two slips, and what `design` returns"""


def run(*command: str | Path) -> subprocess.CompletedProcess[str]:
    return subprocess.run(
        [sys.executable, "-m", *map(str, command)], cwd=ROOT, capture_output=True, text=True
    )


def mypy_on(path: Path) -> list[tuple[int, str, str]]:
    """(line, severity, message) of what mypy says of a file."""
    done = run("mypy", "--output", "json", path)
    said = [json.loads(line) for line in done.stdout.splitlines()]
    assert {Path(one["file"]).name for one in said} == {path.name}, done.stderr
    return [(one["line"], one["severity"], one["message"]) for one in said]


def pyright_on(path: Path) -> list[tuple[int, str, str]]:
    """The same of pyright."""
    done = run("pyright", "--pythonpath", sys.executable, "--outputjson", path)
    return [
        (one["range"]["start"]["line"] + 1, one["severity"], one["message"])
        for one in json.loads(done.stdout)["generalDiagnostics"]
    ]


def test_mypy_finds_no_error_in_the_package():
    done = run("mypy")
    assert done.returncode == 0, done.stdout + done.stderr


@pytest.mark.parametrize("checker", [mypy_on, pyright_on])
def test_a_misspelt_argument_is_an_error_and_a_result_has_its_type(checker, tmp_path):
    path = tmp_path / "of_a_user.py"
    path.write_text(FILE)
    said = checker(path)
    errors = {line: message for line, severity, message in said if severity == "error"}
    assert errors.keys() == {TUNE, SPECIFICATION}
    assert "lop" in errors[TUNE]
    assert "Mss" in errors[SPECIFICATION]
    (revealed,) = (message for line, _, message in said if line == REVEALED)
    assert revealed.replace('"hydroctl.chain.Design"', '"Design"').endswith('is "Design"')


def test_the_stub_shows_the_public_names():
    assert STUB.read_text() == stub()
