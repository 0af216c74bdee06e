"""The project's own equations, compiled with numba as they stand.

A compiled module holds the functions of a module, compiled when first called, with `scalar` in the place of numpy; the machine
code is kept on disk.
"""

from __future__ import annotations

import hashlib
import inspect
from contextlib import contextmanager
from pathlib import Path
from threading import RLock
from types import FunctionType, ModuleType

import numba

from . import scalar

_HERE = Path(__file__).parent
_SOURCES = ("compiling.py", "scalar.py", "plant.py", "equilibrium.py", "polynomials.py", "transfer_function.py", "simulation/*.py")


def _cache_directory() -> str:
    """Where numba keeps machine code: a directory named after a hash of all the sources that enter a kernel.

    numba renews a cached function when its own file changes, but not when a function that it calls does.
    """
    sources = sorted(path for pattern in _SOURCES for path in _HERE.glob(pattern))
    fingerprint = hashlib.sha256(b"\0".join(path.read_bytes() for path in sources)).hexdigest()[:16]
    return str(Path(numba.config.CACHE_DIR or _HERE / "__pycache__") / fingerprint)


CACHE_DIRECTORY = _cache_directory()
LOCK = RLock()
"""One thread at a time makes kernels: numba's cache directory is a global setting, and a kernel made twice is compiled twice."""


@contextmanager
def _own_cache():
    with LOCK:
        before = numba.config.CACHE_DIR
        numba.config.CACHE_DIR = CACHE_DIRECTORY
        try:
            yield
        finally:
            numba.config.CACHE_DIR = before


def compiled(module: ModuleType, build: str, **replaced) -> ModuleType:
    """A module with the functions of `module`, compiled; each calls the compiled versions of the others.

    `replaced`: what stands in the place of names in `module`. Every build has a name of its own, so that the machine code of one
    is never taken for that of another. All are compiled into their callers, but for those that the module names in `CALLED`.
    """
    result = ModuleType(module.__name__, module.__doc__)
    names = vars(result)
    names.update({name: value for name, value in vars(module).items() if not name.startswith("__")}, np=scalar)
    names.update(replaced)
    for name, value in vars(module).items():
        if inspect.isfunction(value) and value.__module__ == module.__name__ and name not in replaced:
            rebound = FunctionType(value.__code__, names, name, value.__defaults__)
            rebound.__qualname__ = f"{build}_{name}"
            options = {"cache": True, "error_model": "numpy", "nogil": True, "forceinline": name not in names.get("CALLED", ())}
            with _own_cache():
                names[name] = numba.njit(rebound, **options)
    return result


def functions(module: ModuleType) -> dict:
    """The compiled functions of a compiled module, by name."""
    return {name: value for name, value in vars(module).items() if isinstance(value, numba.core.dispatcher.Dispatcher)}
