"""Arithmetic on expressions: what a schedule's own settings decide is decided here, and what adds 0
or multiplies by 1 is left out."""

from __future__ import annotations

import operator

from .statements import ATOMS, Choice, Constant, Expression, Name, Negative, Number, Operation

_ARITHMETIC = {
    "+": operator.add,
    "-": operator.sub,
    "*": operator.mul,
    "/": operator.truediv,
}
_COMPARED = {
    "<": operator.lt,
    "<=": operator.le,
    ">": operator.gt,
    ">=": operator.ge,
    "==": operator.eq,
    "!=": operator.ne,
}


def lifted(value) -> Expression:
    """A Python number as an expression."""
    return Number(value) if isinstance(value, int | float) else value


def known(expression: Expression):
    """The value of a number or a setting, else None."""
    return expression.value if isinstance(expression, Number | Constant) else None


def operation(sign: str, left, right):
    """`left sign right`."""
    if sign in "|&":
        return _logical(sign, left, right)
    left, right = lifted(left), lifted(right)
    a, b = known(left), known(right)
    if sign in _COMPARED:
        if a is not None and b is not None:
            return _COMPARED[sign](a, b)
        return Operation(sign, left, right)
    if a is not None and b is not None:
        value = _ARITHMETIC[sign](a, b)
        if (isinstance(left, Number) and isinstance(right, Number)) or value in (0, 1, -1):
            return Number(value)
    return _simplified(sign, left, right, a, b)


def _simplified(sign: str, left: Expression, right: Expression, a, b) -> Expression:
    match sign:
        case "+" if a == 0:
            return right
        case "+" | "-" if b == 0:
            return left
        case "-" if a == 0:
            return negative(right)
        case "*" if a == 0 or b == 0:
            return Number(0.0)
        case "*" if a in (1, -1):
            return right if a == 1 else negative(right)
        case "*" | "/" if b in (1, -1):
            return left if b == 1 else negative(left)
        case "/" if a == 0:
            return Number(0.0)
    return Operation(sign, left, right)


def _logical(sign: str, left, right):
    decides = sign == "|"
    for one, other in ((left, right), (right, left)):
        if isinstance(one, bool):
            return decides if one == decides else other
    return Operation(sign, left, right)


def negative(value) -> Expression:
    """-value"""
    if isinstance(value, int | float):
        return Number(-value)
    match value:
        case Number(given):
            return Number(-given)
        case Negative(inner):
            return inner
    return Negative(value)


def choice(condition, yes, no):
    """`yes` where the condition holds, else `no`."""
    if isinstance(condition, bool):
        return lifted(yes if condition else no)
    yes, no = lifted(yes), lifted(no)
    if yes == no:
        return yes
    if known(yes) == known(no) and known(yes) in (0, 1, -1):
        return Number(known(yes))
    if isinstance(condition, Name | Operation) or not isinstance(condition, ATOMS):
        return Choice(condition, yes, no)
    raise TypeError(f"{condition!r} is no condition")
