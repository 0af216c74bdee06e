"""`campaign`: a schedule on thousands of random variants of the machine, metrics only, on as many cores or machines as are given.

Case i runs scenario (i // 32) modulo their number, with its own bulk modulus, mass, supply pressure, viscous friction and load,
drawn from one stream of random numbers at a place that only i decides. Chunks of cases are therefore the same numbers, bit for
bit, in whatever order and wherever they are run.
"""

from __future__ import annotations

import os
from collections.abc import Callable, Mapping, Sequence
from concurrent.futures import Executor, ThreadPoolExecutor, as_completed
from dataclasses import dataclass, fields
from numbers import Integral, Real
from pathlib import Path
from types import SimpleNamespace
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from .. import plant
from ..actuator import Actuator
from ..errors import InputError, unknown_name
from ..operating_point import stall_force
from ..simulation import Scenario, Trajectory, simulate_closed_loop
from ..simulation.law import Regulator
from ..simulation.modes import substeps as needed_substeps
from ..simulation.regulator import regulator_of
from ..simulation.scenario import require_fit
from ..simulation.trajectory import rest_pressures
from ..specification import VARIATIONS
from .chunks import ChunkStore
from .metrics import Metrics, last_step
from .scenarios import step_scenarios
from .verdict import Requirement, Verdict, excess_of

if TYPE_CHECKING:
    from ..schedule import GainSchedule

SPREAD = VARIATIONS | {"viscous_friction": 0.5, "load_force": 0.1}
"""Relative half-widths of the uniform distributions; of the load, in parts of the smaller stall force at the lowest supply."""
METRICS = tuple(field.name for field in fields(Metrics))
_SERIAL_BELOW = 64
_CASE_BITS = 32


class _Task(NamedTuple):
    """All that a chunk needs; travels to other processes and machines."""

    actuator: Actuator
    regulator: Regulator
    scenarios: tuple[Scenario, ...]
    spread: dict[str, float]
    seed: int
    substeps: int


