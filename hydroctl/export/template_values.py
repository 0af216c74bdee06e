"""What the templates of the law are filled with, whatever the target."""

from __future__ import annotations

from ..regulator.law import inputs_read
from ..regulator.printing.program import Program
from .contents import Contents
from .names import comment


def template_values(contents: Contents, program: Program) -> dict:
    """The values that the templates ask for, besides those that depend on the target."""
    r, s = contents.regulator, contents.schedule
    return {
        "x": r.x,
        "y": r.y,
        "Ts": r.Ts,
        "position": r.position,
        "compensated": r.compensated,
        "integral": r.integrates,
        "forward": s.feed_forward,
        "delay_samples": s.delay_samples,
        "provenance": contents.provenance,
        "tables": [{"name": name, "unit": contents.units[name]} for name in contents.tables],
        "memory": [
            {"name": one.name, "comment": comment(one.unit, one.text)} for one in program.memory
        ],
        "reads": inputs_read(r),
    }
