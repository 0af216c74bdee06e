"""The statements of the law in C."""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar

import numpy as np

from ..regulator.printing.program import Described, Program
from ..regulator.printing.statements import (
    Assign,
    Body,
    Call,
    Constant,
    Count,
    Function,
    Heading,
    Item,
    LookUp,
    Name,
    Statement,
)
from ..regulator.printing.writing import Writer
from .names import WIDTH, comment, long_name, wrapped

_SIZES = ("NX", "NY")


class CWriter(Writer):
    """Expressions in C, in double or float."""

    signs: ClassVar = {"|": "||", "&": "&&"}
    places: ClassVar = {"input": "input->", "memory": "state->", "gain": "gains."}

    def __init__(self, number, suffix: str):
        super().__init__(number)
        self.suffix = suffix

    def name(self, name: Name) -> str:
        place = "" if name.name == "start_x" else self.places.get(name.place, "")
        return place + name.name

    def constant(self, constant: Constant) -> str:
        return long_name(constant.name).upper()

    def item(self, item: Item) -> str:
        places = "".join(f"[{self.text(place)}]" for place in item.places)
        return array_name(item.array.name) + places

    def call(self, call: Call) -> str:
        given = ", ".join(map(self.text, call.arguments))
        return f"{call.function}{self.suffix if call.function in ('sqrt', 'tan') else ''}({given})"

    def not_started(self) -> str:
        return "!state->started"


class CLaw:
    """The law of a program, in lines of C for the template."""

    def __init__(self, program: Program, name: str, writer: CWriter):
        self.program, self.name, self.writer = program, name, writer

    @property
    def constants(self) -> list[str]:
        """Settings that are numbers."""
        return [
            _commented(
                f"static const real {name.upper()} = {self.writer.number(one.value)};",
                one.unit,
                one.text,
            )
            for one in self.program.constants
            for name in [long_name(one.name)]
        ]

    @property
    def arrays(self) -> list[str]:
        """Nodes, limits and tables."""
        return [line for one in self.program.arrays for line in self._array(one)]

    @property
    def functions(self) -> list[str]:
        """Functions that a sample and a start share."""
        return [line for function in self.program.functions for line in self._function(function)]

    @property
    def look_up(self) -> list[str]:
        """The lines that fill `gains`."""
        body = self.program.look_up
        assert body is not None
        return [
            *self._statements(body),
            f"    {self.name}_gains gains;",
            *(f"    gains.{gain} = {self.writer.text(e)};" for gain, e in body.results.items()),
        ]

    @property
    def sample(self) -> list[str]:
        """The lines of a sample, which end with the new memory."""
        return self._with_memory(self.program.sample)

    @property
    def start(self) -> list[str]:
        """The lines of a start, likewise."""
        return self._with_memory(self.program.start)

    def _with_memory(self, body: Body) -> list[str]:
        new = (f"    state->{field} = {self.writer.text(e)};" for field, e in body.results.items())
        return [*self._statements(body), "", *new]

    def _statements(self, body: Body) -> list[str]:
        lines: list[str] = []
        for statement in body.statements:
            for line in self._statement(statement):
                if line or (lines and lines[-1]):
                    lines.append(line)
        return lines[:-1] if lines and not lines[-1] else lines

    def _statement(self, statement: Statement) -> list[str]:
        text = self.writer.text
        match statement:
            case Heading(""):
                return [""]
            case Heading(words):
                return ["", f"    /* {words} */"]
            case LookUp(is_read=False):
                return []
            case LookUp(x, y):
                called = f"{self.name}_look_up({text(x)}, {text(y)})"
                return [f"    const {self.name}_gains gains = {called};"]
            case Assign(target, value, unit, words):
                kind = "real" if target.kind == "real" else "int"
                line = f"const {kind} {target.name} = {text(value)};"
                return _indented(line, unit, words)
            case Count(target, place, last, condition, unit, words):
                k = place.name
                return [
                    *_indented(f"int {target.name} = 0;", unit, words),
                    f"    for (int {k} = 1; {k} < {last + 1}; {k}++) {{",
                    f"        {target.name} += {text(condition)};",
                    "    }",
                ]
        raise NotImplementedError(repr(statement))

    def _array(self, one: Described[np.ndarray]) -> list[str]:
        sizes = "[2][2]" if one.name == "limits" else _size(one)
        head = f"static const real {array_name(one.name)}{sizes} = {{"
        if one.value.ndim == 1:
            return [_commented(f"{head} {self._numbers(one.value)} }};", one.unit, one.text)]
        rows = (f"    {{ {self._numbers(row)} }}," for row in one.value)
        return ["", _commented(head, one.unit, one.text), *rows, "};"]

    def _numbers(self, row: Iterable[float]) -> str:
        return ", ".join(map(self.writer.number, row))

    def _function(self, function: Function) -> list[str]:
        given = ", ".join(f"real {parameter.name}" for parameter in function.parameters)
        return [
            "",
            f"/* {function.text} */",
            f"static real {function.name}({given})",
            "{",
            *self._statements(function.body),
            f"    return {self.writer.text(function.body.results[''])};",
            "}",
        ]


def array_name(name: str) -> str:
    """What an array is called; a table after its gain."""
    return name.removesuffix("_table").upper()


def _size(one: Described[np.ndarray]) -> str:
    if one.value.ndim == 2:
        return "[NX][NY]"
    return f"[{_SIZES[one.name.startswith('y')]}]"


def _commented(line: str, unit: str, text: str) -> str:
    said = comment(unit, text)
    return f"{line} /* {said} */" if said else line


def _indented(line: str, unit: str, text: str) -> list[str]:
    """The statement with its comment behind it, or above it where the line would be too long."""
    whole = f"    {_commented(line, unit, text)}"
    if len(whole) <= WIDTH:
        return [whole]
    above = [f"    /* {comment(unit, text)} */"] if comment(unit, text) else []
    return above + wrapped(f"    {line}")
