"""The project's equations as plain Python on floats, without arrays: the same lines, with `math` in
the place of numpy."""

from __future__ import annotations

import math
from types import FunctionType, ModuleType, SimpleNamespace

from hydroctl.model import plant as _plant
from hydroctl.regulator import law as _law
from hydroctl.simulation.kernels import motion as _motion
from hydroctl.simulation.kernels import runge_kutta as _runge_kutta

_NUMPY = SimpleNamespace(
    abs=abs,
    copysign=lambda size, sign: abs(size) if sign >= 0.0 else -abs(size),
    isfinite=math.isfinite,
    maximum=max,
    minimum=min,
    real=lambda value: value,
    sqrt=math.sqrt,
    tan=math.tan,
    where=lambda condition, yes, no: yes if condition else no,
)


def plain(module: ModuleType, **replaced) -> SimpleNamespace:
    called = {
        name: plain(value)
        for name, value in vars(module).items()
        if isinstance(value, ModuleType) and value.__name__.startswith("hydroctl.regulator.")
    }
    names = vars(module) | {"np": _NUMPY} | called | replaced
    for name, value in vars(module).items():
        if (
            isinstance(value, FunctionType)
            and value.__module__ == module.__name__
            and name not in replaced
        ):
            names[name] = FunctionType(value.__code__, names, name, value.__defaults__)
    return SimpleNamespace(**names)


law = plain(_law)
plant = plain(_plant)
motion = plain(_motion, plant=plant)
runge_kutta = plain(_runge_kutta, plus=motion.plus, slope=motion.slope)
