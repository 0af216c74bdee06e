"""`campaign`: one group on many random variants of its cylinders and loads, with one coupling; only
metrics are kept.

The numbers of a case depend on seed and case alone, so that a case is the same in any campaign, and
alone by `random_group`.
"""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor
from dataclasses import asdict, dataclass, fields
from functools import partial
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError, SimulationError, unknown_name
from ..machine.actuator import Actuator
from ..model.operating_point import stall_force
from .checks import group_faults
from .coupling import Coupling
from .design import design_coupling
from .metrics import SynchronizationMetrics
from .motion import synchronize
from .profile import MotionProfile

if TYPE_CHECKING:
    from ..schedule.schedule import GainSchedule

SPREAD = {
    "bulk_modulus": 0.15,
    "mass": 0.3,
    "viscous_friction": 0.3,
    "supply_pressure": 0.05,
    "load_force": 0.1,
}
"""Relative half-widths of the uniform distributions: of every cylinder its own, but one supply
pressure for all; of the load, in parts of the smaller stall force at the lowest supply."""
METRICS = tuple(field.name for field in fields(SynchronizationMetrics))


@dataclass(frozen=True, eq=False, kw_only=True)
class SynchronizationCampaign:
    """Metrics of every case; arrays (count,)."""

    seed: int
    coupling: Coupling
    metrics: dict[str, np.ndarray]
    """by the names of `SynchronizationMetrics`, SI; NaN where a case failed"""
    completed: np.ndarray
    """False where a case failed or did not reach the end of the reference"""
    reasons: tuple[str, ...]
    """why a case failed; empty where it did not"""

    def worst(self, name: str = "rms") -> int:
        """The case in which the metric is largest, for `random_group`; a failed one first."""
        values = self.metrics[name]
        return int(
            np.argmax(
                np.where(
                    np.isnan(values) & ~self.completed, np.inf, np.nan_to_num(values, nan=-np.inf)
                )
            )
        )


def random_group(
    actuators: Sequence[Actuator], seed: int, case: int, spread: Mapping[str, float] = SPREAD
) -> tuple[tuple[Actuator, ...], np.ndarray]:
    """(cylinders, (N,) further loads in N) of one case."""
    random = np.random.default_rng([seed, case])
    part = {
        name: spread.get(name, 0.0) * random.uniform(-1.0, 1.0, len(actuators)) for name in SPREAD
    }
    part["supply_pressure"][:] = part["supply_pressure"][0]
    names = [name for name in SPREAD if name != "load_force"]
    varied = tuple(
        actuator.replace(
            **{name: getattr(actuator, name) * (1.0 + part[name][i]) for name in names}
        )
        for i, actuator in enumerate(actuators)
    )
    lowest = [
        a.replace(supply_pressure=a.supply_pressure * (1.0 - spread.get("supply_pressure", 0.0)))
        for a in actuators
    ]
    stall = np.array([np.abs(stall_force(a, np.array([-1.0, 1.0]))).min() for a in lowest])
    return varied, part["load_force"] * stall


def campaign(
    actuators: Sequence[Actuator],
    schedules: Sequence[GainSchedule],
    reference: MotionProfile,
    *,
    count: int,
    seed: int,
    coupling: str | Coupling = "mean",
    load_forces: Sequence | None = None,
    spread: Mapping[str, float] = SPREAD,
    executor: Executor | None = None,
    **rules,
) -> SynchronizationCampaign:
    """`synchronize` on `count` random groups; the coupling is designed once, for the group as
    given.

    `rules`: override, limits, stop and longest of `synchronize`. `executor`: where the cases run;
    default: threads of this process. A case that fails is flagged with its reason. Raises
    InputError, all faults at once, for what no case could run with.
    """
    faults = [unknown_name("spread", name, SPREAD) for name in spread if name not in SPREAD]
    faults += [
        f"spread[{name!r}] = {part!r} is outside 0 ... 0.95."
        for name, part in spread.items()
        if not 0.0 <= part <= 0.95
    ]
    for name, value, least in (("count", count, 1), ("seed", seed, 0)):
        if not isinstance(value, int) or isinstance(value, bool) or value < least:
            faults.append(f"{name} = {value!r} must be a whole number of at least {least}.")
    if faults := faults + group_faults(actuators, schedules):
        raise InputError(faults)
    if not isinstance(coupling, Coupling):
        coupling = design_coupling(actuators, schedules, coupling)
    loads = [0.0] * len(actuators) if load_forces is None else load_forces
    case = partial(
        _case,
        tuple(actuators),
        tuple(schedules),
        reference,
        coupling,
        tuple(loads),
        dict(spread),
        seed,
        rules,
    )
    if executor is not None:
        found = list(executor.map(case, range(count)))
    else:
        with ThreadPoolExecutor(os.cpu_count()) as own:
            found = list(own.map(case, range(count)))
    rows, completed, reasons = zip(*found, strict=True)
    return SynchronizationCampaign(
        seed=seed,
        coupling=coupling,
        metrics={name: np.array([row[name] for row in rows]) for name in METRICS},
        completed=np.array(completed),
        reasons=reasons,
    )


def _case(actuators, schedules, reference, coupling, loads, spread, seed, rules, case: int):
    """(metrics by name, whether it was completed, why not) of one case."""
    varied, further = random_group(actuators, seed, case, spread)
    loads = [np.asarray(load) + more for load, more in zip(loads, further, strict=True)]
    try:
        result = synchronize(
            varied, schedules, reference, coupling=coupling, load_forces=loads, **rules
        )
    except SimulationError as error:
        return dict.fromkeys(METRICS, np.nan), False, str(error)
    return asdict(result.metrics), result.completed, ""
