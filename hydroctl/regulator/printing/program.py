"""The law of one schedule as statements: the lookup of its gains, a sample, a start."""

from __future__ import annotations

import re
from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from functools import partial
from typing import Any, Generic, TypeVar

import numpy as np

from .. import clipping, compensation, feed_forward, gains, law
from ..units import GAIN_UNITS, MEASURED_UNITS
from .folding import known
from .statements import (
    Array,
    Assign,
    Body,
    Call,
    Constant,
    Expression,
    Function,
    Item,
    Name,
    Number,
    all_parts,
    read_by,
)
from .tidying import tidied
from .tracing import Tables, Trace

APART = (clipping.within, feed_forward.step, compensation.step)
"""Functions that a sample and a start share."""
TABLES = ("kp", "ki", "kd", "notch_frequency")
ARRAYS = {"x": "x_nodes", "y": "y_nodes"}
"""arrays whose name is that of a signal, too"""
_TEXT = re.compile(r"(?:\[(?P<unit>[^\]]*)\] )?(?P<text>.*)")
Value = TypeVar("Value", float, np.ndarray)


@dataclass(frozen=True)
class Described(Generic[Value]):
    """A constant, an array or a number of the memory, with its unit and what it is."""

    name: str
    unit: str
    text: str
    value: Value


@dataclass(frozen=True)
class Program:
    """The law of one schedule. A body's results are the gains, or the memory by field."""

    look_up: Body | None
    """x and y to gains; None: written in place"""
    sample: Body
    start: Body
    functions: tuple[Function, ...]
    constants: tuple[Described[float], ...]
    """those that are read"""
    arrays: tuple[Described[np.ndarray], ...]
    memory: tuple[Described[float], ...]
    """the fields that act, besides x and running; their values at rest"""

    @property
    def bodies(self) -> list[Body]:
        """All of them, those of the functions included."""
        own = [function.body for function in self.functions]
        return [*own, *([self.look_up] if self.look_up else []), self.sample, self.start]


def program_of(
    regulator: law.Regulator,
    *,
    apart: Collection[Callable] = (*APART, gains.gains_at),
    taken: Collection[str] = (),
) -> Program:
    """The law that runs `regulator`.

    apart: what is not written in place, but as functions of their own, or, of the gains, as a
    lookup. taken: names that the target uses otherwise.
    """
    signal = "y" if regulator.position else "v"
    words = {"m": MEASURED_UNITS[signal], **GAIN_UNITS[signal]}
    settings = symbolic(regulator)
    inputs = {n: Name(n, place="input") for n in ("reference", "v_ref", "p_a", "p_b", "v", "y")}
    used = tuple(
        Name(name, place="gain") if np.any(regulator.table[..., k]) else Constant(name, 0.0)
        for k, name in enumerate(TABLES)
    )
    functions: dict = {}
    own = [function for function in apart if function is not gains.gains_at]
    trace = partial(Trace, words=words, apart=own, functions=functions)
    look_up = None
    if gains.gains_at in apart:
        look_up = _look_up(trace(), settings, taken)
        trace = partial(trace, looked_up=(gains.gains_at, used))
    measured = tuple(inputs[name] for name in ("p_a", "p_b", "v", "y"))
    given = (inputs["reference"], inputs["v_ref"], measured)
    sample, acting = _sample(trace, given, settings, taken)
    start = trace()
    new = start.run(law.start, Name("start_x", place="input"), *given, settings)
    made = tidied(Body(start.statements, _fields(new, acting)), taken)
    program = Program(
        look_up,
        _with_texts(sample, words),
        _with_texts(made, words),
        _called(functions, [look_up, sample, made]),
        (),
        (),
        tuple(described(n, law.MEMORY[n], words, 0.0) for n in acting if n != "x"),
    )
    return _with_what_is_read(program, words)


def _sample(trace, given: tuple, settings, taken) -> tuple[Body, list[str]]:
    """(a sample, the fields of the memory that act on the command).

    A field that no sample ever changes from rest is 0.
    """
    still: set[str] = set()
    while True:
        before = law.Memory(
            **{
                field: Number(0.0) if field in still else Name(field, place="memory")
                for field in law.MEMORY
            }
        )
        made = trace()
        new = made.run(law.sample, *given, before, settings)
        unchanged = {f for f in law.MEMORY if known(getattr(new, f)) == 0 and f != "running"}
        if unchanged <= still:
            break
        still |= unchanged
    acting = {"x"}
    while True:
        body = tidied(Body(made.statements, _fields(new, acting)), taken)
        read = {
            part.name for part in read_by(body) if isinstance(part, Name) and part.place == "memory"
        }
        if read <= acting | {"running"}:
            return body, [field for field in law.MEMORY if field in acting]
        acting |= read - {"running"}


