"""Where the nodes of a schedule stand: the fewest design points between which the best gains interpolate well enough."""

from __future__ import annotations

import numpy as np

from ..schedule import interpolation

_LARGEST_DEVIATION = 0.003
_MANY_X, _MANY_Y = 5, 17


def mixing_matrix(x_nodes: np.ndarray, y_nodes: np.ndarray, x: np.ndarray, y: np.ndarray):
    """(x.size * y.size, nodes) sparse: the gains at the points x by y are this matrix times those at the nodes."""
    from scipy import sparse

    index, weight = interpolation(x_nodes, y_nodes, x[:, None], y)
    rows = np.repeat(np.arange(x.size * y.size), index.shape[-1])
    shape = (x.size * y.size, x_nodes.size * y_nodes.size)
    matrix = sparse.csr_array((weight.ravel(), (rows, index.ravel())), shape=shape)
    matrix.eliminate_zeros()
    return matrix


def candidates(x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Indices into x and y of the points that may become nodes: all, or every second one of an axis (of a side of x) with many."""
    first = int(np.searchsorted(x, 0.0))
    left, right = np.arange(first), np.arange(first, x.size)
    return np.concatenate([_thinned(left, _MANY_X), _thinned(right, _MANY_X)]), _thinned(np.arange(y.size), _MANY_Y)


def _thinned(indices: np.ndarray, many: int) -> np.ndarray:
    return indices if indices.size < many else np.union1d(indices[::2], indices[-1:])


def choose_nodes(x: np.ndarray, y: np.ndarray, best: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Indices into x and into y of the nodes from which `best` (x.size, y.size) interpolates to 0.3 % everywhere.

    Starts from the ends of the stroke and of each side of x, and adds the row or column that lowers the largest deviation most.
    """
    rows, columns = _ends(x), {0, y.size - 1}
    while _deviation(x, y, best, rows, columns) > _LARGEST_DEVIATION:
        more_rows = [(_deviation(x, y, best, rows | {i}, columns), i) for i in set(range(x.size)) - rows]
        more_columns = [(_deviation(x, y, best, rows, columns | {j}), j) for j in set(range(y.size)) - columns]
        if not more_columns or (more_rows and min(more_rows) < min(more_columns)):
            rows = rows | {min(more_rows)[1]}
        else:
            columns = columns | {min(more_columns)[1]}
    return np.array(sorted(rows)), np.array(sorted(columns))


def _ends(x: np.ndarray) -> set[int]:
    first = int(np.searchsorted(x, 0.0))
    return {i for i in (0, first - 1, first, x.size - 1) if 0 <= i < x.size}


def _deviation(x, y, best, rows: set[int], columns: set[int]) -> float:
    i, j = sorted(rows), sorted(columns)
    if len(i) == x.size and len(j) == y.size:
        return 0.0
    index, weight = interpolation(x[i], y[j], x[:, None], y)
    return float(np.abs((best[np.ix_(i, j)].ravel()[index] * weight).sum(axis=-1) / best - 1.0).max())
