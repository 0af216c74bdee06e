"""ISO C99: one header and one source, whose functions carry the file's name as a prefix."""

from __future__ import annotations

from math import isnan
from pathlib import Path

from ..files import write_file
from ..simulation import law
from ..test_vectors import TOLERANCE
from .contents import Contents
from .text import identifier, render, shortest

_FLOAT_TOLERANCE = 1e-5


def write_c(contents: Contents, path: Path, real: str) -> tuple[Path, ...]:
    """Write `path` and the header beside it."""
    header, source = sources(contents, identifier(path.stem), real)
    return write_file(path.with_suffix(".h"), header), write_file(path.with_suffix(".c"), source)


def sources(contents: Contents, name: str, real: str) -> tuple[bytes, bytes]:
    """(header, source) of the regulator `name` in "double" or "float"."""
    values = template_values(contents) | {
        "name": name,
        "NAME": name.upper(),
        "real": real,
        "fn": lambda function: function + ("f" if real == "float" else ""),
        "tolerance": _FLOAT_TOLERANCE if real == "float" else TOLERANCE,
    }
    filters = {"number": lambda value: number(value, real), "numbers": lambda values: ", ".join(number(v, real) for v in values)}
    return tuple(render(f"regulator.{kind}.jinja", filters=filters, **values) for kind in ("h", "c"))


def number(value: float, real: str) -> str:
    """A literal in C."""
    return "NAN" if isnan(value) else shortest(value, real) + ("f" if real == "float" else "")


def template_values(contents: Contents) -> dict:
    """What the templates of the law ask for: its constants, and which of its parts are in use."""
    r, s = contents.regulator, contents.schedule
    tables = contents.tables
    sections = [section for section in r.sections if section[0] != section[1]]
    values = {
        "integral": "ki" in tables,
        "derivative": "kd" in tables,
        "measurement_filter": r.Tm != 0.0,
        "weighted": r.b != 1.0,
        "on_error": r.c == 1.0,
        "notch": r.zz != r.zp,
        "sections": sections,
        "forward": s.feed_forward,
        "inverse": r.inverse_depth != 0.0,
        "k": r.compensation,
        "least_ratio": law.LEAST_RATIO,
        "most_ratio": law.MOST_RATIO,
        "least_drop": law.LEAST_DROP,
        "delay_samples": s.delay_samples,
        "provenance": contents.provenance,
        "vectors": contents.vectors,
    }
    return (
        r._asdict()
        | values
        | {
            "tables": [{"name": name, "unit": contents.units[name], "rows": table.tolist()} for name, table in tables.items()],
            "fields": _fields(values),
        }
    )


def _fields(used: dict) -> list[str]:
    """The memory's numbers besides x."""
    fields = {
        "integral": ["integral"],
        "derivative": ["derivative", "last"],
        "measurement_filter": ["filtered"],
        "sections": [f"section_{k + 1}" for k in range(len(used["sections"]))],
        "notch": ["notch_1", "notch_2"],
    }
    return [name for part, names in fields.items() if used[part] for name in names]
