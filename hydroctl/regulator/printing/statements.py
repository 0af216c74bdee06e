"""What the law comes to for one schedule: expressions and statements that every target can
write."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any, Literal

import numpy as np

Kind = Literal["real", "int", "bool"]
Place = Literal["local", "input", "memory", "gain", "parameter", "looked up"]
_COMPARISONS = ("<", "<=", ">", ">=", "==", "!=")


@dataclass(frozen=True)
class Number:
    """A number that stands in the source."""

    value: float | int


@dataclass(frozen=True)
class Constant:
    """A setting of the schedule; written by its name."""

    name: str
    value: float | int


@dataclass(frozen=True)
class Name:
    """A variable: of the function itself, an input, of the memory, a gain that was looked up, a
    parameter."""

    name: str
    kind: Kind = "real"
    place: Place = "local"


@dataclass(frozen=True)
class Array:
    """Nodes or a table of the schedule."""

    name: str
    values: np.ndarray = field(compare=False)


@dataclass(frozen=True)
class Item:
    """An entry of an array."""

    array: Array
    places: tuple


@dataclass(frozen=True)
class Operation:
    """`left sign right`; sign as in Python, | and & for or and and."""

    sign: str
    left: Expression
    right: Expression


@dataclass(frozen=True)
class Negative:
    """-value"""

    value: Expression


@dataclass(frozen=True)
class Choice:
    """`yes` where the condition holds, else `no`."""

    condition: Expression
    yes: Expression
    no: Expression


@dataclass(frozen=True)
class Call:
    """A function of the target (sqrt, tan), or a printed one."""

    function: str
    arguments: tuple


Expression = Number | Constant | Name | Item | Operation | Negative | Choice | Call
ATOMS = (Number, Constant, Name)


@dataclass
class Assign:
    """`target = value`, with its unit and what it is, "" where the source does not say."""

    target: Name
    value: Expression
    unit: str = ""
    text: str = ""


@dataclass
class Count:
    """target = the number of places from 1 to last for which the condition holds."""

    target: Name
    place: Name
    last: int
    condition: Expression
    unit: str = ""
    text: str = ""


@dataclass
class LookUp:
    """The gains are looked up here, at the opening x and the position y."""

    x: Expression
    y: Expression
    is_read: bool = True
    """whether any gain is needed"""


@dataclass
class Heading:
    """What the following statements do; "" ends them."""

    text: str


Statement = Assign | Count | LookUp | Heading


@dataclass
class Body:
    """Statements, and what they come to: expressions by name."""

    statements: list[Statement]
    results: dict[str, Expression]


@dataclass
class Function:
    """A function of its own, with one result."""

    name: str
    text: str
    parameters: tuple[Name, ...]
    body: Body


def kind_of(expression: Expression) -> Kind:
    """Whether it is a real number, a whole one or a truth value."""
    match expression:
        case Number(value) | Constant(_, value):
            return "int" if isinstance(value, int) else "real"
        case Name(_, kind, _):
            return kind
        case Operation(sign, left, right):
            if sign in (*_COMPARISONS, "|", "&"):
                return "bool"
            return "real" if "real" in (kind_of(left), kind_of(right)) else "int"
        case Choice(_, yes, no):
            return "real" if "real" in (kind_of(yes), kind_of(no)) else kind_of(yes)
        case Negative(value):
            return kind_of(value)
    return "real"


def replaced(expression: Expression, by: Mapping) -> Expression:
    """The expression with others in the place of names."""
    if expression in by:
        return by[expression]
    changed: dict[str, Any] = {}
    for part in fields(expression):
        value = getattr(expression, part.name)
        if isinstance(value, tuple):
            changed[part.name] = tuple(replaced(inner, by) for inner in value)
        elif isinstance(value, Expression):
            changed[part.name] = replaced(value, by)
    return replace(expression, **changed)


def parts_of(expression: Expression):
    """The expression and all that it is made of."""
    yield expression
    inner: tuple[Expression, ...]
    match expression:
        case Operation(_, left, right):
            inner = (left, right)
        case Negative(value):
            inner = (value,)
        case Choice(condition, yes, no):
            inner = (condition, yes, no)
        case Call(_, arguments):
            inner = arguments
        case Item(_, places):
            inner = places
        case _:
            inner = ()
    for one in inner:
        yield from parts_of(one)


def expressions_of(statement: Statement) -> tuple:
    """What a statement reads."""
    match statement:
        case Assign(_, value):
            return (value,)
        case Count(_, _, _, condition):
            return (condition,)
        case LookUp(x, y, _):
            return x, y
    return ()


def all_parts(body: Body):
    """Every part of what the body reads, in order."""
    expressions = [e for s in body.statements for e in expressions_of(s)]
    for expression in (*expressions, *body.results.values()):
        yield from parts_of(expression)


def read_by(body: Body) -> set:
    """The same as a set."""
    return set(all_parts(body))
