"""Writing files so that a crash leaves the old file or the new one, never half of it."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from .errors import InputError


def make_directory(path: str | Path) -> Path:
    """The directory `path`, made if it is not there and proven writable; otherwise InputError."""
    path = Path(path)
    try:
        path.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path):
            pass
    except OSError as error:
        raise InputError(f"output directory {path} cannot be written ({error.strerror}); name another.") from None
    return path


def write_file(path: str | Path, data: bytes) -> Path:
    """Write `data` to a temporary name beside `path`, then rename; InputError where that is not possible."""
    path = Path(path)
    temporary = None
    try:
        handle, temporary = tempfile.mkstemp(dir=path.parent, prefix=f".{path.name}.")
        with os.fdopen(handle, "wb") as file:
            file.write(data)
        os.chmod(temporary, 0o644)
        os.replace(temporary, path)
    except OSError as error:
        if temporary is not None and os.path.exists(temporary):
            os.unlink(temporary)
        raise InputError(f"{path} cannot be written ({error.strerror}); name another place.") from None
    return path
