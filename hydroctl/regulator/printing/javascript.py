"""The law of one schedule in JavaScript."""

from __future__ import annotations

import json
from typing import ClassVar

from .. import law
from .program import Program, program_of, setting_names
from .statements import Assign, Body, Call, Count, Function, Heading, LookUp, Name, Statement
from .writing import Writer

_PLACES = {"input": "input.", "memory": "memory.", "gain": "gains."}


class _JavaScript(Writer):
    signs: ClassVar = {"|": "||", "&": "&&"}

    def name(self, name: Name) -> str:
        return _PLACES.get(name.place, "") + name.name

    def call(self, call: Call) -> str:
        native = call.function in ("sqrt", "tan")
        return f"{'Math.' if native else ''}{super().call(call)}"

    def not_started(self) -> str:
        return "memory.running === 0"


_WRITER = _JavaScript(repr)


def javascript_of(regulator: law.Regulator) -> str:
    """The body of a function that returns the law: `rest`, the memory at rest; `lookUp(x, y)`, the
    gains; `sample(memory, input, gains)` and `start(input)`, the memory after a sample and from
    which the next sample goes on.

    input: {reference, v_ref, p_a, p_b, v, y, start_x}; gains are looked up where none are given.
    The memory's x is the command. Inputs must be finite.
    """
    program = program_of(regulator, taken=setting_names())
    assert program.look_up is not None
    rest = {one.name: 0.0 for one in program.memory} | {"x": 0.0, "running": 0.0}
    looked_up = "gains = lookUp(memory.x, input.y)"
    lines = [
        *_settings(program),
        f"const rest = {json.dumps(rest)};",
        *(line for function in program.functions for line in _own(function)),
        *_function("lookUp(x, y)", program.look_up, {}),
        *_function(f"sample(memory, input, {looked_up})", program.sample, {"running": "1"}),
        *_function("start(input)", program.start, {"running": "1"}),
        "return { rest, lookUp, sample, start };",
    ]
    return "\n".join(lines)


def _settings(program: Program) -> list[str]:
    arrays = ((one.name, json.dumps(one.value.tolist())) for one in program.arrays)
    numbers = ((one.name, repr(one.value)) for one in program.constants)
    return [f"const {name} = {value};" for name, value in (*numbers, *arrays)]


def _function(head: str, body: Body, more: dict[str, str]) -> list[str]:
    results = {name: _WRITER.text(value) for name, value in body.results.items()} | more
    given = (name if name == text else f"{name}: {text}" for name, text in results.items())
    return [
        f"function {head} {{",
        *(f"  {line}" for statement in body.statements for line in _statement(statement)),
        f"  return {{ {', '.join(given)} }};",
        "}",
    ]


def _own(function: Function) -> list[str]:
    given = ", ".join(one.name for one in function.parameters)
    return [
        f"// {function.text}",
        f"function {function.name}({given}) {{",
        *(f"  {line}" for statement in function.body.statements for line in _statement(statement)),
        f"  return {_WRITER.text(function.body.results[''])};",
        "}",
    ]


def _statement(statement: Statement) -> list[str]:
    text = _WRITER.text
    match statement:
        case Heading(words):
            return [f"// {words}"] if words else []
        case LookUp(Name("x", _, "memory"), _) | LookUp(is_read=False):
            return []
        case LookUp(x, y):
            return [f"const gains = lookUp({text(x)}, {text(y)});"]
        case Assign(target, value):
            return [f"const {target.name} = {text(value)};"]
        case Count(target, place, last, condition):
            counted = f"if ({text(condition)}) {target.name}++;"
            return [
                f"let {target.name} = 0;",
                f"for (let {place.name} = 1; {place.name} <= {last}; {place.name}++) {counted}",
            ]
    raise NotImplementedError(repr(statement))
