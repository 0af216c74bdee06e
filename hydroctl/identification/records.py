"""`Record`: a measured motion, checked when made; `read_record` takes one from a CSV file."""

from __future__ import annotations

import csv
import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from ..digits import apart
from ..errors import InputError, unknown_name
from ..machine.units import to_si

_SI = {"t": "s", "x": "", "v": "m/s", "y": "m"}
_EVEN = 0.02
"""largest deviation of a sampling interval from the median, relative"""
_TRAVEL = 0.2
"""largest disagreement of y with the integral of v, relative to the travel"""
_LEAST = 50
_LARGEST_FILE = 500_000_000


@dataclass(frozen=True, eq=False)
class Record:
    """Evenly sampled measurements, (n,) each. Raises InputError with every fault at once: gaps,
    NaN, constant x, swapped columns.

    x[k] is taken as held from t[k] to t[k + 1].
    """

    t: np.ndarray
    """s, rising in even steps"""
    x: np.ndarray
    """valve opening, in [-1, 1]"""
    v: np.ndarray
    """m/s; noise allowed"""
    y: np.ndarray | None = None
    """m; None where it was not measured, which only the basis "constant" allows"""

    def __post_init__(self):
        for name in ("t", "x", "v", "y"):
            if getattr(self, name) is not None:
                object.__setattr__(self, name, _numbers(name, getattr(self, name)))
        faults = list(self._shape_faults())
        faults = faults or list(self._value_faults())
        if faults:
            raise InputError(faults)

    @property
    def sample_time(self) -> float:
        """s: the mean sampling interval."""
        return float((self.t[-1] - self.t[0]) / (len(self.t) - 1))

    def _channels(self) -> dict[str, np.ndarray]:
        return {name: getattr(self, name) for name in _SI if getattr(self, name) is not None}

    def _shape_faults(self) -> Iterator[str]:
        shapes = {name: values.shape for name, values in self._channels().items()}
        if len(set(shapes.values())) > 1 or self.t.ndim != 1:
            yield f"the columns have the shapes {shapes}; give arrays of one length."
        elif len(self.t) < _LEAST:
            yield f"the record has {len(self.t)} samples; at least {_LEAST} are needed."

    def _value_faults(self) -> Iterator[str]:
        clean = True
        for name, values in self._channels().items():
            if (bad := np.flatnonzero(~np.isfinite(values))).size:
                clean = False
                yield (
                    f"{name} holds {bad.size} values that are not numbers, the first in row"
                    f" {bad[0]}; cut the record there."
                )
        if not clean:
            return
        yield from self._time_faults()
        if np.ptp(self.x) == 0.0:
            yield (
                f"x is {self.x[0]:g} in every row: a constant input excites nothing. Record steps"
                " or a PRBS."
            )
        if (largest := np.max(np.abs(self.x))) > 1.0:
            yield (
                f"x reaches {apart(largest, 1.0)[0]} in size, beyond [-1, 1]; check its unit and"
                " the order of the columns."
            )
        if np.ptp(self.v) == 0.0:
            yield f"v is {self.v[0]:g} in every row; check the sensor and the order of the columns."
        yield from self._travel_faults()

    def _time_faults(self) -> Iterator[str]:
        steps = np.diff(self.t)
        if (backward := np.flatnonzero(steps <= 0.0)).size:
            yield (
                f"t does not rise in row {backward[0] + 1} (t = {self.t[backward[0] + 1]:g} s);"
                " sort the rows, drop doubled ones."
            )
            return
        usual = np.median(steps)
        uneven = np.flatnonzero(np.abs(steps - usual) > _EVEN * usual)
        if uneven.size == 0:
            return
        row, missing = uneven[0], np.max(steps) / usual
        if uneven.size <= 0.01 * len(steps) and missing > 1.5:
            found, expected = apart(steps[row], usual)
            yield (
                f"t has {uneven.size} gaps, the first after row {row} (t = {self.t[row]:g} s):"
                f" {found} s in place of {expected} s; cut the record at the gaps and identify the"
                " longest part."
            )
        else:
            shortest, longest = apart(steps.min(), steps.max())
            yield (
                f"t is not evenly spaced (steps of {shortest} to {longest} s); resample the record"
                " to one sample time."
            )

    def _travel_faults(self) -> Iterator[str]:
        if self.y is None or (np.diff(self.t) <= 0.0).any():
            return
        travel = np.concatenate(
            [[0.0], np.cumsum((self.v[1:] + self.v[:-1]) / 2.0 * np.diff(self.t))]
        )
        error = self.y - travel
        error -= error.mean()
        size = np.sqrt(
            np.mean((self.y - self.y.mean()) ** 2) + np.mean((travel - travel.mean()) ** 2)
        )
        difference = np.sqrt(np.mean(error**2))
        if size > 0.0 and difference > _TRAVEL * size:
            yield (
                f"y is not the integral of v: y spans {np.ptp(self.y):g} m, its integral"
                f" {np.ptp(travel):g} m, {difference:g} m rms apart. Check the order of the"
                " columns, their units and the sign of v."
            )


