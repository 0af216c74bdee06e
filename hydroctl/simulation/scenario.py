"""`Scenario`: what a closed loop is asked to do, sample by sample."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..digits import apart
from ..errors import InputError, unknown_name
from ..loop.quantity import LOOPS, ControlledQuantity, LoopName, controlled_quantity
from .sensing import Sensors
from .trajectory import State, state_of

if TYPE_CHECKING:
    from ..schedule.schedule import GainSchedule

KINDS = ("step", "saturated", "reversal", "tracking")


@dataclass(frozen=True, eq=False, kw_only=True)
class Scenario:
    """A reference and a load over n samples of Ts seconds, and where the motion starts. Raises
    InputError, all faults at once."""

    name: str
    loop: LoopName
    """"velocity": the reference is v in m/s; "position": y in m"""
    Ts: float
    """sample time in s"""
    reference: np.ndarray
    """(n,) held from sample to sample"""
    y: float
    """where the piston rests at the start, m"""
    v_ref: np.ndarray | None = None
    """(n,) speed reference of the feed-forward, m/s; default: the reference of a velocity loop,
    else 0"""
    load_force: np.ndarray | float = 0.0
    """(n,) or a number, N, positive against extension, held from sample to sample; added to the
    actuator's"""
    sensors: Sensors | None = None
    """what the regulator sees; default: the true values"""
    initial: State | None = None
    """default: `rest_state` at y under the first load"""
    kind: str = "tracking"
    """"step": within the valve's range; "saturated": beyond it; "reversal"; "tracking": anything
    else, not expected to settle"""
    settle_by: float | None = None
    """s after the last change of the reference in which the loop is expected to settle; default:
    the whole duration"""

    def __post_init__(self):
        faults = []
        if self.loop not in LOOPS:
            faults.append(unknown_name("loop", self.loop, LOOPS))
        if self.kind not in KINDS:
            faults.append(unknown_name("kind", self.kind, KINDS))
        if not 0.0 < self.Ts < np.inf:
            faults.append(f"Ts = {self.Ts!r} must be a sample time above 0 s.")
        reference = np.array(self.reference, dtype=float)
        if reference.ndim != 1 or reference.size < 2:
            faults.append(
                f"reference of shape {reference.shape} must be one row of at least two samples."
            )
        is_speed = self.loop in LOOPS and self.quantity.is_speed
        default = reference if is_speed else np.zeros_like(reference)
        v_ref = default if self.v_ref is None else np.array(self.v_ref, dtype=float)
        load = np.array(self.load_force, dtype=float)
        for name, array in (("v_ref", v_ref), ("load_force", load)):
            if array.shape not in ((), reference.shape):
                faults.append(
                    f"{name} has shape {array.shape}; give one number or one for each of the"
                    f" {reference.size} samples."
                )
        for name, array in (
            ("reference", reference),
            ("v_ref", v_ref),
            ("load_force", load),
            ("y", np.asarray(self.y)),
        ):
            if not np.isfinite(array).all():
                faults.append(f"{name} holds a value that is not finite; remove it.")
        if not (self.sensors is None or isinstance(self.sensors, Sensors)):
            faults.append(f"sensors = {self.sensors!r} must be Sensors(...) or None.")
        if self.initial is not None:
            try:
                object.__setattr__(self, "initial", state_of(self.initial))
            except InputError as error:
                faults += error.faults
        if faults:
            raise InputError([f"scenario {self.name!r}: {fault}" for fault in faults])
        for name, array in (("reference", reference), ("v_ref", v_ref), ("load_force", load)):
            object.__setattr__(
                self, name, np.ascontiguousarray(np.broadcast_to(array, reference.shape))
            )

        if self.settle_by is None:
            object.__setattr__(self, "settle_by", self.duration)

    @property
    def t(self) -> np.ndarray:
        """(n,) the sample instants in s."""
        return self.Ts * np.arange(self.reference.size)

    def sensor_signals(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Noise and resolution for the kernels; None where the regulator sees the true values."""
        return None if self.sensors is None else self.sensors.signals(self.reference.size)

    @property
    def quantity(self) -> ControlledQuantity:
        """What the loop controls."""
        return controlled_quantity(self.loop)

    @property
    def duration(self) -> float:
        """s"""
        return self.Ts * self.reference.size


def require_fit(schedule: GainSchedule, scenario: Scenario) -> None:
    """InputError where the schedule cannot control the scenario."""
    faults = []
    if schedule.loop != scenario.loop:
        faults.append(
            f"scenario {scenario.name!r} is for the {scenario.loop} loop, the schedule for the"
            f" {schedule.loop} loop."
        )
    if abs(schedule.Ts - scenario.Ts) > 1e-12 * schedule.Ts:
        own, needed = apart(scenario.Ts, schedule.Ts)
        faults.append(
            f"scenario {scenario.name!r} is sampled every {own} s, the schedule every {needed} s."
        )
    if faults:
        raise InputError(faults)
