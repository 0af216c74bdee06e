"""The law's own source, evaluated on names instead of numbers: what is done becomes statements.

Understood is the Python in which the law is written: assignments, returns, a loop that counts, and
guards (`if ...: return AT_REST`), which are the answer to a fault and left to the target. Functions
of the law that are called are written in place, with the names that the caller gives to what they
return; those in `apart` become functions of their own.
"""

from __future__ import annotations

import ast
import inspect
import io
import re
import textwrap
import tokenize
from collections.abc import Callable, Iterable
from contextlib import contextmanager
from functools import cache
from types import FunctionType
from typing import Any, NamedTuple

import numpy as np

from .folding import choice, known, lifted, negative, operation
from .statements import (
    Array,
    Assign,
    Body,
    Call,
    Choice,
    Count,
    Expression,
    Function,
    Heading,
    Item,
    Kind,
    LookUp,
    Name,
    Negative,
    Operation,
    Statement,
    kind_of,
)
from .tidying import MARK, tidied

_SIGNS = {
    ast.Add: "+",
    ast.Sub: "-",
    ast.Mult: "*",
    ast.Div: "/",
    ast.BitOr: "|",
    ast.BitAnd: "&",
    ast.Lt: "<",
    ast.LtE: "<=",
    ast.Gt: ">",
    ast.GtE: ">=",
    ast.Eq: "==",
    ast.NotEq: "!=",
}
_COMPUTED = (Operation, Negative, Choice, Call, Item)
_COMMENT = re.compile(r"#\s*(?:\[(?P<unit>[^\]]*)\])?\s*(?P<text>.*)")


class _Source(NamedTuple):
    tree: ast.FunctionDef
    comments: dict[int, str]
    """by line of the function"""


@cache
def _source_of(function: FunctionType) -> _Source:
    text = textwrap.dedent(inspect.getsource(function))
    tree = ast.parse(text).body[0]
    assert isinstance(tree, ast.FunctionDef)
    tokens = tokenize.generate_tokens(io.StringIO(text).readline)
    comments = {token.start[0]: token.string for token in tokens if token.type == tokenize.COMMENT}
    return _Source(tree, comments)


def heading_of(function: FunctionType) -> str:
    """The first paragraph of its docstring, in one line."""
    return " ".join((inspect.getdoc(function) or "").split("\n\n")[0].split())


def printed_name(function: FunctionType) -> str:
    """What a function is called in the target: a `step` after its structure."""
    module = function.__module__.rpartition(".")[2]
    return module if function.__name__ == "step" else function.__name__


class Trace:
    """The statements of one function of the target.

    apart: functions of the law that are not written in place. looked_up: the function that looks
    the gains up and the gains that it gives, where that is not written in place either. words: what
    stands for {m}, {kp}, ... in units.
    """

    def __init__(
        self,
        *,
        apart: Iterable[Callable] = (),
        looked_up: tuple[Callable, tuple] | None = None,
        words: dict[str, str],
        functions: dict[str, Function | Expression] | None = None,
    ):
        self.apart, self.looked_up, self.words = tuple(apart), looked_up, words
        self.functions = {} if functions is None else functions
        self.statements: list[Statement] = []

    def run(self, function: Callable, *arguments):
        """What the function returns; its statements are added. Functions of other modules have a
        heading where one of its own module calls them."""
        assert isinstance(function, FunctionType)
        self.module = function.__module__
        return _Frame(self, function, {}, "").run(arguments)

    def new_name(self, wanted: str, kind: Kind) -> Name:
        """A variable that wants to be called so; it gets its name when all are known."""
        return Name(f"{wanted}{MARK}{len(self.statements)}", kind)

    def assigned(self, wanted: str, value: Expression, comment: tuple[str, str] = ("", "")) -> Name:
        """A new variable of that value."""
        name = self.new_name(wanted, kind_of(value))
        self.statements.append(Assign(name, value, *comment))
        return name

    @contextmanager
    def under_heading(self, is_call: bool):
        """What a call returns is assigned before the heading of what was called ends."""
        last = self.statements[-1] if self.statements else None
        ends = is_call and isinstance(last, Heading) and not last.text
        if ends:
            self.statements.pop()
        yield
        if ends:
            self.statements.append(Heading(""))

    def measure(self, statements: list[Statement], unit: str) -> None:
        """Real numbers without a unit, on the way to one that has it, are in that unit."""
        for statement in statements:
            if isinstance(statement, Assign) and statement.target.kind == "real":
                statement.unit = statement.unit or unit

    def function(self, function: FunctionType, arguments: tuple):
        """A call of a function apart, which is traced on names of its own when first called."""
        tree = _source_of(function).tree
        given = [(place.arg, value) for place, value in zip(tree.args.args, arguments, strict=True)]
        name = printed_name(function)
        if name not in self.functions:
            own = [
                Name(parameter, place="parameter") if isinstance(value, Expression) else value
                for parameter, value in given
            ]
            parameters = tuple(value for value in own if isinstance(value, Name))
            inner = Trace(apart=self.apart, words=self.words, functions=self.functions)
            result = inner.run(function, *own)
            body = Body(inner.statements, {"": result})
            self.functions[name] = (
                result
                if known(result) is not None
                else Function(
                    name,
                    heading_of(function),
                    parameters,
                    tidied(body, [one.name for one in parameters]),
                )
            )
        made = self.functions[name]
        if not isinstance(made, Function):
            return made
        return Call(name, tuple(value for _, value in given if isinstance(value, Expression)))


