"""Where loops are looked at besides the design points: half-way between them, and inside the cells
of the gain tables."""

from __future__ import annotations

from itertools import pairwise

import numpy as np

_INSIDE = 1e-3
"""of a cell: the distance from its edges"""


def with_midpoints(nodes: np.ndarray) -> np.ndarray:
    """`nodes` (n,), ascending, and the middles between neighbours of the same sign."""
    middles = [(a + b) / 2.0 for a, b in pairwise(nodes) if a * b >= 0.0]
    return np.sort(np.concatenate([nodes, middles]))


def cell_points(nodes: np.ndarray) -> np.ndarray:
    """The middle of every cell between `nodes` (n,), ascending, and two points just inside its
    edges; a single node stands for itself."""
    cells = [(a, b) for a, b in pairwise(nodes) if a * b >= 0.0]
    inside = [a + share * (b - a) for a, b in cells for share in (_INSIDE, 0.5, 1.0 - _INSIDE)]
    alone = [node for node in nodes if not any(node in cell for cell in cells)]
    return np.sort([*inside, *(node * (1.0 - _INSIDE) for node in alone)])
