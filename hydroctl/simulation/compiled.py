"""The project's own equations, compiled with numba as they stand: the plant, its motion, its integration, the regulator law.

The modules of a `Motion` and of a `Loop` hold the functions of the modules of these names, compiled when first called, with
`scalar` in the place of numpy; the machine code is kept on disk. There are builds for machines without the effects in `absent`,
and for schedules without those in `absent_law`.
"""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Sequence
from contextlib import contextmanager
from functools import cache
from pathlib import Path
from threading import RLock
from types import FunctionType, ModuleType

import numba

from .. import plant as _plant
from ..actuator import Actuator
from . import absent as _absent
from . import absent_law as _absent_law
from . import adaptive as _adaptive
from . import butcher as _butcher
from . import careful as _careful
from . import dormand_prince as _dormand_prince
from . import group as _group
from . import lanes as _lanes
from . import law as _law
from . import motion as _motion
from . import rodas as _rodas
from . import sampled as _sampled
from . import scalar
from . import sensing as _sensing
from .law import Regulator

_HERE = Path(__file__).parent
_SOURCES = (_plant, _absent, _absent_law, _adaptive, _butcher, _careful, _dormand_prince, _lanes, _law, _motion, _rodas, _sampled)
_SOURCES += (_sensing, scalar)


def _cache_directory() -> str:
    """Where numba keeps machine code: a directory named after a hash of all the sources that enter a kernel.

    numba renews a cached function when its own file changes, but not when a function that it calls does.
    """
    sources = [Path(__file__), *(Path(module.__file__) for module in _SOURCES)]
    fingerprint = hashlib.sha256(b"\0".join(path.read_bytes() for path in sources)).hexdigest()[:16]
    return str(Path(numba.config.CACHE_DIR or _HERE / "__pycache__") / fingerprint)


_CACHE_DIRECTORY = _cache_directory()
_LOCK = RLock()
"""One thread at a time makes kernels: numba's cache directory is a global setting, and a kernel made twice is compiled twice."""


@contextmanager
def _own_cache():
    before = numba.config.CACHE_DIR
    numba.config.CACHE_DIR = _CACHE_DIRECTORY
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


class Motion:
    """The compiled modules of one machine build: `plant`, `motion`, `butcher`, `careful`, and `adaptive` and `stiff`,
    which step by Dormand and Prince and by Rodas4.
    """

    def __init__(self, build: str, **replaced):
        self.build = build
        self.plant = compiled(_plant, build, signed_root=scalar.signed_root, **replaced)
        self.motion = compiled(_motion, build, plant=self.plant, **replaced)
        field = functions(self.motion)
        self.butcher = compiled(_butcher, build, **field)
        self.adaptive = compiled(_adaptive, build, method=compiled(_dormand_prince, build, **field), **field)
        self.stiff = compiled(_adaptive, f"{build}_stiff", method=compiled(_rodas, build, **field), **field)
        self.careful = compiled(_careful, build, motion=self.motion, butcher=self.butcher, adaptive=self.adaptive)


class Loop:
    """The compiled closed loop of one machine build and one law build: `law`, `sampled`, `lanes`, `group`."""

    def __init__(self, motion: Motion, law: ModuleType, build: str):
        self.law = law
        modules = {"law": law, "motion": motion.motion, "butcher": motion.butcher, "careful": motion.careful}
        modules["sensing"] = compiled(_sensing, "sensing")
        self.sampled = compiled(_sampled, f"{motion.build}_{build}", **modules)
        self.lanes = compiled(_lanes, f"{motion.build}_{build}", **modules)
        self.group = compiled(_group, f"{motion.build}_{build}", **modules)


@cache
def motion_build(build: str) -> Motion:
    """ "full", or "plain" for machines without the effects in `absent`."""
    return Motion(build, **({} if build == "full" else functions(compiled(_absent, "absent"))))


@cache
def law_build(build: str) -> ModuleType:
    """The compiled law: "full", "notched" for schedules without the effects in `absent_law` but a notch, "plain" without any."""
    absent = {} if build == "full" else functions(compiled(_absent_law, "absent"))
    if build == "notched":
        del absent["notch"]
    return compiled(_law, f"law_{build}", **absent)


@cache
def _loop(motion: str, law: str) -> Loop:
    return Loop(motion_build(motion), law_build(law), law)


def motion_for(actuator: Actuator) -> Motion:
    """The kernels that integrate `actuator`: without the lines of effects that it does not have, where it has none of them."""
    with _LOCK:
        return motion_build(_motion_name([actuator]))


def loop_for(actuator: Actuator, regulator: Regulator) -> Loop:
    """The kernels that run `regulator` on `actuator`, without the lines of what they do not use."""
    return loop_for_group([actuator], [regulator])


def loop_for_group(actuators: Sequence[Actuator], regulators: Sequence[Regulator]) -> Loop:
    """The kernels that run these regulators on these actuators, without the lines of what none of them uses."""
    with _LOCK:
        return _loop(_motion_name(actuators), _law_name(regulators))


def _motion_name(actuators: Sequence[Actuator]) -> str:
    p = [_plant.parameters(actuator) for actuator in actuators]
    effects = [(q.breakaway_friction, q.end_stop_stiffness, q.valve_natural_frequency, q.dead_band) for q in p]
    return "full" if any(map(any, effects)) else "plain"


def _law_name(regulators: Sequence[Regulator]) -> str:
    used = [(r.Tm, r.compensated, r.inverse_depth, *(zero != pole for zero, pole in r.sections)) for r in regulators]
    if any(map(any, used)):
        return "full"
    return "notched" if any(r.zz != r.zp for r in regulators) else "plain"
