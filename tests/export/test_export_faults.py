"""Bad samples: whatever bits the sensors give, every target answers with a finite command, counts
the fault and starts afresh."""

import os
import re
import subprocess
from dataclasses import replace
from functools import cache
from pathlib import Path
from types import SimpleNamespace

import numba
import numpy as np
import pytest
from exports import CASES, contents, exported
from plain import plain
from test_export_c import COMPILER, compile_c

from hydroctl.errors import SimulationError
from hydroctl.export.c import sources, write_c
from hydroctl.export.contents import contents_of
from hydroctl.export.fmu import regulator_fmu
from hydroctl.export.st_law import st_name
from hydroctl.export.structured_text import source
from hydroctl.regulator import law
from hydroctl.regulator.printing.program import program_of
from hydroctl.regulator.vectors import law_of
from hydroctl.simulation import Scenario, simulate_closed_loop
from hydroctl.simulation.kernels.builds import law_build
from hydroctl.validation import campaign

LONG = bool(os.environ.get("HYDROCTL_LONG"))
SAMPLES = 1_000_000 if LONG else 20_000
FEWER = 10_000 if LONG else 2000
COMPARED = 20_000 if LONG else 2000
DRIVER = Path(__file__).with_name("fault_driver.c")
REALS = {"double": np.float64, "float": np.float32}
WORDS = {"32": (np.uint32, np.float32), "64": (np.uint64, np.float64)}
COLUMNS = ("reference", "v_ref", "p_a", "p_b", "v", "y")


def samples(case, count, words="32", real=np.float64, seed=4):
    """(count, 6) inputs of type `real`: a third sound, a third with one random word, a third of
    random words alone."""
    rng, (integer, word) = np.random.default_rng(seed), WORDS[words]
    loop = exported(**CASES[case]).loop
    y, v, error = (
        0.25 + 0.2 * rng.uniform(-1.0, 1.0, count),
        rng.uniform(-0.1, 0.1, count),
        0.01 * rng.uniform(-1.0, 1.0, count),
    )
    pressures = rng.uniform(0.0, 4e7, (2, count))
    sound = np.column_stack(
        [(v if loop == "velocity" else y) + error, v * (rng.random(count) < 0.5), *pressures, v, y]
    )
    random = rng.integers(0, np.iinfo(integer).max, (count, 6), dtype=integer, endpoint=True).view(
        word
    )
    kind = rng.integers(0, 3, (count, 1))
    replaced = (kind == 2) | ((kind == 1) & (np.arange(6) == rng.integers(0, 6, (count, 1))))
    with np.errstate(over="ignore", invalid="ignore"):
        return np.where(replaced, random, sound.astype(np.float32)).astype(real)


def read(case):
    """Which columns the law of the case reads."""
    return np.isin(COLUMNS, law.inputs_read(law_of(exported(**CASES[case]).regulator)))


def require_sound_answers(case, rows, answers, limits=None):
    """What holds after every sample, in every target. answers: x, faults so far, whether all is
    finite, x of a fresh start."""
    x, faults, finite, fresh = answers
    assert np.isfinite(x).all()
    assert (np.abs(x) <= 1.0).all()
    assert finite.all()
    faulty = np.diff(faults, prepend=0) == 1
    assert (np.diff(faults, prepend=0)[~faulty] == 0).all()
    assert (x[faulty] == 0.0).all()
    unsound = ~np.isfinite(rows)
    if limits is not None:
        with np.errstate(invalid="ignore"):
            unsound |= ~((limits[0] <= rows) & (rows <= limits[1]))
    assert faulty[unsound[:, read(case)].any(axis=1)].all()
    recovered = np.flatnonzero(~faulty[1:] & faulty[:-1]) + 1
    assert np.array_equal(x[recovered], fresh[recovered])
    assert len(recovered) >= len(rows) / 4000
    assert np.count_nonzero(x[recovered]) > len(recovered) / 2
    return faulty


@pytest.mark.long
@pytest.mark.parametrize("words", WORDS)
@pytest.mark.parametrize("case", CASES)
def test_no_bits_of_the_sensors_disturb_the_law_in_python(case, words):
    rows, regulator = samples(case, SAMPLES, words), law_of(exported(**CASES[case]).regulator)
    answers = np.zeros((4, SAMPLES))
    counted = _run_compiled(rows, law.AT_REST, regulator, answers)
    faulty = require_sound_answers(case, rows, answers)
    assert counted == np.count_nonzero(faulty)


@numba.njit(error_model="numpy")
def _run_compiled(rows, memory, regulator, answers):
    faults = 0
    rest = memory
    for k in range(len(rows)):
        row = rows[k]
        measured = (row[2], row[3], row[4], row[5])
        memory = _SAMPLE(row[0], row[1], measured, memory, regulator)
        faults += memory.running == 0.0
        finite = True
        for value in memory:
            finite &= np.isfinite(value)
        answers[0, k], answers[1, k], answers[2, k] = memory.x, faults, finite
        answers[3, k] = _SAMPLE(row[0], row[1], measured, rest, regulator).x
    return faults


