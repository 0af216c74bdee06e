"""ISO C99: one header and one source, whose functions carry the file's name as a prefix."""

from __future__ import annotations

from math import isnan
from pathlib import Path

from ..files import write_file
from ..test_vectors import TOLERANCE
from .contents import Contents
from .parts import parts
from .text import identifier, render, shortest

_FLOAT_TOLERANCE = 1e-5


def write_c(contents: Contents, path: Path, real: str) -> tuple[Path, ...]:
    """Write `path` and the header beside it."""
    header, source = sources(contents, identifier(path.stem), real)
    return write_file(path.with_suffix(".h"), header), write_file(path.with_suffix(".c"), source)


def sources(contents: Contents, name: str, real: str) -> tuple[bytes, bytes]:
    """(header, source) of the regulator `name` in "double" or "float"."""
    values = parts(contents) | {
        "name": name,
        "NAME": name.upper(),
        "real": real,
        "fn": lambda function: function + ("f" if real == "float" else ""),
        "tolerance": _FLOAT_TOLERANCE if real == "float" else TOLERANCE,
    }
    return tuple(render(f"regulator.{kind}.jinja", filters=filters(real), **values) for kind in ("h", "c"))


def filters(real: str) -> dict:
    """What the templates write numbers with: `number` for one, `numbers` for several with commas."""

    def number(value: float) -> str:
        return "NAN" if isnan(value) else shortest(value, real) + ("f" if real == "float" else "")

    return {"number": number, "numbers": lambda values: ", ".join(map(number, values))}
