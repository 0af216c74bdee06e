"""Text that goes into generated files: templates, numbers, and names that come from files."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from ..errors import InputError

REALS = ("double", "float")
_HARMLESS = frozenset(
    "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789 .,;:+-/=%()[]_@#'^<>!&|"
)
_IDENTIFIER = re.compile(r"[A-Za-z][A-Za-z0-9]*(_[A-Za-z0-9]+)*")
_RESERVED = re.compile(
    "abs|action|and|any|array|at|begin|bool|by|byte|case|configuration|const|constant|"
    "continue|date|dint|do|dt|dword|else|elsif|end|exit|false|for|from|function|global|if|in|"
    "initial|int|interface|internal|limit|lint|lreal|lword|max|method|min|mod|mux|namespace|"
    "not|null|of|on|or|output|override|overlap|pointer|program|protected|public|private|real|"
    "ref|reference|repeat|resource|retain|return|sel|signed|single|sint|sqrt|step|string|"
    "struct|super|tan|task|then|this|time|tod|to|transition|true|type|udint|uint|ulint|until|"
    "using|usint|var|while|with|word|wstring|xor",
    re.IGNORECASE,
)
"""Words of structured text, which knows no case. Names in C carry the given name as a prefix and
cannot collide."""


def harmless(text: str) -> str:
    """`text` in letters, digits and signs that can end no comment, string or line in any target;
    the rest as <U+002A>."""
    return "".join(sign if sign in _HARMLESS else f"<U+{ord(sign):04X}>" for sign in text)


def identifier(name: str) -> str:
    """`name` itself, fit to name things in C and in structured text. Raises InputError where it is
    not."""
    if not _IDENTIFIER.fullmatch(name) or _RESERVED.fullmatch(name) or len(name) > 40:
        raise InputError(
            f"{name!r} cannot name a function block or a C function: begin with a letter, go on"
            " with letters, digits and single underscores, at most 40 of them, and take no word of"
            " structured text."
        )
    return name


def shortest(value: float, real: str) -> str:
    """The shortest decimal number, with a point, that reads back to `value` in double or float."""
    text = str(np.float32(value) if real == "float" else float(value))
    mantissa, _, exponent = text.partition("e")
    if "." not in mantissa:
        mantissa += ".0"
    return f"{mantissa}e{int(exponent)}" if exponent else mantissa


def render(template: str, *, filters: dict, **values) -> bytes:
    """The template of that file name, filled in."""
    import jinja2

    loader = jinja2.FileSystemLoader(Path(__file__).parent / "templates")
    environment = jinja2.Environment(
        loader=loader,
        undefined=jinja2.StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,
    )
    environment.filters.update(filters)
    return environment.get_template(template).render(values).encode("ascii")
