"""Older versions of the schedule file, brought up to the present one. What a version added is
neutral in older files."""

from __future__ import annotations

from itertools import pairwise
from typing import Any, Final

from ..errors import InputError, shown
from .proof import UNCHECKED

VERSION: Final = 4

_START = "m_f = m, g_previous = (c - 1)*m, all other states 0"
_NOT_FINITE = "is not finite, x = 0, and the next sound sample is a start"
_CONTROLLER_OF_2: dict[str, Any] = {
    "measurement_filter_time": {"value": 0.0, "unit": "s"},
    "lead_lag": [],
    "pressure_compensation": None,
    "dead_band_inverse": 0.0,
    "start": _START,
    "fallback": f"where an input {_NOT_FINITE}",
}
_SENTENCES = {
    "integral": ("forward Euler, stored in units of x",),
    "notch": ("Tustin prewarped at notch_frequency",),
    "anti_windup": ("back-calculation from the saturated x, after the notch",),
    "start": (_START,),
    "fallback": (f"where an input {_NOT_FINITE}", f"where an input, a state or x {_NOT_FINITE}"),
}
"""what files before version 4 say of the law; there was no other"""
_DERIVATIVE_ON = {
    "backward Euler, on the error": "error",
    "backward Euler, on the measurement": "measurement",
}
_COLUMNS = (
    "start, reference, v_ref, p_a, p_b, v, y, kp, ki, kd, "
    "notch_frequency (0 where the law has no use for it), x"
)
_SIGNALS = {"x": "previous_x", "y": "y"}


def upgraded(data: dict[str, Any]) -> dict[str, Any]:
    """The content of a schedule file as one of VERSION. Raises InputError for an unknown version,
    and for an older file that is not as its version has it."""
    version: Any = data.get("version")
    if isinstance(version, bool) or version not in range(1, VERSION + 1):
        raise InputError(
            f"version {version!r} is unknown; only 1 to {VERSION} can be read. Update hydroctl."
        )
    if version >= 3 and data.get("fingerprint", "") is None:
        raise InputError(
            f"fingerprint is null, but a file of version {version} has one; it was changed after it"
            " was written."
        )
    if version == VERSION:
        return data
    if version < 3:
        data = _of_version_3(data, version)
    try:
        return _of_version_4(data)
    except (KeyError, TypeError, ValueError, AttributeError, ZeroDivisionError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(
            f"not as a file of version {version} is ({type(error).__name__}: {error}); it was "
            "changed after it was written."
        ) from None


def _of_version_3(data: dict[str, Any], version: int) -> dict[str, Any]:
    controller = data.get("controller")
    if version == 1 and isinstance(controller, dict):
        data = data | {"controller": _CONTROLLER_OF_2 | controller}
    added = {"failed_checks": [UNCHECKED], "test_vectors": None, "fingerprint": None}
    if later := sorted(added.keys() & data.keys()):
        raise InputError(
            f"{later[0]} does not belong in a file of version {version}; the version was changed."
        )
    return data | added


def _of_version_4(data: dict[str, Any]) -> dict[str, Any]:
    design = {name: value for name, value in data["design"].items() if name != "achieved"}
    vectors = data["test_vectors"]
    if vectors is not None:
        _require("test_vectors.columns", vectors["columns"], (_COLUMNS,))
        names = [name.split(" ")[0] for name in _COLUMNS.split(", ")]
        vectors = vectors | {"columns": names}
    return data | {
        "version": VERSION,
        "controller": _controller(data["controller"]),
        "scheduling": _scheduling(data["scheduling"]),
        "design": design,
        "law": None,
        "proof": None,
        "failed_checks": [{"description": text} for text in data["failed_checks"]],
        "test_vectors": vectors,
    }


def _controller(old: dict[str, Any]) -> dict[str, Any]:
    for name, texts in _SENTENCES.items():
        _require(f"controller.{name}", old[name], texts)
    _require("controller.derivative", old["derivative"], tuple(_DERIVATIVE_ON))
    new = {
        name: value
        for name, value in old.items()
        if name not in (*_SENTENCES, "law", "derivative", "pressure_compensation")
    }
    ratio = old["pressure_compensation"]
    if ratio is not None:
        ratio = {name: value for name, value in ratio.items() if name != "ratio"}
    on = _DERIVATIVE_ON[old["derivative"]]
    return new | {"derivative_on": on, "pressure_compensation": ratio}


def _scheduling(old: dict[str, Any]) -> dict[str, Any]:
    axes = {axis["name"]: axis for axis in old["axes"]}
    tables = {table["name"]: table for table in old["tables"]}
    new = {
        name: {
            "signal": signal,
            "unit": axes[name]["unit"],
            "nodes": (nodes := axes[name]["values"]),
            "slopes": [*(1.0 / (b - a) for a, b in pairwise(nodes)), 0.0],
        }
        for name, signal in _SIGNALS.items()
    }
    return new | {
        "interpolation": old["interpolation"],
        "extrapolation": old["extrapolation"],
        "sides": "separate",
        "tables": {
            name: {key: value for key, value in table.items() if key != "name"}
            for name, table in tables.items()
        },
    }


def _require(name: str, given: object, known: tuple[str, ...]) -> None:
    if given not in known:
        raise InputError(f"{name} = {shown(given)}: must be {known[0]!r}.")
