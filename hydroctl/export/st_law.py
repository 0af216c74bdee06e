"""The statements of the law in structured text."""

from __future__ import annotations

from collections.abc import Iterable
from typing import ClassVar

import numpy as np

from ..regulator import law
from ..regulator.formulas import INPUTS
from ..regulator.printing.program import Described, Program, setting_names
from ..regulator.printing.statements import (
    Assign,
    Body,
    Call,
    Choice,
    Constant,
    Count,
    Expression,
    Function,
    Heading,
    Item,
    LookUp,
    Name,
    Statement,
    read_by,
)
from ..regulator.printing.writing import Writer
from .names import comment, long_name, wrapped

FUNCTION_BLOCKS = frozenset(
    [
        "ctd",
        "ctu",
        "ctud",
        "derivative",
        "f_trig",
        "hysteresis",
        "integral",
        "pid",
        "r_trig",
        "ramp",
        "rs",
        "rtc",
        "sema",
        "sr",
        "tof",
        "ton",
        "tp",
    ]
)
"""blocks of the standard library, whose names no variable may have"""
_FRAME = ["setpoint", "x", "started", "faults", "reset", "start", "start_x", "sound"]
_FRAME += ["scheduled_x", "largest", "k"]
_KINDS = {"int": "INT", "bool": "BOOL"}
_RENAMED = {"reference": "setpoint"}


def st_name(name: str) -> str:
    """A name that no block of the standard library has."""
    return f"{name}_state" if name in FUNCTION_BLOCKS else _RENAMED.get(name, name)


TAKEN = frozenset([*INPUTS, *law.MEMORY, *map(long_name, setting_names()), *_FRAME]) | (
    FUNCTION_BLOCKS
)
"""Names that no variable of the law itself may have."""


class StWriter(Writer):
    """Expressions in structured text."""

    signs: ClassVar = {"|": "OR", "&": "AND", "==": "=", "!=": "<>"}

    def __init__(self, number, block: str):
        super().__init__(number)
        self.block = block

    def name(self, name: Name) -> str:
        if (name.name, name.place) == ("x", "looked up"):
            return "scheduled_x"
        return st_name(name.name)

    def constant(self, constant: Constant) -> str:
        return long_name(constant.name)

    def item(self, item: Item) -> str:
        return f"{item.array.name}[{', '.join(map(self.text, item.places))}]"

    def call(self, call: Call) -> str:
        given = ", ".join(map(self.text, call.arguments))
        if call.function in ("sqrt", "tan"):
            return f"{call.function.upper()}({given})"
        return f"{self.block}_{call.function}({given})"

    def choice(self, choice: Choice) -> tuple[str, int]:
        given = (choice.condition, choice.no, choice.yes)
        return f"SEL({', '.join(map(self.text, given))})", 8

    def not_started(self) -> str:
        return "NOT started"


