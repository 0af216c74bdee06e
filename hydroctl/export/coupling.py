"""`export_coupling`: the coupling of several cylinders in ISO C99, which gives each exported
regulator its reference."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING, Literal

import numpy as np

from .. import __version__
from ..errors import FailedChecksError, InputError, unknown_name
from ..files import write_file
from .c import filters
from .text import REALS, harmless, identifier, render

if TYPE_CHECKING:
    from ..synchronization import Coupling


def export_coupling(
    coupling: Coupling,
    path: str | Path,
    *,
    sample_time: float,
    real: Literal["double", "float"] = "double",
) -> tuple[Path, ...]:
    """Write `coupling`, sampled every `sample_time` s, as C to `path` and a header beside it, named
    after it; the files written.

    Its functions compute what `simulation.group` gives the regulators; slowing down and stopping
    stay with the caller. A coupling whose evidence says that its limit is not kept is refused with
    FailedChecksError. Raises InputError, all faults at once.
    """
    faults = [] if real in REALS else [unknown_name("real", real, REALS)]
    if not 0.0 < sample_time < np.inf:
        faults.append(f"sample_time = {sample_time!r} must be a time above 0 s.")
    if faults:
        raise InputError(faults)
    path = Path(path)
    name = identifier(path.stem)
    evidence = coupling.evidence
    if evidence is not None and not evidence.kept:
        advice = (
            f"the coupling {coupling.name!r} does not keep its limit; design it with smaller gains"
            " or a larger Ms:"
        )
        raise FailedChecksError(advice, [str(evidence)])
    checks = (
        ["gains as given, without a design"]
        if evidence is None
        else harmless(str(evidence)).split("; ")
    )
    values = {
        "name": name,
        "NAME": name.upper(),
        "real": real,
        "kind": harmless(coupling.name),
        "version": __version__,
        "checks": checks,
        "matrix": coupling.matrix.tolist(),
        "kc": coupling.kc,
        "ki": coupling.ki,
        "Ts": sample_time,
    }
    header, source = (
        render(f"coupling.{kind}.jinja", filters=filters(real), **values) for kind in ("h", "c")
    )
    return write_file(path.with_suffix(".h"), header), write_file(path.with_suffix(".c"), source)
