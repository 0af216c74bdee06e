"""MATLAB and Octave: one struct with axes, tables, settings, names and units."""

from __future__ import annotations

from io import BytesIO
from pathlib import Path

import numpy as np

from .. import __version__
from ..files import write_file
from .contents import Contents

_HEADER = b"MATLAB 5.0 MAT-file, written by hydroctl"
_HEADER_SIZE = 116
_LOOKUP = (
    "s is this struct; limits = s.x_limits(1 + (x >= 0), :); x_c = min(max(x, limits(1)),"
    " limits(2)); y_c = min(max(y, s.y_limits(1)), s.y_limits(2)); kp = interp2(s.y, s.x, s.kp,"
    " y_c, x_c). An axis of one node is written as two with the same gains."
)


def write_matlab(contents: Contents, path: Path) -> tuple[Path, ...]:
    """Write `path`, a MAT-file of version 5 with the struct `schedule`."""
    from scipy.io import savemat

    buffer = BytesIO()
    savemat(buffer, {"schedule": _struct(contents)}, oned_as="row")
    data = buffer.getvalue()
    return (write_file(path, _HEADER.ljust(_HEADER_SIZE) + data[_HEADER_SIZE:]),)


def _struct(contents: Contents) -> dict:
    s, r = contents.schedule, contents.regulator
    tables = {name: _at_least_two(getattr(s, name)) for name in contents.units}
    return {
        **contents.origin,
        "fingerprint": contents.document.fingerprint,
        "written_by": f"hydroctl {__version__}",
        "failed_checks": "; ".join(contents.schedule.failed_checks),
        "loop": s.loop,
        "structure": s.structure,
        "lookup": _LOOKUP,
        "x": _two_nodes(s.x),
        "y": _two_nodes(s.y),
        "x_limits": r.limits,
        "y_limits": s.y[[0, -1]],
        **tables,
        "units": {"x": "1", "y": "m", **contents.units},
        "settings": {
            "Ts": r.Ts,
            "delay_samples": float(s.delay_samples),
            "Tf": r.Tf,
            "Tm": r.Tm,
            "b": r.b,
            "c": r.c,
            "zz": r.zz,
            "zp": r.zp,
            "lead_lag": np.array(s.sections, dtype=float).reshape(-1, 2),
            "tracking_rate": r.tracking_rate,
            "extend_slope": r.extend_slope,
            "extend_offset": r.extend_offset,
            "retract_slope": r.retract_slope,
            "retract_offset": r.retract_offset,
            "pressure_drops": np.zeros((0, 2)) if s.pressure_drops is None else s.pressure_drops,
            "inverse_depth": r.inverse_depth,
            "inverse_width": r.inverse_width,
        },
        "settings_units": {
            "Ts": "s",
            "delay_samples": "samples",
            "Tf": "s",
            "Tm": "s",
            "tracking_rate": "1/s",
            "extend_slope": "s/m",
            "retract_slope": "s/m",
            "pressure_drops": "Pa; rows retract, extend; columns edge a, edge b",
        },
    }


def _two_nodes(nodes: np.ndarray) -> np.ndarray:
    return nodes if nodes.size > 1 else np.append(nodes, nodes + 1.0)


def _at_least_two(table: np.ndarray) -> np.ndarray:
    return np.tile(table, [1 if size > 1 else 2 for size in table.shape])
