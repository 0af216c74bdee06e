"""Margins of a schedule at its design points and between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..loop.margins import MARGIN_UNITS, WORST_AT_MOST, Margins


@dataclass(frozen=True, eq=False)
class ScheduleMargins:
    """Margins of a schedule over variants of the plant and points between and at its nodes."""

    variants: tuple[str, ...]
    x: np.ndarray
    """(mx,)"""
    y: np.ndarray
    """(my,) m"""
    designed: np.ndarray
    """(mx, my): True where the limits were imposed"""
    margins: Margins
    """over (variants, mx, my)"""

    def worst(self, name: str, *, where: np.ndarray | None = None) -> WorstPoint:
        """Where the margin `name` of `Margins` is worst: the largest of `WORST_AT_MOST`, the
        smallest of the others.

        `where` (mx, my), for example `designed`, leaves the other points out.
        """
        values = np.asarray(getattr(self.margins, name), float)
        badness = values if name in WORST_AT_MOST else -values
        if where is not None:
            badness = np.where(where, badness, -np.inf)
        k, i, j = np.unravel_index(np.argmax(badness), badness.shape)
        return WorstPoint(
            name, float(values[k, i, j]), self.variants[k], float(self.x[i]), float(self.y[j])
        )

    def to_csv(self) -> str:
        """One line for each point and variant: x, y in m, whether it is a design point, and the
        margins with their units."""
        header = [
            "variant",
            "x",
            "y [m]",
            "design point",
            *(f"{name} [{unit}]" for name, unit in MARGIN_UNITS.items()),
            "stable",
        ]
        lines = [",".join(header)]
        columns = [getattr(self.margins, name) for name in MARGIN_UNITS]
        for k, i, j in np.ndindex(self.margins.Ms.shape):
            values = [f"{column[k, i, j]:.8g}" for column in columns]
            flags = [
                str(bool(self.designed[i, j])),
                *values,
                str(bool(self.margins.stable[k, i, j])),
            ]
            lines.append(
                ",".join([f'"{self.variants[k]}"', f"{self.x[i]:.8g}", f"{self.y[j]:.8g}", *flags])
            )
        return "\n".join(lines) + "\n"

    @property
    def unstable(self) -> int:
        """How many closed loops are unstable."""
        return int(np.count_nonzero(~self.margins.stable))


@dataclass(frozen=True)
class WorstPoint:
    """One margin's worst value and where it is."""

    margin: str
    value: float
    variant: str
    x: float
    y: float
