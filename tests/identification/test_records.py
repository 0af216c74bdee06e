"""Measured records: what is refused and why, and CSV files with names and units."""

import numpy as np
import pytest

import hydroctl as hc

N = 400


def columns(**changes):
    """A sound record of a piston that follows a slow square wave."""
    t = np.arange(N) * 1e-2
    x = np.where(np.sin(t) > 0.0, 0.2, -0.3)
    v = 0.1 * x
    return {"t": t, "x": x, "v": v, "y": 0.2 + np.cumsum(v) * 1e-2} | changes


def spoilt(name, rows, value):
    given = columns()
    given[name][rows] = value
    return given


def test_a_sound_record_is_kept():
    record = hc.Record(**columns())
    assert record.sample_time == pytest.approx(1e-2)
    np.testing.assert_array_equal(record.x, columns()["x"])


def gap():
    return {name: np.delete(values, slice(100, 140)) for name, values in columns().items()}


def jittered():
    t = columns()["t"] + 4e-3 * np.random.default_rng(0).uniform(-1.0, 1.0, N)
    return columns(t=t)


def swapped(one, other):
    given = columns()
    given[one], given[other] = given[other], given[one]
    return given


@pytest.mark.parametrize(
    ("given", "message"),
    [
        (
            spoilt("v", [7, 9], np.nan),
            r"v holds 2 values that are not numbers, the first in row 7; cut the record",
        ),
        (gap(), r"t has 1 gaps, the first after row 99 .*cut the record at the gaps"),
        (jittered(), r"t is not evenly spaced .*resample"),
        (spoilt("t", 50, 0.1), r"t does not rise in row 50"),
        (spoilt("x", slice(None), 0.1), r"x is 0.1 in every row: a constant input excites nothing"),
        (spoilt("x", 3, 30.0), r"x reaches 30 in size, beyond \[-1, 1\]"),
        (swapped("v", "y"), r"y is not the integral of v"),
        (swapped("x", "y"), r"y is not the integral of v"),
        (swapped("x", "v"), r"y is not the integral of v"),
        (swapped("t", "y"), r"t does not rise"),
        (columns(v=-columns()["v"]), r"y is not the integral of v.*sign of v"),
        (columns(y=1e3 * columns()["y"]), r"y is not the integral of v.*units"),
        (columns(y=np.zeros(N - 1)), r"give arrays of one length"),
        (
            {name: values[:20] for name, values in columns().items()},
            r"the record has 20 samples; at least 50",
        ),
        (columns(x="text"), r"x is not an array of numbers"),
    ],
)
def test_a_record_that_cannot_be_used_is_refused_with_its_reason(given, message):
    with pytest.raises(hc.InputError, match=message):
        hc.Record(**given)


def test_all_faults_of_a_record_are_named_at_once():
    with pytest.raises(hc.InputError) as caught:
        hc.Record(**(swapped("v", "y") | {"x": np.full(N, 3.0)}))
    assert len(caught.value.faults) == 3


def write(path, given, separator=",", names=("Time", "Valve", "Speed", "Pos")):
    rows = np.column_stack(
        [given["t"] * 1e3, given["x"] * 100.0, given["v"] * 1e3, given["y"] * 1e3]
    )
    lines = [
        separator.join(names),
        *(separator.join(f"{value:.9g}" for value in row) for row in rows),
    ]
    path.write_text("\n".join(lines))


NAMES = {"t": "Time", "x": "Valve", "v": "Speed", "y": "Pos"}
UNITS = {"t": "ms", "x": "%", "v": "mm/s", "y": "mm"}


@pytest.mark.parametrize("separator", [",", ";", "\t"])
def test_csv_columns_and_units_are_turned_into_si(tmp_path, separator):
    write(tmp_path / "record.csv", columns(), separator)
    record = hc.read_record(tmp_path / "record.csv", columns=NAMES, units=UNITS)
    for name, values in columns().items():
        np.testing.assert_allclose(getattr(record, name), values, rtol=1e-8, atol=1e-12)


def test_a_file_without_position_gives_a_record_without_it(tmp_path):
    write(tmp_path / "record.csv", columns(), names=("t", "x", "v", "other"))
    assert hc.read_record(tmp_path / "record.csv", units=UNITS).y is None


@pytest.mark.parametrize(
    ("text", "arguments", "message"),
    [
        (
            "t,x,v\n1,2,3",
            {"columns": {"x": "valve"}},
            r"column 'valve' for x is not in the file \(t, x, v\)",
        ),
        ("t,x,v\n1,2,3", {"columns": {"z": "valve"}}, r"column 'z' is unknown"),
        (
            "t,x,v\n1,2,3",
            {"units": {"t": "mm"}},
            r"units\['t'\] = '1 mm' has an unknown unit or one of the wrong dimension",
        ),
        ("t,x,v\n1,up,3", {}, r"column 'x', row 0: 'up' is not a number"),
        ("t;x;v\n0;0,5;0", {}, r"column 'x', row 0: '0,5' is not a number; decimals have a point"),
        ("t,x,v\n0,0,5,0", {}, r"row 1 has 4 fields under 3 names; decimals have a point"),
        ("1,2,3\n4,5,6", {}, r"the first line holds numbers"),
        ("t,x,v\n", {}, r"holds no rows"),
        ("", {}, r"holds no rows"),
        (
            "t,x,v\n" + "".join(f"{k},{k % 2},\n" for k in range(60)),
            {},
            r"v holds 60 values that are not numbers",
        ),
    ],
)
def test_a_bad_file_is_named_with_its_fault(tmp_path, text, arguments, message):
    path = tmp_path / "record.csv"
    path.write_text(text)
    with pytest.raises(hc.InputError, match=message):
        hc.read_record(path, **arguments)


def test_a_file_that_cannot_be_read_is_named(tmp_path):
    with pytest.raises(hc.InputError, match=r"missing.csv: cannot be read \(No such file"):
        hc.read_record(tmp_path / "missing.csv")
    (tmp_path / "binary.csv").write_bytes(b"\xff\xfe\x00\x81")
    with pytest.raises(hc.InputError, match="not UTF-8 text"):
        hc.read_record(tmp_path / "binary.csv")
