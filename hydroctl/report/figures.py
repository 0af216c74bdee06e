"""The numbers that the page's map and motions are drawn from."""

from __future__ import annotations

import math
from collections.abc import Mapping

import numpy as np

from ..model.characteristics import resonance
from ..model.linearization import linearize
from ..model.operating_point import find_operating_points
from ..regulator.structures import STRUCTURES
from ..regulator.units import GAIN_UNITS
from ..schedule.schedule import GainSchedule
from ..simulation import Scenario, Trajectory
from ..validation import ValidationReport
from .explorer import encoded

_MOST_SAMPLES = 400
"""of one motion, spread evenly"""
_DEGREES, _HERTZ, _BAR = 180.0 / math.pi, 0.5 / math.pi, 1e-5
_MARGINS = {
    "Ms": ("Ms, worst plant", "1", 1.0, "max"),
    "Mt": ("Mt, worst plant", "1", 1.0, "max"),
    "gain_margin": ("gain margin, worst plant", "1", 1.0, "min"),
    "phase_margin": ("phase margin, worst plant", "degrees", _DEGREES, "min"),
    "delay_margin": ("delay margin, worst plant", "ms", 1e3, "min"),
    "crossover": ("crossover, slowest plant", "Hz", _HERTZ, "min"),
}


def map_data(schedule: GainSchedule) -> dict:
    """Layers over the openings x and positions y of the schedule's margins: margins, gains, and the
    nominal machine itself."""
    found = schedule.margins
    layers = [
        _layer(
            label, unit, factor * getattr(np, worst)(getattr(found.margins, name), axis=0), worst
        )
        for name, (label, unit, factor, worst) in _MARGINS.items()
    ]
    gains = schedule.gains(found.x[:, None], found.y)
    layers += [
        _layer(name, GAIN_UNITS[schedule.loop][name], getattr(gains, name))
        for name in STRUCTURES[schedule.structure]
    ]
    if schedule.zz != schedule.zp or schedule.sections:
        layers.append(_layer("notch frequency", "Hz", _HERTZ * gains.notch_frequency))
    points = find_operating_points(schedule.actuator, found.x[:, None], found.y)
    natural, damping = resonance(linearize(schedule.actuator, points))
    machine = {
        ("natural frequency", "Hz"): _HERTZ * natural,
        ("damping ratio", "1"): damping,
        ("speed v", "m/s"): points.v,
        ("pressure a", "bar"): _BAR * points.p_a,
        ("pressure b", "bar"): _BAR * points.p_b,
    }
    layers += [_layer(label, unit, values) for (label, unit), values in machine.items()]
    return {"x": found.x.tolist(), "y": found.y.tolist(), "layers": layers}


def _layer(label: str, unit: str, values: np.ndarray, worst: str = "") -> dict:
    """`worst`: "max" or "min" where that is the bad end, else empty. Values in six digits; what is
    not finite is None."""
    rows = [
        [float(f"{value:.6g}") if np.isfinite(value) else None for value in row] for row in values
    ]
    return {"label": label, "unit": unit, "worst": worst, "values": rows}


def trace_data(reports: Mapping[str, ValidationReport]) -> list[dict]:
    """The motions of every scenario on the plant that comes first, of each report by name; a run
    that failed has its reason."""
    runs = {
        name: [run for run in report.runs if run.variant == report.runs[0].variant]
        for name, report in reports.items()
    }
    return [
        _scenario(
            row[0].scenario,
            {name: run.trajectory or run.reason for name, run in zip(runs, row, strict=True)},
        )
        for row in zip(*runs.values(), strict=True)
    ]


def _scenario(scenario: Scenario, motions: Mapping[str, Trajectory | str]) -> dict:
    stride = -(-scenario.reference.size // _MOST_SAMPLES)
    return {
        "name": scenario.name,
        "kind": scenario.kind,
        "loop": scenario.loop,
        "step": stride * scenario.Ts,
        "reference": encoded(scenario.reference[::stride].astype(np.float32)),
        "motions": [
            {"label": label}
            | ({"reason": motion} if isinstance(motion, str) else _signals(motion, stride))
            for label, motion in motions.items()
        ],
    }


def _signals(trajectory: Trajectory, stride: int) -> dict[str, str]:
    t = trajectory
    signals = {"y": t.y, "v": t.v, "x": t.x, "p_a": _BAR * t.p_a, "p_b": _BAR * t.p_b}
    return {name: encoded(values[::stride].astype(np.float32)) for name, values in signals.items()}
