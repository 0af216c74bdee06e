"""Interpolation of tables over x and y: bilinear, clipped, the sides of x apart."""

from __future__ import annotations

import numpy as np


def interpolation(x_nodes: np.ndarray, y_nodes: np.ndarray, x, y):
    """(index, weight), each (..., 4): which entries of a raveled table (nx, ny) make up the value
    at x and y (broadcast).

    Bilinear and clipped. x >= 0 uses the nodes x > 0 and x < 0 the nodes x < 0; where a side has no
    nodes, all of them.
    """
    x, y = np.broadcast_arrays(np.asarray(x, float), np.asarray(y, float))
    row, along_x = _locate_sided(x_nodes, x)
    column, along_y = _locate(y_nodes, y)
    next_row, next_column = (
        np.minimum(row + 1, len(x_nodes) - 1),
        np.minimum(column + 1, len(y_nodes) - 1),
    )
    corners = ((row, column), (row, next_column), (next_row, column), (next_row, next_column))
    index = np.stack([i * len(y_nodes) + j for i, j in corners], axis=-1)
    along = (
        (1.0 - along_x, 1.0 - along_y),
        (1.0 - along_x, along_y),
        (along_x, 1.0 - along_y),
        (along_x, along_y),
    )
    return index, np.stack([a * b for a, b in along], axis=-1)


def _locate(nodes: np.ndarray, value: np.ndarray):
    """(index of the node at or below, fraction of the way to the next), clipped to the nodes."""
    index = np.clip(np.searchsorted(nodes, value, side="right") - 1, 0, max(len(nodes) - 2, 0))
    if len(nodes) == 1:
        return index, np.zeros_like(value)
    return index, np.clip((value - nodes[index]) / (nodes[index + 1] - nodes[index]), 0.0, 1.0)


def _locate_sided(nodes: np.ndarray, value: np.ndarray):
    """`_locate` among the nodes on the side of `value`, or among all where that side has none."""
    first = int(np.searchsorted(nodes, 0.0))
    left, along_left = _locate(nodes[:first] if first else nodes, value)
    right, along_right = _locate(nodes[first:] if first < len(nodes) else nodes, value)
    positive = value >= 0.0
    return np.where(positive, right + (first if first < len(nodes) else 0), left), np.where(
        positive, along_right, along_left
    )
