"""What the templates of the law are filled with: its constants, and which of its parts are in
use."""

from __future__ import annotations

from ..regulator import compensation, law
from .contents import Contents


def parts(contents: Contents) -> dict:
    """The values that the templates ask for, beside those that depend on the target."""
    r, s = contents.regulator, contents.schedule
    tables = contents.tables
    sections = [section for section in r.sections if section[0] != section[1]]
    values = {
        "integral": "ki" in tables,
        "derivative": "kd" in tables,
        "measurement_filter": r.Tm != 0.0,
        "weighted": r.b != 1.0,
        "on_error": r.c == 1.0,
        "notch": r.zz != r.zp,
        "sections": sections,
        "forward": s.feed_forward,
        "inverse": r.inverse_depth != 0.0,
        "k": r.compensation,
        "least_ratio": compensation.LEAST_RATIO,
        "most_ratio": compensation.MOST_RATIO,
        "least_drop": compensation.LEAST_DROP,
        "delay_samples": s.delay_samples,
        "provenance": contents.provenance,
    }
    return (
        r._asdict()
        | values
        | {
            "tables": [
                {"name": name, "unit": contents.units[name], "rows": table.tolist()}
                for name, table in tables.items()
            ],
            "fields": _fields(values),
            "reads": law.inputs_read(r),
        }
    )


def _fields(used: dict) -> list[str]:
    """The memory's numbers besides x."""
    fields = {
        "integral": ["integral"],
        "derivative": ["derivative", "last"],
        "measurement_filter": ["filtered"],
        "sections": [f"section_{k + 1}" for k in range(len(used["sections"]))],
        "notch": ["notch_1", "notch_2"],
    }
    return [name for part, names in fields.items() if used[part] for name in names]
