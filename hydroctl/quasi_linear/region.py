"""`Region`: the part of the (x, y) plane in which a fitted model may be used, as cells of a
rectangular grid."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..errors import InputError

_SLACK = 1e-9


@dataclass(frozen=True, eq=False)
class Region:
    """Cells between the edges x (k + 1,) and y (l + 1,), both rising; `covered` (k, l) says which
    belong to the region.

    A border belongs to the region.
    """

    x: np.ndarray
    y: np.ndarray
    covered: np.ndarray

    @classmethod
    def rectangle(cls, x, y) -> Region:
        """From the least to the largest of x, and of y."""
        along_x, along_y = (
            _edges(np.unique([np.min(values), np.max(values)]).astype(float)) for values in (x, y)
        )
        return cls(along_x, along_y, np.ones((1, 1), dtype=bool))

    @classmethod
    def of_points(cls, x: np.ndarray, y: np.ndarray, usable: np.ndarray) -> Region:
        """The grid cells whose corners are all usable; for points (n,) that form no grid, the
        rectangle of the usable ones."""
        (columns, i), (rows, j) = (
            np.unique(x, return_inverse=True),
            np.unique(y, return_inverse=True),
        )
        if len(x) != len(columns) * len(rows) or len(np.unique(i * len(rows) + j)) != len(x):
            return cls.rectangle(x[usable], y[usable])
        corners = np.zeros((len(columns), len(rows)), dtype=bool)
        corners[i, j] = usable
        corners = np.repeat(corners, 2, axis=0) if len(columns) == 1 else corners
        corners = np.repeat(corners, 2, axis=1) if len(rows) == 1 else corners
        return cls(
            _edges(columns),
            _edges(rows),
            corners[:-1, :-1] & corners[1:, :-1] & corners[:-1, 1:] & corners[1:, 1:],
        )

    def contains(self, x: np.ndarray, y: np.ndarray) -> np.ndarray:
        """(...) bool, for x and y of one shape."""
        inside = np.zeros(np.shape(x), dtype=bool)
        for shift_x in (-_SLACK, _SLACK):
            for shift_y in (-_SLACK, _SLACK):
                i, j = _cell(self.x, x + shift_x), _cell(self.y, y + shift_y)
                known = (i >= 0) & (j >= 0)
                inside |= known & self.covered[np.where(known, i, 0), np.where(known, j, 0)]
        return inside

    def clip(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(x, y) brought between the outermost edges of covered cells; InputError where there are
        none."""
        (left, right), (low, high) = self._bounds()
        return np.clip(x, left, right), np.clip(y, low, high)

    def corners(self) -> tuple[np.ndarray, np.ndarray]:
        """(x, y), each (4,): the corners of the rectangle that holds the region."""
        x, y = self._bounds()
        return np.repeat(x, 2), np.tile(y, 2)

    def _bounds(self):
        if not self.covered.any():
            raise InputError(
                "the model is not known in any cell of (x, y); fit more points, or record longer"
                " and excite more."
            )
        i, j = np.nonzero(self.covered)
        return (self.x[i.min()], self.x[i.max() + 1]), (self.y[j.min()], self.y[j.max() + 1])

    def __str__(self) -> str:
        if not self.covered.any():
            return "empty"
        (left, right), (low, high) = self._bounds()
        holes = "" if self.covered.all() else ", with cells left out"
        return f"x {left} to {right}, y {low} to {high} m{holes}"


def _cell(edges: np.ndarray, value: np.ndarray) -> np.ndarray:
    """Index of the cell that holds each value, -1 outside."""
    index = np.searchsorted(edges, value, side="right") - 1
    return np.where(index < len(edges) - 1, index, -1)


def _edges(values: np.ndarray) -> np.ndarray:
    """The distinct values; a single one becomes the borders of a cell just around it."""
    return values if len(values) > 1 else values[0] + 2.0 * _SLACK * np.array([-1.0, 1.0])
