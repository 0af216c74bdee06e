"""Single precision: the self test passes, and finds any wrong table entry; the stated bound
holds."""

import os
import re
import subprocess
from dataclasses import replace
from itertools import product
from pathlib import Path

import numpy as np
import pytest
from exports import CASES, closed_loop, exported, fitted
from test_export_c import COMPILER, compile_c, run
from test_export_c import DRIVER as STEPS

import hydroctl as hc
from hydroctl.export import precision
from hydroctl.export.c import write_c
from hydroctl.export.contents import contents_of
from hydroctl.regulator import law
from hydroctl.regulator.vectors import answer, law_of, vectors_of

LONG = bool(os.environ.get("HYDROCTL_LONG"))
TABLES = Path(__file__).with_name("table_driver.c")
LOOPS = ("velocity", "position")
STRUCTURES = ("p", "pi", "pi+notch", "pid", "pid+lead-lag+notch")
SWEEP = list(product(hc.list_actuators(), LOOPS, STRUCTURES))
COMBINATIONS = SWEEP if LONG else SWEEP[::3]
"""a step of 3 meets every machine, loop and structure"""

pytestmark = pytest.mark.skipif(COMPILER is None, reason="no C compiler")


def unfound_changes(schedule, directory, real):
    """(what the self test ends with, the changes of the tables by one percent that it misses)."""
    contents = contents_of(schedule, force=True)
    write_c(contents, directory / "press.c", real)
    tables = " ".join(f"CHANGE({name.upper()})" for name in contents.tables)
    given = (
        "-O2",
        "-std=c99",
        "-Dconst=",
        "-DPRESS_SELF_TEST",
        f"-DTABLES={tables}",
        "-I.",
        TABLES,
    )
    subprocess.run([COMPILER, *map(str, given), "-lm", "-o", "program"], cwd=directory, check=True)
    done = subprocess.run([directory / "program"], capture_output=True, text=True, check=False)
    return done.returncode, done.stdout.splitlines()


@pytest.mark.long
@pytest.mark.parametrize(("machine", "loop", "structure"), COMBINATIONS)
def test_the_self_test_in_single_precision_passes_and_finds_every_wrong_entry(
    machine, loop, structure, tmp_path
):
    assert unfound_changes(fitted(machine, loop, structure), tmp_path, "float") == (0, [])


@pytest.mark.long
@pytest.mark.parametrize(
    ("machine", "loop", "structure"), COMBINATIONS if LONG else COMBINATIONS[::6]
)
def test_the_self_test_in_double_precision_finds_every_wrong_entry(
    machine, loop, structure, tmp_path
):
    assert unfound_changes(fitted(machine, loop, structure), tmp_path, "double") == (0, [])


@pytest.mark.parametrize("real", ["double", "float"])
def test_zeros_and_gains_of_very_different_sizes_in_a_table_are_tested_too(real, tmp_path):
    given = exported("position", "pid+notch")
    ki, kd = given.ki.copy(), given.kd.copy()
    kd[1:3, :2], ki[0, 1], ki[2, 0] = 0.0, 0.01 * ki[0, 1], 0.0
    assert unfound_changes(replace(given, ki=ki, kd=kd), tmp_path, real) == (0, [])


def tuned(machine, loop, structure):
    """As the tuner makes it, on a few points."""
    actuator = hc.load_actuator(machine)
    x = np.array([-1.0, -0.3, -0.08, 0.08, 0.3, 1.0])
    y = actuator.stroke * np.array([0.02, 0.25, 0.5, 0.75, 0.98])
    specification = hc.Specification(uncertainty="nominal")
    return hc.tune(actuator, x, y, loop=loop, structure=structure, specification=specification)


