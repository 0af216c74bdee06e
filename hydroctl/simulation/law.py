"""The sampled regulator law, written once: what runs each sample in every simulation and what an exported regulator must do.

At sample k, with the reference r, the measured quantity m (v for a velocity loop, y for a position loop) and the measured y:

    kp, ki, kd, wn   bilinear in (x[k-1], y), clipped to the nodes; x[k-1] >= 0 uses the nodes with x > 0, else those with x < 0
    e  = r - m
    d  = (Tf d + e - e[k-1])/(Tf + Ts)                              derivative of e, backward Euler
    u  = kp e + I + kd d
    w  = notch(u) + feed-forward(v_ref)                             feed-forward: v_ref/K + offset of the side of v_ref, 0 at 0
    x  = w limited to [-1, 1]
    I += Ts (ki e + (x - w)/Tt)                                     forward Euler, in units of x; back-calculation of the limit;
                                                                    stays 0 for a schedule whose ki is 0 everywhere

The notch (s^2 + 2 zz wn s + wn^2)/(s^2 + 2 zp wn s + wn^2) is Tustin's, prewarped at wn, in the transposed direct form II; with
zz = zp it passes u on unchanged. Every function takes numbers, as Python or compiled, and is free of branches.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np


class Regulator(NamedTuple):
    """A gain schedule as the law reads it. All x nodes below zero come first; none is zero."""

    x: np.ndarray
    """(nx,) nodes, ascending"""
    x_slope: np.ndarray
    """(nx,) 1/(distance to the next node), 0 at the last"""
    y: np.ndarray
    """(ny,) nodes in m, ascending"""
    y_slope: np.ndarray
    """(ny,) the same along y, 1/m"""
    table: np.ndarray
    """(nx, ny, 4): kp, ki, kd in units of x over those of the loop; wn in rad/s"""
    limits: np.ndarray
    """(2, 2): lowest and highest node that x[k-1] < 0 may use, then the same for x[k-1] >= 0"""
    position: bool
    """True: y is controlled, False: v is"""
    Ts: float
    Tf: float
    zz: float
    zp: float
    tracking_rate: float
    """1/Tt in 1/s; 0 for a schedule without integral"""
    extend_slope: float
    """feed-forward per speed, s/m, for v_ref > 0"""
    extend_offset: float
    retract_slope: float
    retract_offset: float
    delay_samples: int


AT_REST = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""The memory before the first sample: integral, derivative, last error, two states of the notch, last x."""


def clipped_opening(x, regulator):
    """x clipped to the nodes of its own side."""
    lowest = np.where(x < 0.0, regulator.limits[0, 0], regulator.limits[1, 0])
    highest = np.where(x < 0.0, regulator.limits[0, 1], regulator.limits[1, 1])
    raised = np.where(x < lowest, lowest, x)
    return np.where(raised > highest, highest, raised)


def clipped_position(y, regulator):
    """y clipped to the nodes."""
    raised = np.where(y < regulator.y[0], regulator.y[0], y)
    return np.where(raised > regulator.y[-1], regulator.y[-1], raised)


def interval(nodes, value):
    """Index of the last node that is not above `value`, 0 if all are."""
    index = 0
    for k in range(1, nodes.size):
        index += value >= nodes[k]
    return index


def interpolate(table, i, j, fraction_x, fraction_y, column):
    """Bilinear value in the cell that starts at node (i, j); at the last node of an axis its fraction is 0."""
    ii = np.where(i + 1 < table.shape[0], i + 1, i)
    jj = np.where(j + 1 < table.shape[1], j + 1, j)
    low = table[i, j, column] + fraction_y * (table[i, jj, column] - table[i, j, column])
    high = table[ii, j, column] + fraction_y * (table[ii, jj, column] - table[ii, j, column])
    return low + fraction_x * (high - low)


def notch_coefficients(wn, zz, zp, Ts):
    """(b0, b1, b2, a2) of the notch at wn; a1 = b1. Needs wn Ts < pi."""
    w = np.tan(0.5 * wn * Ts)
    square = w * w
    scale = 1.0 / (1.0 + 2.0 * zp * w + square)
    return (
        (1.0 + 2.0 * zz * w + square) * scale,
        2.0 * (square - 1.0) * scale,
        (1.0 - 2.0 * zz * w + square) * scale,
        (1.0 - 2.0 * zp * w + square) * scale,
    )


def feed_forward(v_ref, regulator):
    """The opening that gives the speed v_ref in steady state; 0 at rest."""
    slope = np.where(v_ref < 0.0, regulator.retract_slope, regulator.extend_slope)
    offset = np.where(v_ref < 0.0, regulator.retract_offset, regulator.extend_offset)
    return np.where(v_ref == 0.0, 0.0, v_ref * slope + offset)


def regulate(error, forward, gains, memory, regulator):
    """The new memory after one sample: gains = (kp, ki, kd, wn), forward = the feed-forward. The memory's x is the command."""
    kp, ki, kd, wn = gains
    integral, derivative, last_error, s1, s2, _ = memory
    Ts, Tf = regulator.Ts, regulator.Tf
    derivative = (Tf * derivative + error - last_error) / (Tf + Ts)
    u = kp * error + integral + kd * derivative
    b0, b1, b2, a2 = notch_coefficients(wn, regulator.zz, regulator.zp, Ts)
    notched = b0 * u + s1
    s1, s2 = b1 * u - b1 * notched + s2, b2 * u - a2 * notched
    wanted = notched + forward
    raised = np.where(wanted < -1.0, -1.0, wanted)
    x = np.where(raised > 1.0, 1.0, raised)
    integral = integral + Ts * (ki * error + (x - wanted) * regulator.tracking_rate)
    return integral, derivative, error, s1, s2, x


def sample(reference, v_ref, v, y, memory, regulator):
    """The whole law for one sample: lookup at (memory's x, y), then `regulate`. Returns the new memory."""
    x_c, y_c = clipped_opening(memory[5], regulator), clipped_position(y, regulator)
    i, j = interval(regulator.x, x_c), interval(regulator.y, y_c)
    fraction_x = (x_c - regulator.x[i]) * regulator.x_slope[i]
    fraction_y = (y_c - regulator.y[j]) * regulator.y_slope[j]
    table = regulator.table
    gains = (
        interpolate(table, i, j, fraction_x, fraction_y, 0),
        interpolate(table, i, j, fraction_x, fraction_y, 1),
        interpolate(table, i, j, fraction_x, fraction_y, 2),
        interpolate(table, i, j, fraction_x, fraction_y, 3),
    )
    error = reference - np.where(regulator.position, y, v)
    return regulate(error, feed_forward(v_ref, regulator), gains, memory, regulator)
