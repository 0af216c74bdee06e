"""How fast the plant can move: the largest eigenvalue of its equations, which sets the step length
of fixed-step kernels and tells stiff machines.
"""

from __future__ import annotations

import math
from functools import lru_cache

import numpy as np

from ..machine.actuator import Actuator
from ..model import plant
from ..model.operating_point import find_operating_points, stall_force
from .trajectory import rest_pressures

_POSITIONS = 9
_CONTACT = 1e-5
_ALMOST = 0.99
_STIFF = 100.0
_RADIANS_PER_STEP = 1.0
"""`runge_kutta` errs by about a millionth of a mode's amplitude in such a step."""


@lru_cache(maxsize=256)
def fastest_mode(actuator: Actuator) -> float:
    """The largest |eigenvalue| in rad/s of d(rates)/d(p_a, p_b, v, y) over the stroke and in
    contact with its ends, at rest and at full speed both ways; or the valve's, where that is
    larger.
    """
    y = np.linspace(0.0, actuator.stroke, _POSITIONS)
    points = find_operating_points(actuator, np.array([[-1.0], [1.0]]), y)
    lowest, highest = (float(stall_force(actuator, side)) for side in (-1.0, 1.0))
    held = min(max(actuator.constant_load, _ALMOST * lowest), _ALMOST * highest)
    rest = rest_pressures(plant.parameters(actuator), held)
    contact = _CONTACT * actuator.stroke
    states = [(*rest, 0.0, position, 0.0) for position in (-contact, *y, actuator.stroke + contact)]
    columns = (points.p_a, points.p_b, points.v, points.y, points.x)
    states += list(zip(*(column[points.feasible] for column in columns), strict=True))
    matrices = _jacobians(actuator, np.array(states).T)
    return max(float(np.abs(np.linalg.eigvals(matrices)).max()), _valve_mode(actuator))


def longest_step(actuator: Actuator) -> float:
    """The longest step in s of the fixed-step integrator: 1 rad of the fastest mode."""
    return _RADIANS_PER_STEP / fastest_mode(actuator)


def substeps(actuator: Actuator, Ts: float) -> int:
    """Steps of the fixed-step integrator per sample."""
    return max(1, math.ceil(Ts / longest_step(actuator)))


def is_stiff(actuator: Actuator, step: float) -> bool:
    """Whether the fastest mode passes through more than 100 rad in `step` seconds, the spacing at
    which a motion is wanted.

    An explicit method needs some 30 steps there to stay stable, however smooth the motion is.
    """
    return fastest_mode(actuator) * step > _STIFF


def _valve_mode(actuator: Actuator) -> float:
    """The faster |root| of s^2 + 2 zeta w s + w^2 in rad/s; 0 for an ideal valve."""
    frequency, damping = actuator.valve_natural_frequency, actuator.valve_damping
    if frequency is None or damping is None:
        return 0.0
    return frequency * max(1.0, damping + math.sqrt(max(0.0, damping**2 - 1.0)))


def _jacobians(actuator: Actuator, states: np.ndarray) -> np.ndarray:
    """(n, 4, 4) by central differences, in states scaled to their ranges; `states` (5, n) holds
    p_a, p_b, v, y, x."""
    p = plant.parameters(actuator)
    pressure = actuator.supply_pressure
    scales = np.array(
        [
            pressure,
            pressure,
            actuator.flow_coefficient * math.sqrt(pressure) / actuator.area_a,
            actuator.stroke,
        ]
    )

    def slopes(p_a, p_b, v, y, x):
        return np.array([*plant.rates(p_a, p_b, v, y, x, actuator.constant_load, p), v])

    matrices = np.empty((states.shape[1], 4, 4))
    for k, scale in enumerate(scales):
        step = np.zeros((5, 1))
        step[k] = 1e-6 * scale
        difference = slopes(*(states + step)) - slopes(*(states - step))
        matrices[:, :, k] = (difference / scales[:, None] / 2e-6).T
    return matrices
