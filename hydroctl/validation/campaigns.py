"""`campaign`: a schedule on thousands of random variants of the machine, metrics only, on as many
cores or machines as are given.

Chunks of cases are the same numbers, bit for bit, in whatever order and wherever they are run (see
`cases`).
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor, as_completed
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, Any

import numpy as np

from ..errors import InputError
from ..machine.actuator import Actuator
from ..schedule.verdict import Verdict
from ..simulation import Scenario, Trajectory, simulate_closed_loop
from .cases import (
    CASE_BITS,
    METRICS,
    SPREAD,
    Task,
    draw,
    make_task,
    run_chunk,
    scenario_of,
    whole_number_fault,
)
from .chunks import ChunkStore
from .verdict import Requirement, worst_of

if TYPE_CHECKING:
    from ..schedule.schedule import GainSchedule

_SERIAL_BELOW = 64


@dataclass(frozen=True, eq=False)
class CampaignResult:
    """Metrics of every case; arrays (count,)."""

    actuator: Actuator
    scenarios: tuple[Scenario, ...]
    seed: int
    scenario: np.ndarray
    """which of the scenarios each case ran"""
    parameters: dict[str, np.ndarray]
    """what each case had of its own, SI, by name; `load_force` is added to the scenario's and the
    actuator's"""
    metrics: dict[str, np.ndarray]
    """by the names of `Metrics`; NaN where a case failed"""
    failed: np.ndarray
    """True where the motion left the numbers or used up a chamber"""
    substeps: int
    """integration steps per sample, enough for the fastest mode within the spread"""

    @property
    def count(self) -> int:
        """How many cases ran."""
        return self.failed.size

    def case_seed(self, case: int) -> int:
        """The number by which `replay` runs this case alone."""
        return (self.seed << CASE_BITS) + int(case)

    def reason(self, case: int) -> str:
        """Why a case failed, with the seed that replays it; empty where it did not."""
        if not self.failed[case]:
            return ""
        name = self.scenarios[self.scenario[case]].name
        return (
            f"scenario {name!r}: the loop is unstable or the piston used up a chamber; replay it"
            f" with seed {self.case_seed(case)}."
        )

    def verdicts(self, requirements: Sequence[Requirement]) -> tuple[Verdict, ...]:
        """Each requirement at the case that is worst for it, which the verdict's variant names by
        its seed."""
        achieved: Any = SimpleNamespace(**self.metrics)
        known = {"stroke": self.actuator.stroke, "pressure_rating": self.actuator.pressure_rating}
        machine: Any = SimpleNamespace(**known, supply_pressure=self.parameters["supply_pressure"])
        failures = int(self.failed.sum())
        first = int(np.argmax(self.failed))
        found = [
            self._verdict(
                "simulations that failed", "", self.reason(first), 0.0, float(failures), first
            )
        ]
        for requirement in requirements:
            subject, limits = np.zeros(self.count, bool), np.full(self.count, np.nan)
            values = np.broadcast_to(requirement.achieved(achieved), self.count)
            for index, scenario in enumerate(self.scenarios):
                mine = (self.scenario == index) & ~self.failed
                if scenario.kind in requirement.kinds:
                    limits[mine] = np.broadcast_to(
                        requirement.limit(scenario, machine), self.count
                    )[mine]
                    subject |= mine
            if subject.any():
                worst = int(np.flatnonzero(subject)[worst_of(values[subject], limits[subject])])
                case = (float(limits[worst]), float(values[worst]), worst)
                found.append(
                    self._verdict(requirement.name, requirement.unit, requirement.reason, *case)
                )
        return tuple(found)

    def _verdict(self, name, unit, reason, limit, achieved, case) -> Verdict:
        scenario = self.scenarios[self.scenario[case]].name
        return Verdict(
            name,
            unit,
            reason,
            limit,
            achieved,
            achieved <= limit,
            scenario,
            f"seed {self.case_seed(case)}",
        )