def _called(functions: dict, bodies: list[Body | None]) -> tuple[Function, ...]:
    """The functions that any of the bodies calls, each after those that it calls itself."""
    found: dict[str, Function] = {}
    for body in bodies:
        for part in all_parts(body) if body else ():
            if isinstance(part, Call) and isinstance(
                made := functions.get(part.function), Function
            ):
                found |= {one.name: one for one in _called(functions, [made.body])}
                found[made.name] = made
    return tuple(found.values())


def _with_texts(body: Body, words: dict) -> Body:
    """What a new number of the memory is, where its own statement does not say."""
    for field, value in body.results.items():
        text = described(field, law.MEMORY[field], words)
        for statement in body.statements:
            if isinstance(statement, Assign) and statement.target == value and not statement.unit:
                statement.unit, statement.text = text.unit, statement.text or text.text
    return body


def _fields(memory: law.Memory, acting) -> dict[str, Expression]:
    return {field: getattr(memory, field) for field in law.MEMORY if field in acting}


def _look_up(trace: Trace, settings, taken) -> Body:
    place = (Name("x", place="looked up"), Name("y", place="looked up"))
    found = trace.run(gains.gains_at, *place, settings)
    used = {name: e for name, e in zip(TABLES, found, strict=True) if known(e) is None}
    return tidied(Body(trace.statements, used), ("x", "y", *taken))


def symbolic(regulator: law.Regulator) -> law.Regulator:
    """The regulator with names in the place of its numbers; truth values stay."""
    made: dict[str, Any] = {}
    for name, value in regulator._asdict().items():
        if isinstance(value, np.ndarray) and value.ndim < 3:
            made[name] = Array(ARRAYS.get(name, name), value)
        elif isinstance(value, float):
            made[name] = Constant(name, value)
        else:
            made[name] = value
    tables = tuple(Array(f"{name}_table", regulator.table[..., k]) for k, name in enumerate(TABLES))
    made["table"] = Tables(tables, regulator.table.shape[:2])
    made["sections"] = tuple(
        (Constant(f"zero_{k + 1}", zero), Constant(f"pole_{k + 1}", pole))
        for k, (zero, pole) in enumerate(regulator.sections)
    )
    machine: dict[str, Any] = {
        name: Constant(name, value) for name, value in regulator.compensation._asdict().items()
    }
    made["compensation"] = compensation.Compensation(**machine)
    return law.Regulator(**made)


def described(name: str, text: str, words: dict, value: Any = 0.0) -> Described[Any]:
    """`text` taken apart: "[unit] what it is"."""
    found = _TEXT.fullmatch(text)
    assert found is not None
    return Described(name, (found["unit"] or "").format(**words), found["text"], value)


def setting_names() -> tuple[str, ...]:
    """Names of all constants and arrays."""
    return tuple(_texts())


def _texts() -> dict[str, str]:
    """What every constant and array is."""
    sections = {
        f"{end}_{k}": f"[1] {end} of lead-lag section {k}, times the notch frequency"
        for k in (1, 2)
        for end in ("zero", "pole")
    }
    tables = {
        "kp_table": "[{kp}] proportional gain",
        "ki_table": "[{ki}] integral gain",
        "kd_table": "[{kd}] derivative gain",
        "notch_frequency_table": "[rad/s] of the notch and the lead-lag sections",
    }
    own = {ARRAYS.get(name, name): text for name, text in law.SETTINGS.items()}
    return own | compensation.MACHINE | sections | tables


def _with_what_is_read(program: Program, words: dict) -> Program:
    """The program with the constants and arrays that any of its bodies reads."""
    read = set().union(*map(read_by, program.bodies))
    texts = _texts()
    constants = {part.name: part.value for part in read if isinstance(part, Constant)}
    arrays = {part.array.name: part.array.values for part in read if isinstance(part, Item)}

    def listed(values: dict) -> tuple[Described[Any], ...]:
        order = [name for name in texts if name in values]
        return tuple(described(name, texts[name], words, values[name]) for name in order)

    return replace(program, constants=listed(constants), arrays=listed(arrays))
