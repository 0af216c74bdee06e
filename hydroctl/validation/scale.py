"""`Scale`: a cylinder's own measures, by which scenarios and requirements are sized."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import InputError
from ..loop.quantity import controlled_quantity
from ..machine.actuator import Actuator
from ..model.linearization import linearize
from ..model.operating_point import find_operating_points


@dataclass(frozen=True)
class Scale:
    """Speeds, times and steps that a velocity or position loop of the cylinder can be asked for."""

    extend_speed: float
    """m/s at x = 1"""
    retract_speed: float
    """m/s at x = -1, positive"""
    time_constant: float
    """s: the longest over the stroke of 1/(2 zeta omega_n) and 2 zeta/omega_n of the hydraulic
    mode. Without a notch no loop reaches a crossover above 2 zeta omega_n."""
    settling: float
    """s: 40 (velocity) or 80 (position) of these time constants, in which a step must have
    settled"""
    step: float
    """m/s or m: the library's step within the valve's range, a third of the lower full speed or 2 %
    of the stroke"""

    def speed(self, direction: float) -> float:
        """Full speed, signed like `direction`, m/s."""
        return self.extend_speed if direction > 0.0 else -self.retract_speed


def scale_of(actuator: Actuator, loop: str) -> Scale:
    """The measures of `actuator`. Raises InputError where it cannot move both ways under its own
    load."""
    quantity = controlled_quantity(loop)
    points = find_operating_points(
        actuator, np.array([[-1.0], [1.0]]), np.linspace(0.0, actuator.stroke, 9)
    )
    if not points.feasible.all():
        raise InputError(points.reason[~points.feasible][0])
    poles = linearize(actuator, points).poles()[..., 1:]
    damping = -poles.sum(axis=-1).real
    square = np.prod(poles, axis=-1).real
    time_constant = float(np.maximum(1.0 / damping, damping / square).max())
    extend, retract = float(points.v[1, 0]), -float(points.v[0, 0])
    step = quantity.step(min(extend, retract), actuator.stroke)
    return Scale(extend, retract, time_constant, quantity.settling * time_constant, step)
