"""`simulate_closed_loop`: the nonlinear plant under a sampled, gain-scheduled regulator."""

from __future__ import annotations

from numbers import Integral
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError, SimulationError
from ..machine.actuator import Actuator
from ..model import plant
from ..regulator.prepared import regulator_of
from .modes import substeps as needed_substeps
from .scenario import Scenario, require_fit
from .trajectory import State, Trajectory, require_motion, rest_state

if TYPE_CHECKING:
    from ..schedule.schedule import GainSchedule


def simulate_closed_loop(
    actuator: Actuator, schedule: GainSchedule, scenario: Scenario, *, substeps: int | None = None
) -> Trajectory:
    """The motion at the scenario's sample instants; its regulator law is that of `regulator.law`.

    The plant is integrated by Runge-Kutta 6 in equal substeps of a sample, `substeps` of them or as
    many as its fastest mode needs, and with error control through those in which its equations
    bend. Raises InputError where schedule and scenario do not fit together, SimulationError where
    the motion, or the regulator, leaves the numbers.
    """
    require_fit(schedule, scenario)
    if substeps is not None and (
        isinstance(substeps, bool) or not isinstance(substeps, Integral) or substeps < 1
    ):
        raise InputError(f"substeps = {substeps!r} must be a whole number of at least 1, or None.")
    outside = np.asarray(scenario.load_force)
    load = outside + actuator.constant_load
    start = scenario.initial
    if start is None:
        start = rest_state(actuator, scenario.y, load_force=float(outside[0]))
    count = substeps or needed_substeps(actuator, scenario.Ts)
    out = np.empty((7, scenario.reference.size))

    from .kernels.builds import loop_for

    p, regulator = plant.parameters(actuator), regulator_of(schedule.regulator)
    final, faults = loop_for(actuator, regulator).sampled.run(
        tuple(start),
        scenario.reference,
        scenario.v_ref,
        load,
        scenario.sensor_signals(),
        regulator,
        p,
        count,
        out,
    )
    integrator = f"Runge-Kutta 6, {count} substeps of {scenario.Ts / count:g} s per sample"
    p_a, p_b, v, y, spool, x, command = out
    motion = (scenario.t, x, y, v, p_a, p_b, spool, integrator, State(*final))
    answer = require_motion(
        actuator, Trajectory(*motion, reference=scenario.reference, command=command)
    )
    if faults > 0:
        raise SimulationError(
            f"The regulator is unstable in itself: its states overflow at {faults} of"
            f" {command.size} samples. Give its anti-windup a time Tt well above"
            f" {0.5 * scenario.Ts:g} s, half a sample."
        )
    return answer
