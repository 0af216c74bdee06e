"""Gains from the tables: bilinear in (x[k-1], y), clipped to the nodes; x[k-1] >= 0 uses the nodes
with x > 0, else those with x < 0."""

from __future__ import annotations

import numpy as np

from . import clipping


def clipped_opening(x, regulator):
    """x clipped to the nodes of its own side."""
    lowest = np.where(x < 0.0, regulator.limits[0, 0], regulator.limits[1, 0])  # [1] of its side
    highest = np.where(x < 0.0, regulator.limits[0, 1], regulator.limits[1, 1])  # [1]
    return clipping.within(x, lowest, highest)


def clipped_position(y, regulator):
    """y clipped to the nodes."""
    return clipping.within(y, regulator.y[0], regulator.y[-1])


def interval(nodes, value):
    """Index of the last node that is not above `value`, 0 if all are."""
    index = 0
    for k in range(1, nodes.size):
        index += value >= nodes[k]
    return index


def corners(table, i, j, column):
    """The values at the corners of the cell that starts at node (i, j): (i, j), (i, j + 1), (i + 1,
    j), (i + 1, j + 1).

    Beyond the last node of an axis stand its own values once more; the fraction is 0 there.
    """
    next_i = np.where(i + 1 < table.shape[0], i + 1, i)  # the node after i
    next_j = np.where(j + 1 < table.shape[1], j + 1, j)  # the node after j
    return (
        table[i, j, column],
        table[i, next_j, column],
        table[next_i, j, column],
        table[next_i, next_j, column],
    )


def bilinear(values, along_x, along_y):
    """The value between the four of `corners`."""
    low = values[0] + along_y * (values[1] - values[0])  # at the node below x
    high = values[2] + along_y * (values[3] - values[2])  # at the node above x
    return low + along_x * (high - low)


def gains_at(x, y, regulator):
    """The gains at the last command and the present position: bilinear, clipped to the nodes."""
    x_inside = clipped_opening(x, regulator)  # [1] clipped to the nodes of its side
    y_inside = clipped_position(y, regulator)  # [m] clipped to the nodes
    i = interval(regulator.x, x_inside)  # node at or below x
    j = interval(regulator.y, y_inside)  # node at or below y
    along_x = (x_inside - regulator.x[i]) * regulator.x_slope[i]  # [1] part of the way to the next
    along_y = (y_inside - regulator.y[j]) * regulator.y_slope[j]  # [1]
    table = regulator.table
    kp = bilinear(corners(table, i, j, 0), along_x, along_y)  # [{kp}] proportional gain
    ki = bilinear(corners(table, i, j, 1), along_x, along_y)  # [{ki}] integral gain
    kd = bilinear(corners(table, i, j, 2), along_x, along_y)  # [{kd}] derivative gain
    notch_frequency = bilinear(corners(table, i, j, 3), along_x, along_y)  # [rad/s]
    return kp, ki, kd, notch_frequency
