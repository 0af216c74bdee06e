"""The tables from which the page's explorer computes a loop at any opening of its grid and any
position.

Every linear model is A = diag(Ec/V_a(y), Ec/V_b(y), 1) M(x), and its B alike: the operating point
does not depend on y, and the volumes only multiply the pressure equations. A table over x of M,
with the volumes beside it, is therefore exact at every y.
"""

from __future__ import annotations

import base64
from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from ..machine.actuator import Actuator
from ..machine.variants import variants
from ..model import chambers, plant
from ..model.linearization import linearize
from ..model.operating_point import find_operating_points
from ..regulator.printing.javascript import javascript_of
from ..regulator.vectors import law_of
from ..schedule.schedule import GainSchedule

_LEAST_OPENING, _OPENINGS = 0.02, 99
_PRESSURE_SCALE = 1e6
_PLANT_FIELDS = ("bulk_modulus", "area_a", "area_b", "volume_a", "volume_b")


def explorer_data(schedules: Mapping[str, GainSchedule]) -> dict:
    """What the explorer reads, of plain types, from schedules by name that share machine, loop and
    sampling; the first leads."""
    leading = next(iter(schedules.values()))
    actuator, specification = leading.machine, leading.specification
    openings = opening_grid(actuator)
    return {
        "loop": leading.loop,
        "Ts": leading.Ts,
        "delay_samples": leading.delay_samples,
        "stroke": actuator.stroke,
        "openings": openings.tolist(),
        "units": dict(leading.quantity.gain_units),
        "limits": {"Ms": specification.Ms, "Mt": specification.Mt},
        "plants": [
            {"label": label} | _plant_table(machine, openings)
            for label, machine in variants(
                actuator, specification.uncertainty, specification.added_plants
            ).items()
        ],
        "regulators": [{"label": label, "law": k} for k, label in enumerate(schedules)],
    }


def laws_script(schedules: Mapping[str, GainSchedule]) -> str:
    """JavaScript: LAWS, the law of each schedule without what is not linear or does not act in the
    loop: the compensation of the pressures, the inverse of the dead band, the feed-forward."""
    linear = (
        replace(s.regulator, compensation=None, inverse_depth=0.0, feed_forward=False)
        for s in schedules.values()
    )
    laws = (f"() => {{\n{javascript_of(law_of(regulator))}\n}}" for regulator in linear)
    return f"const LAWS = [{', '.join(laws)}].map((law) => law());"


def opening_grid(actuator: Actuator) -> np.ndarray:
    """(2 n,) openings of both signs, evenly from a fiftieth of what lies beyond the dead band to
    1."""
    beyond = np.linspace(_LEAST_OPENING, 1.0, _OPENINGS)
    right = actuator.dead_band + beyond * (1.0 - actuator.dead_band)
    return np.concatenate([-right[::-1], right])


def encoded(values: np.ndarray) -> str:
    """The raveled values as little-endian bytes of their own precision, in base64."""
    values = np.ascontiguousarray(values)
    return base64.b64encode(values.astype(values.dtype.newbyteorder("<")).tobytes()).decode("ascii")


def _plant_table(machine: Actuator, openings: np.ndarray) -> dict:
    """M by rows, the two entries of B's, p_a, p_b in Pa and v in m/s for each opening; pressures in
    M are MPa."""
    points = find_operating_points(machine, openings, machine.stroke / 2.0)
    family = linearize(machine, points)
    stiff = np.array(
        [*chambers.stiffnesses(machine.stroke / 2.0, plant.parameters(machine).chambers), 1.0]
    )
    scale = np.array([_PRESSURE_SCALE, _PRESSURE_SCALE, 1.0])
    M = family.A * scale / (scale * stiff)[:, None]
    entry = (family.B[..., 0] / (scale * stiff))[..., :2]
    rows = np.concatenate(
        [M.reshape(-1, 9), entry, np.stack([points.p_a, points.p_b, points.v], axis=-1)], axis=-1
    )
    reasons = {
        str(i): reason.partition(": ")[2] for i, reason in enumerate(points.reason) if reason
    }
    valve = None
    if machine.valve_natural_frequency is not None:
        valve = {
            "natural_frequency": machine.valve_natural_frequency,
            "damping": machine.valve_damping,
        }
    return {name: getattr(machine, name) for name in _PLANT_FIELDS} | {
        "valve": valve,
        "rows": encoded(rows),
        "reasons": reasons,
    }
