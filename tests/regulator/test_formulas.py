"""The formulas of a law: a reader in JavaScript that knows nothing of it reproduces every test
vector, and notices a changed sign."""

import copy
import json
import math
import re
from pathlib import Path

import pytest
from exports import CASES, exported
from py_mini_racer import JSEvalException, MiniRacer

from hydroctl.regulator.formulas import law_formulas
from hydroctl.regulator.vectors import vectors_of

READER = Path(__file__).with_name("formula_reader.js").read_text("utf-8")
INPUTS = ("reference", "v_ref", "p_a", "p_b", "v", "y")
GAINS = ("kp", "ki", "kd", "notch_frequency")
ROUNDING = 1e-12
GAIN_DIGITS = 5e-12 + ROUNDING
"""gains in vectors have twelve digits"""


def largest_difference(law, vectors):
    """What the reader makes of a law and the vectors of a schedule."""
    given = [
        {
            "start": v.start,
            "inputs": {
                name: value if math.isfinite(value) else None
                for name, value in zip(INPUTS, v.inputs, strict=True)
            },
            "gains": None if v.gains is None else dict(zip(GAINS, v.gains, strict=True)),
            "x": v.x,
        }
        for v in vectors
    ]
    with MiniRacer() as engine:
        engine.eval(READER)
        asked = f"largestDifference({json.dumps(law)}, {json.dumps(given)})"
        try:
            found = json.loads(engine.eval(f"JSON.stringify({asked})"))
        except JSEvalException:  # a node beyond the table, say
            return {"x": math.inf}
    return {name: math.inf if value is None else value for name, value in found.items()}


@pytest.mark.parametrize("case", CASES)
def test_a_reader_that_holds_nothing_of_the_law_reproduces_every_vector(case):
    scheduled = exported(**CASES[case]).regulator
    found = largest_difference(law_formulas(scheduled), vectors_of(scheduled))
    assert found["x"] <= ROUNDING
    assert found["gains"] <= GAIN_DIGITS


def test_the_reader_is_short_and_names_nothing_of_the_law():
    lines = READER.splitlines()
    assert len(lines) <= 60
    scheduled = exported(**CASES["position pid+lead-lag+notch"]).regulator
    law = law_formulas(scheduled)
    names = {one["name"] for part in ("sample", "start") for one in law[part]["statements"]}
    words = set(re.findall(r"\w+", re.sub(r"//.*", "", READER)))
    assert names & words <= {"x"}


SIGNS = re.compile(r" ([+-]) ")


@pytest.mark.parametrize("case", CASES)
def test_every_changed_sign_in_the_formulas_of_a_sample_is_noticed(case):
    """Each + and - between two terms, one at a time; none of them is without effect on the
    vectors."""
    scheduled = exported(**CASES[case]).regulator
    vectors, law = vectors_of(scheduled), law_formulas(scheduled)
    for k, statement in enumerate(law["sample"]["statements"]):
        if statement["expression"].startswith("0 + "):
            continue
        for sign in SIGNS.finditer(statement["expression"]):
            changed = copy.deepcopy(law)
            other = " - " if sign[1] == "+" else " + "
            text = statement["expression"]
            changed["sample"]["statements"][k]["expression"] = (
                text[: sign.start()] + other + text[sign.end() :]
            )
            found = largest_difference(changed, vectors)
            assert max(found.values()) > 1e-9, (statement["name"], statement["expression"])


def test_every_statement_of_a_real_number_says_its_unit_or_stands_in_a_limit():
    law = law_formulas(exported(**CASES["position pid+lead-lag+notch"]).regulator)
    for part in ("sample", "start"):
        for one in law[part]["statements"]:
            counted = one["name"] in ("i", "j", "next_i", "next_j", "is_extending")
            limit = "raised" in one["name"] or one["name"].endswith("_value")
            assert one["unit"] or counted or limit, one
