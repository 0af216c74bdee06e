"""Statements as a reader wants them: none that nothing needs, nothing computed twice, short
names."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import replace

from .statements import (
    Assign,
    Body,
    Count,
    Heading,
    LookUp,
    Name,
    Statement,
    expressions_of,
    parts_of,
    replaced,
)

MARK = "#"
"""what stands between a wanted name and a number that makes it the only one of its kind"""


def tidied(body: Body, taken: Iterable[str] = ()) -> Body:
    """The body without what is not needed, under names that are not `taken`."""
    return _named(_without_repetition(_without_unused(body)), set(taken))


def _without_unused(body: Body) -> Body:
    """The body without statements that nothing needs, and without headings over nothing."""
    needed = {part for e in body.results.values() for part in parts_of(e)}
    kept: list[Statement] = []
    for given in reversed(body.statements):
        statement = given
        if isinstance(statement, Assign | Count) and statement.target not in needed:
            continue
        if isinstance(statement, Heading) and (not kept or isinstance(kept[-1], Heading)):
            continue
        if isinstance(statement, LookUp):
            statement = replace(statement, is_read=any(map(_is_gain, needed)))
        kept.append(statement)
        needed |= {part for e in expressions_of(statement) for part in parts_of(e)}
    return Body(kept[::-1], body.results)


def _is_gain(part) -> bool:
    return isinstance(part, Name) and part.place == "gain"


def _without_repetition(body: Body) -> Body:
    """Of statements with the same value the first."""
    first: dict = {}
    same: dict[Name, Name] = {}
    kept: list[Statement] = []
    for given in body.statements:
        statement = _changed(given, same)
        if isinstance(statement, Assign):
            if statement.value in first:
                same[statement.target] = first[statement.value]
                continue
            first[statement.value] = statement.target
        kept.append(statement)
    return _without_unused(Body(kept, _results(body, same)))


def _named(body: Body, taken: set[str]) -> Body:
    """Every variable under its wanted name, or the like where that is taken."""
    used, names = set(taken), {}
    for statement in body.statements:
        if isinstance(statement, Assign | Count):
            target = statement.target
            names[target] = replace(target, name=_free(target.name.split(MARK)[0], taken, used))
    statements = [_changed(statement, names) for statement in body.statements]
    return Body(statements, _results(body, names))


def _free(wanted: str, taken: set[str], used: set[str]) -> str:
    first = f"new_{wanted}" if wanted in taken else wanted
    others = (f"{first}_{k}" for k in range(2, 1000))
    name = next(name for name in (first, *others) if name not in used)
    used.add(name)
    return name


def _results(body: Body, by: dict) -> dict:
    return {name: replaced(value, by) for name, value in body.results.items()}


def _changed(statement: Statement, by: dict) -> Statement:
    match statement:
        case Assign(target, value):
            return replace(statement, target=by.get(target, target), value=replaced(value, by))
        case Count(target, _, _, condition):
            return replace(
                statement, target=by.get(target, target), condition=replaced(condition, by)
            )
        case LookUp(x, y, is_read):
            return LookUp(replaced(x, by), replaced(y, by), is_read)
    return statement
