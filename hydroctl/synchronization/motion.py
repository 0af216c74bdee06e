"""`synchronize`: several cylinders on the nonlinear plant, each under its own schedule, following
one reference together."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..digits import apart
from ..errors import InputError
from ..machine.actuator import Actuator
from ..model.operating_point import stall_force
from ..regulator.prepared import regulator_of
from ..simulation import State, Trajectory, rest_state
from ..simulation.kernels.tables import machine_tables, regulator_tables
from ..simulation.modes import substeps as needed_substeps
from ..simulation.trajectory import require_motion
from .checks import group_faults, profile_faults
from .coupling import Coupling
from .design import design_coupling
from .metrics import SETTLING, SynchronizationMetrics, measure_group
from .profile import MotionProfile
from .rules import Failure, MotionLimits, RateOverride, StopStrategy

if TYPE_CHECKING:
    from ..schedule.schedule import GainSchedule

_LONGEST = 4.0
_LOAD_STEP = 0.01


@dataclass(frozen=True, eq=False, kw_only=True)
class Stop:
    """How the group stopped."""

    time: float
    """s at which it was told to"""
    cylinder: int
    """the one that gave the reason, from 0"""
    reason: str
    distance: np.ndarray
    """(N,) m that each cylinder still moved, at most, from where it was at `time`"""
    stated: float
    """m over which the reference ran out"""
    error: float
    """m, the largest synchronisation error from `time` on"""


@dataclass(frozen=True, eq=False, kw_only=True)
class SynchronizationResult:
    """The motion of N cylinders over n samples."""

    profile: MotionProfile
    coupling: Coupling
    trajectories: tuple[Trajectory, ...]
    """one for each cylinder; their `reference` is what its regulator was given"""
    reference: np.ndarray
    """(n,) the common reference in m"""
    v_ref: np.ndarray
    """(n,) its speed in m/s"""
    rate: np.ndarray
    """(n,) progress along the profile: 1 at its own speed, less where it is slowed down, 0 after a
    stop"""
    load_steps: np.ndarray
    """(n,) True where a load jumps by more than 1 % of what the cylinder can hold"""
    stop: Stop | None
    """None where the group was not stopped"""
    completed: bool
    """whether the reference reached its end within the longest time"""

    @property
    def t(self) -> np.ndarray:
        """(n,) s"""
        return self.trajectories[0].t

    @property
    def y(self) -> np.ndarray:
        """(N, n) m"""
        return np.array([trajectory.y for trajectory in self.trajectories])

    @cached_property
    def error(self) -> np.ndarray:
        """(n,) the synchronisation error max - min over the cylinders in m."""
        return np.ptp(self.y, axis=0)

    @cached_property
    def metrics(self) -> SynchronizationMetrics:
        """Figures of the whole motion."""
        commands = np.array([trajectory.command for trajectory in self.trajectories])
        return measure_group(
            self.error, self.reference - self.y, commands, self.load_steps, self.profile.Ts
        )

    def summary(self) -> str:
        """What was reached, and with which coupling, in a few lines."""
        m, c = self.metrics, self.coupling
        lines = [
            (
                f"{len(self.trajectories)} cylinders, coupling {c.name}, kc = {c.kc:.3g}, ki ="
                f" {c.ki:.3g} 1/s"
            ),
            *([f"  {c.evidence}"] if c.evidence else []),
            f"  synchronisation error: rms {1e3 * m.rms:.4f} mm, peak {1e3 * m.peak:.4f} mm",
        ]
        if self.load_steps.any():
            parts = (
                f"rms {1e3 * m.rms_after_load_steps:.4f} mm, peak"
                f" {1e3 * m.peak_after_load_steps:.4f} mm"
            )
            lines.append(f"  in the {SETTLING:g} s after each load step: {parts}")
        end = "to the end of the reference" if self.completed else "NOT to the end of the reference"
        lines.append(
            f"  {m.duration:.3f} s, {end}, {m.saturation_time:.3f} s with a valve fully open"
        )
        if self.stop is not None:
            s = self.stop
            halted, stated = apart(s.distance.max(), s.stated, factor=1e3)
            way = f"all halted within {halted} mm ({stated} mm stated)"
            lines.append(
                f"  stopped at {s.time:.3f} s, cylinder {s.cylinder + 1}: {s.reason}; {way}"
            )
        return "\n".join(lines)


def synchronize(
    actuators: Sequence[Actuator],
    schedules: Sequence[GainSchedule],
    reference: MotionProfile,
    *,
    coupling: str | Coupling = "mean",
    load_forces: Sequence | None = None,
    override: RateOverride | None = None,
    limits: MotionLimits | None = None,
    stop: StopStrategy | None = None,
    failure: Failure | None = None,
    longest: float | None = None,
) -> SynchronizationResult:
    """The motion of 2 to 16 cylinders along one reference, from rest; law and equations are those
    of `simulation.group`.

    `schedules`: one for each cylinder. `coupling`: one of COUPLINGS, with the gains of
    `design_coupling`, or a `Coupling`. `load_forces`: for each cylinder a number or (n,) over the
    samples in N, positive against extension, held after the last one and added to the actuator's.
    `longest`: s after which a slowed motion ends unfinished; default: four times the reference's.
    Raises InputError, all faults at once; SimulationError where a motion leaves the numbers.
    """
    loads, faults = _loads(load_forces, len(actuators), reference)
    faults += group_faults(actuators, schedules) + profile_faults(actuators, schedules, reference)
    faults += _rule_faults(len(actuators), reference, limits, stop, failure, longest)
    if isinstance(coupling, Coupling) and coupling.matrix.shape != (len(actuators),) * 2:
        faults.append(
            f"the coupling is for {len(coupling.matrix)} cylinders, given are {len(actuators)};"
            " design it for these."
        )
    if faults:
        raise InputError(faults)
    if not isinstance(coupling, Coupling):
        coupling = design_coupling(actuators, schedules, coupling)
    slowed = override is not None or limits is not None
    samples = reference.position.size
    if slowed:
        samples = (
            math.ceil((_LONGEST * reference.t[-1] if longest is None else longest) / reference.Ts)
            + 1
        )
    loads = np.pad(loads, ((0, 0), (0, max(0, samples - loads.shape[1]))), mode="edge")[:, :samples]
    return _run(actuators, schedules, reference, coupling, loads, override, limits, stop, failure)


def _loads(load_forces, count: int, reference: MotionProfile) -> tuple[np.ndarray, list[str]]:
    """(N, n) N and what is wrong with them."""
    faults: list[str] = []
    loads = np.zeros((count, reference.position.size))
    if load_forces is None:
        return loads, faults
    if not hasattr(load_forces, "__len__") or len(load_forces) != count:
        return loads, [
            f"load_forces must be {count} loads, one for each cylinder, each a number or one for"
            " each sample."
        ]
    for i, load in enumerate(load_forces):
        load = np.asarray(load, dtype=float)
        if load.shape not in ((), reference.position.shape) or not np.isfinite(load).all():
            faults.append(
                f"the load of cylinder {i + 1}, shape {load.shape}, must be one finite number or"
                f" one for each of the {reference.position.size} samples."
            )
        else:
            loads[i] = load
    return loads, faults


def _rule_faults(count, reference, limits, stop, failure, longest) -> list[str]:
    faults = []
    if limits is not None and np.size(limits.speed) not in (1, count):
        faults.append(
            f"limits.speed has {np.size(limits.speed)} values for {count} cylinders; give one"
            " number, or one for each."
        )
    if failure is not None and stop is None:
        faults.append("a failure needs a stop strategy; give stop=StopStrategy(...).")
    if failure is not None and not (
        isinstance(failure.cylinder, int) and 0 <= failure.cylinder < count
    ):
        faults.append(
            f"failure.cylinder = {failure.cylinder!r} is none of the cylinders 0 to {count - 1}."
        )
    if failure is not None and failure.time > reference.t[-1]:
        given, end = apart(failure.time, reference.t[-1])
        faults.append(f"failure.time = {given} s is after the end of the reference, {end} s.")
    if longest is not None and not reference.t[-1] <= longest < math.inf:
        given, end = apart(longest, reference.t[-1])
        faults.append(
            f"longest = {given} s must be finite and not shorter than the reference, {end} s."
        )
    return faults


def _run(
    actuators, schedules, reference, coupling, loads, override, limits, stop, failure
) -> SynchronizationResult:
    from ..simulation.kernels.builds import loop_for_group
    from ..simulation.kernels.group import COMMON_ROWS, ROWS

    count, samples = loads.shape
    regulators = [regulator_of(schedule.regulator) for schedule in schedules]
    own = np.array([[actuator.constant_load] for actuator in actuators])
    states = np.array(
        [
            rest_state(a, reference.position[0], load_force=load[0])
            for a, load in zip(actuators, loads, strict=True)
        ]
    )
    ceiling = (
        np.ones(reference.speed.size)
        if limits is None
        else limits.ceiling(reference.speed, actuators)
    )
    path = np.array([reference.position, reference.speed, ceiling])
    rules = (
        *_rule_numbers(override, stop, failure, reference.Ts),
        (coupling.matrix, float(coupling.kc), float(coupling.ki)),
    )
    substeps = np.array([needed_substeps(actuator, reference.Ts) for actuator in actuators])
    tables = regulator_tables(regulators), machine_tables(actuators), substeps
    out, common = np.empty((count, len(ROWS), samples)), np.empty((len(COMMON_ROWS), samples))
    done, stopped, place = loop_for_group(actuators, regulators).group.run(
        states, path, loads + own, *rules, *tables, out, common
    )
    common = common[:, :done].copy()
    trajectories = tuple(
        require_motion(
            actuator, _trajectory(rows[:, :done].copy(), reference.Ts, int(steps), state)
        )
        for actuator, rows, steps, state in zip(actuators, out, substeps, states, strict=True)
    )
    return SynchronizationResult(
        profile=reference,
        coupling=coupling,
        trajectories=trajectories,
        reference=common[0],
        v_ref=common[1],
        rate=common[2],
        load_steps=_load_steps(actuators, loads[:, :done]),
        stop=(
            None
            if stopped < 0
            else _stop_report(trajectories, common[0], stopped, stop, failure, reference.Ts)
        ),
        completed=stopped < 0 and place >= reference.position.size - 1,
    )


def _rule_numbers(
    override: RateOverride | None, stop: StopStrategy | None, failure: Failure | None, Ts: float
):
    """What the kernel takes as override, stop and failure."""
    from ..simulation.kernels.group import SENSOR, SOUND, VALVE

    slowing = (np.inf, 1.0, 0.0, 0.0)
    if override is not None:
        slowing = (
            float(override.free),
            float(override.span),
            float(override.time_constant),
            float(override.least),
        )
    stopping = (1.0, np.inf) if stop is None else (float(stop.distance), float(stop.largest_lag))
    if failure is None:
        return slowing, stopping, (-1, 0, SOUND)
    return (
        slowing,
        stopping,
        (failure.cylinder, round(failure.time / Ts), SENSOR if failure.kind == "sensor" else VALVE),
    )


def _trajectory(rows: np.ndarray, Ts: float, substeps: int, final: np.ndarray) -> Trajectory:
    p_a, p_b, v, y, spool, x, command, target = rows
    integrator = f"Runge-Kutta 6, {substeps} substeps of {Ts / substeps:g} s per sample"
    motion = (
        Ts * np.arange(y.size),
        x,
        y,
        v,
        p_a,
        p_b,
        spool,
        integrator,
        State(*map(float, final)),
    )
    return Trajectory(*motion, reference=target, command=command)


def _load_steps(actuators: Sequence[Actuator], loads: np.ndarray) -> np.ndarray:
    held = np.array(
        [np.abs(stall_force(actuator, np.array([-1.0, 1.0]))).min() for actuator in actuators]
    )
    changes = np.abs(np.diff(loads, axis=1, prepend=loads[:, :1]))
    return np.any(changes > _LOAD_STEP * held[:, None], axis=0)


def _stop_report(
    trajectories, reference, stopped: int, stop: StopStrategy, failure: Failure | None, Ts: float
) -> Stop:
    y = np.array([trajectory.y for trajectory in trajectories])[:, stopped:]
    blind = failure is not None and failure.kind == "sensor" and round(failure.time / Ts) <= stopped
    lags = np.abs(reference[stopped] - y[:, 0])
    cylinder = failure.cylinder if failure is not None and blind else int(np.argmax(lags))
    found, allowed = apart(lags[cylinder], stop.largest_lag)
    lag = f"it is {found} m from the reference, more than {allowed} m"
    return Stop(
        time=stopped * Ts,
        cylinder=cylinder,
        reason="its position is not known" if blind else lag,
        distance=np.abs(y - y[:, :1]).max(axis=1),
        stated=stop.distance,
        error=float(np.ptp(y, axis=0).max()),
    )