_SAMPLE = law_build("full").sample


def in_python(case, rows, real):
    """(x, faults so far) of the law, in numbers of type `real`."""
    functions = {
        "sqrt": lambda value: np.sqrt(real(value)),
        "tan": lambda value: np.tan(real(value)),
        "isfinite": np.isfinite,
    }
    typed = plain(
        law,
        np=SimpleNamespace(**functions, where=lambda condition, yes, no: yes if condition else no),
    )
    regulator = _converted(law_of(exported(**CASES[case]).regulator), real)
    memory, answers, faults = typed.AT_REST, [], 0
    with np.errstate(over="ignore", invalid="ignore", under="ignore"):
        for reference, v_ref, *measured in rows:
            memory = typed.sample(reference, v_ref, tuple(measured), memory, regulator)
            faults += memory.running == 0.0
            answers.append((memory.x, faults))
    return np.array(answers, dtype=float).T


def _converted(value, real):
    if isinstance(value, bool | int):
        return value
    if isinstance(value, np.ndarray):
        return value.astype(real)
    if isinstance(value, tuple):
        parts = [_converted(part, real) for part in value]
        return type(value)(*parts) if hasattr(value, "_fields") else tuple(parts)
    return real(value)


def require_same_faults(case, rows, answers, real):
    """A fault where, and only where, the law in that precision finds one."""
    x, faults = in_python(case, rows[:COMPARED], real)
    assert np.array_equal(faults, answers[1][:COMPARED])
    assert np.mean(np.abs(x - answers[0][:COMPARED]) <= 1e-3) > 0.99


@pytest.mark.long
@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
@pytest.mark.parametrize(("real", "words"), [("double", "32"), ("double", "64"), ("float", "32")])
@pytest.mark.parametrize("case", CASES)
def test_no_bits_of_the_sensors_disturb_the_law_in_c(case, real, words, tmp_path):
    rows = samples(case, SAMPLES, words, REALS[real])
    write_c(contents(case), tmp_path / "press.c", real)
    program = compile_c(tmp_path, "-O2", "-I.", DRIVER, "press.c")
    answers = run_c(program, rows)
    require_sound_answers(case, rows, answers)
    require_same_faults(case, rows, answers, REALS[real])


def run_c(program, rows, *limits):
    """(4, n): x, faults so far, whether every state is finite, x of a fresh start."""
    arguments = [repr(float(limit)) for limit in limits]
    done = subprocess.run(
        [program, *arguments], input=rows.tobytes(), capture_output=True, check=True
    )
    return np.frombuffer(done.stdout).reshape(-1, 4).T


def limits_of(case):
    """(2, 6) limits of the reference and of y that some of the sound samples break."""
    reference = (-0.05, 0.05) if exported(**CASES[case]).loop == "velocity" else (0.125, 0.375)
    limits = np.array([[-np.inf] * 6, [np.inf] * 6])
    limits[:, 0], limits[:, 5] = reference, (0.125, 0.375)
    return limits


LIMITED = list(CASES)[::4]


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
@pytest.mark.parametrize("real", REALS)
@pytest.mark.parametrize("case", LIMITED)
def test_an_input_outside_its_limits_is_a_fault_in_c(case, real, tmp_path):
    rows, limits = samples(case, 20_000, real=REALS[real]), limits_of(case)
    write_c(contents(case), tmp_path / "press.c", real)
    program = compile_c(tmp_path, "-O2", "-I.", DRIVER, "press.c")
    answers = run_c(program, rows, *limits[:, [0, 5]].T.ravel())
    faulty = require_sound_answers(case, rows, answers, limits)
    unlimited = run_c(program, rows)[1]
    assert np.count_nonzero(faulty) > unlimited[-1] + 1000


@cache
def block_of(case, real):
    """The function block of a case, to make instances of."""
    structured_text = pytest.importorskip("structured_text", reason="blark is not installed")
    return structured_text.load(source(contents(case), "press", real).decode(), "press")


def states_of(case):
    """What the function block calls the numbers that it remembers."""
    program = program_of(contents(case).regulator)
    return [st_name(one.name) for one in program.memory]


