"""Regulators and machines of a group as arrays with one row per cylinder, which the kernel of
`group` reads."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...machine.actuator import Actuator
from ...model import plant
from ...regulator.law import Regulator


def regulator_tables(regulators: Sequence[Regulator]) -> tuple[np.ndarray, ...]:
    """The tables of `group.regulator_at`. Axes that differ in length are continued by their last
    node, which no lookup passes."""
    from .group import ARRAYS, NUMBERS

    rows, columns = max(r.x.size for r in regulators), max(r.y.size for r in regulators)
    shapes = {
        "x": (rows,),
        "x_slope": (rows,),
        "y": (columns,),
        "y_slope": (columns,),
        "table": (rows, columns, regulators[0].table.shape[2]),
    }
    arrays = (
        [_continued(np.array(getattr(r, name), dtype=float), shapes.get(name)) for r in regulators]
        for name in ARRAYS
    )
    numbers = [[getattr(r, name) for name in NUMBERS] for r in regulators]
    return (*map(np.array, arrays), np.array(numbers, dtype=float))


def machine_tables(actuators: Sequence[Actuator]) -> tuple[np.ndarray, ...]:
    """The tables of `group.machine_at`, one for each component, with a row for each machine."""
    machines = [plant.parameters(actuator) for actuator in actuators]
    return tuple(np.array(rows, dtype=float) for rows in zip(*machines, strict=True))


def _continued(array: np.ndarray, shape: tuple[int, ...] | None) -> np.ndarray:
    """The array, with its last values repeated up to `shape`."""
    if shape is None:
        return array
    return np.pad(
        array,
        [(0, long - short) for long, short in zip(shape, array.shape, strict=True)],
        mode="edge",
    )
