"""Writing files so that a crash leaves the old file or the new one, never half of it."""

from __future__ import annotations

import os
import tempfile
from pathlib import Path

from .errors import InputError


def require_writable(directory: str | Path) -> None:
    """InputError unless `directory` can be written, or be made where it is not there. Leaves
    nothing behind."""
    nearest = Path(directory)
    while not nearest.exists() and nearest != nearest.parent:
        nearest = nearest.parent
    try:
        with tempfile.TemporaryFile(dir=nearest):
            pass
    except OSError as error:
        raise _unwritable(directory, error) from None


def make_directory(path: str | Path) -> Path:
    """The directory `path`, made with its parents if it is not there; InputError where that is not
    possible."""
    try:
        Path(path).mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise _unwritable(path, error) from None
    return Path(path)


def _unwritable(directory, error: OSError) -> InputError:
    return InputError(
        f"output directory {directory} cannot be written ({error.strerror}); name another."
    )


def write_file(path: str | Path, data: bytes) -> Path:
    """Write `data` to a temporary name beside `path`, then rename; InputError where that is not
    possible."""
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
        raise InputError(
            f"{path} cannot be written ({error.strerror}); name another place."
        ) from None
    return path
