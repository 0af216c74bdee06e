"""The formulas of a law as values; that a stranger can run them from a file stands in
tests/schedule/test_schedule_reader.py."""

from exports import CASES, exported

from hydroctl.regulator.formulas import law_formulas


def test_every_statement_of_a_real_number_says_its_unit_or_stands_in_a_limit():
    law = law_formulas(exported(**CASES["position pid+lead-lag+notch"]).regulator)
    for part in ("sample", "start"):
        for one in law[part]["statements"]:
            counted = one["name"] in ("i", "j", "next_i", "next_j", "is_extending")
            limit = "raised" in one["name"] or one["name"].endswith("_value")
            assert one["unit"] or counted or limit, one
