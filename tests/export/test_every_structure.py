"""Every structure of both loops, with and without the other effects: 10 000 random steps in C,
JavaScript and structured text are those of the law in Python."""

import json
import os
from itertools import product

import numpy as np
import pytest
from exports import FULL, exported
from plain import law
from py_mini_racer import MiniRacer
from test_export_c import COMPILER, compile_c
from test_export_faults import DRIVER, run_c

from hydroctl.export.c import write_c
from hydroctl.export.contents import contents_of
from hydroctl.export.structured_text import source
from hydroctl.regulator.printing.javascript import javascript_of
from hydroctl.regulator.structures import STRUCTURES
from hydroctl.regulator.vectors import law_of

LONG = bool(os.environ.get("HYDROCTL_LONG"))
STEPS = 10_000
LOOPS = ("velocity", "position")
KINDS = list(product(STRUCTURES, LOOPS))
IN_TEXT = KINDS if LONG else [KINDS[2 * k + k % 2] for k in range(len(STRUCTURES))]
"""every structure, in one loop after the other: the parser is slow"""
INPUTS = ("reference", "v_ref", "p_a", "p_b", "v", "y")


def schedule_of(structure, loop):
    """The effects beyond the structure in every other kind, so that each structure is seen with and
    without them."""
    place = list(STRUCTURES).index(structure) + LOOPS.index(loop)
    return exported(loop, structure, **(FULL if place % 2 else {}))


def random_steps(loop, count=STEPS, seed=7):
    """(count, 6) inputs: errors of either sign that now and then drive the command into its
    limits."""
    rng = np.random.default_rng(seed)
    y, v = 0.25 + 0.3 * rng.uniform(-1.0, 1.0, count), 0.1 * rng.uniform(-1.0, 1.0, count)
    error = rng.choice([0.002, 0.01, 3.0], count) * rng.uniform(-1.0, 1.0, count)
    v_ref = 0.1 * rng.uniform(-1.0, 1.0, count) * (rng.random(count) < 0.5)
    pressures = rng.uniform(-1e6, 4e7, (2, count))
    return np.column_stack([(v if loop == "velocity" else y) + error, v_ref, *pressures, v, y])


def answers_of_the_law(schedule, rows):
    """x of the law in Python, run as it stands."""
    regulator, memory, answers = law_of(schedule.regulator), law.AT_REST, []
    for reference, v_ref, *measured in rows.tolist():
        memory = law.sample(reference, v_ref, tuple(measured), memory, regulator)
        answers.append(memory.x)
    limited = np.mean(np.abs(answers) == 1.0)
    assert 0.01 < limited < 0.99
    return np.array(answers)


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
@pytest.mark.parametrize(("structure", "loop"), KINDS)
def test_every_structure_in_c(structure, loop, tmp_path):
    schedule, rows = schedule_of(structure, loop), random_steps(loop)
    write_c(contents_of(schedule, force=True), tmp_path / "press.c", "double")
    x = run_c(compile_c(tmp_path, "-I.", "-ffp-contract=off", DRIVER, "press.c"), rows)[0]
    assert np.abs(x - answers_of_the_law(schedule, rows)).max() <= 1e-12


@pytest.mark.parametrize(("structure", "loop"), KINDS)
def test_every_structure_in_javascript(structure, loop):
    schedule, rows = schedule_of(structure, loop), random_steps(loop)
    inputs = json.dumps([dict(zip(INPUTS, row, strict=True)) for row in rows.tolist()])
    program = f"""
        const law = (() => {{ {javascript_of(law_of(schedule.regulator))} }})();
        let memory = law.rest;
        JSON.stringify({inputs}.map((input) => (memory = law.sample(memory, input)).x))"""
    with MiniRacer() as engine:
        x = np.array(json.loads(engine.eval(program)))
    assert np.abs(x - answers_of_the_law(schedule, rows)).max() <= 1e-12


@pytest.mark.parametrize(("structure", "loop"), IN_TEXT)
def test_every_structure_in_structured_text(structure, loop):
    structured_text = pytest.importorskip("structured_text", reason="blark is not installed")
    schedule, rows = schedule_of(structure, loop), random_steps(loop)
    text = source(contents_of(schedule, force=True), "press", "double").decode()
    block, x = structured_text.load(text, "press")(), []
    for row in rows.tolist():
        block(**dict(zip(("setpoint", *INPUTS[1:]), row, strict=True)))
        x.append(block.m.x)
    assert np.abs(np.array(x) - answers_of_the_law(schedule, rows)).max() <= 1e-12


def test_the_kinds_in_text_leave_out_no_structure_and_no_loop():
    assert {structure for structure, _ in IN_TEXT} == set(STRUCTURES)
    assert {loop for _, loop in IN_TEXT} == set(LOOPS)
