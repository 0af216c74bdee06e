"""The project's own equations, compiled with numba as they stand: the plant, its motion, its integration, the regulator law.

`law` and the modules of `full` and `plain` hold the functions of the modules of these names, compiled when first called, with
`scalar` in the place of numpy; the machine code is kept on disk. `plain` is for machines without the effects in `absent`.
"""

from __future__ import annotations

import hashlib
import inspect
from contextlib import contextmanager
from pathlib import Path
from types import FunctionType, ModuleType

import numba

from .. import plant as _plant
from ..actuator import Actuator
from . import absent as _absent
from . import butcher as _butcher
from . import dormand_prince as _dormand_prince
from . import lanes as _lanes
from . import law as _law
from . import motion as _motion
from . import sampled as _sampled
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


def compiled(module: ModuleType, build: str, **replaced) -> ModuleType:
    """A module with the functions of `module`, compiled; each calls the compiled versions of the others.

    `replaced`: what stands in the place of names in `module`. Every build has a name of its own, so that the machine code of one
    is never taken for that of another.
    """
    result = ModuleType(module.__name__, module.__doc__)
    names = vars(result)
    names.update({name: value for name, value in vars(module).items() if not name.startswith("__")}, np=scalar)
    names.update(replaced)
    for name, value in vars(module).items():
        if inspect.isfunction(value) and value.__module__ == module.__name__ and name not in replaced:
            rebound = FunctionType(value.__code__, names, name, value.__defaults__)
            rebound.__qualname__ = f"{build}_{name}"
            with _cache_directory():
                names[name] = numba.njit(rebound, cache=True, error_model="numpy", nogil=True, forceinline=True)
    return result


def functions(module: ModuleType) -> dict:
    """The compiled functions of a compiled module, by name."""
    return {name: value for name, value in vars(module).items() if isinstance(value, numba.core.dispatcher.Dispatcher)}


class Kernels:
    """All compiled modules of one build: `plant`, `motion`, `butcher`, `dormand_prince`, `sampled`, `lanes`."""

    def __init__(self, build: str, **replaced):
        self.plant = compiled(_plant, build, **replaced)
        self.motion = compiled(_motion, build, plant=self.plant, **replaced)
        field = {"plus": self.motion.plus, "slope": self.motion.slope, "told": self.motion.told}
        self.butcher = compiled(_butcher, build, plus=field["plus"], slope=field["slope"])
        self.dormand_prince = compiled(_dormand_prince, build, **field)
        loop = {"law": law, "motion": self.motion, "butcher": self.butcher}
        self.sampled = compiled(_sampled, build, **loop)
        self.lanes = compiled(_lanes, build, **loop)


law = compiled(_law, "law")
full = Kernels("full")
plain = Kernels("plain", **functions(compiled(_absent, "absent")))


def kernels_for(actuator: Actuator) -> Kernels:
    """The kernels that integrate `actuator`: without the lines of effects that it does not have, where it has none of them."""
    p = _plant.parameters(actuator)
    effects = (p.breakaway_friction, p.end_stop_stiffness, p.valve_natural_frequency, p.dead_band)
    return full if any(effects) else plain
