"""IEC 61131-3 structured text: one function block, named after the file, in LREAL or REAL."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from ..files import write_file
from ..regulator.printing.program import program_of
from . import precision
from .contents import Contents
from .st_law import TAKEN, StLaw, StWriter, st_name
from .template_values import template_values
from .text import identifier, render, shortest


def write_structured_text(contents: Contents, path: Path, real: str) -> tuple[Path, ...]:
    """Write `path`."""
    return (write_file(path, source(contents, identifier(path.stem), real)),)


def source(contents: Contents, name: str, real: str) -> bytes:
    """The function block `name` in LREAL for "double" or REAL for "float"."""

    def number(value) -> str:
        return shortest(value, real)

    declared = "REAL" if real == "float" else "LREAL"
    program = program_of(contents.regulator, taken=TAKEN)
    values = template_values(contents, program) | {
        "law": StLaw(program, StWriter(number, name), declared),
        "name": name,
        "REAL": declared,
        "precision": precision.statement(contents) if real == "float" else [],
        "largest": np.finfo(np.float32 if real == "float" else np.float64).max,
    }
    values["inputs"] = [st_name(read) for read in values["reads"]]
    filters = {"number": number, "st_name": st_name}
    return render("regulator.st.jinja", filters=filters, **values)