def _numbers(name: str, values) -> np.ndarray:
    try:
        return np.array(values, dtype=float)
    except (TypeError, ValueError):
        raise InputError(f"{name} is not an array of numbers.") from None


def read_record(
    path: str | Path,
    *,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
) -> Record:
    """A `Record` from a CSV file with one line of column names.

    `columns` maps t, x, v, y to the file's names (default: the same letters; without a column for y
    the record has none), `units` maps them to units ("ms", "mm/s", "mm", "%"; default SI). The
    separator is a comma, semicolon or tab; decimals have a point. Raises InputError that names the
    file and every fault.
    """
    columns, units = (
        {"t": "t", "x": "x", "v": "v", "y": "y"} | dict(columns or {}),
        dict(units or {}),
    )
    faults = [unknown_name("column", name, _SI) for name in (*columns, *units) if name not in _SI]
    if faults:
        raise InputError(faults)
    factors = {
        name: to_si(f"units[{name!r}]", f"1 {units[name]}", _SI[name]) if name in units else 1.0
        for name in _SI
    }
    names, rows = _table(Path(path))
    faults = [
        f"{path}: column {columns[name]!r} for {name} is not in the file ({', '.join(names)}); name"
        " it in columns."
        for name in ("t", "x", "v")
        if columns[name] not in names
    ]
    if faults:
        raise InputError(faults)
    present = [name for name in _SI if columns[name] in names]
    try:
        return Record(
            **{
                name: factors[name] * _column(rows, names.index(columns[name]), columns[name])
                for name in present
            }
        )
    except InputError as error:
        raise InputError(f"{path}: {fault}" for fault in error.faults) from None


def _table(path: Path) -> tuple[list[str], list[list[str]]]:
    try:
        if path.stat().st_size > _LARGEST_FILE:
            raise InputError(
                f"{path}: more than {_LARGEST_FILE // 1_000_000} MB; cut or thin the record."
            )
        text = path.read_text(encoding="utf-8-sig")
    except (OSError, ValueError) as error:
        reason = (
            error.strerror if isinstance(error, OSError) and error.strerror else "not UTF-8 text"
        )
        raise InputError(f"{path}: cannot be read ({reason}); name a CSV file.") from None
    lines = text.splitlines()
    header = lines[0] if lines else ""
    separator = max(";\t,", key=header.count)
    rows = [row for row in csv.reader(lines, delimiter=separator) if row]
    if len(rows) < 2:
        raise InputError(f"{path}: holds no rows of numbers below a line of column names.")
    names = [name.strip() for name in rows[0]]
    if all(_is_number(name) for name in names):
        raise InputError(f"{path}: the first line holds numbers; put the column names there.")
    for number, row in enumerate(rows[1:], start=1):
        if len(row) != len(names):
            raise InputError(
                f"{path}: row {number} has {len(row)} fields under {len(names)} names; decimals"
                " have a point."
            )
    return names, rows[1:]


def _column(rows: list[list[str]], index: int, name: str) -> np.ndarray:
    """The numbers of a column; an empty field becomes NaN, which `Record` reports."""
    values = np.empty(len(rows))
    for number, row in enumerate(rows):
        field = row[index].strip()
        if field and not _is_number(field):
            raise InputError(
                f"column {name!r}, row {number}: {field!r} is not a number; decimals have a point."
            )
        values[number] = float(field) if field else math.nan
    return values


def _is_number(text: str) -> bool:
    try:
        float(text)
    except ValueError:
        return False
    return True
