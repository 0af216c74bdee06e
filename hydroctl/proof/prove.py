"""`prove`: everything that is shown of a schedule, once, as a value."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np

from .. import __version__
from ..loop.margins import MARGIN_UNITS
from ..schedule.proof import Proof
from ..schedule.schedule import GainSchedule
from ..validation import ValidationReport, validate
from .margin_verdicts import margin_verdicts
from .remarks import machine_remarks


def prove(schedule: GainSchedule, *, validation: ValidationReport | None = None) -> Proof:
    """Margins at and between the design points, the box, hidden coupling, and the motion of the
    nonlinear machine.

    validation: the motions that are judged; by default those of `validate`. A schedule of models
    of one's own has no nonlinear machine: its proof says that no motion was looked at. Raises
    InputError as `validate` and `check_margins` do.
    """
    linear = prove_margins(schedule)
    if schedule.actuator is None:
        return linear
    if validation is None:
        validation = validate(schedule.actuator, schedule)
    return replace(
        linear,
        verdicts=(*linear.verdicts, *validation.verdicts),
        not_shown=tuple(_not_shown(schedule, validation)),
    )


def prove_margins(schedule: GainSchedule) -> Proof:
    """The part of `prove` that needs no simulation."""
    actuator = schedule.actuator
    remarks: tuple[str, ...] = ()
    if actuator is not None:
        places = schedule.design_x, schedule.design_y
        remarks = machine_remarks(actuator, *places, schedule.specification)
    return Proof(
        generator=f"hydroctl {__version__}",
        schedule=schedule.fingerprint,
        machine=None if actuator is None else actuator.fingerprint(),
        plants=schedule.plants.labels,
        margins=tuple(schedule.margins.worst(name) for name in MARGIN_UNITS),
        verdicts=margin_verdicts(schedule),
        not_shown=tuple(_not_shown(schedule, None)),
        remarks=remarks,
    )


def proven(schedule: GainSchedule, proof: Proof) -> GainSchedule:
    """`schedule` with its `proof`, and the requirements that failed in it as `failed_checks`."""
    return replace(schedule, proof=proof, failed_checks=proof.failed_checks)


def standing_proof(schedule: GainSchedule) -> Proof:
    """The proof that `schedule` carries, if it is its own; else that of its margins, made now."""
    return schedule.own_proof or prove_margins(schedule)


def _not_shown(schedule: GainSchedule, validation: ValidationReport | None) -> Iterator[str]:
    if schedule.plants.box is not None:
        yield "a bound for all plants of the box: the worst ones were searched, not proven"
    yield "points closer than half-way between the design points, and other plants than these"
    if not schedule.plants.knows_speed:
        yield "hidden coupling: the steady speeds of the models are not known"
    if validation is None:
        yield "the motion of a nonlinear machine"
    else:
        labels = dict.fromkeys(run.variant for run in validation.runs)
        yield f"the motion of other machines than these: {', '.join(labels)}"
        kinds = np.unique([run.scenario.kind for run in validation.runs])
        yield f"motions of other kinds than these: {', '.join(kinds)}"
