"""Writes hydroctl/__init__.pyi, what editors and type checkers see of the lazy names, from the
table in hydroctl/__init__.py."""

from itertools import groupby
from pathlib import Path

import hydroctl

STUB = Path(hydroctl.__file__).with_suffix(".pyi")


def stub() -> str:
    """The text of the stub."""
    home = sorted(hydroctl._HOME.items(), key=lambda entry: (entry[1], entry[0]))
    lines = [
        f"from .{module} import {name} as {name}"
        for module, names in groupby(home, key=lambda entry: entry[1])
        for name, _ in names
    ]
    return "\n".join([*lines, "", "__version__: str", "__all__: list[str]", ""])


if __name__ == "__main__":
    STUB.write_text(stub())
