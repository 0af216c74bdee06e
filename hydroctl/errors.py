"""Error kinds. Every message names the field, the value and the way out."""

from __future__ import annotations

from collections.abc import Iterable
from difflib import get_close_matches

_LONGEST_NAME = 60
_LONGEST_VALUE = 60


class HydroctlError(Exception):
    """Base of every error that hydroctl raises on purpose."""


class InputError(HydroctlError, ValueError):
    """Something the user gave cannot be used. `faults` holds all of them, one sentence each."""

    def __init__(self, faults: str | Iterable[str]):
        self.faults = (faults,) if isinstance(faults, str) else tuple(faults)
        super().__init__("\n".join(self.faults))


class OperatingPointError(HydroctlError, ValueError):
    """A single operating point was asked for and there is none that a linear model can use."""


class InfeasibleError(HydroctlError):
    """No regulator meets the specification; the message says which limit, where, and what is
    feasible."""


class FailedChecksError(HydroctlError):
    """An export was refused, because what it would write fails checks; `checks` holds them."""

    def __init__(self, advice: str, checks: Iterable[str]):
        self.checks = tuple(checks)
        super().__init__("\n".join([advice, *self.checks]))


class SimulationError(HydroctlError, ArithmeticError):
    """A simulation could not be carried to its end; the message says when it stopped and why."""


def shown(value: object) -> str:
    """`repr(value)` for a message, cut where it is long; Python itself refuses to write out an
    integer of thousands of digits."""
    try:
        text = repr(value)
    except ValueError:
        return f"({type(value).__name__} too long to print)"
    return text if len(text) <= _LONGEST_VALUE else text[: _LONGEST_VALUE - 3] + "..."


def unknown_name(kind: str, name: object, known: Iterable[str]) -> str:
    """One sentence for a name that is not in `known`, with the nearest known name first; a long
    name is cut."""
    text, names = str(name), sorted(known)
    shown = text if len(text) <= _LONGEST_NAME else text[:_LONGEST_NAME] + "..."
    near = get_close_matches(shown, names, n=1)
    hint = f"did you mean {near[0]!r}?" if near else f"known: {', '.join(names)}."
    return f"{kind} {shown!r} is unknown; {hint}"
