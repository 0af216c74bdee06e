"""The regulator in C: the same commands as the law in Python, through any compiler's strictest
eyes."""

import re
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from exports import CASES, HOSTILE, REFERENCE, closed_loop, contents, exported, exported_pair

import hydroctl as hc
from hydroctl.export import precision
from hydroctl.export.c import sources, write_c
from hydroctl.export.contents import contents_of

COMPILER = shutil.which("cc") or shutil.which("gcc") or shutil.which("clang")
STRICT = (
    "-std=c99",
    "-pedantic",
    "-Wall",
    "-Wextra",
    "-Wconversion",
    "-Wdouble-promotion",
    "-Wshadow",
    "-Werror",
)
DRIVER = Path(__file__).with_name("export_driver.c")
REALS = ("double", "float")

pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler")


def compile_c(directory, *arguments):
    subprocess.run(
        [COMPILER, *STRICT, *map(str, arguments), "-lm", "-o", "program"], cwd=directory, check=True
    )
    return directory / "program"


def run(program, rows=None):
    data = None if rows is None else rows.tobytes()
    return subprocess.run([program], input=data, capture_output=True, check=False)


@pytest.fixture(scope="module", params=CASES)
def loop(request):
    """Two schedules, and a random closed loop that changes between them; 10 000 steps for the one
    that has everything."""
    schedules = exported_pair(request.param)
    samples = 10_000 if request.param == list(CASES)[-1] else 2000
    return [contents_of(schedule, force=True) for schedule in schedules], *closed_loop(
        schedules, samples
    )


@pytest.mark.parametrize("real", REALS)
def test_random_closed_loop_steps_are_those_of_the_law(loop, tmp_path, real):
    both, operations, expected = loop
    for name, given in zip(("first", "second"), both, strict=True):
        write_c(given, tmp_path / f"{name}.c", real)
    sanitizers = ("-g", "-fsanitize=address,undefined", "-fno-sanitize-recover=all", "-I.")
    program = compile_c(tmp_path, "-O1", *sanitizers, DRIVER, "first.c", "second.c")
    answer = run(program, operations)
    assert (answer.returncode, answer.stderr) == (0, b"")
    x = np.frombuffer(answer.stdout)
    assert x.shape == expected.shape
    bound = (
        1e-12
        if real == "double"
        else max(precision.stated_bound(given, len(operations)) for given in both)
    )
    assert np.abs(x - expected).max() <= bound
    assert np.ptp(expected) > 0.1
    assert (operations[:, 0] > 0.0).sum() > 20


@pytest.mark.parametrize(
    ("case", "real"), [*((case, "double") for case in CASES), (list(CASES)[-1], "float")]
)
def test_the_self_test_passes_and_finds_a_changed_gain(case, tmp_path, real):
    write_c(contents(case), tmp_path / "press.c", real)
    assert run(compile_c(tmp_path, "-DPRESS_SELF_TEST", "press.c")).returncode == 0
    source = (tmp_path / "press.c").read_text()
    row = source.index("KP[NX][NY]")
    start = source.index("{ ", source.index("\n", row)) + 2
    (tmp_path / "press.c").write_text(f"{source[:start]}2{source[start + 1 :]}")
    assert run(compile_c(tmp_path, "-DPRESS_SELF_TEST", "press.c")).returncode > 0


def test_the_state_stays_what_it_was_told_without_calls_of_other_libraries(tmp_path):
    """The object needs nothing from outside but functions of math.h."""
    write_c(contents("position pid+lead-lag+notch"), tmp_path / "press.c", "double")
    subprocess.run(
        [COMPILER, *STRICT, "-O2", "-fno-stack-protector", "-c", "press.c"],
        cwd=tmp_path,
        check=True,
    )
    listed = subprocess.run(
        ["nm", "-u", "press.o"], cwd=tmp_path, check=True, capture_output=True, text=True
    ).stdout
    assert {line.split()[-1].lstrip("_") for line in listed.splitlines()} <= {
        "tan",
        "sqrt",
        "GLOBAL_OFFSET_TABLE_",
    }


def test_names_from_files_change_nothing_but_comments(tmp_path):
    def written(text):
        machine = REFERENCE.replace(name=text, source=text, note=text)
        return dict(
            zip(
                "hc",
                sources(contents_of(exported(actuator=machine), force=True), "press", "double"),
                strict=True,
            )
        )

    plain, hostile = written("plain"), written(HOSTILE)
    for kind in "hc":
        assert without_comments(hostile[kind]) == without_comments(plain[kind])
    for kind, text in hostile.items():
        (tmp_path / f"press.{kind}").write_bytes(text)
    for trigraphs in ("-trigraphs", "-std=gnu99"):
        assert run(compile_c(tmp_path, trigraphs, "-DPRESS_SELF_TEST", "press.c")).returncode == 0


def without_comments(source: bytes) -> str:
    """The tokens that the preprocessor would see."""
    return re.sub(r"/\*.*?\*/", " ", source.decode("ascii"), flags=re.DOTALL)


@pytest.mark.parametrize(
    "name",
    ["two__lines", "1st", "press-left", "array", "Function", "_hidden", "ä", "x" * 41, "a b"],
)
def test_names_that_cannot_name_functions_are_refused(tmp_path, name):
    with pytest.raises(hc.InputError, match="cannot name"):
        write_c(contents("velocity p"), tmp_path / f"{name}.c", "double")


def test_the_same_schedule_gives_the_same_bytes():
    first, again = (
        sources(contents_of(exported(structure="p"), force=True), "press", "float")
        for _ in range(2)
    )
    assert first == again
