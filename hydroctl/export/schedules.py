"""`export_schedule`: a gain schedule in the form that a machine or another program takes."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

from ..errors import InputError, unknown_name
from . import c, csv, fmu, json, matlab, structured_text
from .contents import contents_of
from .text import REALS

if TYPE_CHECKING:
    from ..schedule.schedule import GainSchedule

_WRITERS = {
    "json": json.write_json,
    "csv": csv.write_csv,
    "mat": matlab.write_matlab,
    "fmu": fmu.write_fmu,
}
_CODE_WRITERS = {"c": c.write_c, "st": structured_text.write_structured_text}
FORMATS = (*_WRITERS, *_CODE_WRITERS)


def export_schedule(
    schedule: GainSchedule,
    path: str | Path,
    format: Literal["json", "c", "st", "mat", "csv", "fmu"] = "json",
    *,
    real: Literal["double", "float"] = "double",
    force: bool = False,
) -> tuple[Path, ...]:
    """Write `schedule` to `path` in `format`, atomically and with the same bytes for the same
    schedule; the files written.

    "json": the schedule file, with test vectors. "c": ISO C99, `path` and a header beside it; "st":
    a function block of IEC 61131-3; both named after the file, in `real` arithmetic. "mat": tables
    for MATLAB and Octave. "csv": a line for each node. "fmu": the regulator and, beside it, the
    plant for co-simulation (FMI 2.0); needs a C compiler. A schedule whose margins fail its
    specification, or that failed a requirement in its design, is refused with FailedChecksError
    unless `force`, and then every file says so. Raises InputError for what cannot be written.
    """
    if format not in FORMATS:
        raise InputError(unknown_name("format", format, FORMATS))
    if real not in REALS:
        raise InputError(unknown_name("real", real, REALS))
    if real != "double" and format not in _CODE_WRITERS:
        raise InputError(
            f"real = {real!r} is for generated code ({', '.join(_CODE_WRITERS)}); {format} holds"
            " double numbers."
        )
    contents, path = contents_of(schedule, force=force), Path(path)
    if format in _CODE_WRITERS:
        return _CODE_WRITERS[format](contents, path, real)
    return _WRITERS[format](contents, path)
