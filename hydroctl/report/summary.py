"""A design, and a machine, in words and numbers: for the terminal, and for programs. `design` is a
`hydroctl.design.Design`."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from ..loop.margins import MARGIN_UNITS
from ..machine.actuator import PARAMETERS
from ..model.characteristics import Characteristics
from ..validation import Standing

_SHOWN = {
    "Ms": "Ms {:.3f}",
    "Mt": "Mt {:.3f}",
    "gain_margin": "gain margin {:.2f}",
    "gain_reduction_margin": "gain reduction {:.3f}",
    "phase_margin": "phase margin {:.1f} deg",
    "delay_margin": "delay margin {:.2f} ms",
    "crossover": "crossover {:.1f} rad/s",
}
_SCALE = {"phase_margin": 180.0 / math.pi, "delay_margin": 1e3}


def summarize(design) -> str:
    """The printed summary of `design`."""
    parts = (_head, _verdicts, _worst_points, _comparison, _stages)
    return "\n\n".join("\n".join(part(design)) for part in parts)


def to_dict(design) -> dict:
    """Verdicts, worst margins, comparison and times of `design`, of plain types; infinite numbers
    become None."""
    margins = {
        name: dataclasses.asdict(design.schedule.margins.worst(name)) | {"unit": unit}
        for name, unit in MARGIN_UNITS.items()
    }
    return _plain(
        {
            "actuator": design.actuator.name,
            "loop": design.schedule.loop,
            "structure": design.schedule.structure,
            "passed": design.passed,
            "verdicts": [
                dataclasses.asdict(verdict)
                for verdict in (*design.margin_verdicts, *design.validation.verdicts)
            ],
            "worst_margins": margins,
            "remarks": list(design.remarks),
            "iae_over_fixed": {name: _standing(found) for name, found in design.comparison.items()},
            "seconds": design.seconds,
        }
    )


def _standing(found: Standing) -> dict:
    return {
        "nominal": found.nominal.mean,
        "worst": found.worst.mean,
        "worst_variant": found.worst_variant,
    }


def _head(design):
    schedule, reduced = design.schedule, design.reduced
    verdict = "every requirement is met" if design.passed else "A REQUIREMENT IS NOT MET"
    yield f"{design.actuator.name}: {schedule.loop} loop, {schedule.structure}, {verdict}"
    yield (
        f"sampled every {1e3 * schedule.Ts:g} ms, delay {schedule.delay_samples:g} samples; "
        f"{schedule.x.size} x {schedule.y.size} nodes over valve opening and position"
    )
    accepted = np.count_nonzero(reduced.accepted)
    yield (
        f"second order holds within {100 * reduced.tolerance:g} % at {accepted} of"
        f" {reduced.accepted.size} operating points (the regulators are tuned on third order)"
    )
    if reasons := [reason for reason in design.points.reason.ravel() if reason]:
        yield f"{len(reasons)} operating points are left out: {reasons[0]}"
    yield from design.remarks


def _verdicts(design):
    yield (
        f"Margins over {len(design.schedule.margins.variants)} plants"
        f" ({'; '.join(design.schedule.margins.variants)})"
    )
    yield from (f"  {verdict}" for verdict in design.margin_verdicts)
    yield design.validation.summary()


def _worst_points(design):
    yield "Worst margins at and between the design points (all of them: margins.csv)"
    for name, form in _SHOWN.items():
        worst = design.schedule.margins.worst(name)
        if name == "gain_reduction_margin" and worst.value == 0.0:
            continue
        yield (
            f"  {form.format(worst.value * _SCALE.get(name, 1.0)):24s} at x={worst.x:g},"
            f" y={worst.y:g} m, {worst.variant}"
        )


def _comparison(design):
    schedule, fixed = design.schedule, design.fixed
    gain = "ki" if schedule.ki.any() else "kp"
    scheduled, constant = getattr(schedule, gain), getattr(fixed, gain).item()
    yield "Integral of |error| over that of one fixed regulator of the same structure and limits"
    yield "(geometric mean over steps, ramps, sines and load steps)"
    for name, found in design.comparison.items():
        yield (
            f"  {name:17s} x {found.nominal.mean:.3f} nominal, x {found.worst.mean:.3f} at worst"
            f" ({found.worst_variant})"
        )
    outcome = "meets" if design.fixed_validation.passed else "does not meet"
    yield (
        f"  {gain} {scheduled.min():.4g} ... {scheduled.max():.4g} scheduled, {constant:.4g} fixed"
    )
    yield f"  the fixed regulator {outcome} the requirements on the nonlinear plant"


def _stages(design):
    yield "Time: " + ", ".join(
        f"{name} {seconds:.2f} s" for name, seconds in design.seconds.items()
    )


def describe(machine: Characteristics) -> str:
    """Parameters, derived quantities and source of a machine, in the units of a data sheet."""
    actuator = machine.actuator
    width = max(map(len, PARAMETERS))
    stated = {
        name: (
            "  not stated"
            if value is None
            else f"{value:>12.6g} {PARAMETERS[name].metadata['unit']}".rstrip()
        )
        for name, value in actuator.parameters().items()
    }
    parameters = [f"  {name:{width}s} {text}" for name, text in stated.items()]
    derived = [
        f"  area ratio b/a             {machine.area_ratio:.4g}",
        (
            f"  natural frequency          {_hertz(machine.natural_frequency.min())} ..."
            f" {_hertz(machine.natural_frequency.max())} Hz"
        ),
        (
            f"  its minimum                {_hertz(machine.lowest_frequency)} Hz at y ="
            f" {machine.lowest_position:.4g} m"
        ),
        (
            f"  stall force                {machine.stall_force_extending / 1e3:.4g} kN,"
            f" {machine.stall_force_retracting / 1e3:.4g} kN"
        ),
        (
            f"  speed at full opening      {machine.speed_extending:.4g} m/s,"
            f" {machine.speed_retracting:.4g} m/s"
        ),
        (
            f"  pressure jump at reversal  {machine.pressure_jump_a / 1e5:.4g} bar (a),"
            f" {machine.pressure_jump_b / 1e5:.4g} bar (b)"
        ),
    ]
    texts = [
        f"{title}: {text}"
        for title, text in (("source", actuator.source), ("note", actuator.note))
        if text
    ]
    return "\n".join(
        [actuator.name, *parameters, "derived (extending, retracting)", *derived, *texts]
    )


def machine_to_dict(machine: Characteristics) -> dict:
    """The same for programs, in SI."""
    actuator = machine.actuator
    texts = {"name": actuator.name, "source": actuator.source, "note": actuator.note}
    derived = {
        f.name: getattr(machine, f.name)
        for f in dataclasses.fields(machine)
        if f.name != "actuator"
    }
    return _plain(texts | {"parameters": actuator.parameters(), "derived": derived})


def _hertz(omega: float) -> str:
    return f"{omega / (2.0 * math.pi):.4g}"


def _plain(value):
    if isinstance(value, dict):
        return {key: _plain(item) for key, item in value.items()}
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, (list, tuple)):
        return [_plain(item) for item in value]
    if isinstance(value, float) and not math.isfinite(value):
        return None
    return value
