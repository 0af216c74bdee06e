"""The project's own equations, compiled with numba as they stand.

A compiled module holds the functions of a module, compiled when first called, with `scalar` in the
place of numpy; the machine code is kept on disk.
"""

from __future__ import annotations

import hashlib
import inspect
import sys
from collections.abc import Collection, Mapping
from contextlib import contextmanager
from pathlib import Path
from threading import RLock
from types import FunctionType, ModuleType
from typing import Any

import numba

from . import scalar

_PACKAGE = __name__.partition(".")[0]
LOCK = RLock()
"""One thread at a time makes kernels: numba's cache directory is a global setting, and a kernel
made twice is compiled twice."""


def cache_directory(names: Mapping[str, object]) -> str:
    """Where numba keeps the machine code of functions that see `names`: a directory named after a
    hash of all their sources.

    numba renews a cached function when its own file changes, but not when a function that it calls
    does.
    """
    modules = {__name__, scalar.__name__}
    _collect(names, modules)
    sources = [Path(inspect.getfile(sys.modules[name])).read_bytes() for name in sorted(modules)]
    fingerprint = hashlib.sha256(b"\0".join(sources)).hexdigest()[:16]
    return str(Path(numba.config.CACHE_DIR or Path(__file__).parent / "__pycache__") / fingerprint)


def _collect(names: Mapping[str, object], modules: set[str]) -> None:
    """Add the modules of this package from which `names` come, and those that these see."""
    for value in names.values():
        owner = (
            value.__name__ if isinstance(value, ModuleType) else getattr(value, "__module__", None)
        )
        if isinstance(owner, str) and owner.startswith(f"{_PACKAGE}.") and owner not in modules:
            modules.add(owner)
            _collect(vars(sys.modules[owner]), modules)


@contextmanager
def _cache_in(directory: str):
    with LOCK:
        before = numba.config.CACHE_DIR
        numba.config.CACHE_DIR = directory
        try:
            yield
        finally:
            numba.config.CACHE_DIR = before


def compiled(module: ModuleType, build: str, **replaced) -> ModuleType:
    """A module with the functions of `module`, compiled; each calls the compiled versions of the
    others.

    `replaced`: what stands in the place of names in `module`. Every build has a name of its own, so
    that the machine code of one is never taken for that of another. All are compiled into their
    callers, but for those that the module names in `CALLED`.
    """
    result = ModuleType(module.__name__, module.__doc__)
    names = vars(result)
    names.update(
        {name: value for name, value in vars(module).items() if not name.startswith("__")},
        np=scalar,
    )
    names.update(replaced)
    directory = cache_directory(names)
    for name, value in vars(module).items():
        if (
            inspect.isfunction(value)
            and value.__module__ == module.__name__
            and name not in replaced
        ):
            rebound = FunctionType(value.__code__, names, name, value.__defaults__)
            rebound.__qualname__ = f"{build}_{name}"
            options: dict[str, Any] = {
                "cache": True,
                "error_model": "numpy",
                "nogil": True,
                "forceinline": name not in names.get("CALLED", ()),
            }
            with _cache_in(directory):
                names[name] = numba.njit(rebound, **options)
    return result


def compiled_tree(
    module: ModuleType,
    build: str,
    package: str,
    left_out: Collection[str] = (),
    made: dict[str, ModuleType] | None = None,
    **replaced,
) -> ModuleType:
    """`module` compiled, with the modules of `package` that it calls, and those that they call.

    Of the modules named in `left_out` a function `f` is their `absent_f`, where there is one.
    `made`: modules of this build that were compiled before, by name; new ones are added to it.
    """
    made = {} if made is None else made
    if module.__name__ not in made:
        called = {}
        for name, value in vars(module).items():
            home = value.__name__ if isinstance(value, ModuleType) else _home(value)
            if home.startswith(f"{package}.") and home != module.__name__:
                other = compiled_tree(sys.modules[home], build, package, left_out, made, **replaced)
                called[name] = (
                    other if home == getattr(value, "__name__", "") else vars(other)[name]
                )
        own = {name: value for name, value in replaced.items() if hasattr(module, name)}
        result = compiled(module, build, **called | own)
        if module.__name__.rpartition(".")[2] in left_out:
            for name, function in functions(result).items():
                if name.startswith("absent_"):
                    setattr(result, name.removeprefix("absent_"), function)
        made[module.__name__] = result
    return made[module.__name__]


def _home(value: object) -> str:
    """The module of a function; nothing for anything else."""
    return value.__module__ if inspect.isfunction(value) else ""


def functions(module: ModuleType) -> dict:
    """The compiled functions of a compiled module, by name."""
    return {
        name: value
        for name, value in vars(module).items()
        if isinstance(value, numba.core.dispatcher.Dispatcher)
    }
