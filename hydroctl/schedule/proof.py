"""`Proof`: what was shown of a schedule, as plain values. `hydroctl.prove` makes it."""

from __future__ import annotations

from dataclasses import dataclass

from .margins import WorstPoint
from .verdict import Verdict, failures

UNCHECKED = "unchecked: written before fingerprints"
"""what a schedule of a file fails that nothing protected from changes"""


@dataclass(frozen=True, kw_only=True)
class Proof:
    """The verdicts on one schedule, and what none of them says.

    It belongs to the schedule whose fingerprint it carries. A verdict says by its `method` how much
    it is worth: proven, searched or sampled.
    """

    generator: str
    """the hydroctl that made it"""
    schedule: str
    """SHA-256 of the regulator, the plants and the specification that it was made for"""
    machine: str | None
    """SHA-256 of the machine's parameters; None for models of one's own"""
    plants: tuple[str, ...]
    """the linear plants that were looked at; the first is the nominal one"""
    margins: tuple[WorstPoint, ...]
    """each margin where it is worst, at the design points and half-way between them"""
    verdicts: tuple[Verdict, ...]
    """on margins, hidden coupling, and the motion of the nonlinear plant"""
    not_shown: tuple[str, ...]
    """what was not looked at"""
    remarks: tuple[str, ...] = ()
    """what the user should know besides"""

    @property
    def passed(self) -> bool:
        """True where no requirement failed."""
        return all(verdict.passed for verdict in self.verdicts)

    @property
    def failed_checks(self) -> tuple[str, ...]:
        """The requirements that failed, in words."""
        return failures(self.verdicts)

    @property
    def state(self) -> str:
        """One word: "failed", or the weakest method by which its verdicts were found."""
        if not self.passed:
            return "failed"
        methods = {verdict.method for verdict in self.verdicts}
        return next(word for word in ("sampled", "searched", "proven") if word in methods)

    def worst(self, margin: str) -> WorstPoint:
        """Where the margin of that name is worst."""
        return next(point for point in self.margins if point.margin == margin)

    @property
    def linear(self) -> tuple[Verdict, ...]:
        """The verdicts on the linear loops, hidden coupling included."""
        return tuple(verdict for verdict in self.verdicts if verdict.subject != "motion")

    def __str__(self) -> str:
        lines = [f"{self.state}: {len(self.verdicts)} requirements on {len(self.plants)} plants"]
        lines += [f"  {verdict} [{verdict.method}]" for verdict in self.verdicts]
        return "\n".join([*lines, *(f"  not shown: {text}" for text in self.not_shown)])
