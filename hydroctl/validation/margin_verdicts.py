"""Verdicts on the margins of a schedule: at the design points, and between them."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from ..loop.allowances import between_points
from ..loop.margins import MARGIN_UNITS, WORST_AT_MOST
from ..machine.variants import box_of
from ..regulator.units import GAIN_UNITS
from ..schedule.margins import WorstPoint
from ..schedule.schedule import GainSchedule, check_coupling
from ..tuning.box import search_box
from . import Verdict, failures

_AT_NODES = 1.005
"""what the tuner's frequency grid may leave above a limit"""
_LINEAR_PROGRAM = 1.0 + 1e-6
"""what the tuner's linear programs may leave above a bound on the gains"""


def margin_verdicts(schedule: GainSchedule) -> tuple[Verdict, ...]:
    """Every limit of the specification at the design points and between them, and unstable loops,
    frozen and scheduled, over all variants."""
    specification, margins = schedule.specification, schedule.margins
    between = between_points(specification)
    verdicts = []
    for name in ("Ms", "Mt"):
        limit = getattr(specification, name)
        for where, mask, allowed, reason in (
            (
                "at the design points",
                margins.designed,
                limit * _AT_NODES,
                "the specification, and 0.5 % for the tuner's grid",
            ),
            (
                "between them",
                ~margins.designed,
                getattr(between, name),
                "the specification, and 0.02 for interpolated gains",
            ),
        ):
            if mask.any():
                verdicts.append(
                    _verdict(
                        f"{name} {where} (specified {limit:g})",
                        reason,
                        margins.worst(name, where=mask),
                        allowed,
                    )
                )
    verdicts += _minimum_verdicts(schedule)
    verdicts += _box_verdicts(schedule)
    if specification.high_frequency_gain is not None:
        verdicts.append(_high_frequency_verdict(schedule, specification.high_frequency_gain))
    k, i, j = np.unravel_index(np.argmin(margins.margins.stable), margins.margins.stable.shape)
    place = f"x={margins.x[i]:g}, y={margins.y[j]:g} m" if margins.unstable else "all points"
    variant = margins.variants[k] if margins.unstable else "all variants"
    count = float(margins.unstable)
    verdicts.append(
        Verdict(
            "unstable closed loops",
            "",
            "poles of the sampled loop",
            0.0,
            count,
            count == 0.0,
            place,
            variant,
        )
    )
    return (*verdicts, _coupling_verdict(schedule))


def with_failures(schedule: GainSchedule, verdicts: Iterable[Verdict]) -> GainSchedule:
    """`schedule` with those of the `verdicts` on it that failed as its `failed_checks`."""
    failed = failures(verdicts)
    return replace(schedule, failed_checks=failed) if failed else schedule


def _coupling_verdict(schedule: GainSchedule) -> Verdict:
    coupled = check_coupling(schedule)
    _, variant, x, y = coupled.worst
    count, name = float(coupled.unstable), "unstable loops with the slopes of the gains"
    place = f"x={x:g}, y={y:g} m"
    return Verdict(
        name, "", "poles of the linearized law that runs", 0.0, count, count == 0.0, place, variant
    )


def _box_verdicts(schedule: GainSchedule):
    """Every limit on the plants of the box that a search found worst, at and between the design
    points."""
    specification = schedule.specification
    if not box_of(schedule.actuator, specification.uncertainty):
        return
    between = between_points(specification)
    for field, worst in search_box(schedule).worst.items():
        limit, at_least = getattr(between, field), worst.margin not in WORST_AT_MOST
        passed = bool(worst.value >= limit if at_least else worst.value <= limit)
        title, unit = (
            f"{worst.margin.replace('_', ' ')} on the whole box (searched)",
            MARGIN_UNITS[worst.margin].removeprefix("1"),
        )
        reason, place = (
            "the specification, with the allowance for interpolation",
            f"x={worst.x:g}, y={worst.y:g} m",
        )
        yield Verdict(
            title, unit, reason, limit, worst.value, passed, place, worst.variant, at_least=at_least
        )


def _minimum_verdicts(schedule: GainSchedule):
    specification, margins = schedule.specification, schedule.margins
    between = between_points(specification)
    for name, field in (
        ("gain_margin", "gain_margin"),
        ("phase_margin", "phase_margin"),
        ("crossover", "min_crossover"),
    ):
        if (limit := getattr(specification, field)) is None:
            continue
        for where, mask, least in (
            ("at the design points", margins.designed, limit / _AT_NODES),
            ("between them", ~margins.designed, getattr(between, field)),
        ):
            if mask.any():
                worst = margins.worst(name, where=mask)
                title, unit = (
                    f"{name.replace('_', ' ')} {where}",
                    MARGIN_UNITS[name].removeprefix("1"),
                )
                place, passed = f"x={worst.x:g}, y={worst.y:g} m", bool(worst.value >= least)
                reason = (
                    "the specification"
                    if mask is margins.designed
                    else "the specification, less an allowance for interpolation"
                )
                yield Verdict(
                    title,
                    unit,
                    reason,
                    least,
                    worst.value,
                    passed,
                    place,
                    worst.variant,
                    at_least=True,
                )


def _high_frequency_verdict(schedule: GainSchedule, limit: float) -> Verdict:
    """C at the Nyquist frequency is linear in the gains, which are interpolated between nodes: |C|
    is largest at a node."""
    gain = schedule.regulators.nyquist_gain
    i, j = np.unravel_index(np.argmax(gain), gain.shape)
    place, achieved = f"x={schedule.x[i]:g}, y={schedule.y[j]:g} m", float(gain[i, j])
    unit, allowed = GAIN_UNITS[schedule.loop]["kp"], limit * _LINEAR_PROGRAM
    reason = "the specification, and 1e-6 for the tuner's linear programs"
    return Verdict(
        "gain at the Nyquist frequency",
        unit,
        reason,
        allowed,
        achieved,
        achieved <= allowed,
        place,
        "all variants",
    )


def _verdict(name: str, reason: str, worst: WorstPoint, limit: float) -> Verdict:
    place = f"x={worst.x:g}, y={worst.y:g} m"
    return Verdict(
        name, "", reason, limit, worst.value, bool(worst.value <= limit), place, worst.variant
    )
