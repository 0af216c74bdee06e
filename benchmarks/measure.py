"""Interleaved timing of peers in one process, and a table of the outcome."""

from __future__ import annotations

import os
import platform
import statistics
import sys
import time
from collections.abc import Callable
from dataclasses import asdict, dataclass
from importlib import metadata
from importlib.util import find_spec
from typing import Any

_REST = 0.1
"""s before each turn, in which threads of the contender before stop spinning: their processor time
would count for this one"""


@dataclass(frozen=True)
class Row:
    """One contender of a job."""

    job: str
    name: str
    seconds: float
    """median time for one unit of the job's work"""
    ratio: float
    """how many times faster than the job's first contender"""
    error: float
    """largest error over the job's amplitude; NaN where the job has none"""
    note: str = ""


@dataclass(frozen=True)
class Contender:
    """`run()` does `units` units of work; `error` makes an error of what it returned, outside of
    the time; `needs` names packages without which it is skipped."""

    name: str
    run: Callable[[], Any]
    error: Callable[[Any], float] = float
    units: float = 1.0
    needs: tuple[str, ...] = ()
    clock: Callable[[], float] = time.process_time
    """processor time, which a busy machine disturbs least; the wall clock for work on several
    threads"""
    note: str = ""


def compare(job: str, contenders: list[Contender], repeats: int) -> list[Row]:
    """Warm every contender once, then time them in turn `repeats` times. The first one is the
    measure of the others."""
    present = []
    for contender in contenders:
        missing = [name for name in contender.needs if find_spec(name) is None]
        if missing:
            print(
                f"{job}: {contender.name} skipped, {', '.join(missing)} is not installed",
                file=sys.stderr,
            )
        else:
            present.append(contender)
    errors = [contender.error(contender.run()) for contender in present]
    times = [[] for _ in present]
    for _ in range(repeats):
        for contender, row in zip(present, times, strict=True):
            time.sleep(_REST)
            start = contender.clock()
            contender.run()
            row.append((contender.clock() - start) / contender.units)
    medians = [statistics.median(row) for row in times]
    return [
        Row(job, contender.name, median, medians[0] / median, error, contender.note)
        for contender, median, error in zip(present, medians, errors, strict=True)
    ]


def table(rows: list[Row]) -> str:
    """The rows as text."""
    lines = [f"{'job':<4} {'contender':<58} {'time':>12} {'ratio':>9} {'error':>9}"]
    for row in rows:
        line = (
            f"{row.job:<4} {row.name:<58} {1e3 * row.seconds:>9.4g} ms {row.ratio:>9.4g}"
            f" {row.error:>9.1e}  {row.note}"
        )
        lines.append(line.rstrip())
    return "\n".join(lines)


def document(rows: list[Row]) -> dict:
    """What `results.json` holds: the machine, the versions, the rows."""
    versions = {}
    for name in (
        "numpy",
        "scipy",
        "numba",
        "control",
        "slycot",
        "casadi",
        "scikit-sundae",
        "jax",
        "diffrax",
    ):
        if find_spec({"scikit-sundae": "sksundae"}.get(name, name)):
            versions[name] = metadata.version(name)
    machine = {
        "cores": os.cpu_count(),
        "python": platform.python_version(),
        "machine": platform.machine(),
        "system": platform.system(),
    }
    return {"machine": machine, "versions": versions, "rows": [asdict(row) for row in rows]}
