"""The law of one schedule as formulas: plain values that any program can evaluate."""

from __future__ import annotations

from typing import ClassVar

from .law import MEMORY, inputs_read
from .prepared import regulator_of
from .printing.program import Described, described, program_of, setting_names
from .printing.statements import Assign, Body, Count, Name, Number, replaced
from .printing.writing import Writer
from .scheduled import ScheduledRegulator
from .units import MEASURED_UNITS

FALLBACK = (
    "where an input that is read, or a number of the memory after the sample, is not finite, "
    "x = 0, and the memory is at rest"
)
INPUTS = {
    "reference": "[{m}] what is wanted of the measured quantity",
    "v_ref": "[m/s] speed of the reference, for the feed-forward; 0 at rest",
    "p_a": "[Pa] pressure in the cap side",
    "p_b": "[Pa] pressure in the rod side",
    "v": "[m/s] measured speed",
    "y": "[m] measured position",
}


class _Formulas(Writer):
    """JavaScript, of which the formulas use a small part. The memory's x is `last_x`."""

    signs: ClassVar = {"|": "||", "&": "&&"}

    def name(self, name: Name) -> str:
        return "last_x" if (name.name, name.place) == ("x", "memory") else name.name


_WRITER = _Formulas(repr)


def law_formulas(scheduled: ScheduledRegulator) -> dict:
    """The whole law that runs `scheduled`, of plain types.

    "inputs" that are read, "constants", "arrays" and "memory" with names, units and values (those
    of the memory at rest); "sample" and "start", each with "statements" {name, unit, expression,
    description} to be evaluated in this order, "memory", what it is afterwards, and "output", the
    command; "fallback", what a fault leads to. A start, with the inputs of the next sample and the
    command `start_x` to go on from, gives the memory for that sample. Expressions are JavaScript:
    numbers, names, + - * /, comparisons, || &&, ?:, sqrt(), tan(), array[i][j]. Raises InputError
    for a regulator that the law cannot run.
    """
    regulator = regulator_of(scheduled)
    measured = MEASURED_UNITS[scheduled.measured]
    taken = (*INPUTS, *MEMORY, *setting_names())
    program = program_of(regulator, apart=(), taken=set(taken) - {"x"})
    return {
        "measured": scheduled.measured,
        "inputs": [
            _entry(described(name, INPUTS[name], {"m": measured}))
            for name in inputs_read(regulator)
        ],
        "constants": [_entry(one) | {"value": one.value} for one in program.constants],
        "arrays": [_entry(one) | {"values": one.value.tolist()} for one in program.arrays],
        "memory": [
            *(_entry(one) | {"rest": one.value} for one in program.memory),
            {"name": "last_x", "unit": "1", "description": "the last command", "rest": 0.0},
            {"name": "running", "unit": "", "description": MEMORY["running"], "rest": 0.0},
        ],
        "sample": _body(program.sample),
        "start": _body(program.start),
        "fallback": FALLBACK,
    }


def _entry(one: Described) -> dict:
    return {"name": one.name, "unit": one.unit, "description": one.text}


def _body(body: Body) -> dict:
    memory = {name: _WRITER.text(value) for name, value in body.results.items()}
    return {
        "statements": [_statement(s) for s in body.statements if isinstance(s, Assign | Count)],
        "memory": {n: t for n, t in memory.items() if n != "x"}
        | {"last_x": memory["x"], "running": "1.0"},
        "output": memory["x"],
    }


def _statement(statement: Assign | Count) -> dict:
    return {
        "name": statement.target.name,
        "unit": statement.unit,
        "expression": _WRITER.text(statement.value)
        if isinstance(statement, Assign)
        else _counted(statement),
        "description": statement.text,
    }


def _counted(count: Count) -> str:
    """The sum over all places; a true comparison counts 1."""
    terms = (
        f"({_WRITER.text(replaced(count.condition, {count.place: Number(k)}))})"
        for k in range(1, count.last + 1)
    )
    return " + ".join(("0", *terms))
