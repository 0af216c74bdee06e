"""Expressions as text, in the order of operations of the source."""

from __future__ import annotations

from collections.abc import Callable
from typing import ClassVar

from .statements import (
    Call,
    Choice,
    Constant,
    Expression,
    Item,
    Name,
    Negative,
    Number,
    Operation,
)

_LEVELS = {"|": 1, "&": 2, "==": 3, "!=": 3, "<": 4, "<=": 4, ">": 4, ">=": 4}
_LEVELS |= {"+": 5, "-": 5, "*": 6, "/": 6}
_UNARY, _ATOM = 7, 8


class Writer:
    """How one target writes expressions. `number` writes a real number; the rest is overridden."""

    def __init__(self, number: Callable[[float], str]):
        self.number = number

    signs: ClassVar[dict[str, str]] = {}
    """of operations that the target writes in another way than Python"""

    def name(self, name: Name) -> str:
        """A variable."""
        return name.name

    def constant(self, constant: Constant) -> str:
        """A setting."""
        return constant.name

    def item(self, item: Item) -> str:
        """An entry of an array."""
        return item.array.name + "".join(f"[{self.text(place)}]" for place in item.places)

    def call(self, call: Call) -> str:
        """A call."""
        return f"{call.function}({', '.join(map(self.text, call.arguments))})"

    def choice(self, choice: Choice) -> tuple[str, int]:
        """(text, level) of a choice."""
        condition, yes, no = (
            self.inner(part, 1) for part in (choice.condition, choice.yes, choice.no)
        )
        return f"{condition} ? {yes} : {no}", 0

    def not_started(self) -> str:
        """Whether this is the first sample."""
        return "running == 0.0"

    def text(self, expression: Expression) -> str:
        """The expression."""
        return self._level(expression)[0]

    def inner(self, expression: Expression, least: int) -> str:
        """The expression as a part of another that binds at the level `least`."""
        text, level = self._level(expression)
        return text if level >= least else f"({text})"

    def _level(self, expression: Expression) -> tuple[str, int]:
        match expression:
            case Number(value):
                text = str(value) if isinstance(value, int) else self.number(value)
                return text, _ATOM if value >= 0 else _UNARY
            case Constant():
                return self.constant(expression), _ATOM
            case Name():
                return self.name(expression), _ATOM
            case Item():
                return self.item(expression), _ATOM
            case Call():
                return self.call(expression), _ATOM
            case Negative(value):
                return f"-{self.inner(value, _ATOM)}", _UNARY
            case Choice():
                return self.choice(expression)
            case Operation("==", Name("running"), _):
                return self.not_started(), 3
            case Operation(sign, left, right):
                level = _LEVELS[sign]
                written = self.signs.get(sign, sign)
                both = self.inner(left, level), self.inner(right, level + 1)
                return f"{both[0]} {written} {both[1]}", level
        raise NotImplementedError(repr(expression))
