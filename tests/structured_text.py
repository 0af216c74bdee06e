"""A small interpreter of structured text: what blark parses is turned into Python and run.

It knows the part of IEC 61131-3 that the exported function blocks use, and refuses everything else
by name: an export that strays from that part fails its tests.
"""

from __future__ import annotations

import math
import re
from types import SimpleNamespace

import numpy as np
from blark.parse import parse_source_code

FUNCTIONS = {
    "abs": abs,
    "limit": lambda lowest, value, highest: min(max(value, lowest), highest),
    "max": max,
    "min": min,
    "sel": lambda condition, no, yes: yes if condition else no,
    "sqrt": np.sqrt,
    "tan": np.tan,
}
TYPES = {"lreal": float, "real": np.float32, "int": int, "udint": int, "bool": bool}
OPERATORS = {"=": "==", "<>": "!=", "and": "and", "or": "or"} | {
    sign: sign for sign in ("+", "-", "*", "/", "<", "<=", ">", ">=")
}


def load(source: str, name: str):
    """A class: the function block `name`. An instance holds every variable as an attribute, in
    lower case, and is called to run."""
    units = parse_source_code(without_comments(source)).transform().items
    functions = dict(FUNCTIONS)
    for unit in units:
        if type(unit).__name__ == "Function":
            functions[unit.name.lower()] = _function(unit, functions)
    (block,) = (unit for unit in units if type(unit).__name__ == "FunctionBlock")
    assert block.name == name
    return lambda: _Instance(block, functions)


def without_comments(source: str) -> str:
    """The same program without comments and spare blanks: the parser's time grows with every
    character."""
    bare = re.sub(r"\(\*.*?\*\)", " ", source, flags=re.DOTALL)
    return re.sub(r"\s*([^\w.\s])\s*", r"\1", re.sub(r"\s+", " ", bare)).strip()


class _Instance:
    def __init__(self, unit, functions):
        declared = _declared(unit)
        self.m = SimpleNamespace(**declared)
        self._run = _compiled(unit.body, functions, declared)

    def __call__(self, **inputs):
        for name, value in inputs.items():
            setattr(self.m, name, type(getattr(self.m, name))(value))
        with np.errstate(invalid="ignore"):
            self._run(self.m)


def _function(unit, functions):
    inputs = [
        variable.variable.name.lower()
        for item in unit.declarations[0].items
        for variable in item.variables
    ]
    declared = _declared(unit)
    body = _compiled(unit.body, functions, declared)

    def call(*values):
        m = SimpleNamespace(**declared, **{unit.name.lower(): None})
        for name, value in zip(inputs, values, strict=True):
            setattr(m, name, value)
        body(m)
        return getattr(m, unit.name.lower())

    return call


def _declared(unit) -> dict:
    values = {}
    for group in unit.declarations:
        for item in group.items:
            for variable in item.variables:
                name = variable.variable.name.lower()
                assert name not in values, f"{name} is declared twice"
                values[name] = _initial(item.init)
    return values


def _initial(init):
    if type(init).__name__ == "TypeInitialization":
        kind = TYPES[init.spec.type.lower()]
        return kind(0) if init.value is None else kind(eval(_expression(init.value)))
    shape = [int(edge.stop.value) - int(edge.start.value) + 1 for edge in init.spec.subranges]
    assert all(edge.start.value == "0" for edge in init.spec.subranges)
    values = [TYPES[init.spec.type.type_name.lower()](value) for value in _flat(init.value)]
    assert len(values) == math.prod(shape), f"{len(values)} values for an array of {shape}"
    return (
        values
        if len(shape) == 1
        else [values[k * shape[1] : (k + 1) * shape[1]] for k in range(shape[0])]
    )


def _flat(array):
    for part in array.elements:
        assert getattr(part, "count", None) is None
        if type(part.element).__name__ == "ArrayInitialization":
            yield from _flat(part.element)
        else:
            yield eval(_expression(part.element))


def _compiled(body, functions, declared):
    names = {f"f_{name}": function for name, function in functions.items()} | {"real": np.float32}
    reals = {f"m.{name}" for name, value in declared.items() if isinstance(value, np.float32)}
    exec("def run(m):\n" + "\n".join(_statements(body, 1, reals)), names)
    return names["run"]


def _statements(body, depth, reals):
    """Lines of Python; what is assigned to one of the variables `reals` is rounded to single
    precision."""
    indent = "    " * depth
    for node in body.statements if body else ():
        match type(node).__name__:
            case "AssignmentStatement":
                (variable,) = node.variables
                target, value = _expression(variable), _expression(node.expression)
                yield f"{indent}{target} = {f'real({value})' if target in reals else value}"
            case "IfStatement":
                yield f"{indent}if {_expression(node.if_expression)}:"
                yield from _statements(node.statements, depth + 1, reals)
                for clause in node.else_ifs:
                    yield f"{indent}elif {_expression(clause.if_expression)}:"
                    yield from _statements(clause.statements, depth + 1, reals)
                if node.else_clause:
                    yield f"{indent}else:"
                    yield from _statements(node.else_clause.statements, depth + 1, reals)
            case "ForStatement":
                assert node.step is None
                control = _expression(node.control)
                yield (
                    f"{indent}for {control} in range({_expression(node.from_)},"
                    f" {_expression(node.to)} + 1):"
                )
                yield from _statements(node.statements, depth + 1, reals)
            case "ReturnStatement":
                yield f"{indent}return"
            case other:
                raise NotImplementedError(other)


def _expression(node) -> str:
    match type(node).__name__:
        case "SimpleVariable":
            return f"m.{node.name.lower()}"
        case "MultiElementVariable":
            (subscripts,) = node.elements
            return _expression(node.name) + "".join(
                f"[{_expression(index)}]" for index in subscripts.subscripts
            )
        case "Real" | "Integer":
            return str(node.value)
        case "Boolean":
            return str(node.value).capitalize()
        case "UnaryOperation":
            return f"({'not ' if node.op.lower() == 'not' else node.op}{_expression(node.expr)})"
        case "BinaryOperation":
            return (
                f"({_expression(node.left)} {OPERATORS[node.op.lower()]} {_expression(node.right)})"
            )
        case "ParenthesizedExpression":
            return f"({_expression(node.expr)})"
        case "FunctionCall":
            given = ", ".join(_expression(one.value) for one in node.parameters)
            return f"f_{node.name.name.lower()}({given})"
        case other:
            raise NotImplementedError(other)
