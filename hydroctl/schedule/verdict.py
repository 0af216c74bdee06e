"""`Verdict`: what was asked of a schedule, what was found at worst, and how it was looked for."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Literal

import numpy as np

from ..digits import apart

Subject = Literal["margins", "hidden coupling", "motion"]
Method = Literal["proven", "searched", "sampled"]
"""holds everywhere; no worse was found by a search; was looked at in samples, and there alone"""


@dataclass(frozen=True)
class Verdict:
    """One requirement's worst case over everything that was looked at."""

    name: str
    unit: str
    reason: str
    """where the limit comes from"""
    limit: float
    achieved: float
    passed: bool
    scenario: str
    """or the place: x and y"""
    variant: str
    at_least: bool = False
    """whether `limit` is a minimum"""
    subject: Subject = "motion"
    method: Method = "sampled"

    @property
    def is_remark(self) -> bool:
        """True where there is no limit, so that nothing can fail: what was achieved is for the
        reader to know."""
        return self.limit == np.inf and not self.at_least

    def __str__(self) -> str:
        where = f"({self.scenario}; {self.variant})"
        if np.isnan(self.achieved):
            return f"FAIL  {self.name}: cannot be judged, the motion has no such number  {where}"
        if self.is_remark:
            achieved = f"{self.achieved:.4g} {self.unit}".rstrip()
            return f"note  {self.name}: {achieved}, {self.reason} is not stated  {where}"
        signs = ("<=", ">=") if self.passed else (">", "<")
        word, sign = "pass" if self.passed else "FAIL", signs[self.at_least]
        achieved, limit = apart(self.achieved, self.limit, digits=4)
        if self.achieved == self.limit:
            equal = f"{achieved} {self.unit}".rstrip()
            return f"{word}  {self.name}: {equal}, the limit  {where}"
        return f"{word}  {self.name}: {achieved} {sign} {limit} {self.unit}".rstrip() + f"  {where}"


def failures(verdicts: Iterable[Verdict]) -> tuple[str, ...]:
    """Those that failed, in words."""
    return tuple(str(verdict) for verdict in verdicts if not verdict.passed)
