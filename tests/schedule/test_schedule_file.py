"""The schedule file: its JSON Schema, older versions, test vectors; no changed file passes for
another schedule."""

import copy
import json
from dataclasses import fields
from pathlib import Path

import jsonschema
import numpy as np
import pytest
from exports import CASES, exported
from loops import PlainRegulator

import hydroctl as hc
from hydroctl.regulator.vectors import vectors_of
from hydroctl.schedule.document import SCHEMA_FILE, json_schema

DATA = Path(__file__).parents[1] / "data"
MUTATIONS = 1000


def same(one, other) -> bool:
    """Whether two schedules agree to the last bit."""
    return all(
        np.array_equal(getattr(one, field.name), getattr(other, field.name))
        for field in fields(one)
    )


@pytest.fixture(scope="module")
def schedule():
    return exported()


@pytest.fixture(scope="module")
def text(schedule, tmp_path_factory):
    return schedule.save(tmp_path_factory.mktemp("file") / "schedule.json").read_text()


def test_the_shipped_schema_is_that_of_the_models_and_is_printed(command):
    assert SCHEMA_FILE.read_text() == json_schema()
    code, stdout, _ = command("schema")
    assert (code, stdout) == (0, json_schema())
    jsonschema.Draft202012Validator.check_schema(json.loads(stdout))


@pytest.mark.parametrize("case", CASES)
def test_files_are_valid_under_the_schema_and_read_back_to_the_same_bits(case, tmp_path):
    made = exported(**CASES[case])
    path = made.save(tmp_path / "schedule.json")
    jsonschema.Draft202012Validator(json.loads(json_schema())).validate(
        json.loads(path.read_text())
    )
    again = hc.load_schedule(path)
    assert same(made, again)
    assert again.save(tmp_path / "again.json").read_bytes() == path.read_bytes()


def test_ranges_in_units_are_kept_as_they_were_stated(reference, tmp_path):
    stated = {"load_force": ("-5 kN", "20 kN"), "mass": (0.5, 1.5)}
    made = hc.tune(
        reference, [-0.5, 0.5], [0.25], specification=hc.Specification(uncertainty=stated)
    )
    path = made.save(tmp_path / "schedule.json")
    jsonschema.Draft202012Validator(json.loads(json_schema())).validate(
        json.loads(path.read_text())
    )
    again = hc.load_schedule(path)
    assert again.specification.uncertainty == stated
    assert again.margins.variants == made.margins.variants
    assert "load_force 20 kN, mass -50 %" in again.margins.variants


def test_an_inclined_machine_with_a_rating_is_kept_and_a_plain_one_written_as_before(
    reference, tmp_path
):
    for changes in ({"inclination": 0.5, "pressure_rating": 5e7}, {}):
        machine = reference.replace(**changes)
        made = hc.tune(
            machine, [-0.5, 0.5], [0.25], specification=hc.Specification(uncertainty="nominal")
        )
        path = made.save(tmp_path / "schedule.json")
        stated = json.loads(path.read_text())["actuator"]["parameters"]
        assert {name for name in stated if name in ("inclination", "pressure_rating")} == set(
            changes
        )
        assert hc.load_schedule(path).actuator == machine


def test_the_file_and_its_schema_state_the_ratios_between_which_the_law_compensates(tmp_path):
    path = exported(pressure_compensation=True).save(tmp_path / "schedule.json")
    document, schema = (
        json.loads(path.read_text()),
        jsonschema.Draft202012Validator(json.loads(json_schema())),
    )
    stated = document["controller"]["pressure_compensation"]["limits"]
    assert stated == [0.4, 3.0]
    assert schema.is_valid(document)
    for other in ([0.4, 2.9], [0.4, 3.1], [0.5, 3.0], [0.3, 3.0], [0.4], [0.4, 3.0, 3.0]):
        stated[:] = other
        assert not schema.is_valid(document)
        path.write_text(json.dumps(document))
        with pytest.raises(hc.InputError, match=r"pressure_compensation\.limits"):
            hc.load_schedule(path)


