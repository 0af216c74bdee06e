"""ISO C99: one header and one source, whose functions carry the file's name as a prefix."""

from __future__ import annotations

from math import isnan
from pathlib import Path

from ..files import write_file
from ..regulator.printing.program import program_of
from ..regulator.vectors import TOLERANCE
from . import precision
from .c_law import CLaw, CWriter
from .contents import Contents
from .template_values import template_values
from .text import identifier, render, shortest


def write_c(contents: Contents, path: Path, real: str) -> tuple[Path, ...]:
    """Write `path` and the header beside it."""
    header, source = sources(contents, identifier(path.stem), real)
    return write_file(path.with_suffix(".h"), header), write_file(path.with_suffix(".c"), source)


def sources(contents: Contents, name: str, real: str) -> tuple[bytes, bytes]:
    """(header, source) of the regulator `name` in "double" or "float"."""
    program = program_of(contents.regulator)
    number = filters(real)["number"]
    writer = CWriter(number, "f" if real == "float" else "")
    values = template_values(contents, program) | {
        "law": CLaw(program, name, writer),
        "name": name,
        "NAME": name.upper(),
        "real": real,
        "fn": lambda function: function + ("f" if real == "float" else ""),
        "precision": precision.statement(contents) if real == "float" else [],
        "checks": _checks(contents, real),
    }
    header, source = (
        render(f"regulator.{kind}.jinja", filters=filters(real), **values) for kind in ("h", "c")
    )
    return header, source


def _checks(contents: Contents, real: str) -> list[dict]:
    """The test vectors, with what x may differ by and, where one starts, the gains in use and what
    they may differ by."""
    vectors = contents.vectors
    if real == "float":
        by_x = precision.tolerances(contents.regulator, vectors)
        by_gains = precision.gain_tolerances(contents.regulator, vectors)
    else:
        by_x = [TOLERANCE] * len(vectors)
        by_gains = [tuple(TOLERANCE * abs(g) for g in vector.gains or ()) for vector in vectors]
    used = [list(contents.units).index(name) for name in contents.tables]
    checks = []
    for vector, within, gains_within in zip(vectors, by_x, by_gains, strict=True):
        gains = []
        if vector.start is not None and vector.gains is not None:
            gains = [(vector.gains[k], gains_within[k]) for k in used]
        checks.append(vector._asdict() | {"within": within, "gains": gains})
    return checks


def filters(real: str) -> dict:
    """What the templates write numbers with: `number` for one, `numbers` for several with
    commas."""

    def number(value: float) -> str:
        return "NAN" if isnan(value) else shortest(value, real) + ("f" if real == "float" else "")

    return {"number": number, "numbers": lambda values: ", ".join(map(number, values))}
