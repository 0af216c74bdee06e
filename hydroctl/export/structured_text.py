"""IEC 61131-3 structured text: one function block, named after the file, in LREAL or REAL."""

from __future__ import annotations

from pathlib import Path

from ..files import write_file
from .contents import Contents
from .parts import parts
from .text import identifier, render, shortest


def write_structured_text(contents: Contents, path: Path, real: str) -> tuple[Path, ...]:
    """Write `path`."""
    return (write_file(path, source(contents, identifier(path.stem), real)),)


def source(contents: Contents, name: str, real: str) -> bytes:
    """The function block `name` in LREAL for "double" or REAL for "float"."""

    def number(value) -> str:
        return shortest(value, real)

    filters = {"number": number, "numbers": lambda values: ", ".join(map(number, values))}
    kind = "REAL" if real == "float" else "LREAL"
    return render("regulator.st.jinja", filters=filters, name=name, REAL=kind, **parts(contents))
