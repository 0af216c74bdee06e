"""A `Proof` as a part of the schedule file, and back."""

from __future__ import annotations

import math
import re
from collections.abc import Iterable
from typing import Literal

from ..loop.margins import MARGIN_UNITS
from .margins import WorstPoint
from .proof import Proof
from .shown import Achieved, Judged, Margins, ProofPart, Remark
from .verdict import Verdict


def proof_part(proof: Proof) -> ProofPart:
    """What stands in the file of `proof`."""
    return ProofPart(
        generator=proof.generator,
        schedule=proof.schedule,
        machine=proof.machine,
        plants=list(proof.plants),
        margins=Margins(**{point.margin: _achieved(point) for point in proof.margins}),
        verdicts=[_judged(verdict) for verdict in proof.verdicts],
        not_shown=remarks_of(proof.not_shown),
        remarks=remarks_of(proof.remarks),
    )


def proof_of(part: ProofPart) -> Proof:
    """The proof that `part` describes."""
    margins = ((name, getattr(part.margins, name)) for name in MARGIN_UNITS)
    return Proof(
        generator=part.generator,
        schedule=part.schedule,
        machine=part.machine,
        plants=tuple(part.plants),
        margins=tuple(_point(name, found) for name, found in margins if found is not None),
        verdicts=tuple(_verdict(judged) for judged in part.verdicts),
        not_shown=tuple(remark.description for remark in part.not_shown),
        remarks=tuple(remark.description for remark in part.remarks),
    )


def remarks_of(texts: Iterable[str]) -> list[Remark]:
    """Sentences for people."""
    return [Remark(description=text) for text in texts]


def _achieved(point: WorstPoint) -> Achieved:
    value = point.value if math.isfinite(point.value) else None
    unit = MARGIN_UNITS[point.margin]
    return Achieved(value=value, unit=unit, variant=point.variant, x=point.x, y=point.y)


def _point(name: str, found: Achieved) -> WorstPoint:
    value = math.inf if found.value is None else found.value
    return WorstPoint(name, value, found.variant, found.x, found.y)


def _judged(verdict: Verdict) -> Judged:
    return Judged(
        requirement=identifier(verdict.name),
        subject="hidden_coupling" if verdict.subject == "hidden coupling" else verdict.subject,
        method=verdict.method,
        unit=verdict.unit,
        limit=float(verdict.limit) if math.isfinite(verdict.limit) else None,
        at_least=verdict.at_least,
        achieved=_number(float(verdict.achieved)),
        passed=bool(verdict.passed),
        place=verdict.scenario,
        variant=verdict.variant,
        description=verdict.name,
        reason=verdict.reason,
    )


def _number(value: float) -> float | Literal["nan", "inf", "-inf"]:
    """What stands for `value` in JSON, where numbers are finite."""
    if math.isfinite(value):
        return value
    return "nan" if math.isnan(value) else "inf" if value > 0.0 else "-inf"


def _verdict(judged: Judged) -> Verdict:
    return Verdict(
        name=judged.description,
        unit=judged.unit,
        reason=judged.reason,
        limit=math.inf if judged.limit is None else judged.limit,
        achieved=float(judged.achieved),
        passed=judged.passed,
        scenario=judged.place,
        variant=judged.variant,
        at_least=judged.at_least,
        subject="hidden coupling" if judged.subject == "hidden_coupling" else judged.subject,
        method=judged.method,
    )


def identifier(name: str) -> str:
    """The name of a requirement in snake_case, without what stands in brackets."""
    words = re.sub(r"\(.*?\)", "", name)
    return re.sub(r"\W+", "_", words).strip("_")