@dataclass(frozen=True, eq=False)
class CampaignResult:
    """Metrics of every case; arrays (count,)."""

    actuator: Actuator
    scenarios: tuple[Scenario, ...]
    seed: int
    scenario: np.ndarray
    """which of the scenarios each case ran"""
    parameters: dict[str, np.ndarray]
    """what each case had of its own, SI, by name; `load_force` is added to the scenario's and the actuator's"""
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
        return (self.seed << _CASE_BITS) + int(case)

    def reason(self, case: int) -> str:
        """Why a case failed, with the seed that replays it; empty where it did not."""
        if not self.failed[case]:
            return ""
        name = self.scenarios[self.scenario[case]].name
        return (
            f"scenario {name!r}: the loop is unstable or the piston used up a chamber; replay it with seed {self.case_seed(case)}."
        )

    def verdicts(self, requirements: Sequence[Requirement]) -> tuple[Verdict, ...]:
        """Each requirement at the case that is worst for it, which the verdict's variant names by its seed."""
        achieved = SimpleNamespace(**self.metrics)
        machine = SimpleNamespace(stroke=self.actuator.stroke, supply_pressure=self.parameters["supply_pressure"])
        failures = int(self.failed.sum())
        first = int(np.argmax(self.failed))
        found = [self._verdict("simulations that failed", "", self.reason(first), 0.0, float(failures), first)]
        for requirement in requirements:
            excess, limits = np.full(self.count, -np.inf), np.full(self.count, np.nan)
            values = np.broadcast_to(requirement.achieved(achieved), self.count)
            for index, scenario in enumerate(self.scenarios):
                mine = (self.scenario == index) & ~self.failed
                if scenario.kind in requirement.kinds and mine.any():
                    limits[mine] = np.broadcast_to(requirement.limit(scenario, machine), self.count)[mine]
                    excess[mine] = excess_of(values[mine], limits[mine])
            if (excess > -np.inf).any():
                worst = int(np.argmax(excess))
                case = (float(limits[worst]), float(values[worst]), worst)
                found.append(self._verdict(requirement.name, requirement.unit, requirement.reason, *case))
        return tuple(found)

    def _verdict(self, name, unit, reason, limit, achieved, case) -> Verdict:
        scenario = self.scenarios[self.scenario[case]].name
        return Verdict(name, unit, reason, limit, achieved, achieved <= limit, scenario, f"seed {self.case_seed(case)}")


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
    """Run `count` random cases of the scenarios (default: `step_scenarios`); only metrics are kept.

    `substeps` per sample: default what the fastest mode within the spread needs; fewer are as accurate where references are smooth.
    `executor`: where chunks of `chunk_size` cases run, e.g. `dask.distributed.Client(...).get_executor()`; default: threads of
    this process, none for little work. `directory`: finished chunks are kept there; the same call again goes on from them.
    `on_progress(done, count)` is called after every chunk. A case that fails is flagged; it raises nothing. Raises InputError, all
    faults at once.
    """
    if scenarios is None:
        scenarios = step_scenarios(actuator, schedule.loop, Ts=schedule.Ts)
    task = _task(actuator, schedule, scenarios, spread, count, seed, substeps, chunk_size)
    store = ChunkStore(
        directory, (actuator.fingerprint(), task.regulator, task.scenarios, sorted(task.spread.items()), seed, count, task.substeps)
    )
    bounds = [(start, min(start + chunk_size, count)) for start in range(0, count, chunk_size)]
    rows = {bound: store.load(bound) for bound in bounds}
    missing = [bound for bound in bounds if rows[bound] is None]
    done = count - sum(stop - start for start, stop in missing)
    for bound, chunk in _run_all(task, missing, executor):
        rows[bound] = chunk
        store.save(bound, chunk)
        done += bound[1] - bound[0]
        if on_progress is not None:
            on_progress(done, count)
    return _result(task, count, np.concatenate([rows[bound] for bound in bounds], axis=1))


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

    `scenarios`, `spread` and `substeps` as in the campaign. Raises SimulationError where the case failed.
    """
    if scenarios is None:
        scenarios = step_scenarios(actuator, schedule.loop, Ts=schedule.Ts)
    if fault := _whole_number_fault("case_seed", case_seed, 0, 2 * _CASE_BITS):
        raise InputError(fault)
    case = case_seed % (1 << _CASE_BITS)
    task = _task(actuator, schedule, scenarios, spread, case + 1, case_seed >> _CASE_BITS, substeps)
    drawn = dict(zip(SPREAD, _draw(task, case, case + 1)[:, 0].tolist(), strict=True))
    load = drawn.pop("load_force") + actuator.load_force
    machine, scenario = actuator.replace(**drawn, load_force=load), scenarios[_scenario_of(task, case)]
    return machine, scenario, simulate_closed_loop(machine, schedule, scenario, substeps=task.substeps)


def _task(actuator, schedule, scenarios, spread, count, seed, substeps, chunk_size=1) -> _Task:
    scenarios, spread = tuple(scenarios), dict(spread)
    faults = [unknown_name("spread", name, SPREAD) for name in spread if name not in SPREAD]
    faults += [
        f"spread[{name!r}] = {part!r} must be a number from 0 to 0.95."
        for name, part in spread.items()
        if isinstance(part, bool) or not isinstance(part, Real) or not 0.0 <= part <= 0.95
    ]
    given = {"count": (count, 1), "seed": (seed, 0), "chunk_size": (chunk_size, 1)}
    if substeps is not None:
        given["substeps"] = substeps, 1
    faults += [fault for name, (value, least) in given.items() if (fault := _whole_number_fault(name, value, least, _CASE_BITS))]
    if not scenarios:
        faults.append("scenarios is empty; give at least one, or leave it out for the library's.")
    if faults:
        raise InputError(faults)
    for scenario in scenarios:
        require_fit(schedule, scenario)
    spread = {name: float(spread.get(name, 0.0)) for name in SPREAD}
    stiffest = actuator.replace(
        bulk_modulus=actuator.bulk_modulus * (1.0 + spread["bulk_modulus"]),
        mass=actuator.mass * (1.0 - spread["mass"]),
        supply_pressure=actuator.supply_pressure * (1.0 + spread["supply_pressure"]),
    )
    return _Task(actuator, regulator_of(schedule), scenarios, spread, seed, substeps or needed_substeps(stiffest, schedule.Ts))


def _whole_number_fault(name: str, value, least: int, bits: int) -> str | None:
    if isinstance(value, Integral) and not isinstance(value, bool) and least <= value < 1 << bits:
        return None
    return f"{name} = {value!r} must be a whole number from {least} to 2^{bits} - 1."


def _run_all(task: _Task, bounds, executor: Executor | None):
    """((start, stop), rows) of every chunk, as they come."""
    if executor is None and sum(stop - start for start, stop in bounds) <= _SERIAL_BELOW:
        yield from ((bound, run_chunk(task, *bound)) for bound in bounds)
        return
    own = ThreadPoolExecutor(os.cpu_count()) if executor is None else None
    try:
        futures = {(own or executor).submit(run_chunk, task, *bound): bound for bound in bounds}
        for future in as_completed(futures):
            yield futures.pop(future), future.result()
    finally:
        if own is not None:
            own.shutdown(cancel_futures=True)


def _scenario_of(task: _Task, cases):
    from ..simulation.lanes import LANES

    return np.asarray(cases) // LANES % len(task.scenarios)


def _draw(task: _Task, start: int, stop: int) -> np.ndarray:
    """(5, n): the parameters that cases start ... stop - 1 have of their own, in the order of SPREAD."""
    stream = np.random.PCG64(task.seed).advance(start * len(SPREAD))
    signed = 2.0 * np.random.Generator(stream).random((stop - start, len(SPREAD))).T - 1.0
    a = task.actuator
    weakest = a.replace(supply_pressure=a.supply_pressure * (1.0 - task.spread["supply_pressure"]))
    stall = float(np.abs(stall_force(weakest, np.array([1.0, -1.0]))).min())
    rows = [
        getattr(a, name) * (1.0 + task.spread[name] * row) if name != "load_force" else task.spread[name] * stall * row
        for name, row in zip(SPREAD, signed, strict=True)
    ]
    return np.array(rows)


def run_chunk(task: _Task, start: int, stop: int) -> np.ndarray:
    """(len(METRICS), n): the metrics of cases start ... stop - 1; NaN in every row of a case that failed."""
    drawn, chosen = _draw(task, start, stop), _scenario_of(task, np.arange(start, stop))
    out = np.empty((len(METRICS), stop - start))
    for index, scenario in enumerate(task.scenarios):
        mine = np.flatnonzero(chosen == index)
        if mine.size:
            out[:, mine] = _run_scenario(task, scenario, drawn[:, mine])
    return out


def _run_scenario(task: _Task, scenario: Scenario, drawn: np.ndarray) -> np.ndarray:
    from ..simulation.compiled import loop_for
    from ..simulation.lanes import LANES, ROWS, SUMS

    n = drawn.shape[1]
    cases = np.ascontiguousarray(np.pad(drawn, ((0, 0), (0, -n % LANES)), mode="edge"))
    p = plant.parameters(task.actuator)
    own = p._replace(supply_pressure=cases[list(SPREAD).index("supply_pressure")])
    load = scenario.load_force + task.actuator.load_force
    initial = np.zeros((6, cases.shape[1]))
    if scenario.initial is None:
        initial[:2] = rest_pressures(own, load[0] + cases[list(SPREAD).index("load_force")])
        initial[3] = scenario.y
    else:
        initial[:] = np.array(scenario.initial)[:, None]
    window = last_step(scenario)
    sums = np.empty((len(SUMS), cases.shape[1]))
    room = np.zeros(ROWS * LANES), np.zeros((task.regulator.delay_samples + 1, LANES))
    signals = (scenario.reference, scenario.v_ref, load, *window)
    loop_for(task.actuator, task.regulator).lanes.run(cases, initial, *signals, task.regulator, p, task.substeps, *room, sums)
    return _metrics(task, scenario, window, dict(zip(SUMS, sums[:, :n], strict=True)))


def _metrics(task: _Task, scenario: Scenario, window, s: dict[str, np.ndarray]) -> np.ndarray:
    """Rows in the order of METRICS from the kernel's sums; the definitions are those of `measure`."""
    Ts, n, (first, late, steady) = scenario.Ts, scenario.reference.size, window
    with np.errstate(invalid="ignore", divide="ignore"):
        overshoot = np.maximum(0.0, s["most"] - 1.0)
        values = {
            "rise_time": np.where(np.isinf(s["rise_90"]), np.inf, s["rise_90"] - s["rise_10"]) * Ts,
            "settling_time": np.where(s["last_outside"] < n - first, s["last_outside"] * Ts, np.inf),
            "overshoot": overshoot,
            "passing": overshoot / np.abs(s["per_step"]),
            "oscillation": s["late_most"] - s["late_least"] if late < n else np.full_like(overshoot, np.nan),
            "steady_error": 1.0 - s["late_sum"] / max(1, n - steady),
        }
        stepped = np.isfinite(s["per_step"]) & (first < n)
        values = {name: np.where(stepped, value, np.nan) for name, value in values.items()}
        beyond = np.maximum(0.0, np.maximum(-s["least_y"], s["most_y"] - task.actuator.stroke))
    values |= {name: s[name] for name in METRICS if name in s} | {"beyond_stroke": beyond}
    rows = np.array([values[name] for name in METRICS])
    a = task.actuator
    used_up = (a.volume_a + a.area_a * s["least_y"] <= 0.0) | (a.volume_b - a.area_b * s["most_y"] <= 0.0)
    rows[:, used_up | ~np.isfinite(s["iae"] + s["total_variation"])] = np.nan
    return rows


def _result(task: _Task, count: int, rows: np.ndarray) -> CampaignResult:
    metrics = dict(zip(METRICS, rows, strict=True))
    parameters = dict(zip(SPREAD, _draw(task, 0, count), strict=True))
    chosen, failed = _scenario_of(task, np.arange(count)), np.isnan(metrics["iae"])
    return CampaignResult(task.actuator, task.scenarios, task.seed, chosen, parameters, metrics, failed, task.substeps)
