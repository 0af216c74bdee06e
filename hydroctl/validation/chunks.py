"""`ChunkStore`: finished chunks of a campaign on disk, so that an interrupted one goes on where it
stopped."""

from __future__ import annotations

import dataclasses
import hashlib
import io
from pathlib import Path

import numpy as np

from ..errors import InputError
from ..files import make_directory, write_file


class ChunkStore:
    """A file for each chunk, and one that says which campaign they belong to. Without a directory
    it keeps nothing.

    Raises InputError where the directory holds another campaign or cannot be written.
    """

    def __init__(self, directory: str | Path | None, identity: tuple):
        self._directory = None if directory is None else make_directory(directory)
        if self._directory is None:
            return
        digest = hashlib.sha256()
        _feed(digest, identity)
        label, mark = self._directory / "campaign.sha256", digest.hexdigest()
        if not label.exists():
            write_file(label, mark.encode())
        if label.read_text() != mark:
            raise InputError(
                f"{directory} holds chunks of another campaign; name a new directory, or repeat"
                " that campaign's input."
            )

    def load(self, bound: tuple[int, int]) -> np.ndarray | None:
        """The chunk's rows, None where it has not been finished."""
        if self._directory is None or not self._path(bound).exists():
            return None
        return np.load(self._path(bound))

    def save(self, bound: tuple[int, int], rows: np.ndarray) -> None:
        """Keep a finished chunk."""
        if self._directory is not None:
            buffer = io.BytesIO()
            np.save(buffer, rows)
            write_file(self._path(bound), buffer.getvalue())

    def _path(self, bound: tuple[int, int]) -> Path:
        assert self._directory is not None
        return self._directory / f"cases-{bound[0]:09d}-{bound[1]:09d}.npy"


def _feed(digest, value) -> None:
    """Add a value to the hash: arrays by their bytes, collections and dataclasses by their parts,
    the rest as text."""
    if isinstance(value, np.ndarray):
        digest.update(f"{value.dtype}{value.shape}".encode() + value.tobytes())
    elif dataclasses.is_dataclass(value):
        _feed(digest, [getattr(value, field.name) for field in dataclasses.fields(value)])
    elif isinstance(value, (list, tuple)):
        digest.update(f"({len(value)}".encode())
        for part in value:
            _feed(digest, part)
    else:
        digest.update(repr(value).encode() + b";")
