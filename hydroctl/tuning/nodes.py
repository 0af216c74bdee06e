"""Where the nodes of a schedule stand: the fewest design points between which the best gains
interpolate well enough."""

from __future__ import annotations

import numpy as np

from ..regulator.lookup import interpolation

_LARGEST_DEVIATION = 0.003


def mixing_matrix(x_nodes: np.ndarray, y_nodes: np.ndarray, x: np.ndarray, y: np.ndarray):
    """(x.size * y.size, nodes) sparse: the gains at the points x by y are this matrix times those
    at the nodes."""
    from scipy import sparse

    index, weight = interpolation(x_nodes, y_nodes, x[:, None], y)
    rows = np.repeat(np.arange(x.size * y.size), index.shape[-1])
    shape = (x.size * y.size, x_nodes.size * y_nodes.size)
    matrix = sparse.csr_array((weight.ravel(), (rows, index.ravel())), shape=shape)
    matrix.eliminate_zeros()
    return matrix


def choose_nodes(x: np.ndarray, y: np.ndarray, best: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Indices into x and into y of the nodes from which `best` (x.size, y.size) interpolates to 0.3
    % everywhere.

    Starts from the ends of the stroke and of each side of x. The row or the column of the largest
    deviation joins, whichever lowers it more.
    """
    rows, columns = _ends(x), {0, y.size - 1}
    deviation, (i, j) = _deviation(x, y, best, rows, columns)
    while deviation > _LARGEST_DEVIATION:
        more = [(rows | {i}, columns)] * (i not in rows) + [(rows, columns | {j})] * (
            j not in columns
        )
        tried = [(*_deviation(x, y, best, *nodes), nodes) for nodes in more]
        deviation, (i, j), (rows, columns) = min(tried, key=lambda one: one[0])
    return np.array(sorted(rows)), np.array(sorted(columns))


def _ends(x: np.ndarray) -> set[int]:
    first = int(np.searchsorted(x, 0.0))
    return {i for i in (0, first - 1, first, x.size - 1) if 0 <= i < x.size}


def _deviation(x, y, best, rows: set[int], columns: set[int]) -> tuple[float, tuple[int, int]]:
    """(largest relative deviation of `best` from what it is at the nodes, interpolated; the indices
    where)."""
    i, j = sorted(rows), sorted(columns)
    index, weight = interpolation(x[i], y[j], x[:, None], y)
    deviation = np.abs((best[np.ix_(i, j)].ravel()[index] * weight).sum(axis=-1) / best - 1.0)
    deviation[np.ix_(i, j)] = 0.0
    worst = np.unravel_index(np.argmax(deviation), deviation.shape)
    return float(deviation[worst]), (int(worst[0]), int(worst[1]))