def run_structured_text(case, rows, real, limits=None):
    """What `run_c` gives, of the function block."""
    new = block_of(case, real)
    names, states = ("setpoint", *COLUMNS[1:]), ["x", *states_of(case)]
    extra = {}
    if limits is not None:
        extra = {
            f"{names[k]}_{end}": row[k]
            for end, row in zip(("lowest", "highest"), limits, strict=True)
            for k in (0, 5)
        }
    block, fresh, answers = new(), new(), []
    with np.errstate(over="ignore", invalid="ignore", under="ignore"):
        for row in rows:
            fresh(reset=True)
            for one in (block, fresh):
                one(**dict(zip(names, row, strict=True)), **extra, reset=False)
            finite = np.isfinite([getattr(block.m, state) for state in states]).all()
            answers.append((block.m.x, block.m.faults, finite, fresh.m.x))
    return np.array(answers, dtype=float).T


@pytest.mark.long
@pytest.mark.parametrize("real", REALS)
@pytest.mark.parametrize("case", CASES if LONG else LIMITED)
def test_no_bits_of_the_sensors_disturb_the_law_in_structured_text(case, real):
    rows = samples(case, FEWER, real=REALS[real])
    answers = run_structured_text(case, rows, real)
    require_sound_answers(case, rows, answers)
    require_same_faults(case, rows, answers, REALS[real])


@pytest.mark.parametrize("case", LIMITED)
def test_an_input_outside_its_limits_is_a_fault_in_structured_text(case):
    rows, limits = samples(case, 1000), limits_of(case)
    faulty = require_sound_answers(
        case, rows, run_structured_text(case, rows, "double", limits), limits
    )
    assert np.count_nonzero(faulty) > 500


def run_fmu(case, rows, tmp_path, **limits):
    """What `run_c` gives, of the unit in FMPy; its states are not to be seen."""
    pytest.importorskip("fmpy")
    from test_export_fmu import Unit

    path = tmp_path / "press.fmu"
    path.write_bytes(
        regulator_fmu(contents_of(exported(**CASES[case], delay_samples=0), force=True), "press")
    )
    unit, answers = Unit(path, tmp_path / "unit", **limits), []
    for k, row in enumerate(rows):
        unit.set(**dict(zip(COLUMNS, row, strict=True)))
        (x,) = unit.get("x")
        unit.fmu.doStep(1e-3 * k, 1e-3)
        answers.append((x, *unit.get("faults"), True))
    unit.close()
    return np.array(answers, dtype=float).T


@pytest.mark.long
@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
@pytest.mark.parametrize("case", CASES if LONG else LIMITED)
def test_no_bits_of_the_sensors_disturb_the_unit_of_cosimulation(case, tmp_path):
    rows = samples(case, FEWER)
    x, faults, finite = run_fmu(case, rows, tmp_path)
    write_c(contents(case), tmp_path / "press.c", "double")
    fresh = run_c(compile_c(tmp_path, "-O2", "-ffp-contract=off", "-I.", DRIVER, "press.c"), rows)[
        3
    ]
    require_sound_answers(case, rows, (x, faults, finite, fresh))
    require_same_faults(case, rows, (x, faults), np.float64)


@pytest.mark.skipif(COMPILER is None, reason="no C compiler")
def test_an_input_outside_its_limits_is_a_fault_in_the_unit_of_cosimulation(tmp_path):
    case, rows = LIMITED[0], samples(LIMITED[0], 200)
    x, faults, _ = run_fmu(case, rows, tmp_path, y_lowest=0.125, y_highest=0.375)
    with np.errstate(invalid="ignore"):
        outside = ~((rows[:, 5] >= 0.125) & (rows[:, 5] <= 0.375))
    assert (np.diff(faults, prepend=0)[outside] == 1).all()
    assert 50 < np.count_nonzero(outside) <= faults[-1] < 150
    assert (x[np.diff(faults, prepend=0) == 1] == 0.0).all()


def test_a_simulation_in_which_the_regulator_overflows_fails_alone_and_in_a_campaign():
    """An anti-windup faster than half a sample lets the integral run away in saturation."""
    unstable = replace(exported(structure="pi"), Tt=1e-5)
    sound = replace(unstable, Tt=0.02)
    asked = Scenario(name="far", loop="velocity", Ts=1e-3, reference=np.full(400, 5.0), y=0.1)
    with pytest.raises(SimulationError, match="unstable in itself"):
        simulate_closed_loop(unstable.actuator, unstable, asked)
    assert np.abs(simulate_closed_loop(sound.actuator, sound, asked).command).max() == 1.0
    for schedule, failed in ((unstable, True), (sound, False)):
        assert (
            campaign(schedule.actuator, schedule, count=3, seed=1, scenarios=[asked]).failed
            == failed
        ).all()


def test_every_number_of_the_state_in_c_is_checked():
    header, code = (text.decode() for text in sources(contents(list(CASES)[-1]), "press", "double"))
    state = header[
        header.index("typedef struct {\n    int started") : header.index("} press_state;")
    ]
    assert re.findall(r"press_real (\w+);", state) == re.findall(r"isfinite\(state->(\w+)\)", code)
