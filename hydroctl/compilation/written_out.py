"""Functions that are written out from the fields of a record, for kernels: numba compiles a call
with every field named, but no loop over fields of different kinds."""

from __future__ import annotations

from collections.abc import Mapping
from types import FunctionType
from typing import Any


def maker(name: str, arguments: str, record: type, expressions: Mapping[str, str], **seen: Any):
    """A function of `arguments` that returns a `record` of these expressions, one for each field.

    `seen`: what the expressions see, `__name__` of the module that it is for among it; compiled,
    they see that module's names, which must hold the record, too.

    >>> from hydroctl.regulator.law import Memory
    >>> alike = dict.fromkeys(Memory._fields, "z")
    >>> maker("all_alike", "z", Memory, alike, __name__=__name__)(2.0).integral
    2.0
    """
    fields = ", ".join(f"{field}={expressions[field]}" for field in expressions)
    return _written(name, arguments, f"return {record.__name__}({fields})", seen, record)


def keeper(name: str, arguments: str, places: Mapping[str, str], **seen: Any) -> FunctionType:
    """A function of `arguments`, the last of which is a record, that puts each field at its
    place."""
    record = arguments.rpartition(",")[2].strip()
    body = "; ".join(f"{place} = {record}.{field}" for field, place in places.items())
    return _written(name, arguments, body, seen)


def _written(
    name: str, arguments: str, body: str, seen: Mapping[str, Any], *records: type
) -> FunctionType:
    names = dict(seen) | {record.__name__: record for record in records}
    exec(compile(f"def {name}({arguments}): {body}", __file__, "exec"), names)
    return names[name]
