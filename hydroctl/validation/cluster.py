"""Other machines for a campaign: a running dask scheduler as an executor."""

from __future__ import annotations

from collections.abc import Iterator
from concurrent.futures import Executor
from contextlib import contextmanager

from ..errors import InputError

_PATIENCE = "10s"


@contextmanager
def connected(address: str) -> Iterator[Executor]:
    """The executor of the dask scheduler at `address`, such as "tcp://host:8786"; its workers need
    hydroctl of the same version.

    Raises InputError where dask is not installed or nothing answers within ten seconds.
    """
    try:
        from distributed import Client
    except ImportError:
        raise InputError(
            "a scheduler needs dask; install it with: pip install 'hydroctl[cluster]'"
        ) from None
    try:
        client = Client(address, timeout=_PATIENCE)
    except (OSError, ValueError, TypeError) as error:
        raise InputError(
            f"no dask scheduler answers at {address!r} ({error}); start one with: dask scheduler"
        ) from None
    with client:
        yield client.get_executor()
