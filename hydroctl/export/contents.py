"""What every export of a schedule starts from: its law, its test vectors and where it comes
from."""

from __future__ import annotations

from dataclasses import dataclass
from textwrap import wrap
from typing import TYPE_CHECKING

import numpy as np

from .. import __version__
from ..errors import FailedChecksError
from ..regulator.law import Regulator
from ..regulator.units import GAIN_UNITS
from ..regulator.vectors import Vector, law_of
from ..schedule.document import Document
from ..schedule.file import document_of, vectors_in
from ..validation import failures
from ..validation.margin_verdicts import margin_verdicts
from .text import harmless

if TYPE_CHECKING:
    from ..schedule.schedule import GainSchedule

_WIDTH = 100


@dataclass(frozen=True, eq=False)
class Contents:
    """A schedule, ready to be written."""

    schedule: GainSchedule
    regulator: Regulator
    document: Document
    """the schedule file, with the checks that failed"""

    @property
    def vectors(self) -> list[Vector]:
        """The test vectors of the schedule file."""
        return vectors_in(self.document)

    @property
    def tables(self) -> dict[str, np.ndarray]:
        """The tables (nx, ny) that the law has a use for, by name."""
        used = {
            "kp": True,
            "ki": bool(np.any(self.schedule.ki)),
            "kd": bool(np.any(self.schedule.kd)),
        }
        used["notch_frequency"] = self.regulator.shaped
        return {name: getattr(self.schedule, name) for name, use in used.items() if use}

    @property
    def units(self) -> dict[str, str]:
        """Units of the tables by name."""
        return GAIN_UNITS[self.schedule.loop]

    @property
    def provenance(self) -> list[str]:
        """Lines that say what this is and where it comes from, harmless in every target."""
        s, actuator = self.schedule, self.schedule.actuator
        given = [
            f"Gain-scheduled regulator of the {s.loop} of a hydraulic cylinder; structure {s.structure}.",
            f"Written by hydroctl {__version__}. Change the schedule and export it again; do not change this file.",
            f"Machine: {actuator.name}",
            f"Source: {actuator.source}",
            f"Note: {actuator.note}",
            f"SHA-256 of the schedule: {self.document.fingerprint}",
            f"SHA-256 of the machine's parameters: {actuator.fingerprint()}",
            *map(self._worst, ("Ms", "Mt")),
        ]
        if self.document.failed_checks:
            given += [
                "WRITTEN BY FORCE, ALTHOUGH THESE CHECKS FAILED:",
                *self.document.failed_checks,
            ]
        return [
            part
            for line in given
            for part in wrap(harmless(line), _WIDTH, subsequent_indent="    ")
        ]

    def _worst(self, name: str) -> str:
        worst = self.schedule.margins.worst(name)
        return f"{name} at worst {worst.value:.4g} ({worst.variant}, x = {worst.x:g}, y = {worst.y:g} m)"


def contents_of(schedule: GainSchedule, *, force: bool = False) -> Contents:
    """The contents of `schedule`. Raises FailedChecksError where it fails a check of its margins,
    or failed one in its design, unless `force`."""
    failed = tuple(dict.fromkeys([*failures(margin_verdicts(schedule)), *schedule.failed_checks]))
    if failed and not force:
        raise FailedChecksError(
            "the schedule fails its own checks; design it anew, or force the export:", failed
        )
    return Contents(schedule, law_of(schedule.regulator), document_of(schedule, failed))
