"""`tune`: regulator gains at every node, found on all plants of the specification at once."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from ..actuator import Actuator
from ..errors import InfeasibleError, InputError
from ..frequency import SampledFamily, frequency_grid
from ..margins import Loop, peaks
from ..operating_point import find_operating_points
from ..regulators import GAINS, STRUCTURES, Regulators, require_structure
from ..schedule import GainSchedule, sampled_plants
from ..specification import Specification
from .convex import circles, largest_gains, small_gains

_SMALLEST_FLOW = 0.02
_Y_NODES = 9
_REFINEMENTS = 4
_TOLERANCE = 1e-4
_LEAST_WINDUP_SAMPLES = 10


def default_nodes(actuator: Actuator) -> tuple[np.ndarray, np.ndarray]:
    """(x, y): two openings a side, from the smallest at which a linear model is used, and nine positions along the stroke.

    The smallest opening lets 2 % of the full flow pass; a dead band adds to it.
    """
    smallest = actuator.dead_band + _SMALLEST_FLOW * (1.0 - actuator.dead_band)
    x = np.array([-1.0, -smallest, smallest, 1.0])
    return x, np.linspace(0.0, actuator.stroke, _Y_NODES)


def tune(
    actuator: Actuator, x, y, *, loop: str = "velocity", structure: str = "pi", specification: Specification | None = None
) -> GainSchedule:
    """The gain schedule with nodes x (nx,) and y (ny,) in m whose every regulator has the largest integral gain (for "p" the
    largest kp) that keeps Ms and Mt on all plants of the specification.

    x must not hold 0 (see `GainSchedule`). Raises InputError for nodes that no linear model can describe, InfeasibleError
    where no gain meets the limits.
    """
    specification = Specification() if specification is None else specification
    x, y, plants = _design_plants(actuator, x, y, loop, structure, specification)
    regulators = _synthesize(plants, plants.resonance[0, ..., 0], structure, loop, specification, lambda i, j: (x[i], y[j]))
    return _schedule(actuator, specification, loop, structure, (x, y), (x, y), regulators)


def tune_fixed(
    actuator: Actuator, x, y, *, loop: str = "velocity", structure: str = "pi", specification: Specification | None = None
) -> GainSchedule:
    """One regulator that holds at all points x by y and on all plants of the specification: a schedule with one node.

    This is the robust constant regulator of the source paper's section 5; its notch stands at the middle of the nominal
    plant's natural frequencies. Arguments and errors as in `tune`.
    """
    specification = Specification() if specification is None else specification
    x, y, plants = _design_plants(actuator, x, y, loop, structure, specification)
    natural = plants.resonance[0, ..., 0]
    middle = np.array([[np.sqrt(natural.min() * natural.max())]])
    every = plants.reshape(-1, 1, 1)
    regulators = _synthesize(every, middle, structure, loop, specification, lambda i, j: (x[-1], y[len(y) // 2]))
    return _schedule(actuator, specification, loop, structure, (x[-1:], y[len(y) // 2][None]), (x, y), regulators)


def _design_plants(actuator: Actuator, x, y, loop: str, structure: str, specification: Specification):
    require_structure(structure)
    x, y = _nodes("x", x), _nodes("y", y)
    if (x == 0.0).any():
        raise InputError("x = 0 cannot be a node, because the plant has no derivative there; use a small opening of either sign.")
    return x, y, sampled_plants(actuator, x, y, loop, specification)[1]


def _schedule(actuator, specification, loop: str, structure: str, nodes, points, regulators: Regulators) -> GainSchedule:
    return GainSchedule(
        actuator=actuator,
        specification=specification,
        loop=loop,
        structure=structure,
        x=nodes[0],
        y=nodes[1],
        design_x=points[0],
        design_y=points[1],
        kp=regulators.kp,
        ki=regulators.ki,
        kd=regulators.kd,
        notch_frequency=regulators.notch_frequency,
        zz=regulators.zz,
        zp=regulators.zp,
        Tt=_anti_windup_time(regulators.kp, regulators.ki, specification.sample_time),
        feed_forward=loop == "position",
        **_speed_gains(actuator),
    )


def _nodes(name: str, values) -> np.ndarray:
    nodes = np.atleast_1d(np.asarray(values, dtype=float))
    if nodes.ndim != 1 or not np.isfinite(nodes).all() or (np.diff(nodes) <= 0.0).any():
        raise InputError(f"{name} nodes = {values!r} must be one ascending row of finite numbers.")
    return nodes


def _synthesize(
    plants: SampledFamily, notch_frequency, structure: str, loop: str, specification: Specification, place
) -> Regulators:
    """Regulators (nx, ny) that hold on all `plants` (variants, nx, ny), with notches at `notch_frequency` (nx, ny).

    The tuner sees a grid of frequencies. The refined peaks of |S| and |T| of its result join that grid until none is above its
    limit. `place` gives (x, y) of a node's indices, for the message where nothing is feasible.
    """
    zz, zp = specification.notch_damping if "notch" in structure else (1.0, 1.0)
    empty = np.zeros(notch_frequency.shape)
    notch = Regulators(specification.sample_time, empty, empty, empty, notch_frequency, specification.Tf, zz, zp)
    used = [GAINS.index(name) for name in STRUCTURES[structure]]
    objective = min(1, len(used) - 1)
    limits = circles(specification.Ms, specification.Mt)
    phi = _terms(plants, notch, frequency_grid(plants))[..., used]
    gains = small_gains(phi, limits, first=objective if loop == "velocity" else 0)
    if np.isnan(gains).any():
        x, y = place(*np.unravel_index(np.argmax(np.isnan(gains).any(axis=1)), notch.shape))
        raise InfeasibleError(
            f"x={x:g}, y={y:g} m: no gain, however small, keeps Ms <= {specification.Ms:g} and Mt <= {specification.Mt:g}. "
            "Raise a limit or shorten the delay."
        )
    for _ in range(_REFINEMENTS):
        gains = largest_gains(phi, gains, objective, limits)
        table = np.zeros((len(GAINS), *notch.shape))
        table[used] = gains.T.reshape(-1, *notch.shape)
        regulators = replace(notch, **dict(zip(GAINS, table, strict=True)))
        (Ms, at_Ms), (Mt, at_Mt) = peaks(Loop(plants, regulators.broadcast_to(plants.shape)))
        if Ms.max() <= specification.Ms * (1.0 + _TOLERANCE) and Mt.max() <= specification.Mt * (1.0 + _TOLERANCE):
            break
        phi = np.concatenate([phi, _terms(plants, notch, np.stack([at_Ms, at_Mt], axis=-1))[..., used]], axis=1)
    return regulators


def _terms(plants: SampledFamily, notch: Regulators, omega) -> np.ndarray:
    """(nodes, variants * n, 3): what each gain contributes to the loop gain at omega (variants, nx, ny, n)."""
    terms = notch.terms(omega) * plants.frequency_response(omega)[..., None]
    variants, nx, ny, n, gains = terms.shape
    return terms.transpose(1, 2, 0, 3, 4).reshape(nx * ny, variants * n, gains)


def _anti_windup_time(kp, ki, sample_time: float) -> float:
    """Tt in s: the regulator's own integral time (median over the nodes), at least ten samples."""
    times = kp[ki > 0.0] / ki[ki > 0.0]
    return float(max(np.median(times) if times.size else 0.0, _LEAST_WINDUP_SAMPLES * sample_time))


def _speed_gains(actuator: Actuator) -> dict[str, float]:
    """Feed-forward per direction: the straight line v = gain (x - offset) through the operating points at |x| = 0.1 and 1."""
    v = find_operating_points(actuator, [-1.0, -0.1, 0.1, 1.0], actuator.stroke / 2.0).v
    gain_extend, gain_retract = (v[3] - v[2]) / 0.9, (v[1] - v[0]) / 0.9
    return {
        "speed_gain_extend": float(gain_extend),
        "speed_gain_retract": float(gain_retract),
        "speed_offset_extend": float(0.1 - v[2] / gain_extend),
        "speed_offset_retract": float(-0.1 - v[1] / gain_retract),
    }