class StLaw:
    """The law of a program, in lines of structured text for the template."""

    def __init__(self, program: Program, writer: StWriter, real: str):
        self.program, self.writer, self.real = program, writer, real

    @property
    def constants(self) -> list[str]:
        """Settings that the block itself reads, as declarations."""
        return self._constants(self._own)

    @property
    def arrays(self) -> list[str]:
        """Nodes, limits and tables, as declarations."""
        return [line for one in self.program.arrays for line in self._array(one)]

    @property
    def variables(self) -> list[str]:
        """The variables of lookup, start and sample, as declarations."""
        return self._variables(self._own)

    @property
    def _own(self) -> tuple[Body, ...]:
        assert self.program.look_up is not None
        return self.program.look_up, self.program.sample, self.program.start

    @property
    def look_up(self) -> list[str]:
        """The lookup of the gains at scheduled_x and y."""
        body = self.program.look_up
        assert body is not None
        named = ((gain, self.writer.text(e)) for gain, e in body.results.items())
        return [
            *self._statements(body.statements, ""),
            *(f"{gain} := {text};" for gain, text in named if gain != text),
        ]

    @property
    def start_before_look_up(self) -> list[str]:
        """The lines of a start as far as scheduled_x."""
        return self._statements(self._start[0], "    ")

    @property
    def start_after_look_up(self) -> list[str]:
        """The rest of them, which end with the new memory."""
        return [
            *self._statements(self._start[1], "    "),
            *self._memory(self.program.start, "    "),
        ]

    @property
    def sample(self) -> list[str]:
        """The lines of a sample, likewise."""
        body = self.program.sample
        return [*self._statements(body.statements, ""), *self._memory(body, "")]

    @property
    def functions(self) -> list[str]:
        """Functions that a sample and a start share."""
        return [line for function in self.program.functions for line in self._function(function)]

    @property
    def _start(self) -> tuple[list[Statement], list[Statement]]:
        statements = self.program.start.statements
        places = [k for k, s in enumerate(statements) if isinstance(s, LookUp)]
        end = places[0] + 1 if places else len(statements)
        return statements[:end], statements[end:]

    def _memory(self, body: Body, indent: str) -> list[str]:
        return [
            f"{indent}{st_name(field)} := {self.writer.text(value)};"
            for field, value in body.results.items()
        ]

    def _statements(self, statements: Iterable[Statement], indent: str) -> list[str]:
        lines: list[str] = []
        for statement in statements:
            for line in self._statement(statement):
                if line or (lines and lines[-1]):
                    lines += wrapped(indent + line) if line else [""]
        return lines

    def _statement(self, statement: Statement) -> list[str]:
        text = self.writer.text
        match statement:
            case Heading(""):
                return [""]
            case Heading(words):
                return ["", f"(* {words} *)"]
            case LookUp(Name("x", _, "memory"), _):
                return []
            case LookUp(x, _):
                return [f"scheduled_x := {text(x)};"]
            case Assign(target, Choice(condition, yes, no)):
                return [
                    f"IF {text(condition)} THEN",
                    f"    {text(target)} := {text(yes)};",
                    "ELSE",
                    f"    {text(target)} := {text(no)};",
                    "END_IF;",
                ]
            case Assign(target, value):
                return [f"{text(target)} := {text(value)};"]
            case Count(target, place, last, condition):
                name = text(target)
                return [
                    f"{name} := 0;",
                    f"FOR {place.name} := 1 TO {last} DO",
                    f"    IF {text(condition)} THEN",
                    f"        {name} := {name} + 1;",
                    "    END_IF;",
                    "END_FOR;",
                ]
        raise NotImplementedError(repr(statement))

    def _constants(self, bodies: Iterable[Body]) -> list[str]:
        read = {p.name for body in bodies for p in read_by(body) if isinstance(p, Constant)}
        return [
            _declared(long_name(one.name), f"{self.real} := {self.writer.number(one.value)}", one)
            for one in self.program.constants
            if one.name in read
        ]

    def _variables(self, bodies: Iterable[Body]) -> list[str]:
        found: dict[str, str] = {}
        for body in bodies:
            for statement in body.statements:
                if isinstance(statement, Assign | Count):
                    kind = _KINDS.get(statement.target.kind, self.real)
                    name = self.writer.text(statement.target)
                    found.setdefault(name, _declared(name, kind, statement))
        return list(found.values())

    def _array(self, one: Described[np.ndarray]) -> list[str]:
        shape = ", ".join(f"0..{size - 1}" for size in one.value.shape)
        head = f"{one.name} : ARRAY[{shape}] OF {self.real} := ["
        said = f" (* {comment(one.unit, one.text)} *)"
        if one.value.ndim == 1:
            return [f"{head}{', '.join(map(self.writer.number, one.value))}];{said}"]
        rows = [", ".join(map(self.writer.number, row)) for row in one.value]
        return [f"{head}{said}", *(f"    {row}," for row in rows[:-1]), f"    {rows[-1]}", "];"]

    def _function(self, function: Function) -> list[str]:
        name = f"{self.writer.block}_{function.name}"
        constants, variables = self._constants([function.body]), self._variables([function.body])
        result: Expression = function.body.results[""]
        return [
            "",
            f"(* {function.text} *)",
            f"FUNCTION {name} : {self.real}",
            "VAR_INPUT",
            *(f"    {st_name(one.name)} : {self.real};" for one in function.parameters),
            "END_VAR",
            *_section("VAR", variables),
            *_section("VAR CONSTANT", constants),
            *self._statements(function.body.statements, ""),
            *self._statement(Assign(Name(name), result)),
            "END_FUNCTION",
        ]


def _section(kind: str, declarations: list[str]) -> list[str]:
    return [kind, *(f"    {line}" for line in declarations), "END_VAR"] if declarations else []


def _declared(name: str, kind: str, one: Described | Assign | Count) -> str:
    said = comment(one.unit, one.text)
    return f"{name} : {kind};" + (f" (* {said} *)" if said else "")
