"""What a user should know of a machine besides the verdicts: pressures above its rating, a weight
stated as a mere load, a resonance that is sampled too slowly."""

from __future__ import annotations

import math

import numpy as np

from ..machine.actuator import STANDARD_GRAVITY, Actuator
from ..machine.variants import ranges, variants
from ..model.characteristics import resonance
from ..model.linearization import linearize
from ..model.operating_point import find_operating_points
from ..specification import Specification

_NEAR = 0.1
"""as a fraction of the weight: a load this near to it is taken for it"""


def machine_remarks(actuator: Actuator, x, y, specification: Specification) -> tuple[str, ...]:
    """The remarks on `actuator` at the openings x (n,) by the positions y (m,) in m, and on the
    plants of the specification."""
    found = (
        _rating_remark(actuator, x, specification),
        _weight_remark(actuator, specification),
        _sampling_remark(actuator, x, y, specification),
    )
    return tuple(remark for remark in found if remark)


def _sampling_remark(actuator: Actuator, x, y, specification: Specification) -> str | None:
    """The stiffest resonance, where it lies above half the sample rate."""
    stiffest = []
    for label, plant in variants(
        actuator, specification.uncertainty, specification.added_plants
    ).items():
        points = find_operating_points(plant, np.asarray(x)[:, None], y)
        frequency = np.where(points.feasible, resonance(linearize(plant, points))[0], 0.0)
        i, j = np.unravel_index(np.argmax(frequency), frequency.shape)
        stiffest.append((float(frequency[i, j]), label, float(x[i]), float(y[j])))
    omega, label, opening, position = max(stiffest)
    if omega * specification.sample_time <= math.pi:
        return None
    return (
        f"omega_n Ts reaches {omega * specification.sample_time:.3g}, above pi (omega_n ="
        f" {omega:.4g} rad/s at x={opening:g}, y={position:g} m, {label} plant): the sampled loop"
        f" shows this resonance at its alias below {math.pi / specification.sample_time:.4g} rad/s,"
        f" where the margins count it. A scan time below {1e3 * math.pi / omega:.3g} ms avoids it."
    )


def _rating_remark(actuator: Actuator, x, specification: Specification) -> str | None:
    """The highest pressure of all operating points, where it passes the rating."""
    rating = actuator.pressure_rating
    if rating is None:
        return None
    above = []
    for label, plant in variants(
        actuator, specification.uncertainty, specification.added_plants
    ).items():
        points = find_operating_points(plant, x, actuator.stroke / 2.0)
        peaks, above_rating = (
            np.maximum(points.p_a, points.p_b),
            points.above_rating & points.feasible,
        )
        above += [
            (float(peak), label, float(opening))
            for peak, opening in zip(peaks[above_rating], points.x[above_rating], strict=True)
        ]
    if not above:
        return None
    peak, label, opening = max(above)
    return (
        f"a chamber reaches {peak / 1e5:.4g} bar at the operating points of x={opening:g} ({label}"
        f" plant), above pressure_rating = {rating / 1e5:.4g} bar: lower the load"
        " or the supply, widen the outlet edge, or take a stronger cylinder."
    )


def _weight_remark(actuator: Actuator, specification: Specification) -> str | None:
    """A load that is near to the weight of a mass which varies, while the machine stands level."""
    lowest, highest = ranges(actuator, specification.uncertainty).get("mass", (actuator.mass,) * 2)
    load, weight = actuator.load_force, actuator.mass * STANDARD_GRAVITY
    if lowest == highest or actuator.inclination != 0.0 or abs(abs(load) - weight) > _NEAR * weight:
        return None
    angle, rest = math.copysign(90.0, load), load - math.copysign(weight, load)
    return (
        f"load_force = {load:g} N is near the weight of mass = {actuator.mass:g} kg, {weight:.5g}"
        " N, but does not "
        "follow the mass, which varies; if it is the weight, state "
        f'inclination = "{angle:g} deg" and load_force = {rest:.4g} N.'
    )