@pytest.mark.long
@pytest.mark.parametrize(
    ("machine", "loop", "structure"), SWEEP if LONG else [("reference", "position", "pi+notch")]
)
def test_tuned_schedules_pass_their_self_test_in_single_precision(
    machine, loop, structure, tmp_path
):
    try:
        schedule = tuned(machine, loop, structure)
    except hc.InfeasibleError as error:
        pytest.skip(str(error))
    assert unfound_changes(schedule, tmp_path, "float") == (0, [])


@pytest.mark.parametrize("case", CASES)
def test_answers_alone_show_every_wrong_entry_of_a_table(case):
    """For readers that compare no gains: without the rest of the law, each entry matters to some
    x."""
    schedule = exported(**CASES[case])
    regulator, vectors = law_of(schedule.regulator), vectors_of(schedule.regulator)
    for column, i, j in np.ndindex(4, *schedule.kp.shape):
        table = regulator.table.copy()
        table[i, j, column] *= 1.01
        changed, memory, differences = regulator._replace(table=table), law.AT_REST, []
        for vector in vectors:
            found, memory = answer(vector.start, vector.inputs, memory, changed)
            differences.append(abs(found.x - vector.x))
        assert max(differences) > 1e-6 or not table[..., column].any()


@pytest.mark.parametrize("case", CASES)
def test_the_inputs_of_the_vectors_are_numbers_of_single_precision(case):
    vectors = vectors_of(exported(**CASES[case]).regulator)
    inputs = np.array([[*vector.inputs, vector.start or 0.0] for vector in vectors])
    assert np.array_equal(inputs.astype(np.float32).astype(float), inputs, equal_nan=True)


BOUNDED = [(machine, loop) for machine in hc.list_actuators() for loop in LOOPS]


@pytest.mark.long
@pytest.mark.parametrize(
    ("machine", "loop"),
    BOUNDED if LONG else [("crane_80_45", "position"), ("fast_50_28", "velocity")],
)
@pytest.mark.parametrize("structure", STRUCTURES if LONG else ["pi+notch"])
def test_ten_thousand_steps_stay_within_the_stated_bound(machine, loop, structure, tmp_path):
    pair = [
        fitted(machine, loop, structure, scale=scale, pressure_compensation=True)
        for scale in (1.0, 0.7)
    ]
    operations, expected = closed_loop(pair, 10_000)
    both = [contents_of(schedule, force=True) for schedule in pair]
    for name, given in zip(("first", "second"), both, strict=True):
        write_c(given, tmp_path / f"{name}.c", "float")
    found = np.frombuffer(
        run(compile_c(tmp_path, "-O2", "-I.", STEPS, "first.c", "second.c"), operations).stdout
    )
    worst, bound = (
        np.abs(found - expected).max(),
        max(precision.stated_bound(given, 10_000) for given in both),
    )
    print(f"{machine} {loop} {structure}: {worst:.1e} of {bound:.1e}")
    assert worst <= bound
    assert np.ptp(expected) > 0.1


def test_the_file_states_a_bound_that_is_not_below_the_computed_one(tmp_path):
    given = contents_of(exported(), force=True)
    header = write_c(given, tmp_path / "press.c", "float")[0].read_text()
    stated = [
        float(number)
        for number in re.findall(r"(\d\.\de-\d+)", header[header.index("Single precision") :])[:2]
    ]
    computed = [precision.stated_bound(given, samples) for samples in (1, 10_000)]
    assert np.all(np.array(computed) <= stated)
    assert stated == pytest.approx(computed, rel=0.1)
    assert "Single precision" not in write_c(given, tmp_path / "press.c", "double")[0].read_text()


def test_the_bound_of_a_proportional_regulator_is_that_by_hand():
    """x = kp (r - y) with r - y = 1/kp: kp as written and looked up; the difference, the product,
    and the sums with an absent integral, derivative and feed-forward; r and y themselves, times kp.
    """
    flat = replace(exported("position", "p"), kp=np.full((4, 3), 40.0), feed_forward=False)
    lookup, operations, inputs = 9.0, 5.0, 40.0 * (0.5 + 0.5 + 1.0 / 40.0)
    assert precision.bound(law_of(flat.regulator), 1, 0.5) == pytest.approx(
        2.0**-24 * (lookup + operations + inputs), rel=0.005
    )


