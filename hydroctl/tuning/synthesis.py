"""`tune`: regulator gains at every node, found on all plants of the specification at once."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import ArrayLike

from ..digits import apart
from ..errors import InfeasibleError, InputError
from ..loop.allowances import between_points
from ..loop.margins import Loop, analyse, peaks
from ..loop.model_plants import ModelPlants
from ..loop.plant_family import Change
from ..loop.points import with_midpoints
from ..loop.quantity import LoopName
from ..regulator.structures import Regulators
from ..schedule.schedule import GainSchedule
from ..specification import Specification
from .box import search_box, search_design_points
from .limits import limits_of, phrase
from .nodes import choose_nodes, mixing_matrix
from .refinement import Problem, broken, exact_gains, rough_gains
from .task import Task, task_of

if TYPE_CHECKING:
    from ..loop.as_plant import Plant

_WINDUP_SHARE, _LEAST_WINDUP_SAMPLES = 0.25, 10
_DENSER = 9
_DENSE = 0.5
"""share of what is allowed between the points, beyond which they become denser; the rest is left to
other plants"""
_SEARCHES = 12
_FEW = 4
_NEAR = 0.02
"""by how much Ms and Mt may stay below their limits where a plant binds"""


def tune(
    plant: Plant,
    x: ArrayLike | None = None,
    y: ArrayLike | None = None,
    *,
    loop: LoopName = "velocity",
    structure: str = "pi",
    specification: Specification | None = None,
) -> GainSchedule:
    """The gain schedule that keeps every limit at all points x (nx,) by y (ny,) in m, on all plants
    of the specification.

    Each point on its own would allow a largest integral gain (for "p" a largest kp). The nodes are
    the fewest of the points (of every second one, where there are many) between which these gains
    interpolate to 0.3 %; the gains at the nodes are then found together, so that the interpolated
    ones keep the limits at every point. Half-way between the points Ms, Mt and a phase margin (rad)
    may miss their limits by 0.02, a gain margin by 2 %; where they miss more, these places become
    points too.

    plant: an `Actuator`, or models as in `as_plant`. A machine varies by the specification's
    uncertainty, models by their own variants: a specification for them states "nominal", or leaves
    the default, and their schedule says "nominal". Of models on a grid x and y may be left out:
    they are the grid's; between its points there is nothing to look at, and nothing is shown
    there.

    x must not hold 0 (see `GainSchedule`). Raises InputError for points that no linear model can
    describe, InfeasibleError where no gain meets the limits, or their largest crossover is below
    `min_crossover`.
    """
    return schedule_for(task_of(plant, x, y, loop, structure, specification))


def schedule_for(task: Task) -> GainSchedule:
    """The schedule of `tune` for a task."""
    return on_the_whole_box(task, _dense_schedule, scheduled)


def on_the_whole_box(
    task: Task, make: Callable[[Task], GainSchedule], make_few: Callable[[Task], GainSchedule]
) -> GainSchedule:
    """What `make` designs for the task and for the plants of its box on which it is worst: those
    that a search finds of the designs of `make_few` at a few points, then of those of `make`, until
    there is none that is worse than the ones it counts."""
    if task.family.box is None:
        return make(task)
    few = task.part(_few(task.x), _few(task.y))
    schedule, _ = _until_none_is_worse(
        task.with_plants(worst_plants(few, make_few)), make, search_box
    )
    return schedule


def worst_plants(task: Task, make: Callable[[Task], GainSchedule]) -> tuple[Change, ...]:
    """What those plants of the task's box differ by on which designs of `make` are worst at its
    points; none without a box."""
    if task.family.box is None:
        return ()
    return _binding_plants(*_until_none_is_worse(task, make, search_design_points))


def _until_none_is_worse(task: Task, make, search) -> tuple[GainSchedule, Task]:
    for _ in range(_SEARCHES):
        schedule = make(task)
        found = search(schedule)
        new = tuple(change for change in found.worse if change not in task.family.changes)
        if not new:
            break
        task = task.with_plants(new).at(schedule.design_x, schedule.design_y)
    return schedule, task


def _binding_plants(schedule: GainSchedule, task: Task) -> tuple[Change, ...]:
    """What those plants of the task differ by on which `schedule` comes near a limit of Ms or Mt at
    a design point."""
    loops = Loop(
        task.plants, schedule.gains(task.x[:, None], task.y).broadcast_to(task.plants.shape)
    )
    found = analyse(loops)
    near = (found.Ms > schedule.specification.Ms - _NEAR) | (
        found.Mt > schedule.specification.Mt - _NEAR
    )
    return tuple(
        change for change, plant in zip(task.family.changes, near[1:], strict=True) if plant.any()
    )


def _few(nodes: np.ndarray) -> np.ndarray:
    """Indices of at most `_FEW` of the nodes of each side of 0, the outermost among them."""
    first = int(np.searchsorted(nodes, 0.0))
    sides = (np.arange(first), np.arange(first, nodes.size))
    spread = (
        side[np.linspace(0, side.size - 1, min(_FEW, side.size)).round().astype(int)]
        for side in sides
        if side.size
    )
    return np.concatenate(list(spread))


def _dense_schedule(task: Task) -> GainSchedule:
    """The schedule that keeps every limit at the points of `task`, and at those half-way between
    them that it needs."""
    schedule = scheduled(task)
    for _ in range(_DENSER):
        x, y = _needed_points(task, schedule)
        if x.size == task.x.size and y.size == task.y.size:
            break
        task = task.at(x, y)
        schedule = scheduled(task)
    return schedule


def scheduled(task: Task) -> GainSchedule:
    """The schedule that keeps every limit at the points of `task`."""
    alone = rough_gains(Problem.pointwise(task))
    best = alone[:, task.objective].reshape(task.notch_frequency.shape)
    rows, columns = choose_nodes(task.x, task.y, best)
    nodes, at_nodes = (
        (task.x[rows], task.y[columns]),
        np.ravel_multi_index(np.ix_(rows, columns), best.shape),
    )
    frequency = task.notch_frequency.ravel()[at_nodes]
    mix = mixing_matrix(*nodes, task.x, task.y)
    worth = 1.0 / best.ravel()
    problem = Problem(
        task, (mix @ frequency.ravel()).reshape(task.notch_frequency.shape), mix, worth
    )
    gains = exact_gains(problem, alone[at_nodes.ravel()])
    _require_crossover(task, problem.regulators(gains))
    return assemble_schedule(task, nodes, task.regulators(gains, frequency))


def _needed_points(task: Task, schedule: GainSchedule) -> tuple[np.ndarray, np.ndarray]:
    """(x, y): the design points, with those rows and columns half-way between them about which a
    limit is missed by too much.

    Along x, where the damping changes by factors within a cell, it is looked for at the quarters,
    too. Where it is missed at a design opening or position, the other coordinate is the one that
    lacks points.
    """
    x, y = task.family.between(schedule.design_x, schedule.design_y)
    quarters = with_midpoints(x)
    if not task.family.defined(quarters, y).all():
        return schedule.design_x, schedule.design_y
    plants = task.at(quarters, y).plants
    loops = Loop(plants, schedule.gains(quarters[:, None], y).broadcast_to(plants.shape))
    missed_there = np.any(broken(loops, between_points(schedule.specification, _DENSE)), axis=0)
    new_x, new_y = ~np.isin(x, schedule.design_x), ~np.isin(y, schedule.design_y)
    missed = missed_there[np.isin(quarters, x)]
    for row in np.flatnonzero(new_x):
        beside = (x[row - 1] < quarters) & (quarters < x[row + 1])
        missed[row] = missed_there[beside].any(axis=0)
    on_a_line = missed & ~(new_x[:, None] & new_y)
    missed = on_a_line if on_a_line.any() else missed
    return x[missed.any(axis=1) | ~new_x], y[missed.any(axis=0) | ~new_y]


def tune_fixed(
    plant: Plant,
    x: ArrayLike | None = None,
    y: ArrayLike | None = None,
    *,
    loop: LoopName = "velocity",
    structure: str = "pi",
    specification: Specification | None = None,
) -> GainSchedule:
    """One regulator that holds at all points x by y and on all plants of the specification: a
    schedule with one node.

    This is the robust constant regulator of the source paper's section 5; its notch stands at the
    middle of the nominal plant's natural frequencies. Arguments and errors as in `tune`.
    """
    return on_the_whole_box(
        task_of(plant, x, y, loop, structure, specification), _fixed_schedule, _fixed_schedule
    )


def _fixed_schedule(task: Task) -> GainSchedule:
    middle = np.sqrt(task.notch_frequency.min() * task.notch_frequency.max())
    mix = mixing_matrix(task.x[-1:], task.y[-1:], task.x, task.y)
    problem = Problem(
        task, np.full(task.notch_frequency.shape, middle), mix, np.ones(task.notch_frequency.size)
    )
    gains = exact_gains(problem, rough_gains(problem))
    _require_crossover(task, problem.regulators(gains))
    nodes = task.x[-1:], task.y[[len(task.y) // 2]]
    return assemble_schedule(task, nodes, task.regulators(gains, np.array([[middle]])))


def _require_crossover(task: Task, regulators: Regulators) -> None:
    """InfeasibleError where the crossover of `regulators` (nx, ny) is below `min_crossover`, with
    the limit nearest to binding."""
    least = task.specification.min_crossover
    if least is None:
        return
    limits, loops = (
        limits_of(task.specification),
        Loop(task.plants, regulators.broadcast_to(task.plants.shape)),
    )
    crossover = analyse(loops).crossover
    if crossover.min() >= least:
        return
    k, i, j = np.unravel_index(np.argmin(crossover), crossover.shape)
    intrusion = peaks(loops, [limit.intrusion for limit in limits.values()])[0][:, i, j]
    at, binding = np.unravel_index(np.argmax(intrusion), intrusion.shape)
    reached, asked = apart(crossover[k, i, j], least, digits=4)
    raise InfeasibleError(
        f"{task.place(k, i, j)}: the largest gains cross over at {reached} rad/s, below"
        f" min_crossover = {asked} rad/s; {phrase(list(limits)[binding], task.specification)} binds"
        f" ({task.place(at, i, j)}). Feasible is min_crossover = {0.999 * crossover[k, i, j]:.4g}"
        " rad/s; for more, relax that limit or shorten the delay."
    )


def assemble_schedule(task: Task, nodes, regulators: Regulators) -> GainSchedule:
    """The schedule of `regulators` at `nodes` (x, y). InputError where the set-point weight would
    make it oscillate."""
    b = task.specification.set_point_weight
    if task.quantity.integrations and b != 1.0 and np.ptp(regulators.kp, axis=0).any():
        raise InputError(
            f"set_point_weight = {b:g} with kp scheduled on x: the part (b - 1) kp r of the command"
            " changes with the command itself, through kp(x), and the loop oscillates (see"
            " check_coupling). Use set_point_weight = 1, points at a single opening x, or"
            " tune_fixed."
        )
    speeds = task.family.speed_gains()
    return GainSchedule(
        actuator=task.family.actuator,
        models=task.family if isinstance(task.family, ModelPlants) else None,
        specification=task.searched_specification,
        loop=task.loop,
        structure=task.structure,
        x=nodes[0],
        y=nodes[1],
        design_x=task.x,
        design_y=task.y,
        kp=regulators.kp,
        ki=regulators.ki,
        kd=regulators.kd,
        notch_frequency=regulators.notch_frequency,
        zz=regulators.zz,
        zp=regulators.zp,
        sections=regulators.sections,
        Tt=_anti_windup_time(regulators.kp, regulators.ki, task.specification.sample_time),
        feed_forward=task.family.knows_speed and not task.quantity.is_speed,
        pressure_drops=(
            task.family.pressure_drops(task.x) if task.specification.pressure_compensation else None
        ),
        speed_gain_extend=speeds.gain_extend,
        speed_gain_retract=speeds.gain_retract,
        speed_offset_extend=speeds.offset_extend,
        speed_offset_retract=speeds.offset_retract,
    )


def _anti_windup_time(kp, ki, sample_time: float) -> float:
    """Tt in s: a quarter of the regulator's own integral time (median over the nodes), at least ten
    samples.

    With the whole integral time the integral is still full when a large step comes near its end,
    and overshoots.
    """
    times = _WINDUP_SHARE * kp[ki > 0.0] / ki[ki > 0.0]
    return float(max(np.median(times) if times.size else 0.0, _LEAST_WINDUP_SAMPLES * sample_time))
