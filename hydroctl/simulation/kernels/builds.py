"""The plant, its motion, its integration and the regulator law as compiled modules.

The modules of a `Motion` and of a `Loop` are compiled from the modules of these names. There are
builds for machines without the effects in `absent`, and for schedules without structures that have
an `absent` version.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cache
from types import ModuleType

from ...compilation import scalar
from ...compilation.compiling import LOCK, compiled, functions
from ...machine.actuator import Actuator
from ...model import plant as _plant
from ...regulator import law as _law
from ...regulator import notch as _notch
from ...regulator.law import Regulator
from .. import sensing as _sensing
from . import absent as _absent
from . import adaptive as _adaptive
from . import careful as _careful
from . import dormand_prince as _dormand_prince
from . import group as _group
from . import lanes as _lanes
from . import motion as _motion
from . import rodas as _rodas
from . import runge_kutta as _runge_kutta
from . import sampled as _sampled


class Motion:
    """The compiled modules of one machine build: `plant`, `motion`, `runge_kutta`, `careful`, and
    `adaptive` and `stiff`, which step by Dormand and Prince and by Rodas4.
    """

    def __init__(self, build: str, **replaced):
        self.build = build
        self.plant = compiled(_plant, build, signed_root=scalar.signed_root, **replaced)
        self.motion = compiled(_motion, build, plant=self.plant, **replaced)
        field = functions(self.motion)
        self.runge_kutta = compiled(_runge_kutta, build, **field)
        self.adaptive = compiled(
            _adaptive, build, method=compiled(_dormand_prince, build, **field), **field
        )
        self.stiff = compiled(
            _adaptive, f"{build}_stiff", method=compiled(_rodas, build, **field), **field
        )
        self.careful = compiled(
            _careful,
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
            "careful": motion.careful,
        }
        modules |= {"adaptive": motion.adaptive, "sensing": compiled(_sensing, "sensing")}
        self.sampled = compiled(_sampled, f"{motion.build}_{build}", **modules)
        self.lanes = compiled(_lanes, f"{motion.build}_{build}", **modules)
        self.group = compiled(_group, f"{motion.build}_{build}", **modules)


@cache
def motion_build(build: str) -> Motion:
    """ "full", or "plain" for machines without the effects in `absent`."""
    return Motion(build, **({} if build == "full" else functions(compiled(_absent, "absent"))))


@cache
def law_build(build: str) -> ModuleType:
    """The compiled law: "full", "notched" for schedules that use no structure with an absent
    version but a notch, "plain" without any."""
    left_out = {
        name
        for name, module in vars(_law).items()
        if hasattr(module, "absent") and build != "full" and (name, build) != ("notch", "notched")
    }
    return _law_module(_law, f"law_{build}", left_out)


def _law_module(module: ModuleType, build: str, left_out: set[str]) -> ModuleType:
    """`module` compiled, with the modules of the law that it calls; `step` of those in `left_out`
    is their `absent`."""
    called = {
        name: _law_module(value, build, left_out)
        for name, value in vars(module).items()
        if isinstance(value, ModuleType) and value.__name__.startswith(f"{_law.__package__}.")
    }
    result = compiled(module, build, **called)
    if module.__name__.rpartition(".")[2] in left_out:
        result.step = result.absent
    return result


@cache
def _loop(motion: str, law: str) -> Loop:
    return Loop(motion_build(motion), law_build(law), law)


def motion_for(actuator: Actuator) -> Motion:
    """The kernels that integrate `actuator`: without the lines of effects that it does not have,
    where it has none of them."""
    with LOCK:
        return motion_build(_motion_name([actuator]))


def loop_for(actuator: Actuator, regulator: Regulator) -> Loop:
    """The kernels that run `regulator` on `actuator`, without the lines of what they do not use."""
    return loop_for_group([actuator], [regulator])


def loop_for_group(actuators: Sequence[Actuator], regulators: Sequence[Regulator]) -> Loop:
    """The kernels that run these regulators on these actuators, without the lines of what none of
    them uses."""
    with LOCK:
        return _loop(_motion_name(actuators), _law_name(regulators))


def _motion_name(actuators: Sequence[Actuator]) -> str:
    p = [_plant.parameters(actuator) for actuator in actuators]
    effects = [
        (q.breakaway_friction, q.end_stop_stiffness, q.valve_natural_frequency, q.dead_band)
        for q in p
    ]
    return "full" if any(map(any, effects)) else "plain"


def _law_name(regulators: Sequence[Regulator]) -> str:
    structures = [s for s in _law.STRUCTURES if hasattr(s, "absent") and s is not _notch]
    used = [[structure.is_used(r) for structure in structures] for r in regulators]
    if any(map(any, used)):
        return "full"
    return "notched" if any(map(_notch.is_used, regulators)) else "plain"
