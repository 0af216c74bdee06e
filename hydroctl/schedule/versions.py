"""Older versions of the schedule file, brought up to the present one. What a version added is
neutral in older files."""

from __future__ import annotations

from ..errors import InputError

VERSION = 3

_CONTROLLER_OF_2 = {
    "measurement_filter_time": {"value": 0.0, "unit": "s"},
    "lead_lag": [],
    "pressure_compensation": None,
    "dead_band_inverse": 0.0,
    "start": "m_f = m, g_previous = (c - 1)*m, all other states 0",
    "fallback": "where an input is not finite, x = 0, and the next sound sample is a start",
}
_ADDED_IN_3 = {"failed_checks": [], "test_vectors": None, "fingerprint": None}


def upgraded(data: dict) -> dict:
    """The content of a schedule file as one of VERSION. Raises InputError for an unknown
    version."""
    version = data.get("version")
    if isinstance(version, bool) or version not in range(1, VERSION + 1):
        raise InputError(
            f"version {version!r} is unknown; only 1 to {VERSION} can be read. Update hydroctl."
        )
    controller = data.get("controller")
    if version == 1 and isinstance(controller, dict):
        data = data | {"controller": _CONTROLLER_OF_2 | controller}
    if version < 3:
        if later := sorted(_ADDED_IN_3.keys() & data.keys()):
            raise InputError(
                f"{later[0]} does not belong in a file of version {version}; the version was changed."
            )
        data = data | _ADDED_IN_3
    elif data.get("fingerprint", "") is None:
        raise InputError(
            f"fingerprint is null, but a file of version {version} has one; it was changed after it was written."
        )
    return data | {"version": VERSION}
