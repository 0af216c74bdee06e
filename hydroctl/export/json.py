"""The schedule file."""

from __future__ import annotations

from pathlib import Path

from ..schedule.document import write
from .contents import Contents


def write_json(contents: Contents, path: Path) -> tuple[Path, ...]:
    """Write `path` (see `schedule.document`)."""
    return (write(contents.document, path),)
