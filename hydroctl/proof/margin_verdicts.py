"""Verdicts on the linear loops of a schedule: margins at the design points and between them, on the
box, and hidden coupling."""

from __future__ import annotations

from collections.abc import Iterator
from functools import partial

import numpy as np

from ..loop.allowances import between_points
from ..loop.margins import MARGIN_UNITS, WORST_AT_MOST
from ..schedule.margins import WorstPoint
from ..schedule.schedule import GainSchedule, check_coupling
from ..schedule.verdict import Verdict
from ..tuning.box import search_box

_AT_NODES = 1.005
"""what the tuner's frequency grid may leave above a limit"""
_LINEAR_PROGRAM = 1.0 + 1e-6
"""what the tuner's linear programs may leave above a bound on the gains"""
_OnMargins = partial(Verdict, subject="margins")


def margin_verdicts(schedule: GainSchedule) -> tuple[Verdict, ...]:
    """Every limit of the specification at the design points and between them, on the box where
    there is one, and unstable loops, frozen and scheduled, over all variants."""
    verdicts = [*_peaks(schedule), *_minima(schedule), *_box(schedule)]
    if schedule.specification.high_frequency_gain is not None:
        verdicts.append(_nyquist_gain(schedule, schedule.specification.high_frequency_gain))
    verdicts.append(_frozen_loops(schedule))
    if schedule.plants.knows_speed:
        verdicts.append(_hidden_coupling(schedule))
    return tuple(verdicts)


def _peaks(schedule: GainSchedule) -> Iterator[Verdict]:
    """Ms and Mt."""
    margins, between = schedule.margins, between_points(schedule.specification)
    for name in ("Ms", "Mt"):
        limit = getattr(schedule.specification, name)
        for where, mask, allowed, allowance in (
            ("at the design points", margins.designed, limit * _AT_NODES, "0.5 % for the grid"),
            ("between them", ~margins.designed, getattr(between, name), "0.02 for interpolation"),
        ):
            if mask.any():
                worst = margins.worst(name, where=mask)
                yield _OnMargins(
                    f"{name} {where} (specified {limit:g})",
                    "",
                    f"the specification, and {allowance}",
                    allowed,
                    worst.value,
                    bool(worst.value <= allowed),
                    _place(worst),
                    worst.variant,
                )


def _minima(schedule: GainSchedule) -> Iterator[Verdict]:
    """Gain and phase margin, and crossover, where they are specified."""
    specification, margins = schedule.specification, schedule.margins
    between = between_points(specification)
    for name, field in (
        ("gain_margin", "gain_margin"),
        ("phase_margin", "phase_margin"),
        ("crossover", "min_crossover"),
    ):
        if (limit := getattr(specification, field)) is None:
            continue
        for where, mask, least, allowance in (
            ("at the design points", margins.designed, limit / _AT_NODES, ""),
            (
                "between them",
                ~margins.designed,
                getattr(between, field),
                ", less an allowance for interpolation",
            ),
        ):
            if mask.any():
                worst = margins.worst(name, where=mask)
                yield _OnMargins(
                    f"{_words(name)} {where}",
                    _unit(name),
                    f"the specification{allowance}",
                    least,
                    worst.value,
                    bool(worst.value >= least),
                    _place(worst),
                    worst.variant,
                    at_least=True,
                )


def _box(schedule: GainSchedule) -> Iterator[Verdict]:
    """Every limit on the plants of the box that a search found worst, at and between the design
    points."""
    if schedule.plants.box is None:
        return
    between = between_points(schedule.specification)
    for field, worst in search_box(schedule).worst.items():
        limit, at_least = getattr(between, field), worst.margin not in WORST_AT_MOST
        yield _OnMargins(
            f"{_words(worst.margin)} on the whole box (searched)",
            _unit(worst.margin),
            "the specification, with the allowance for interpolation",
            limit,
            worst.value,
            bool(worst.value >= limit if at_least else worst.value <= limit),
            _place(worst),
            worst.variant,
            at_least=at_least,
            method="searched",
        )


def _nyquist_gain(schedule: GainSchedule, limit: float) -> Verdict:
    """C at the Nyquist frequency is linear in the gains, which are interpolated between nodes: |C|
    is largest at a node."""
    gain = schedule.regulators.nyquist_gain
    i, j = np.unravel_index(np.argmax(gain), gain.shape)
    achieved, allowed = float(gain[i, j]), limit * _LINEAR_PROGRAM
    return _OnMargins(
        "gain at the Nyquist frequency",
        schedule.quantity.gain_units["kp"],
        "the specification, and 1e-6 for the tuner's linear programs",
        allowed,
        achieved,
        achieved <= allowed,
        f"x={schedule.x[i]:g}, y={schedule.y[j]:g} m",
        "all variants",
        method="proven",
    )


def _frozen_loops(schedule: GainSchedule) -> Verdict:
    margins = schedule.margins
    k, i, j = np.unravel_index(np.argmin(margins.margins.stable), margins.margins.stable.shape)
    place, variant, count = "all points", "all variants", margins.unstable
    if count:
        place, variant = f"x={margins.x[i]:g}, y={margins.y[j]:g} m", margins.variants[k]
    return _OnMargins(
        "unstable closed loops",
        "",
        "poles of the sampled loop",
        0.0,
        float(count),
        count == 0,
        place,
        variant,
    )


def _hidden_coupling(schedule: GainSchedule) -> Verdict:
    found = check_coupling(schedule)
    _, variant, x, y = found.worst
    return Verdict(
        "unstable loops through hidden coupling",
        "",
        "poles of the linearized law that runs, the slopes of its gains included",
        0.0,
        float(found.unstable),
        found.unstable == 0,
        f"x={x:g}, y={y:g} m",
        variant,
        subject="hidden coupling",
    )


def _place(worst: WorstPoint) -> str:
    return f"x={worst.x:g}, y={worst.y:g} m"


def _words(margin: str) -> str:
    return margin.replace("_", " ")


def _unit(margin: str) -> str:
    return MARGIN_UNITS[margin].removeprefix("1")
