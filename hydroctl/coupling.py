"""Hidden coupling: the stability of the scheduled loop, whose gains move with x[k-1] and y, and not only of its frozen loops.

Around a steady motion the command of the law varies by the frozen regulator's part and, for every gain g, by

    dg/dx dx[k-1] + dg/dy dy    times the derivative of the law by g

The latter is (b r - m) for kp, e for ki, the filtered derivative for kd, and for wn what notch and sections do to the held command
u_0. With an integral e is 0, so that ki has no part: it multiplies the error before the integral, which is stored in units of x.
With b = 1 kp has none either. There remain (b - 1) r dkp; without an integral u_0 dkp/kp; for a derivative on the measurement of a
moving cylinder -v_0 dkd; and the transients of notch and sections when wn moves under u_0. They are collected by linearizing the
law that runs, gain lookup included, by central differences, and are closed over the sampled plants with the position as a state,
which is exact for the plant: at an operating point its slopes do not depend on y. (Rugh, Shamma: Research on gain scheduling.)

u_0 is the whole opening, as if nothing were fed forward: the worst case. Slopes jump at the nodes, so that every cell of the table
is looked at in its middle and just inside its edges. The motion of a velocity loop leaves one pole at 1, the position itself, which
is not counted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np

from .errors import InputError
from .frequency import SampledFamily
from .operating_point import find_operating_points
from .schedule import GainSchedule, sampled_plants
from .simulation.law import AT_REST, Memory, notch_coefficients, regulate, section_coefficients
from .simulation.regulator import regulator_of

_INSIDE = 1e-3
"""of a cell: the distance from its edges"""
_STEP = 1e-6
"""of the command, or of a cell"""
_V = 2
"""place of the speed among the states of the plant"""


@dataclass(frozen=True, eq=False)
class CoupledLoops:
    """The scheduled loops at openings x (mx,) and positions y (my,) in m, over variants of the plant."""

    variants: tuple[str, ...]
    x: np.ndarray
    y: np.ndarray
    pole_size: np.ndarray
    """(variants, mx, my): largest |pole|, the slopes of the gains included; stable below 1"""

    @property
    def unstable(self) -> int:
        """How many loops are unstable."""
        return int(np.count_nonzero(~(self.pole_size < 1.0)))

    @property
    def worst(self) -> tuple[float, str, float, float]:
        """(largest |pole|, variant, x, y)"""
        k, i, j = np.unravel_index(np.argmax(self.pole_size), self.pole_size.shape)
        return float(self.pole_size[k, i, j]), self.variants[k], float(self.x[i]), float(self.y[j])


def check_coupling(schedule: GainSchedule) -> CoupledLoops:
    """The poles of the scheduled loops in every cell of the table, for every variant of the specification.

    Raises InputError for a schedule that the law cannot run, as `simulate_closed_loop` does.
    """
    x, y = _cell_points(schedule.x), _cell_points(schedule.y)
    labels, plants = sampled_plants(schedule.actuator, x, y, "position", schedule.specification)
    poles = coupled_poles(schedule, x, y, plants)
    if schedule.loop == "velocity":
        neutral = np.argmin(np.abs(poles - 1.0), axis=-1)[..., None]
        np.put_along_axis(poles, neutral, 0.0, axis=-1)
    return CoupledLoops(labels, x, y, np.abs(poles).max(axis=-1))


def coupled_poles(schedule: GainSchedule, x: np.ndarray, y: np.ndarray, plants: SampledFamily) -> np.ndarray:
    """(variants, mx, my, n) complex poles of the scheduled loops at x (mx,) by y (my,) m on `plants`, which read the position."""
    law, by_m, by_y, command = _linear_law(schedule, x, y)
    A, B, read_y = plants.state_space()
    read_v = np.eye(A.shape[-1])[[_V]]
    inputs = by_m @ (read_y if schedule.loop == "position" else read_v) + by_y @ read_y
    upper = np.concatenate([A + B @ inputs[..., [command], :], B @ law[..., [command], :]], axis=-1)
    lower = np.concatenate([inputs, law], axis=-1)
    return np.linalg.eigvals(np.concatenate([upper, np.broadcast_to(lower, (*A.shape[:-2], *lower.shape[-2:]))], axis=-2))


def _cell_points(nodes: np.ndarray) -> np.ndarray:
    """The middle of every cell and two points just inside its edges; a single node stands for itself."""
    cells = [(a, b) for a, b in pairwise(nodes) if a * b >= 0.0]
    inside = [a + share * (b - a) for a, b in cells for share in (_INSIDE, 0.5, 1.0 - _INSIDE)]
    alone = [node for node in nodes if not any(node in cell for cell in cells)]
    return np.sort([*inside, *(node * (1.0 - _INSIDE) for node in alone)])


def _linear_law(schedule: GainSchedule, x: np.ndarray, y: np.ndarray):
    """(by memory (mx, my, n, n), by m (mx, my, n, 1), by y (mx, my, n, 1), place of x in the memory): the law's new memory."""
    regulator = regulator_of(replace(schedule, specification=replace(schedule.specification, delay_samples=0.0)))
    regulator = regulator._replace(compensated=False, inverse_depth=0.0)
    grid = np.broadcast_arrays(x[:, None], y)
    memory, reference, m = _steady_state(schedule, regulator, *grid)
    used = _used_states(schedule)

    def law(changed: Memory, m, y):
        g = schedule.gains(changed.x, y)
        new = regulate(reference, 0.0, (0.0, 0.0, m, m), (g.kp, g.ki, g.kd, g.notch_frequency), changed, regulator)
        return np.stack(np.broadcast_arrays(*(getattr(new, name) for name in used)), axis=-1)

    frozen = schedule.gains(*grid)
    direct = frozen.kp + frozen.kd / (schedule.Tf + schedule.Ts)
    direct = np.where(direct > 0.0, direct, 1.0)
    steps = dict.fromkeys(used, np.full(m.shape, _STEP)) | dict.fromkeys(("last", "filtered"), _STEP / direct)
    steps["derivative"] = _STEP / np.where(frozen.kd > 0.0, frozen.kd, 1.0)
    columns = []
    for name in used:
        above, below = (memory._replace(**{name: getattr(memory, name) + sign * steps[name]}) for sign in (1.0, -1.0))
        columns.append((law(above, m, grid[1]) - law(below, m, grid[1])) / (2.0 * steps[name])[..., None])
    h_m, h_y = _STEP / direct, _STEP * max(float(np.diff(schedule.y).min(initial=1.0)), _STEP)
    by_m = (law(memory, m + h_m, grid[1]) - law(memory, m - h_m, grid[1])) / (2.0 * h_m)[..., None]
    by_y = (law(memory, m, grid[1] + h_y) - law(memory, m, grid[1] - h_y)) / (2.0 * h_y)
    return np.stack(columns, axis=-1), by_m[..., None], by_y[..., None], used.index("x")


