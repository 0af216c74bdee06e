"""The cases of a campaign: what each has of its own, and its metrics.

Case i runs scenario (i // 32) modulo their number, with its own bulk modulus, mass, supply
pressure, viscous friction and load, drawn from one stream of random numbers at a place that only i
decides.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import fields
from numbers import Integral, Real
from typing import TYPE_CHECKING, NamedTuple

import numpy as np

from ..errors import InputError, unknown_name
from ..machine.actuator import Actuator
from ..machine.variants import VARIATIONS
from ..model import plant
from ..model.chambers import volumes
from ..model.operating_point import stall_force
from ..model.supply import with_pressure
from ..regulator.law import Regulator
from ..regulator.prepared import regulator_of
from ..simulation import Scenario
from ..simulation.modes import substeps as needed_substeps
from ..simulation.scenario import require_fit
from ..simulation.trajectory import rest_pressures
from .metrics import Metrics, last_step
from .scenarios import step_scenarios

if TYPE_CHECKING:
    from ..schedule.schedule import GainSchedule

SPREAD = VARIATIONS | {"viscous_friction": 0.5, "load_force": 0.1}
"""Relative half-widths of the uniform distributions; of the load, in parts of the smaller stall
force at the lowest supply."""
METRICS = tuple(field.name for field in fields(Metrics))
CASE_BITS = 32


class Task(NamedTuple):
    """All that a chunk needs; travels to other processes and machines."""

    actuator: Actuator
    regulator: Regulator
    scenarios: tuple[Scenario, ...]
    spread: dict[str, float]
    seed: int
    substeps: int


def make_task(
    actuator: Actuator,
    schedule: GainSchedule,
    scenarios: Sequence[Scenario] | None,
    spread: Mapping[str, float],
    count: int,
    seed: int,
    substeps: int | None,
    chunk_size: int = 1,
) -> Task:
    """The task of a campaign; InputError with all faults of its arguments at once."""
    if scenarios is None:
        scenarios = step_scenarios(actuator, schedule.loop, Ts=schedule.Ts)
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
    faults += [
        fault
        for name, (value, least) in given.items()
        if (fault := whole_number_fault(name, value, least, CASE_BITS))
    ]
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
    return Task(
        actuator,
        regulator_of(schedule.regulator),
        scenarios,
        spread,
        seed,
        substeps or needed_substeps(stiffest, schedule.Ts),
    )


def whole_number_fault(name: str, value, least: int, bits: int) -> str | None:
    """A sentence where `value` is no whole number from `least` to 2^bits - 1."""
    if (
        isinstance(value, Integral)
        and not isinstance(value, bool)
        and least <= int(value) < 1 << bits
    ):
        return None
    return f"{name} = {value!r} must be a whole number from {least} to 2^{bits} - 1."


def scenario_of(task: Task, cases):
    """Which of the scenarios each case runs."""
    from ..simulation.kernels.lanes import LANES

    return np.asarray(cases) // LANES % len(task.scenarios)


def draw(task: Task, start: int, stop: int) -> np.ndarray:
    """(5, n): the parameters that cases start ... stop - 1 have of their own, in the order of
    SPREAD."""
    stream = np.random.PCG64(task.seed).advance(start * len(SPREAD))
    signed = 2.0 * np.random.Generator(stream).random((stop - start, len(SPREAD))).T - 1.0
    a = task.actuator
    weakest = a.replace(supply_pressure=a.supply_pressure * (1.0 - task.spread["supply_pressure"]))
    stall = float(np.abs(stall_force(weakest, np.array([1.0, -1.0]))).min())
    rows = [
        getattr(a, name) * (1.0 + task.spread[name] * row)
        if name != "load_force"
        else task.spread[name] * stall * row
        for name, row in zip(SPREAD, signed, strict=True)
    ]
    return np.array(rows)


def run_chunk(task: Task, start: int, stop: int) -> np.ndarray:
    """(len(METRICS), n): the metrics of cases start ... stop - 1; NaN in every row of a case that
    failed."""
    drawn, chosen = draw(task, start, stop), scenario_of(task, np.arange(start, stop))
    out = np.empty((len(METRICS), stop - start))
    for index, scenario in enumerate(task.scenarios):
        mine = np.flatnonzero(chosen == index)
        if mine.size:
            out[:, mine] = _run_scenario(task, scenario, drawn[:, mine])
    return out


def _run_scenario(task: Task, scenario: Scenario, drawn: np.ndarray) -> np.ndarray:
    from ..simulation.kernels.builds import loop_for
    from ..simulation.kernels.lanes import LANES, ROWS, SUMS

    n = drawn.shape[1]
    cases = np.ascontiguousarray(np.pad(drawn, ((0, 0), (0, -n % LANES)), mode="edge"))
    mass, further = (list(SPREAD).index(name) for name in ("mass", "load_force"))
    cases[further] += task.actuator.axial_gravity * cases[mass]
    p = plant.parameters(task.actuator)
    own = p._replace(supply=with_pressure(p.supply, cases[list(SPREAD).index("supply_pressure")]))
    load = np.asarray(scenario.load_force) + task.actuator.load_force
    initial = np.zeros((6, cases.shape[1]))
    if scenario.initial is None:
        initial[:2] = rest_pressures(own, load[0] + cases[further])
        initial[3] = scenario.y
    else:
        initial[:] = np.array(scenario.initial)[:, None]
    window = last_step(scenario)
    sums = np.empty((len(SUMS), cases.shape[1]))
    room = np.zeros(ROWS * LANES), np.zeros((task.regulator.delay_samples + 2, LANES))
    signals = (scenario.reference, scenario.v_ref, load, *window, scenario.sensor_signals())
    loop_for(task.actuator, task.regulator).lanes.run(
        cases, initial, *signals, task.regulator, p, task.substeps, *room, sums
    )
    return _metrics(task, scenario, window, dict(zip(SUMS, sums[:, :n], strict=True)))


def _metrics(task: Task, scenario: Scenario, window, s: dict[str, np.ndarray]) -> np.ndarray:
    """Rows in the order of METRICS from the kernel's sums; the definitions are those of
    `measure`."""
    Ts, n, (first, late, steady) = scenario.Ts, scenario.reference.size, window
    with np.errstate(invalid="ignore", divide="ignore"):
        overshoot = np.maximum(0.0, s["most"] - 1.0)
        values = {
            "rise_time": np.where(np.isinf(s["rise_90"]), np.inf, s["rise_90"] - s["rise_10"]) * Ts,
            "settling_time": np.where(
                s["last_outside"] < n - first, s["last_outside"] * Ts, np.inf
            ),
            "overshoot": overshoot,
            "passing": overshoot / np.abs(s["per_step"]),
            "oscillation": s["late_most"] - s["late_least"]
            if late < n
            else np.full_like(overshoot, np.nan),
            "steady_error": 1.0 - s["late_sum"] / max(1, n - steady),
        }
        stepped = np.isfinite(s["per_step"]) & (first < n)
        values = {name: np.where(stepped, value, np.nan) for name, value in values.items()}
        beyond = np.maximum(0.0, np.maximum(-s["least_y"], s["most_y"] - task.actuator.stroke))
    values |= {name: s[name] for name in METRICS if name in s} | {"beyond_stroke": beyond}
    rows = np.array([values[name] for name in METRICS])
    chambers = plant.parameters(task.actuator).chambers
    (least_a, _), (_, least_b) = volumes(s["least_y"], chambers), volumes(s["most_y"], chambers)
    used_up = (least_a <= 0.0) | (least_b <= 0.0)
    rows[:, used_up | ~np.isfinite(s["iae"] + s["total_variation"])] = np.nan
    return rows
