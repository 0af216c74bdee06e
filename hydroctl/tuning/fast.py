"""`tune_fast`: gains by formula from the matched second-order models b/(s^2 + a1 s + a2), held to
the same limits as `tune`.

    IMC, velocity loop (pid)      kp, ki, kd = a1/(b tau), a2/(b tau), 1/(b tau)
                                  so that L = 1/(tau s)
    IMC, position loop (p+notch)  kp = a2/(b tau), notch at sqrt(a2)
                                  so that L is about 1/(tau s)
    pole placement, velocity loop (pid), for the closed loop (s + w)(s^2 + 2 zeta w s + w^2):
                                  kp = ((1 + 2 zeta) w^2 - a2)/b, ki = w^3/b,
                                  kd = ((1 + 2 zeta) w - a1)/b

The formulas know neither delay, hold and filter nor the variants of the plant. The gains of IMC are
in proportion to 1/tau: where a limit is missed, tau is raised until it holds. (Rivera, Morari,
Skogestad: Internal model control, PID controller design, 1986.)
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..digits import apart
from ..errors import InfeasibleError, InputError, unknown_name
from ..loop.margins import Loop, analyse
from ..loop.quantity import ControlledQuantity, LoopName, controlled_quantity
from ..machine.actuator import Actuator
from ..model.linearization import linearize
from ..model.operating_point import find_operating_points
from ..quasi_linear.reduction import SecondOrderFamily, reduce_order
from ..regulator.structures import Regulators
from ..schedule.schedule import GainSchedule
from ..specification import Specification
from .limits import limits_of, phrase
from .refinement import broken
from .synthesis import assemble_schedule, on_the_whole_box
from .task import Task, task_of

METHODS = ("imc", "pole-placement")
_DAMPING = 0.7
_HALVINGS = 40
_BISECTIONS = 14


@dataclass(frozen=True, eq=False)
class FastTuning:
    """A schedule whose gains come from formulas, and what they were asked for."""

    schedule: GainSchedule
    method: str
    reduced: SecondOrderFamily
    """(nx, ny) the models the formulas used"""
    wanted: np.ndarray
    """(nx, ny) rad/s: 1/tau of IMC, w of pole placement, as asked"""
    reached: np.ndarray
    """(nx, ny) rad/s: the same, with which every limit holds; below `wanted` where IMC had to be
    slowed"""


def tune_fast(
    actuator: Actuator,
    x,
    y,
    *,
    method: str = "imc",
    loop: LoopName = "velocity",
    bandwidth: float | None = None,
    specification: Specification | None = None,
) -> FastTuning:
    """Gains by `method` "imc" or "pole-placement" at the nodes x (nx,) and y (ny,) in m, checked as
    those of `tune` are.

    `bandwidth` in rad/s is 1/tau or w; by default 1/(delay + Ts/2 + Tf) for IMC and the natural
    frequency of each node for pole placement. Raises InputError as `tune` does and for pole
    placement in a position loop, InfeasibleError where the poles that were placed miss a limit on
    the sampled plants, or where IMC meets none, however slow.
    """
    _require(method, controlled_quantity(loop), bandwidth)
    made: list[FastTuning] = []

    def make(task: Task) -> GainSchedule:
        made.append(_tuned(actuator, task, method, bandwidth))
        return made[-1].schedule

    on_the_whole_box(
        task_of(actuator, x, y, loop, controlled_quantity(loop).formula_structure, specification),
        make,
        make,
    )
    return made[-1]


def _tuned(actuator: Actuator, task: Task, method: str, bandwidth: float | None) -> FastTuning:
    """The regulators of the task, held to its limits at its points and on its plants."""
    reduced = reduce_order(
        linearize(actuator, find_operating_points(actuator, task.x[:, None], task.y))
    )
    default = _default_bandwidth(method, reduced, task.specification)
    wanted = np.broadcast_to(default if bandwidth is None else bandwidth, reduced.shape)
    placed, reached = (
        _regulators(method, task.quantity, reduced, wanted, task.specification),
        wanted,
    )
    if method == "imc":
        share = _slow_down(task, placed)
        placed, reached = _scaled(placed, share), share * wanted
    else:
        _require_held(task, placed)
    return FastTuning(
        assemble_schedule(task, (task.x, task.y), placed), method, reduced, wanted, reached
    )


def _require(method: str, quantity: ControlledQuantity, bandwidth: float | None) -> None:
    faults = [] if method in METHODS else [unknown_name("method", method, METHODS)]
    if bandwidth is not None and not 0.0 < bandwidth < np.inf:
        faults.append(
            f"bandwidth = {bandwidth!r} must be a positive frequency in rad/s, or None for the"
            " default."
        )
    if method == "pole-placement" and not quantity.is_speed:
        faults.append(
            "pole placement needs a velocity loop: with position feedback a PID cannot move the sum"
            ' of the poles, -a1. Use method "imc".'
        )
    if faults:
        raise InputError(faults)


def _default_bandwidth(method: str, reduced: SecondOrderFamily, specification: Specification):
    if method == "imc":
        return 1.0 / (
            (specification.delay_samples + 0.5) * specification.sample_time + specification.Tf
        )
    return reduced.natural_frequency


def _regulators(
    method: str,
    quantity: ControlledQuantity,
    reduced: SecondOrderFamily,
    wanted,
    specification: Specification,
) -> Regulators:
    a1, a2, b = reduced.a1, reduced.a2, reduced.b
    damping = (1.0, 1.0) if quantity.is_speed else specification.notch_damping
    assert damping is not None  # the task has settled it
    zero, (zz, zp) = np.zeros(reduced.shape), damping
    if quantity.integrations:
        kp, ki, kd = a2 * wanted / b, zero, zero
    elif method == "imc":
        kp, ki, kd = (term * wanted / b for term in (a1, a2, 1.0))
    else:
        middle = 1.0 + 2.0 * _DAMPING
        kp, ki, kd = (middle * wanted**2 - a2) / b, wanted**3 / b, (middle * wanted - a1) / b
    return Regulators(
        specification.sample_time,
        kp,
        ki,
        kd,
        (specification.notch_ratio or 1.0) * reduced.natural_frequency,
        specification.Tf,
        zz,
        zp,
        (),
        specification.measurement_filter,
    )


def _scaled(regulators: Regulators, share: np.ndarray) -> Regulators:
    return replace(
        regulators, **{name: share * getattr(regulators, name) for name in ("kp", "ki", "kd")}
    )


def _slow_down(task: Task, regulators: Regulators) -> np.ndarray:
    """(nx, ny): the share of the gains with which every limit holds: 1, or less if the gain at the
    Nyquist frequency asks for it, or by bisection the largest below the first that fails."""

    limit = task.specification.high_frequency_gain
    most = (
        np.ones(regulators.shape)
        if limit is None
        else np.minimum(1.0, limit / regulators.nyquist_gain)
    )

    def holds(share):
        loops = Loop(task.plants, _scaled(regulators, share).broadcast_to(task.plants.shape))
        stable = np.abs(loops.poles()).max(axis=-1) < 1.0
        return (stable & ~broken(loops, task.specification)).all(axis=0)

    high, low = most, most
    for _ in range(_HALVINGS):
        held = holds(low)
        if held.all():
            break
        high, low = np.where(held, high, low), np.where(held, low, low / 2.0)
    if not held.all():
        i, j = np.argwhere(~held)[0]
        raise InfeasibleError(
            f"x={task.x[i]:g}, y={task.y[j]:g} m: IMC meets the specification at no time constant."
            " Raise a limit or use `tune`."
        )
    for _ in range(_BISECTIONS):
        middle = (low + high) / 2.0
        held = holds(middle)
        low, high = np.where(held, middle, low), np.where(held, high, middle)
    return low


def _require_held(task: Task, regulators: Regulators) -> None:
    missed, found = _misses(task, regulators)
    if missed.max() > 0.0:
        worst = np.unravel_index(np.argmax(np.where(found.stable, missed, np.inf)), missed.shape)
        Ms, _ = apart(found.Ms[worst], task.specification.Ms)
        Mt, _ = apart(found.Mt[worst], task.specification.Mt)
        state = f"Ms = {Ms}, Mt = {Mt}" if found.stable[worst] else "an unstable loop"
        asked = " and ".join(
            phrase(name, task.specification) for name in limits_of(task.specification)
        )
        raise InfeasibleError(
            f"{task.place(*worst)}: pole placement, which ignores the delay, gives {state}; asked:"
            f' {asked}. Use method "imc" or `tune`, another bandwidth, or a shorter delay.'
        )


def _misses(task: Task, regulators: Regulators):
    """((variants, nx, ny), margins): by what share the worst limit is missed; not positive where
    all hold."""
    specification = task.specification
    found = analyse(Loop(task.plants, regulators.broadcast_to(task.plants.shape)))
    missed = [
        found.Ms / specification.Ms - 1.0,
        found.Mt / specification.Mt - 1.0,
        np.where(found.stable, 0.0, np.inf),
    ]
    for name in ("gain_margin", "phase_margin"):
        if getattr(specification, name) is not None:
            missed.append(1.0 - getattr(found, name) / getattr(specification, name))
    if specification.high_frequency_gain is not None:
        excess = regulators.nyquist_gain / specification.high_frequency_gain - 1.0
        missed.append(np.broadcast_to(excess, task.plants.shape))
    return np.max(missed, axis=0), found
