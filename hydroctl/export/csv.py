"""CSV: a line for each node, for spreadsheets and simple readers."""

from __future__ import annotations

from pathlib import Path

from ..files import write_file
from .contents import Contents


def write_csv(contents: Contents, path: Path) -> tuple[Path, ...]:
    """Write `path`: comment lines, the names with their units, then x, y and the gains of each
    node, y running fastest."""
    s = contents.schedule
    lines = [f"# {line}" for line in contents.provenance]
    lines.append(
        ",".join(["x", "y [m]", *(f"{name} [{unit}]" for name, unit in contents.units.items())])
    )
    for i, x in enumerate(s.x):
        for j, y in enumerate(s.y):
            gains = [getattr(s, name)[i, j] for name in contents.units]
            lines.append(",".join(repr(float(value)) for value in (x, y, *gains)))
    return (write_file(path, ("\n".join(lines) + "\n").encode("ascii")),)