@pytest.mark.parametrize(
    "path", sorted(DATA.glob("schedule_version_*.json")), ids=lambda path: path.stem
)
def test_every_older_version_is_read_as_it_was_meant(path, tmp_path):
    given, read = json.loads(path.read_text()), hc.load_schedule(path)
    for table in given["scheduling"]["tables"]:
        np.testing.assert_array_equal(getattr(read, table["name"]), table["values"])
    unchecked = "unchecked: written before fingerprints"
    assert read.failed_checks == ((unchecked,) if given["version"] < 3 else ())
    assert read.Tm == given["controller"].get("measurement_filter_time", {"value": 0.0})["value"]
    assert read.actuator.fingerprint() == given["actuator"]["fingerprint"]
    assert same(read, hc.load_schedule(read.save(tmp_path / "present.json")))


@pytest.mark.parametrize("case", CASES)
def test_the_vectors_are_the_answers_of_an_independent_regulator(case):
    """A regulator built of other parts (tests/loops.py), which knows no bumpless start, gives x
    where the law runs from rest."""
    made = exported(**CASES[case])
    plain, compared = PlainRegulator(made), 0
    for vector in vectors_of(made.regulator):
        if vector.start is not None:
            break
        reference, v_ref, *measured = vector.inputs
        assert plain.command(reference, v_ref, *measured) == pytest.approx(vector.x, abs=1e-10)
        compared += 1
    assert compared == 5


def test_the_vectors_cover_both_sides_saturation_starts_and_a_broken_sensor(schedule):
    vectors = vectors_of(schedule.regulator)
    x = np.array([vector.x for vector in vectors])
    assert np.count_nonzero(np.abs(x) == 1.0) >= 2
    assert min(np.count_nonzero(x > 0.0), np.count_nonzero(x < 0.0)) >= 10
    assert np.count_nonzero((np.abs(x) < 1.0) & (x != 0.0)) > len(x) / 2
    assert sum(vector.gains is None for vector in vectors) == 1
    for vector in vectors:
        if vector.start is not None and schedule.ki.any():
            assert vector.x == pytest.approx(vector.start, abs=1e-9)


def test_a_vector_that_the_law_does_not_answer_is_refused(text, tmp_path, monkeypatch):
    document = json.loads(text)
    document["test_vectors"]["rows"][3][-1] += 1e-6
    path = tmp_path / "schedule.json"
    path.write_text(json.dumps(document))
    with pytest.raises(hc.InputError, match="changed after it was written"):
        hc.load_schedule(path)
    monkeypatch.setattr("hydroctl.schedule.schedule.require_unchanged", lambda document: None)
    with pytest.raises(hc.InputError, match=r"test_vectors\.3 gives x"):
        hc.load_schedule(path)


@pytest.mark.parametrize(
    ("version", "message"),
    [
        (1, "does not belong in a file of version 1"),
        (2, "does not belong in a file of version 2"),
        (3, r"test_vectors\.columns = "),
    ],
)
def test_a_new_file_does_not_pass_for_an_old_one(text, tmp_path, version, message):
    path = tmp_path / "schedule.json"
    path.write_text(text.replace('"version": 4', f'"version": {version}'))
    with pytest.raises(hc.InputError, match=message):
        hc.load_schedule(path)


def test_what_an_older_file_says_of_the_law_is_what_its_version_said(tmp_path):
    content = json.loads((DATA / "schedule_version_3.json").read_text())
    path = tmp_path / "schedule.json"
    for name in ("integral", "derivative", "notch", "anti_windup", "start", "fallback"):
        changed = copy.deepcopy(content)
        changed["controller"][name] = "Simpson's rule"
        path.write_text(json.dumps(changed))
        with pytest.raises(hc.InputError, match=rf"controller\.{name} = .*must be"):
            hc.load_schedule(path)


def _without_a_table(scheduling):
    del scheduling["tables"]["ki"]


def _with_a_short_row(scheduling):
    scheduling["tables"]["ki"]["values"][2].pop()


def _with_a_row_too_few(scheduling):
    scheduling["tables"]["kp"]["values"].pop()


def _with_a_node_too_many(scheduling):
    scheduling["y"]["nodes"].append(2.0 * scheduling["y"]["nodes"][-1])


def _with_a_descending_axis(scheduling):
    """Nodes and slopes that belong together."""
    axis = scheduling["y"]
    axis["nodes"].reverse()
    axis["slopes"] = [*(-slope for slope in axis["slopes"][-2::-1]), 0.0]