def test_the_roundings_of_an_integral_add_up_from_sample_to_sample():
    regulator = law_of(exported("position", "pi").regulator)
    one, few, many = (precision.bound(regulator, samples, 0.5) for samples in (1, 10_001, 100_001))
    assert many - one == pytest.approx(10.0 * (few - one), rel=0.01)
    assert few > 10.0 * one
    proportional = law_of(exported("position", "p").regulator)
    assert precision.bound(proportional, 10_000, 0.5) == pytest.approx(
        precision.bound(proportional, 1, 0.5), rel=1e-12
    )


def tried(regulator):
    """(memory, inputs) of samples between nodes, where the law has a derivative."""
    rng = np.random.default_rng(6)
    inputs = (0.2101 if regulator.position else 0.21, 0.03, 1.2e7, 0.9e7, 0.2, 0.21)
    for x in (-0.6, -0.3, 0.4, 0.7):
        started = np.array(law.start(x, *inputs[:2], inputs[2:], regulator), dtype=float)
        moved = started + np.where(started == 0.0, 0.0, 1e-4) * rng.standard_normal(started.size)
        yield law.Memory(*moved.tolist())._replace(x=x, running=1.0), inputs


def linear(memory, inputs, regulator, input_error):
    arrays = law.Memory(*map(np.atleast_1d, memory[:-1]), 1.0), tuple(map(np.atleast_1d, inputs))
    return precision.linear_sample(*arrays, regulator, np.array([input_error]))


def slope(function, value, step):
    return (function(value + step) - function(value - step)) / (2.0 * step)


def states_in_use(regulator):
    states = {
        "x": True,
        "integral": regulator.integrates,
        "derivative": regulator.derives,
        "last": regulator.derives,
    }
    states |= dict.fromkeys(("notch_1", "notch_2"), regulator.zz != regulator.zp) | {
        "filtered": regulator.Tm != 0.0
    }
    states |= {
        f"section_{k + 1}": zero != pole for k, (zero, pole) in enumerate(regulator.sections)
    }
    return [name for name, use in states.items() if use]


@pytest.mark.parametrize("case", CASES)
def test_what_a_memory_does_to_the_next_is_the_derivative_of_the_law(case):
    regulator = law_of(exported(**CASES[case]).regulator)
    for memory, inputs in tried(regulator):
        found = linear(memory, inputs, regulator, 0.0).by_memory[0]
        for name in states_in_use(regulator):

            def after(value, name=name, memory=memory, inputs=inputs):
                changed = memory._replace(**{name: value})
                return np.array(
                    law.sample(*inputs[:2], inputs[2:], changed, regulator)[:-1], dtype=float
                )

            expected = slope(after, getattr(memory, name), 1e-6)
            assert found[:, law.Memory._fields.index(name)] == pytest.approx(
                expected, rel=1e-5, abs=1e-6
            ), name


@pytest.mark.parametrize("case", CASES)
def test_what_the_rounding_of_an_input_does_is_the_derivative_of_the_law(case):
    regulator = law_of(exported(**CASES[case]).regulator)
    for memory, inputs in tried(regulator):
        rounded, exact = (
            linear(memory, inputs, regulator, error).by_rounding[0] for error in (1.0, 0.0)
        )
        found = np.abs(rounded - exact)[law.Memory._fields.index("x")].sum()
        expected = 0.0
        for k, given in enumerate(inputs):

            def command(value, k=k, memory=memory, inputs=inputs):
                changed = (*inputs[:k], value, *inputs[k + 1 :])
                return float(law.sample(*changed[:2], changed[2:], memory, regulator).x)

            expected += abs(given * slope(command, given, 1e-7 * given))
        assert found == pytest.approx(expected, rel=1e-4)
