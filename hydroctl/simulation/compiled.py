"""Compiled versions of the project's own equations: the plant's and the regulator's lines as they stand, through numba.

`plant` and `law` below hold the functions of `hydroctl.plant` and `hydroctl.simulation.law`, compiled when first called, with
`scalar` in the place of numpy. `kernel` compiles an entry point and keeps the machine code on disk.
"""

from __future__ import annotations

import hashlib
import inspect
from contextlib import contextmanager
from pathlib import Path
from types import FunctionType, ModuleType

import numba

from .. import plant as _plant
from . import law as _law
from . import scalar

_HERE = Path(__file__).parent


@contextmanager
def _cache_directory():
    """Where numba keeps machine code: a directory named after a hash of all the sources that enter a kernel.

    numba renews a cached function when its own file changes, but not when a function that it calls does.
    """
    sources = [Path(_plant.__file__), *sorted(_HERE.glob("*.py"))]
    fingerprint = hashlib.sha256(b"\0".join(path.read_bytes() for path in sources)).hexdigest()[:16]
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = str(Path(before or _HERE / "__pycache__") / fingerprint)
    try:
        yield
    finally:
        numba.config.CACHE_DIR = before


def kernel(**options):
    """Decorator: numba.njit with the machine code cached on disk."""

    def decorate(function):
        with _cache_directory():
            return numba.njit(function, cache=True, error_model="numpy", **options)

    return decorate


def compiled(module: ModuleType) -> ModuleType:
    """A module with the functions of `module`, compiled; each calls the compiled versions of the others."""
    result = ModuleType(module.__name__, module.__doc__)
    names = vars(result)
    names.update({name: value for name, value in vars(module).items() if not name.startswith("__")}, np=scalar)
    for name, value in vars(module).items():
        if inspect.isfunction(value) and value.__module__ == module.__name__:
            names[name] = kernel()(FunctionType(value.__code__, names, name, value.__defaults__))
    return result


plant, law = compiled(_plant), compiled(_law)