def _used_states(schedule: GainSchedule) -> list[str]:
    """The fields of the memory that act: those of an absent integral, derivative, notch or section are 0."""
    absent = {"running"} | {f"section_{i + 1}" for i in range(len(schedule.sections), 2)}
    absent |= set() if np.any(schedule.ki) else {"integral"}
    absent |= set() if np.any(schedule.kd) else {"derivative", "last"}
    absent |= set() if schedule.zz != schedule.zp else {"notch_1", "notch_2"}
    return [name for name in Memory._fields if name not in absent]


def _steady_state(schedule: GainSchedule, regulator, x, y):
    """(memory, reference, measured quantity), arrays of the shape of x: the law holds the opening x while the cylinder moves."""
    points = find_operating_points(schedule.actuator, x, y)
    if not points.feasible.all():
        raise InputError(str(points.reason[~points.feasible][0]))
    g = schedule.gains(x, y)
    if np.any(schedule.ki):
        m = y if schedule.loop == "position" else points.v
        reference = m
    else:
        reference, m = np.zeros(x.shape), -x / g.kp
    speed = points.v if schedule.loop == "position" and schedule.c == 0.0 else np.zeros(x.shape)
    seen = schedule.c * reference - m
    held = x - g.kp * (schedule.b * reference - m) + g.kd * speed
    w = np.tan(0.5 * np.where(regulator.shaped, g.notch_frequency, 0.0) * schedule.Ts)
    _, _, b2, a2 = notch_coefficients(w, regulator.zz, regulator.zp)
    sections = [section_coefficients(w, section) for section in regulator.sections]
    (rest_1, rest_2) = ((b1 - a1) * x for _, b1, a1 in sections)
    rest = (b2 - a2) * x
    memory = AT_REST._replace(
        integral=held, derivative=-speed, last=seen + speed * schedule.Ts, notch_1=rest, notch_2=rest, x=x, filtered=m, running=1.0
    )
    return memory._replace(section_1=rest_1, section_2=rest_2), reference, m
