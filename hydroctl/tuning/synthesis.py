"""`tune`: regulator gains at every node, found on all plants of the specification at once."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..actuator import Actuator
from ..errors import InfeasibleError, InputError
from ..frequency import SampledFamily, frequency_grid
from ..margins import Loop, analyse, peaks
from ..operating_point import find_operating_points
from ..regulators import GAINS, STRUCTURES, Regulators, require_structure, section_count
from ..schedule import GainSchedule, design_pressure_drops, sampled_plants
from ..specification import Specification
from .convex import Bounds, half_of_largest, largest_gains, retreat, small_gains, tightest
from .limits import limits_of
from .nodes import candidates, choose_nodes, mixing_matrix

_SMALLEST_FLOW = 0.02
_OPENINGS = np.array([_SMALLEST_FLOW, 0.06, 0.15, 0.4, 1.0])
_POSITIONS = (9, 25)
_RATIO_STEP = 0.2
_FINE = 2001
_REFINEMENTS = 6
_VANISHING = 1e-9
_LEAST_WINDUP_SAMPLES = 10
_GRID_POINTS_FOR_PHASE_MARGIN = 480
"""the corners of the set of a phase margin would slip between coarser frequencies"""


def default_points(actuator: Actuator) -> tuple[np.ndarray, np.ndarray]:
    """(x, y) design points: five openings a side, from the smallest at which a linear model is used, and 9 to 25 positions.

    The smallest opening lets 2 % of the full flow pass; a dead band adds to it. From one position to the next the ratio of the
    chamber volumes changes by the same factor, because the stiffness of the oil follows it.
    """
    openings = actuator.dead_band + _OPENINGS * (1.0 - actuator.dead_band)
    y = np.linspace(0.0, actuator.stroke, _FINE)
    ratio = np.log((actuator.volume_a + actuator.area_a * y) / (actuator.volume_b - actuator.area_b * y))
    count = int(np.clip(np.ceil((ratio[-1] - ratio[0]) / _RATIO_STEP) + 1, *_POSITIONS))
    return np.concatenate([-openings[::-1], openings]), np.interp(np.linspace(ratio[0], ratio[-1], count), ratio, y)


def tune(
    actuator: Actuator, x, y, *, loop: str = "velocity", structure: str = "pi", specification: Specification | None = None
) -> GainSchedule:
    """The gain schedule that keeps every limit at all points x (nx,) by y (ny,) in m, on all plants of the specification.

    Each point on its own would allow a largest integral gain (for "p" a largest kp). The nodes are the fewest of the points (of
    every second one, where there are many) between which these gains interpolate to 1 %; the gains at the nodes are then found
    together, so that the interpolated ones keep the limits at every point.

    x must not hold 0 (see `GainSchedule`). Raises InputError for points that no linear model can describe, InfeasibleError
    where no gain meets the limits, or their largest crossover is below `min_crossover`.
    """
    task = task_of(actuator, x, y, loop, structure, specification)
    rows, columns = candidates(task.x, task.y)
    coarse = task.part(rows, columns)
    every = mixing_matrix(coarse.x, coarse.y, coarse.x, coarse.y)
    small = _small_gains(coarse, coarse.natural)
    alone = _synthesize(coarse, coarse.natural, every, small, rounds=1)
    best = alone[:, task.objective].reshape(coarse.natural.shape)
    rows, columns = choose_nodes(coarse.x, coarse.y, best)
    nodes, natural = (coarse.x[rows], coarse.y[columns]), coarse.natural[np.ix_(rows, columns)]
    if natural.size == task.natural.size:
        gains = _synthesize(task, natural, every, small, gains=alone)
        _require_crossover(task, task.regulators(gains, natural))
        return assemble_schedule(task, nodes, task.regulators(gains, natural))
    mix = mixing_matrix(*nodes, task.x, task.y)
    notch_frequency = (mix @ natural.ravel()).reshape(task.natural.shape)
    small = _small_gains(task, notch_frequency)
    safe = np.array([small[column.nonzero()[0]].min(axis=0) for column in mix.toarray().T])
    worth = 1.0 / (mixing_matrix(coarse.x, coarse.y, task.x, task.y) @ best.ravel())
    gains = _synthesize(task, notch_frequency, mix, safe, worth)
    _require_crossover(task, task.regulators(mix @ gains, notch_frequency))
    return assemble_schedule(task, nodes, task.regulators(gains, natural))


def tune_fixed(
    actuator: Actuator, x, y, *, loop: str = "velocity", structure: str = "pi", specification: Specification | None = None
) -> GainSchedule:
    """One regulator that holds at all points x by y and on all plants of the specification: a schedule with one node.

    This is the robust constant regulator of the source paper's section 5; its notch stands at the middle of the nominal
    plant's natural frequencies. Arguments and errors as in `tune`.
    """
    task = task_of(actuator, x, y, loop, structure, specification)
    middle = np.sqrt(task.natural.min() * task.natural.max())
    notch_frequency = np.full(task.natural.shape, middle)
    safe = _small_gains(task, notch_frequency).min(axis=0, keepdims=True)
    mix = mixing_matrix(task.x[-1:], task.y[-1:], task.x, task.y)
    gains = _synthesize(task, notch_frequency, mix, safe)
    _require_crossover(task, task.regulators(mix @ gains, notch_frequency))
    nodes = task.x[-1:], task.y[[len(task.y) // 2]]
    return assemble_schedule(task, nodes, task.regulators(gains, np.array([[middle]])))


@dataclass(frozen=True, eq=False)
class Task:
    """What is to be tuned: the sampled plants (variants, nx, ny) at the points x by y, and for what."""

    actuator: Actuator
    specification: Specification
    loop: str
    structure: str
    x: np.ndarray
    y: np.ndarray
    labels: tuple[str, ...]
    plants: SampledFamily

    def part(self, rows, columns) -> Task:
        """The same task at some of the points."""
        flat = np.ravel_multi_index(np.ix_(range(self.plants.shape[0]), rows, columns), self.plants.shape)
        plants = self.plants.take(flat.ravel()).reshape(*flat.shape)
        return replace(self, x=self.x[rows], y=self.y[columns], plants=plants)

    def place(self, k: int, i: int, j: int) -> str:
        """The words for plant k at point (i, j)."""
        return f"x={self.x[i]:g}, y={self.y[j]:g} m, {self.labels[k]} plant"

    @property
    def natural(self) -> np.ndarray:
        """(nx, ny) natural frequencies of the nominal plant, rad/s."""
        return self.plants.resonance[0, ..., 0]

    @property
    def used(self) -> list[int]:
        """Which of kp, ki, kd the structure uses."""
        return [GAINS.index(name) for name in STRUCTURES[self.structure]]

    @property
    def objective(self) -> int:
        """The gain to maximize, among those used: ki, or kp where there is no ki."""
        return min(1, len(self.used) - 1)

    @property
    def first(self) -> int:
        """The gain that the tuner starts from, among those used: in a velocity loop the objective, in a position loop kp."""
        return self.objective if self.loop == "velocity" else 0

    def frequencies(self) -> np.ndarray:
        """(variants, nx, ny, n) rad/s at which the tuner begins."""
        if self.specification.phase_margin is None:
            return frequency_grid(self.plants)
        return frequency_grid(self.plants, points=_GRID_POINTS_FOR_PHASE_MARGIN)

    def regulators(self, gains: np.ndarray, notch_frequency: np.ndarray) -> Regulators:
        """Regulators of the shape of `notch_frequency` with gains (N, t)."""
        table = np.zeros((len(GAINS), *notch_frequency.shape))
        table[self.used] = gains.T.reshape(-1, *notch_frequency.shape)
        zz, zp = self.specification.notch_damping if "notch" in self.structure else (1.0, 1.0)
        sections = self.specification.lead_lag[: section_count(self.structure)]
        Ts, Tf, Tm = self.specification.sample_time, self.specification.Tf, self.specification.measurement_filter
        return Regulators(Ts, *table, notch_frequency, Tf, zz, zp, sections, Tm)

    def terms(self, notch_frequency: np.ndarray, omega: np.ndarray) -> np.ndarray:
        """(points, variants * n, t): what each gain contributes to the loop gain at omega (variants, nx, ny, n)."""
        notch = self._notch(notch_frequency)
        terms = (notch.terms(omega) * self.plants.frequency_response(omega)[..., None])[..., self.used]
        variants, nx, ny, n, gains = terms.shape
        return terms.transpose(1, 2, 0, 3, 4).reshape(nx * ny, variants * n, gains)

    def bounds(self, notch_frequency: np.ndarray) -> Bounds:
        """|C| at the Nyquist frequency, where every term is real, as two bounds on the gains of each point; none if unlimited."""
        limit = self.specification.high_frequency_gain
        terms = self._notch(notch_frequency).terms([np.pi / self.specification.sample_time])[..., 0, self.used].real
        terms = terms.reshape(-1, 1, len(self.used))
        rows = terms[:, :0] if limit is None else np.concatenate([terms, -terms], axis=1)
        return Bounds(rows, np.full(rows.shape[:2], limit, dtype=float))

    def _notch(self, notch_frequency: np.ndarray) -> Regulators:
        return self.regulators(np.zeros((notch_frequency.size, len(self.used))), notch_frequency)


def task_of(actuator: Actuator, x, y, loop: str, structure: str, specification: Specification | None) -> Task:
    """The task with its arguments checked: errors as in `tune`."""
    specification = Specification() if specification is None else specification
    require_structure(structure)
    x, y = _points("x", x), _points("y", y)
    if (x == 0.0).any():
        raise InputError("x = 0 cannot be a node, because the plant has no derivative there; use a small opening of either sign.")
    labels, plants = sampled_plants(actuator, x, y, loop, specification)
    return Task(actuator, specification, loop, structure, x, y, tuple(labels), plants)


def _points(name: str, values) -> np.ndarray:
    points = np.atleast_1d(np.asarray(values, dtype=float))
    if points.ndim != 1 or not np.isfinite(points).all() or (np.diff(points) <= 0.0).any():
        raise InputError(f"{name} nodes = {values!r} must be one ascending row of finite numbers.")
    return points


def _small_gains(task: Task, notch_frequency: np.ndarray) -> np.ndarray:
    """(points, t): small gains from which the tuner may start. InfeasibleError names the first point without any."""
    limits = limits_of(task.specification)
    phi = task.terms(notch_frequency, task.frequencies())
    gains = small_gains(phi, list(limits.values()), task.bounds(notch_frequency), first=task.first)
    if np.isnan(gains).any():
        raise InfeasibleError(_no_start(task, phi, gains))
    return gains


def _synthesize(
    task: Task, notch_frequency, mix, safe: np.ndarray, worth=None, *, gains: np.ndarray | None = None, rounds: int = _REFINEMENTS
) -> np.ndarray:
    """Gains (N, t) at the nodes of `mix` (points, N) that hold at all points; `worth` (points,) weighs them.

    `safe` (N, t) are small gains that hold, `gains` (N, t) better ones to start from. The tuner sees a grid of frequencies. Those
    at which its result comes nearest to each limit's set, or lies deepest inside it, join that grid until it stays out, or `rounds`
    have passed.
    """
    limits = list(limits_of(task.specification).values())
    bounds = task.bounds(notch_frequency)
    phi = task.terms(notch_frequency, task.frequencies())
    worth = np.ones(len(phi)) if worth is None else worth
    if gains is None:
        gains = _start(task, phi, mix, safe, worth, limits, bounds)
    for _ in range(rounds):
        gains = retreat(phi, mix, gains, safe, limits)
        gains = largest_gains(phi, mix, gains, task.objective, worth, limits, bounds)
        regulators = task.regulators(mix @ gains, notch_frequency).broadcast_to(task.plants.shape)
        intrusion, omega = peaks(Loop(task.plants, regulators), [limit.intrusion for limit in limits])
        if (intrusion <= [limit.tolerance for limit in limits]).all():
            break
        phi = tightest(phi, mix @ gains, limits)
        phi = np.concatenate([phi, task.terms(notch_frequency, omega)], axis=1)
    return gains


def _start(task: Task, phi, mix, safe, worth, limits, bounds: Bounds) -> np.ndarray:
    """`safe`; but with small gains the set of a phase margin holds ki of a position loop at 0, so that kp then comes first."""
    if task.specification.phase_margin is None or task.first == task.objective:
        return safe
    return half_of_largest(phi, mix, safe, task.first, worth, limits, bounds)


def _no_start(task: Task, phi, gains) -> str:
    """Which limit even a vanishing gain breaks by most, and on which plant, at the first point where `gains` are NaN."""
    limits = limits_of(task.specification)
    point = int(np.argmax(np.isnan(gains).any(axis=1)))
    L = _VANISHING * phi[point, :, task.first] / np.abs(phi[point, :, task.first]).max()
    intrusion = np.stack([limit.intrusion(L) for limit in limits.values()])
    broken, row = np.unravel_index(np.argmax(intrusion), intrusion.shape)
    place = task.place(row * len(task.labels) // L.size, *np.unravel_index(point, task.natural.shape))
    return f"{place}: no gain, however small, keeps {list(limits)[broken]}. Relax this limit or shorten the delay."


def _require_crossover(task: Task, regulators: Regulators) -> None:
    """InfeasibleError where the crossover of `regulators` (nx, ny) is below `min_crossover`, with the limit nearest to binding."""
    least = task.specification.min_crossover
    if least is None:
        return
    limits, loops = limits_of(task.specification), Loop(task.plants, regulators.broadcast_to(task.plants.shape))
    crossover = np.maximum(analyse(loops).crossover, 0.0)
    if crossover.min() >= least:
        return
    k, i, j = np.unravel_index(np.argmin(crossover), crossover.shape)
    intrusion = peaks(loops, [limit.intrusion for limit in limits.values()])[0][:, i, j]
    at, binding = np.unravel_index(np.argmax(intrusion), intrusion.shape)
    raise InfeasibleError(
        f"{task.place(k, i, j)}: the largest gains cross over at {crossover[k, i, j]:.4g} rad/s, below min_crossover = {least:g} "
        f"rad/s; {list(limits)[binding]} binds ({task.place(at, i, j)}). Feasible is min_crossover = "
        f"{0.999 * crossover[k, i, j]:.4g} rad/s; for more, relax that limit or shorten the delay."
    )


def assemble_schedule(task: Task, nodes, regulators: Regulators) -> GainSchedule:
    """The schedule of `regulators` at `nodes` (x, y)."""
    return GainSchedule(
        actuator=task.actuator,
        specification=task.specification,
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
        feed_forward=task.loop == "position",
        pressure_drops=design_pressure_drops(task.actuator, task.x) if task.specification.pressure_compensation else None,
        **_speed_gains(task.actuator),
    )


def _anti_windup_time(kp, ki, sample_time: float) -> float:
    """Tt in s: the regulator's own integral time (median over the nodes), at least ten samples."""
    times = kp[ki > 0.0] / ki[ki > 0.0]
    return float(max(np.median(times) if times.size else 0.0, _LEAST_WINDUP_SAMPLES * sample_time))


def _speed_gains(actuator: Actuator) -> dict[str, float]:
    """Feed-forward per direction: the straight line v = gain (x - offset) through the operating points at a tenth of the flow
    and at full flow."""
    low = actuator.dead_band + 0.1 * (1.0 - actuator.dead_band)
    x = np.array([-1.0, -low, low, 1.0])
    v = find_operating_points(actuator, x, actuator.stroke / 2.0).v
    gain_retract, gain_extend = (v[1] - v[0]) / (x[1] - x[0]), (v[3] - v[2]) / (x[3] - x[2])
    return {
        "speed_gain_extend": float(gain_extend),
        "speed_gain_retract": float(gain_retract),
        "speed_offset_extend": float(x[2] - v[2] / gain_extend),
        "speed_offset_retract": float(x[1] - v[1] / gain_retract),
    }