@pytest.mark.parametrize(
    "spoil",
    [
        _without_a_table,
        _with_a_short_row,
        _with_a_row_too_few,
        _with_a_node_too_many,
        _with_a_descending_axis,
    ],
)
def test_the_schema_by_itself_refuses_tables_that_are_none(text, spoil, tmp_path):
    schema, document = jsonschema.Draft202012Validator(json.loads(json_schema())), json.loads(text)
    assert schema.is_valid(document)
    spoil(document["scheduling"])
    assert not schema.is_valid(document)
    path = tmp_path / "schedule.json"
    path.write_text(json.dumps(document))
    with pytest.raises(hc.InputError):
        hc.load_schedule(path)


@pytest.mark.parametrize("part", ["law", "test_vectors", "fingerprint"])
def test_no_file_of_today_lacks_what_older_ones_lack(text, part):
    schema, document = jsonschema.Draft202012Validator(json.loads(json_schema())), json.loads(text)
    assert not schema.is_valid(document | {part: None})


PROSE = ("description", "reason", "name", "source", "note", "variant", "place", "expression")
"""keys under which sentences, formulas and names of things may stand"""


def _strings(node, key=""):
    if isinstance(node, dict):
        for name, value in node.items():
            yield from _strings(value, name)
    elif isinstance(node, list):
        for value in node:
            yield from _strings(value, key)
    elif isinstance(node, str):
        yield key, node


def test_keys_and_choices_are_identifiers_and_sentences_stand_in_descriptions(text):
    document = json.loads(text)
    chosen = ("interpolation", "extrapolation", "sides", "signal", "derivative_on", "form")
    words = dict(_strings({k: document[k] for k in ("loop", "controller", "scheduling")}))
    assert set(chosen) <= words.keys()
    for key, word in _strings(document):
        if key in (*chosen, "loop", "requirement", "subject", "method", "columns", "measured"):
            assert word.isidentifier(), (key, word)
        elif key not in PROSE:
            assert word.count(" ") <= 3, (key, word)


def test_mutated_files_are_refused_in_sentences_or_mean_the_same(schedule, text, tmp_path):
    rng = np.random.default_rng(20)
    path, faults = tmp_path / "mutated.json", []
    for k in range(MUTATIONS):
        path.write_bytes(
            _changed_bytes(text.encode(), rng) if k % 2 else _changed_content(json.loads(text), rng)
        )
        try:
            read = hc.load_schedule(path)
        except hc.InputError as error:
            faults.append(error.faults)
        else:
            assert same(schedule, read), f"mutation {k}"
    assert len(faults) > 0.7 * MUTATIONS
    assert all("mutated.json: " in fault for sentences in faults for fault in sentences)


def _changed_bytes(data: bytes, rng) -> bytes:
    """One to three bytes flipped, dropped, doubled or moved."""
    changed = bytearray(data)
    for _ in range(rng.integers(1, 4)):
        at, size = int(rng.integers(len(changed))), int(rng.integers(1, 20))
        piece = bytes(changed[at : at + size])
        match rng.integers(4):
            case 0:
                changed[at] ^= 1 << int(rng.integers(8))
            case 1:
                del changed[at : at + size]
            case 2:
                changed[at:at] = piece
            case 3:
                to = int(rng.integers(len(changed)))
                del changed[at : at + size]
                changed[to:to] = piece
    return bytes(changed)


ODD = (None, True, False, 0, -1, 1e308, -0.0, 1e-320, "", "1", "é\n", [], {}, [[]], 10**400, 0.1)


def _changed_content(document, rng) -> bytes:
    """One value anywhere replaced, scaled, removed, repeated or exchanged with another."""
    places = list(_places(document))
    holder, key = places[rng.integers(len(places))]
    other, other_key = places[rng.integers(len(places))]
    value = holder[key]
    match rng.integers(5):
        case 0:
            holder[key] = ODD[rng.integers(len(ODD))]
        case 1:
            holder[key] = (
                value * (1.0 + 10.0 ** -rng.integers(1, 15))
                if isinstance(value, float)
                else [value]
            )
        case 2:
            del holder[key]
        case 3 if isinstance(holder, list):
            holder.insert(key, copy.deepcopy(value))
        case _:
            holder[key], other[other_key] = copy.deepcopy(other[other_key]), copy.deepcopy(value)
    return json.dumps(document).encode()


def _places(node):
    for key in node if isinstance(node, dict) else range(len(node)):
        yield node, key
        if isinstance(node[key], dict | list):
            yield from _places(node[key])
