"""IEC 61131-3 structured text: one function block, named after the file, in LREAL or REAL."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..files import write_file
from . import precision
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
    values = parts(contents) | {
        "name": name,
        "REAL": "REAL" if real == "float" else "LREAL",
        "precision": precision.statement(contents) if real == "float" else [],
        "largest": np.finfo(np.float32 if real == "float" else np.float64).max,
    }
    values["inputs"] = ["setpoint" if read == "reference" else read for read in values["reads"]]
    return render("regulator.st.jinja", filters=filters, **values)
