"""The regulator in structured text: parsed by blark, run by an interpreter, the same commands as
the law in Python."""

import os
import re

import numpy as np
import pytest
from exports import CASES, HOSTILE, REFERENCE, RESET, START, closed_loop, contents, exported

import hydroctl as hc
from hydroctl.export.contents import contents_of
from hydroctl.export.st_law import FUNCTION_BLOCKS
from hydroctl.export.structured_text import source, write_structured_text

structured_text = pytest.importorskip("structured_text", reason="blark is not installed")
STEPS = 1500
BOUNDS = {"double": 1e-12, "float": 1e-5}
REALS = list(BOUNDS) if os.environ.get("HYDROCTL_LONG") else ["double"]


@pytest.mark.long  # the parser takes a millisecond for a character
@pytest.mark.parametrize("real", REALS)
@pytest.mark.parametrize("case", CASES)
def test_random_closed_loop_steps_are_those_of_the_law(case, real):
    schedule = exported(**CASES[case])
    block = structured_text.load(source(contents(case), "press", real).decode(), "press")()
    operations, expected = closed_loop((schedule, schedule), STEPS)
    start, answers = None, []
    for kind, _, start_x, *inputs in operations:
        if kind == START:
            start = start_x
            continue
        flags = {"reset": kind == RESET, "start": start is not None, "start_x": start or 0.0}
        block(
            **dict(zip(("setpoint", "v_ref", "p_a", "p_b", "v", "y"), inputs, strict=True)), **flags
        )
        answers.append(block.m.x)
        start = None
    expected = expected[operations[:, 0] != START]
    assert np.abs(np.array(answers, dtype=float) - expected).max() <= BOUNDS[real]
    assert block.m.faults == np.count_nonzero(
        ~np.isfinite(operations[operations[:, 0] == 0.0]).all(axis=1)
    )


@pytest.mark.parametrize("case", CASES)
def test_single_precision_differs_in_types_and_numbers_alone(case):
    double, single = (source(contents(case), "press", real).decode() for real in BOUNDS)
    single = re.sub(r"   Single precision.*?sensors\.\n", "", single, flags=re.DOTALL)
    numbers = re.compile(r"\d[\d.e+-]*")
    assert numbers.sub("0", double.replace("LREAL", "REAL")) == numbers.sub("0", single)
    assert "LREAL" not in single
    assert "(* 1/m, proportional gain *)" in single or "(* s/m, proportional gain *)" in single


@pytest.mark.parametrize("case", CASES)
def test_a_compiler_that_knows_the_standard_alone_takes_the_names_and_sections(case):
    """No variable is called after a block of the standard library; no vendor's VAR_TEMP; no VAR
    after a VAR CONSTANT, which would be taken as constant."""
    text = _without_comments(source(contents(case), "press", "double"))
    declared = re.findall(r"^ +(\w+) : ", text, flags=re.MULTILINE)
    assert len(declared) > 20
    assert not FUNCTION_BLOCKS & {name.lower() for name in declared}
    assert "VAR_TEMP" not in text
    for unit in re.split(r"^FUNCTION", text, flags=re.MULTILINE)[1:]:
        sections = re.findall(r"^VAR\w*(?: CONSTANT)?", unit, flags=re.MULTILINE)
        assert "VAR CONSTANT" not in sections[:-1]


def test_names_from_files_change_nothing_but_comments(tmp_path):
    plain, hostile = (
        source(
            contents_of(
                exported(actuator=REFERENCE.replace(name=text, source=text, note=text)), force=True
            ),
            "press",
            "double",
        )
        for text in ("plain", HOSTILE)
    )
    assert _without_comments(hostile) == _without_comments(plain)


def _without_comments(text: bytes) -> str:
    return re.sub(r"\(\*.*?\*\)", " ", text.decode("ascii"), flags=re.DOTALL)


def test_a_name_that_structured_text_keeps_for_itself_is_refused(tmp_path):
    with pytest.raises(hc.InputError, match="cannot name"):
        write_structured_text(contents("velocity p"), tmp_path / "Step.st", "double")
    assert list(tmp_path.iterdir()) == []
