"""The plant, its motion, its integration and the regulator law as compiled modules.

The modules of a `Motion` and of a `Loop` are compiled from the modules of these names. There is a
build for each set of optional components that a machine has, and for schedules without structures
that have an `absent_step`.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from types import ModuleType

from ...compilation import scalar
from ...compilation.compiling import LOCK, compiled, compiled_tree, functions
from ...machine.actuator import Actuator
from ...model import plant as _plant
from ...regulator import law as _law
from ...regulator import notch as _notch
from ...regulator.law import Regulator
from .. import sensing as _sensing
from . import adaptive as _adaptive
from . import dormand_prince as _dormand_prince
from . import group as _group
from . import lanes as _lanes
from . import motion as _motion
from . import rodas as _rodas
from . import runge_kutta as _runge_kutta
from . import sampled as _sampled
from . import stepping as _stepping

ALL_COMPONENTS = frozenset(one.__name__.rpartition(".")[2] for one in _plant.OPTIONAL)
"""Names of the optional ones."""


class Motion:
    """The compiled modules of machines with the same components: `motion` and `model`,
    `runge_kutta`, `stepping`, and `adaptive` and `stiff`, which step by Dormand and Prince and by
    Rodas4."""

    def __init__(self, components: frozenset[str]):
        self.build = build = "_".join(sorted(components)) or "plain"
        left_out = ALL_COMPONENTS - components
        made: dict[str, ModuleType] = {}
        self.motion = compiled_tree(
            _motion, build, _plant.__package__, left_out, made, signed_root=scalar.signed_root
        )
        self.model = {name.rpartition(".")[2]: module for name, module in made.items()}
        if "spool" in left_out:
            self.motion.plus = self.motion.plus_of_an_ideal_valve
        field = functions(self.motion)
        self.runge_kutta = compiled(_runge_kutta, build, **field)
        self.adaptive = compiled(
            _adaptive, build, method=compiled(_dormand_prince, build, **field), **field
        )
        self.stiff = compiled(
            _adaptive, f"{build}_stiff", method=compiled(_rodas, build, **field), **field
        )
        self.stepping = compiled(
            _stepping,
            build,
            motion=self.motion,
            runge_kutta=self.runge_kutta,
            adaptive=self.adaptive,
        )


class Loop:
    """The compiled closed loop of one machine build and one law build: `law`, `sampled`, `lanes`,
    `group`."""

    def __init__(self, motion: Motion, law: ModuleType, build: str):
        self.law = law
        modules = {
            "law": law,
            "gains": law.gains,
            "feed_forward": law.feed_forward,
            "motion": motion.motion,
            "runge_kutta": motion.runge_kutta,
            "stepping": motion.stepping,
        }
        modules |= {"adaptive": motion.adaptive, "sensing": compiled(_sensing, "sensing")}
        modules |= motion.model
        self.sampled = compiled(_sampled, f"{motion.build}_{build}", **modules)
        self.lanes = compiled(_lanes, f"{motion.build}_{build}", **modules)
        self.group = compiled(_group, f"{motion.build}_{build}", **modules)


@cache
def motion_build(components: frozenset[str]) -> Motion:
    """The kernels of machines that have these of the plant's optional components."""
    return Motion(components)


@cache
def law_build(build: str) -> ModuleType:
    """The compiled law: "full", "notched" for schedules that use no structure with an absent
    version but a notch, "plain" without any."""
    left_out = {
        name
        for name, module in vars(_law).items()
        if hasattr(module, "absent_step")
        and build != "full"
        and (name, build) != ("notch", "notched")
    }
    return compiled_tree(_law, f"law_{build}", _law.__package__, left_out)


@cache
def _loop(components: frozenset[str], law: str) -> Loop:
    return Loop(motion_build(components), law_build(law), law)


def motion_for(actuator: Actuator) -> Motion:
    """The kernels that integrate `actuator`: without the lines of effects that it does not have,
    where it has none of them."""
    with LOCK:
        return motion_build(_components([actuator]))


def loop_for(actuator: Actuator, regulator: Regulator) -> Loop:
    """The kernels that run `regulator` on `actuator`, without the lines of what they do not use."""
    return loop_for_group([actuator], [regulator])


def loop_for_group(actuators: Sequence[Actuator], regulators: Sequence[Regulator]) -> Loop:
    """The kernels that run these regulators on these actuators, without the lines of what none of
    them uses."""
    with LOCK:
        return _loop(_components(actuators), _law_name(regulators))


def _components(actuators: Sequence[Actuator]) -> frozenset[str]:
    """Those that any of the machines has."""
    used = (_plant.components_used(_plant.parameters(actuator)) for actuator in actuators)
    return frozenset().union(*used)


def _law_name(regulators: Sequence[Regulator]) -> str:
    structures = [s for s in _law.STRUCTURES if hasattr(s, "absent_step") and s is not _notch]
    used = [[structure.is_used(r) for structure in structures] for r in regulators]
    if any(map(any, used)):
        return "full"
    return "notched" if any(map(_notch.is_used, regulators)) else "plain"
