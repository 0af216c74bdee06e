"""What every export of a schedule starts from: its law, its test vectors and where it comes
from."""

from __future__ import annotations

from dataclasses import dataclass, replace
from textwrap import wrap

import numpy as np

from .. import __version__
from ..errors import FailedChecksError
from ..proof.prove import standing_proof
from ..regulator.law import Regulator
from ..regulator.vectors import Vector, law_of
from ..schedule.document import Document
from ..schedule.file import document_of, vectors_in
from ..schedule.proof import Proof
from ..schedule.schedule import GainSchedule
from .text import harmless

_WIDTH = 100


@dataclass(frozen=True, eq=False)
class Contents:
    """A schedule, ready to be written."""

    schedule: GainSchedule
    """with the checks that it fails"""
    proof: Proof
    """its own, or that of its margins"""
    regulator: Regulator
    document: Document
    """the schedule file"""

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
        return dict(self.schedule.quantity.gain_units)

    @property
    def provenance(self) -> list[str]:
        """Lines that say what this is and where it comes from, harmless in every target."""
        s = self.schedule
        given = [
            (
                f"Gain-scheduled regulator of the {s.loop} of a hydraulic cylinder; structure"
                f" {s.structure}."
            ),
            (
                f"Written by hydroctl {__version__}. Change the schedule and export it again; do"
                " not change this file."
            ),
            *(f"{name.capitalize()}: {text}" for name, text in self.origin.items()),
            f"SHA-256 of the schedule: {self.document.fingerprint}",
            *self._fingerprint_of_the_machine,
            *map(self._worst, ("Ms", "Mt")),
        ]
        given += [f"State of the proof: {self.proof.state}. Not shown:", *self.proof.not_shown]
        if failed := self.schedule.failed_checks:
            given += ["WRITTEN BY FORCE, ALTHOUGH THESE CHECKS FAILED:", *failed]
        return [
            part
            for line in given
            for part in wrap(harmless(line), _WIDTH, subsequent_indent="    ")
        ]

    @property
    def origin(self) -> dict[str, str]:
        """machine, source and note."""
        actuator = self.schedule.actuator
        if actuator is None:
            count = len(self.schedule.plants.labels)
            note = f"{count} linear models at each design point"
            return {"machine": "not known", "source": "", "note": note}
        return {"machine": actuator.name, "source": actuator.source, "note": actuator.note}

    @property
    def _fingerprint_of_the_machine(self) -> list[str]:
        actuator = self.schedule.actuator
        if actuator is None:
            return []
        return [f"SHA-256 of the machine's parameters: {actuator.fingerprint()}"]

    def _worst(self, name: str) -> str:
        worst = self.proof.worst(name)
        return (
            f"{name} at worst {worst.value:.4g} ({worst.variant}, x = {worst.x:g}, y ="
            f" {worst.y:g} m)"
        )


def contents_of(schedule: GainSchedule, *, force: bool = False) -> Contents:
    """The contents of `schedule`, which are judged by the proof that it carries, or by that of its
    margins. Raises FailedChecksError where a check failed, unless `force`."""
    proof = standing_proof(schedule)
    failed = tuple(dict.fromkeys([*proof.failed_checks, *schedule.failed_checks]))
    if failed and not force:
        raise FailedChecksError(
            "the schedule fails its own checks; design it anew, or force the export:", failed
        )
    judged = replace(schedule, failed_checks=failed)
    return Contents(judged, proof, law_of(judged.regulator), document_of(judged))
