"""The parts of a schedule file that let a stranger run the schedule and know what it is worth: the
law as formulas, test vectors, and the proof."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field, model_validator

from .parts import Number, Part
from .verdict import Method


class Signal(Part):
    """An input of the law."""

    name: str
    unit: str
    description: str


class Constant(Part):
    """A constant of the law."""

    name: str
    unit: str
    description: str
    value: Number


class Array(Part):
    """An array of the law: its values, or where in this file they stand."""

    name: str
    unit: str
    description: str
    values: list[Number] | list[list[Number]] | None = None
    source: str | None = None
    """keys from the top of the file, joined by dots; left out where there are values"""

    @model_validator(mode="after")
    def _known(self):
        if (self.values is None) == (self.source is None):
            raise ValueError("an array has values or a source, and not both")
        return self


class State(Part):
    """A number that the law remembers from sample to sample."""

    name: str
    unit: str
    description: str
    rest: Number
    """before the first sample, and after a fault"""


class Formula(Part):
    """One statement: `name` is the value of `expression`."""

    name: str
    unit: str
    expression: str
    """JavaScript: numbers, names, + - * /, comparisons, || && ?:, sqrt(), tan(), array[i][j]"""
    description: str


class Formulas(Part):
    """Statements in their order, then the memory and the command."""

    statements: Annotated[list[Formula], Field(min_length=1)]
    memory: dict[str, str]
    """expressions of the memory afterwards"""
    output: str


class Fallback(Part):
    """What a fault leads to."""

    x: Literal[0]
    memory: Literal["rest"]
    description: str


class Law(Part):
    """The law of this schedule, complete: evaluated in this order it gives the test vectors."""

    measured: Literal["v", "y"]
    inputs: Annotated[list[Signal], Field(min_length=1)]
    constants: list[Constant]
    arrays: list[Array]
    memory: Annotated[list[State], Field(min_length=1)]
    sample: Formulas
    start: Formulas
    """with the further input start_x: the memory from which the next sample gives that command"""
    fallback: Fallback


Columns = tuple[
    Literal["start"],
    Literal["reference"],
    Literal["v_ref"],
    Literal["p_a"],
    Literal["p_b"],
    Literal["v"],
    Literal["y"],
    Literal["kp"],
    Literal["ki"],
    Literal["kd"],
    Literal["notch_frequency"],
    Literal["x"],
]


class TestVectors(Part):
    """What the law answers, sample by sample; an input that is not finite (a broken sensor) is
    null, and so are its gains. notch_frequency is 0 where the law has no use for it.

    start: null where the law goes on (at the first row from rest), else the x at which it is
    started just before the row.
    """

    columns: Columns
    units: list[str]
    tolerance: Literal[1e-9]  # type: ignore[valid-type]  # pydantic takes numbers, too
    rows: Annotated[
        list[Annotated[list[Number | None], Field(min_length=12, max_length=12)]],
        Field(min_length=1),
    ]

    @model_validator(mode="after")
    def _answers(self):
        if any(row[-1] is None for row in self.rows):
            raise ValueError("a row of test_vectors has no x")
        return self


class Achieved(Part):
    """The worst value of one margin, and where it is; null where it is infinite."""

    value: Number | None
    unit: Literal["1", "rad", "s", "rad/s"]
    variant: str
    x: Number
    y: Number


class Margins(Part):
    """The worst margins over nodes, midpoints and variants."""

    Ms: Achieved
    Mt: Achieved
    gain_margin: Achieved
    gain_reduction_margin: Achieved | None = None
    """left out of files that were written before it had a name"""
    phase_margin: Achieved
    delay_margin: Achieved
    crossover: Achieved


class Remark(Part):
    """A sentence for people."""

    description: str


class Judged(Part):
    """The verdict on one requirement."""

    requirement: str
    """snake_case"""
    subject: Literal["margins", "hidden_coupling", "motion"]
    method: Method
    unit: str
    limit: Number | None
    """null: none is stated, so that nothing can fail"""
    at_least: bool
    achieved: Number | Literal["nan", "inf", "-inf"]
    passed: bool
    place: str
    """the point, or the motion"""
    variant: str
    description: str
    reason: str


class ProofPart(Part):
    """What was shown of the schedule, and what was not."""

    generator: str
    schedule: str
    """SHA-256 of the schedule that it was made for"""
    machine: str | None
    """SHA-256 of the machine's parameters"""
    plants: list[str]
    margins: Margins
    verdicts: list[Judged]
    not_shown: list[Remark]
    remarks: list[Remark]