def campaign(
    actuator: Actuator,
    schedule: GainSchedule,
    *,
    count: int,
    seed: int,
    scenarios: Sequence[Scenario] | None = None,
    spread: Mapping[str, float] = SPREAD,
    substeps: int | None = None,
    executor: Executor | None = None,
    chunk_size: int = 1024,
    directory: str | Path | None = None,
    on_progress: Callable[[int, int], None] | None = None,
) -> CampaignResult:
    """Run `count` random cases of the scenarios (default: `step_scenarios`); only metrics are kept,
    160 bytes for a case.

    `substeps` per sample: default what the fastest mode within the spread needs; fewer are as
    accurate where references are smooth. `executor`: where chunks of `chunk_size` cases run, e.g.
    `dask.distributed.Client(...).get_executor()`; default: threads of this process, none for little
    work. `directory`: finished chunks are kept there, also where the call is interrupted; the same
    call again goes on from them. `on_progress(done, count)` is called after every chunk. A case
    that fails is flagged; it raises nothing. Raises InputError, all faults at once.
    """
    task = make_task(actuator, schedule, scenarios, spread, count, seed, substeps, chunk_size)
    store = ChunkStore(
        directory,
        (
            actuator.fingerprint(),
            task.regulator,
            task.scenarios,
            sorted(task.spread.items()),
            seed,
            count,
            task.substeps,
        ),
    )
    rows, missing = np.empty((len(METRICS), count)), []
    for start in range(0, count, chunk_size):
        bound = start, min(start + chunk_size, count)
        kept = store.load(bound)
        if kept is None:
            missing.append(bound)
        else:
            rows[:, slice(*bound)] = kept
    done = count - sum(stop - start for start, stop in missing)
    for bound, chunk in _run_all(task, missing, executor):
        rows[:, slice(*bound)] = chunk
        store.save(bound, chunk)
        done += bound[1] - bound[0]
        if on_progress is not None:
            on_progress(done, count)
    return _result(task, count, rows)


def replay(
    actuator: Actuator,
    schedule: GainSchedule,
    case_seed: int,
    *,
    scenarios: Sequence[Scenario] | None = None,
    spread: Mapping[str, float] = SPREAD,
    substeps: int | None = None,
) -> tuple[Actuator, Scenario, Trajectory]:
    """One case of a campaign again, with its motion: (its machine, its scenario, the trajectory).

    `scenarios`, `spread` and `substeps` as in the campaign. Raises SimulationError where the case
    failed.
    """
    if fault := whole_number_fault("case_seed", case_seed, 0, 2 * CASE_BITS):
        raise InputError(fault)
    case = case_seed % (1 << CASE_BITS)
    task = make_task(
        actuator, schedule, scenarios, spread, case + 1, case_seed >> CASE_BITS, substeps
    )
    drawn = dict(zip(SPREAD, draw(task, case, case + 1)[:, 0].tolist(), strict=True))
    load = drawn.pop("load_force") + actuator.load_force
    machine, scenario = (
        actuator.replace(**drawn, load_force=load),
        task.scenarios[scenario_of(task, case)],
    )
    return (
        machine,
        scenario,
        simulate_closed_loop(machine, schedule, scenario, substeps=task.substeps),
    )


def _run_all(task: Task, bounds, executor: Executor | None):
    """((start, stop), rows) of every chunk, as they come."""
    if executor is None and sum(stop - start for start, stop in bounds) <= _SERIAL_BELOW:
        yield from ((bound, run_chunk(task, *bound)) for bound in bounds)
        return
    pool = ThreadPoolExecutor(os.cpu_count()) if executor is None else executor
    futures = {pool.submit(run_chunk, task, *bound): bound for bound in bounds}
    try:
        for future in as_completed(list(futures)):
            yield futures.pop(future), future.result()
    finally:
        for future in futures:
            future.cancel()
        if executor is None:
            pool.shutdown()


def _result(task: Task, count: int, rows: np.ndarray) -> CampaignResult:
    metrics = dict(zip(METRICS, rows, strict=True))
    parameters = dict(zip(SPREAD, draw(task, 0, count), strict=True))
    chosen, failed = scenario_of(task, np.arange(count)), np.isnan(metrics["iae"])
    return CampaignResult(
        task.actuator, task.scenarios, task.seed, chosen, parameters, metrics, failed, task.substeps
    )
