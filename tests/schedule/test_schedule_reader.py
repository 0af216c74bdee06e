"""A stranger's reader in JavaScript, which knows nothing of the law, runs a schedule from its file
alone."""

import copy
import json
import math
import re
from pathlib import Path

import pytest
from exports import CASES, FULL, exported
from py_mini_racer import JSEvalException, MiniRacer

READER = Path(__file__).with_name("schedule_reader.js").read_text("utf-8")
ROUNDING = 1e-12
GAIN_DIGITS = 5e-12 + ROUNDING
"""gains in vectors have twelve digits"""
SIGNS = re.compile(r" ([+-]) ")


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    """The content of a schedule file for every case."""
    path = tmp_path_factory.mktemp("files") / "schedule.json"
    return {
        name: json.loads(exported(**case).save(path).read_text()) for name, case in CASES.items()
    }


def largest_difference(content) -> dict[str, float]:
    """What the reader says of a file."""
    with MiniRacer() as engine:
        engine.eval(READER)
        try:
            told = engine.eval(f"JSON.stringify(largestDifference({json.dumps(content)}))")
        except JSEvalException:
            return {"x": math.inf, "gains": math.inf}
    return {name: math.inf if value is None else value for name, value in json.loads(told).items()}


@pytest.mark.parametrize("case", CASES)
def test_a_reader_that_holds_nothing_of_the_law_reproduces_every_vector_of_a_file(files, case):
    found = largest_difference(files[case])
    assert found["x"] <= ROUNDING
    assert found["gains"] <= GAIN_DIGITS


def test_compensation_and_inverse_are_among_the_files():
    assert FULL.items() <= CASES["position pid+lead-lag+notch"].items()
    assert FULL["pressure_compensation"]
    assert FULL["dead_band_inverse"] > 0.0


def test_the_reader_is_short_and_names_nothing_of_the_law(files):
    assert len(READER.splitlines()) <= 60
    law = files["position pid+lead-lag+notch"]["law"]
    names = {one["name"] for part in ("sample", "start") for one in law[part]["statements"]}
    words = set(re.findall(r"\w+", re.sub(r"//.*", "", READER)))
    assert names & words <= {"x"}


@pytest.mark.parametrize("case", CASES)
def test_every_changed_sign_in_the_formulas_of_a_file_is_noticed(files, case):
    for k, statement in enumerate(files[case]["law"]["sample"]["statements"]):
        if statement["expression"].startswith("0 + "):
            continue
        for sign in SIGNS.finditer(statement["expression"]):
            changed = copy.deepcopy(files[case])
            a, b = sign.span(1)
            other = "-" if sign[1] == "+" else "+"
            text = statement["expression"][:a] + other + statement["expression"][b:]
            changed["law"]["sample"]["statements"][k]["expression"] = text
            assert max(largest_difference(changed).values()) > 1e-9, (statement["name"], text)