class _Frame:
    """One call of a function of the law: its local names."""

    def __init__(self, trace: Trace, function: FunctionType, hints: dict, prefix: str):
        self.trace, self.function, self.prefix = trace, function, prefix
        self.source, self.hints = _source_of(function), hints
        self.names: dict = {}

    def run(self, arguments):
        for parameter, value in zip(self.source.tree.args.args, arguments, strict=True):
            self.names[parameter.arg] = (
                self.trace.assigned(self.final(parameter.arg), value)
                if isinstance(value, _COMPUTED) and not isinstance(value, Item)
                else value
            )
        for node in self.source.tree.body:
            if isinstance(node, ast.Return):
                return self.returned(node.value)
            self.statement(node)
        raise NotImplementedError(f"{self.function.__name__} returns nothing")

    def final(self, name: str) -> str:
        """What a local name is called in the target."""
        return self.hints.get(name, self.prefix + name)

    def statement(self, node: ast.stmt) -> None:
        match node:
            case ast.Expr(ast.Constant()):
                return
            case ast.If(body=[ast.Return(ast.Name("AT_REST"))]):
                return
            case ast.Assign([ast.Name(name)], value):
                before, comment = len(self.trace.statements), self.comment(node)
                made = self.value(value, [name])
                with self.trace.under_heading(isinstance(value, ast.Call)):
                    self.bind(name, made, comment)
                self.trace.measure(self.trace.statements[before:], comment[0])
            case ast.Assign([ast.Tuple(targets)], value):
                names = [target.id for target in targets if isinstance(target, ast.Name)]
                for name, part in zip(names, self.value(value, names), strict=True):
                    self.bind(name, part, ("", ""))
            case ast.For(
                ast.Name(place),
                ast.Call(args=[first, last]),
                [ast.AugAssign(ast.Name(name), ast.Add(), condition)],
            ):
                self.count(name, place, self.value(first), self.value(last), condition)
            case _:
                raise NotImplementedError(f"{self.function.__name__}: {ast.unparse(node)}")

    def returned(self, node):
        if isinstance(node, ast.IfExp):
            node = node.body
        if isinstance(node, ast.Tuple):
            return tuple(self.value(part) for part in node.elts)
        return self.value(node, list(self.hints.get("", ())))

    def comment(self, node: ast.stmt) -> tuple[str, str]:
        """(unit, text) of the comment behind an assignment."""
        found = _COMMENT.match(self.source.comments.get(node.end_lineno or 0, "#"))
        unit, text = (found["unit"] or "", found["text"]) if found else ("", "")
        return unit.format(**self.trace.words), text

    def bind(self, name: str, value, comment: tuple[str, str]) -> None:
        if isinstance(value, _COMPUTED):
            value = self.trace.assigned(self.final(name), value, comment)
        elif isinstance(value, Name) and any(comment):
            for statement in self.trace.statements:
                if isinstance(statement, Assign | Count) and statement.target == value:
                    statement.unit = statement.unit or comment[0]
                    statement.text = statement.text or comment[1]
        self.names[name] = value

    def count(self, name: str, place: str, first, last: int, condition: ast.expr) -> None:
        """The loop that counts, from 0, the places for which a condition holds."""
        assert (known(first), known(self.names[name])) == (1, 0)
        self.names[place] = Name("k", "int")
        target = self.trace.new_name(self.final(name), "int")
        count = Count(target, self.names[place], last - 1, self.value(condition))
        self.trace.statements.append(count)
        self.names[name] = target

    def value(self, node, targets: Iterable[str] = ()):
        """What an expression comes to; targets: the names that it is assigned to."""
        match node:
            case ast.Constant(value):
                return lifted(value) if not isinstance(value, bool) else value
            case ast.Name(name):
                return self.names[name] if name in self.names else self.outside(name)
            case ast.Attribute(owner, name):
                return _attribute(self.value(owner), name)
            case ast.Subscript(owner, index):
                return _item(self.value(owner), self.value(index))
            case ast.Tuple(parts):
                return tuple(self.value(part) for part in parts)
            case ast.UnaryOp(ast.USub(), inner):
                return negative(self.value(inner))
            case ast.BinOp(left, sign, right):
                return operation(_SIGNS[type(sign)], self.value(left), self.value(right))
            case ast.Compare(left, [sign], [right]):
                return operation(_SIGNS[type(sign)], self.value(left), self.value(right))
            case ast.Call(called):
                return self.call(self.value(called), node, list(targets))
        raise NotImplementedError(f"{self.function.__name__}: {ast.unparse(node)}")

    def outside(self, name: str):
        """What a global name of the law's source stands for."""
        value = self.function.__globals__[name]
        return lifted(value) if isinstance(value, int | float) else value

    def call(self, called: Callable, node: ast.Call, targets: list[str]):
        if called is np.where:
            return choice(*map(self.value, node.args))
        if called in (np.sqrt, np.tan):
            return Call(called.__name__, tuple(map(self.value, node.args)))
        if isinstance(called, type):
            return called(**dict(map(self.named, node.keywords)))
        assert isinstance(called, FunctionType)
        arguments = tuple(map(self.value, node.args))
        if called in self.trace.apart:
            return self.trace.function(called, arguments)
        if self.trace.looked_up is not None and called is self.trace.looked_up[0]:
            self.trace.statements.append(LookUp(*arguments[:2]))
            return self.trace.looked_up[1]
        return self.in_place(called, arguments, [self.final(name) for name in targets])

    def named(self, key: ast.keyword) -> tuple[str, Any]:
        """(the field, what it comes to) of what is returned, under a name of its own."""
        assert key.arg is not None
        value = self.value(key.value, [key.arg])
        if isinstance(value, _COMPUTED):
            with self.trace.under_heading(isinstance(key.value, ast.Call)):
                return key.arg, self.trace.assigned(self.final(key.arg), value)
        return key.arg, value

    def in_place(self, called: FunctionType, arguments: tuple, targets: list[str]):
        """The statements of a function, with the names in `targets` for what it returns."""
        returned = _source_of(called).tree.body[-1]
        assert isinstance(returned, ast.Return)
        parts = returned.value.elts if isinstance(returned.value, ast.Tuple) else [returned.value]
        hints: dict = {"": targets}
        if len(parts) == len(targets):
            hints |= {target: target for target in targets} | {
                part.id: target
                for part, target in zip(parts, targets, strict=True)
                if isinstance(part, ast.Name)
            }
        prefix = self.prefix
        if targets and self.is_repeated(called):
            prefix = f"{targets[-1]}_"
        headed = self.function.__module__ == self.trace.module != called.__module__
        if headed:
            self.trace.statements.append(Heading(heading_of(called)))
        result = _Frame(self.trace, called, hints, prefix).run(arguments)
        if headed:
            self.trace.statements.append(Heading(""))
        return result

    def is_repeated(self, called: FunctionType) -> bool:
        """Whether this function calls `called` more than once."""
        calls = [node for node in ast.walk(self.source.tree) if isinstance(node, ast.Call)]
        names = [ast.unparse(call.func) for call in calls]
        mine = [n for n in names if n.rpartition(".")[2] == called.__name__]
        return any(mine.count(name) > 1 for name in mine if self._is(name, called))

    def _is(self, dotted: str, called: FunctionType) -> bool:
        value = self.function.__globals__.get(dotted.partition(".")[0])
        for part in dotted.split(".")[1:]:
            value = getattr(value, part, None)
        return value is called


def _attribute(owner, name: str):
    if isinstance(owner, Array):
        return owner.values.shape if name == "shape" else owner.values.size
    return getattr(owner, name)


def _item(owner, index):
    places = index if isinstance(index, tuple) else (index,)
    numbers = [known(place) if not isinstance(place, int) else place for place in places]
    if isinstance(owner, Tables):
        return owner.item(places[:2], numbers[2])
    if isinstance(owner, tuple):
        return owner[numbers[0]]
    assert isinstance(owner, Array)
    sizes = owner.values.shape
    return Item(
        owner,
        tuple(
            place if number is None else lifted(number % size)
            for place, number, size in zip(places, numbers, sizes, strict=True)
        ),
    )


class Tables(NamedTuple):
    """The tables of the gains as the law reads them: the last index is the gain; a table of zeros
    is 0."""

    arrays: tuple[Array, ...]
    shape: tuple[int, int]

    def item(self, places: tuple, gain: int):
        """The gain at two places."""
        array = self.arrays[gain]
        return Item(array, places) if np.any(array.values) else lifted(0.0)
