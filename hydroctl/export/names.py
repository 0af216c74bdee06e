"""What settings of the law are called in generated code."""

from __future__ import annotations

from textwrap import wrap

WIDTH = 100
_LONG = {
    "Ts": "sample_time",
    "Tf": "derivative_filter_time",
    "Tm": "measurement_filter_time",
    "b": "reference_weight",
    "c": "derivative_weight",
    "zz": "zero_damping",
    "zp": "pole_damping",
}


def long_name(setting: str) -> str:
    """A name that explains itself, in small letters."""
    return _LONG.get(setting, setting)


def comment(unit: str, text: str) -> str:
    """What stands in a comment: unit and description; the unit 1 goes without saying."""
    return ", ".join(part for part in (unit if unit != "1" else "", text) if part)


def wrapped(line: str) -> list[str]:
    """A statement in lines that are not too long."""
    indent = " " * (len(line) - len(line.lstrip()))
    return wrap(
        line,
        WIDTH,
        subsequent_indent=f"{indent}    ",
        break_long_words=False,
        break_on_hyphens=False,
    )
