"""The sampled regulator law, written once: what runs each sample in every simulation and what an
exported regulator must do.

At sample k, with the reference r, the measured quantity m (v for a velocity loop, y for a position
loop), the measured y and, for the compensation of the pressures, p_a and p_b:

    kp, ki, kd, wn   bilinear in (x[k-1], y), clipped to the nodes; x[k-1] >= 0 uses the nodes with x > 0, else those with x < 0
    m_f = m + Tm/(Tm + Ts) (m_f - m)                                filter of the measurement, backward Euler; m_f = m at a start
    e  = r - m_f
    d  = (Tf d + g - g[k-1])/(Tf + Ts),  g = c r - m_f              derivative, backward Euler; c = 1 on the error, 0 on m_f
    u  = kp (b r - m_f) + I + kd d                                  b: set-point weight
    w  = ratio (notch(lead-lag(u)) + feed-forward(v_ref))           feed-forward: v_ref/K + offset of the side of v_ref, 0 at 0
    x  = inverse(w limited to [-1, 1])                              inverse of the dead band
    I += Ts (ki e + (w limited - w)/(ratio Tt))                     forward Euler, in units of x; back-calculation of the limit;
                                                                    stays 0 for a schedule whose ki is 0 everywhere

The notch (s^2 + 2 zz wn s + wn^2)/(s^2 + 2 zp wn s + wn^2) and the two lead-lag sections (s/(z wn)
+ 1)/(s/(p wn) + 1) are Tustin's, prewarped at wn, in the transposed direct form II; with zz = zp,
and with z = p, they pass u on unchanged. The ratio q_ref/q, clipped to [0.4, 3], undoes what the
load does to the gain, which is proportional to

    q = g_a sqrt(dp_a)/V_a + g_b sqrt(dp_b)/V_b

with the pressure drops dp over the open edges; q_ref is the design's.

A start, m_f = m and g[k-1] = (c - 1) m, takes the reference before the first sample as equal to the
measurement. A fault is an input that is not finite (a broken sensor), or one so large that x or a
state would not be finite: then x = 0, and the next sound sample is a start. Every function takes
numbers, as Python or compiled; `regulate` is free of branches.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

LEAST_RATIO, MOST_RATIO = 0.4, 3.0
LEAST_DROP = 1.0
"""Pa; keeps the root of a pressure drop real"""


class Compensation(NamedTuple):
    """What q needs: the flow per root of pressure drop at x = 1 times the area, volumes at y = 0,
    areas, pressures, and the design's own pressure drops for either direction."""

    flow_a: float
    flow_b: float
    volume_a: float
    volume_b: float
    area_a: float
    area_b: float
    stroke: float
    supply_pressure: float
    tank_pressure: float
    extend_drop_a: float
    extend_drop_b: float
    retract_drop_a: float
    retract_drop_b: float


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
    Tm: float
    b: float
    c: float
    zz: float
    zp: float
    sections: tuple[tuple[float, float], tuple[float, float]]
    """(z, p) of the two lead-lag sections"""
    integrates: bool
    """whether any ki is not 0; else the integral stays 0"""
    derives: bool
    """whether any kd is not 0; else the states of the derivative stay 0"""
    shaped: bool
    """whether there is a notch or a section, so that wn is needed"""
    tracking_rate: float
    """1/Tt in 1/s; 0 for a schedule without integral"""
    extend_slope: float
    """feed-forward per speed, s/m, for v_ref > 0"""
    extend_offset: float
    retract_slope: float
    retract_offset: float
    compensated: bool
    compensation: Compensation
    inverse_depth: float
    """the part of the opening that the inverse of the dead band jumps over; 0: no inverse"""
    inverse_width: float
    """the opening over which it does so"""
    delay_samples: int
    """whole samples from the measurement to the valve command"""
    delay_fraction: float
    """the rest of that delay in samples, 0 <= delay_fraction < 1"""


class Memory(NamedTuple):
    """What the law remembers from sample to sample."""

    integral: float
    derivative: float
    last: float
    """g[k-1]"""
    notch_1: float
    notch_2: float
    x: float
    """the command"""
    section_1: float
    section_2: float
    filtered: float
    """m_f"""
    running: float
    """1 after a sample, 0 before the first and after a fault"""


AT_REST = Memory(0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
"""Before the first sample."""


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


def corners(table, i, j, column):
    """The values at the corners of the cell that starts at node (i, j): (i, j), (i, j + 1), (i + 1,
    j), (i + 1, j + 1).

    Beyond the last node of an axis stand its own values once more; the fraction is 0 there.
    """
    ii = np.where(i + 1 < table.shape[0], i + 1, i)
    jj = np.where(j + 1 < table.shape[1], j + 1, j)
    return table[i, j, column], table[i, jj, column], table[ii, j, column], table[ii, jj, column]


def bilinear(values, fraction_x, fraction_y):
    """The value between the four of `corners`."""
    low = values[0] + fraction_y * (values[1] - values[0])
    high = values[2] + fraction_y * (values[3] - values[2])
    return low + fraction_x * (high - low)


def gains_at(x, y, regulator):
    """(kp, ki, kd, wn) at the opening x and the position y."""
    x_c, y_c = clipped_opening(x, regulator), clipped_position(y, regulator)
    i, j = interval(regulator.x, x_c), interval(regulator.y, y_c)
    fraction_x = (x_c - regulator.x[i]) * regulator.x_slope[i]
    fraction_y = (y_c - regulator.y[j]) * regulator.y_slope[j]
    table = regulator.table
    return (
        bilinear(corners(table, i, j, 0), fraction_x, fraction_y),
        bilinear(corners(table, i, j, 1), fraction_x, fraction_y),
        bilinear(corners(table, i, j, 2), fraction_x, fraction_y),
        bilinear(corners(table, i, j, 3), fraction_x, fraction_y),
    )


def notch_coefficients(w, zz, zp):
    """(b0, b1, b2, a2) of the notch for w = tan(wn Ts/2); a1 = b1. Needs wn Ts < pi."""
    square = w * w
    scale = 1.0 / (1.0 + 2.0 * zp * w + square)
    return (
        (1.0 + 2.0 * zz * w + square) * scale,
        2.0 * (square - 1.0) * scale,
        (1.0 - 2.0 * zz * w + square) * scale,
        (1.0 - 2.0 * zp * w + square) * scale,
    )


def section_coefficients(w, section):
    """(b0, b1, a1) of a lead-lag section (z, p) for w = tan(wn Ts/2)."""
    zero, pole = 1.0 / section[0], 1.0 / section[1]
    return (zero + w) / (pole + w), (w - zero) / (pole + w), (w - pole) / (pole + w)


def filtered(measured, memory, regulator):
    """m_f"""
    follows = measured + regulator.Tm / (regulator.Tm + regulator.Ts) * (memory.filtered - measured)
    return np.where((memory.running == 0.0) | (regulator.Tm == 0.0), measured, follows)


def lead_lag(u, wn, memory, regulator):
    """(output, new state 1, new state 2) of the two sections in series."""
    w = np.tan(0.5 * wn * regulator.Ts)
    first, state_1 = _section(u, w, memory.section_1, regulator.sections[0])
    second, state_2 = _section(first, w, memory.section_2, regulator.sections[1])
    return second, state_1, state_2


def _section(u, w, state, section):
    """(output, new state) of one section; without effect, z = p, its state stays 0."""
    b0, b1, a1 = section_coefficients(w, section)
    out = b0 * u + state
    return out, np.where(section[0] == section[1], 0.0, b1 * u - a1 * out)


def notch(u, wn, memory, regulator):
    """(output, new state 1, new state 2) of the notch; without effect, zz = zp, its states stay
    0."""
    b0, b1, b2, a2 = notch_coefficients(np.tan(0.5 * wn * regulator.Ts), regulator.zz, regulator.zp)
    out, absent = b0 * u + memory.notch_1, regulator.zz == regulator.zp
    state_1 = np.where(absent, 0.0, b1 * u - b1 * out + memory.notch_2)
    return out, state_1, np.where(absent, 0.0, b2 * u - a2 * out)


def feed_forward(v_ref, regulator):
    """The opening that gives the speed v_ref in steady state; 0 at rest."""
    slope = np.where(v_ref < 0.0, regulator.retract_slope, regulator.extend_slope)
    offset = np.where(v_ref < 0.0, regulator.retract_offset, regulator.extend_offset)
    return np.where(v_ref == 0.0, 0.0, v_ref * slope + offset)


def pressure_ratio(opening, y, p_a, p_b, regulator):
    """q_ref/q for the edges that `opening` opens; 1 without compensation."""
    k = regulator.compensation
    extends = opening >= 0.0
    drop_a = np.where(extends, k.supply_pressure - p_a, p_a - k.tank_pressure)
    drop_b = np.where(extends, p_b - k.tank_pressure, k.supply_pressure - p_b)
    root_a = np.sqrt(np.where(drop_a > LEAST_DROP, drop_a, LEAST_DROP))
    root_b = np.sqrt(np.where(drop_b > LEAST_DROP, drop_b, LEAST_DROP))
    reference_a = np.sqrt(np.where(extends, k.extend_drop_a, k.retract_drop_a))
    reference_b = np.sqrt(np.where(extends, k.extend_drop_b, k.retract_drop_b))
    inside = np.where(y < 0.0, 0.0, np.where(y > k.stroke, k.stroke, y))
    weight_a = k.flow_a / (k.volume_a + k.area_a * inside)
    weight_b = k.flow_b / (k.volume_b - k.area_b * inside)
    ratio = (weight_a * reference_a + weight_b * reference_b) / (
        weight_a * root_a + weight_b * root_b
    )
    raised = np.where(ratio < LEAST_RATIO, LEAST_RATIO, ratio)
    return np.where(regulator.compensated, np.where(raised > MOST_RATIO, MOST_RATIO, raised), 1.0)


def inverse(w, regulator):
    """The opening that lets the dead band pass w, |w| <= 1: a smooth jump by `inverse_depth`, done
    at about `inverse_width`."""
    size, width = np.where(w < 0.0, -w, w), regulator.inverse_width
    return w + regulator.inverse_depth * w * ((1.0 + width) / (size + width) - 1.0)


def regulate(reference, forward, measured, gains, memory, regulator):
    """The new memory after one sample.

    forward: the feed-forward. measured = (p_a, p_b, v, y). gains = (kp, ki, kd, wn). The memory's x
    is the command.
    """
    kp, ki, kd, wn = gains
    p_a, p_b, v, y = measured
    Ts, Tf = regulator.Ts, regulator.Tf
    m = np.where(regulator.position, y, v)
    m_f = filtered(m, memory, regulator)
    error = reference - m_f
    g = regulator.c * reference - m_f
    before = np.where(memory.running == 0.0, (regulator.c - 1.0) * m, memory.last)
    derivative = np.where(regulator.derives, (Tf * memory.derivative + g - before) / (Tf + Ts), 0.0)
    u = kp * (regulator.b * reference - m_f) + memory.integral + kd * derivative
    led, section_1, section_2 = lead_lag(u, wn, memory, regulator)
    notched, notch_1, notch_2 = notch(led, wn, memory, regulator)
    opening = notched + forward
    ratio = pressure_ratio(opening, y, p_a, p_b, regulator)
    wanted = ratio * opening
    raised = np.where(wanted < -1.0, -1.0, wanted)
    limited = np.where(raised > 1.0, 1.0, raised)
    x = inverse(limited, regulator)
    gained = Ts * (ki * error + (limited - wanted) / ratio * regulator.tracking_rate)
    integral = np.where(regulator.integrates, memory.integral + gained, 0.0)
    last = np.where(regulator.derives, g, 0.0)
    return Memory(integral, derivative, last, notch_1, notch_2, x, section_1, section_2, m_f, 1.0)


def inputs_read(regulator):
    """Names of the inputs that the law reads, in the order of (reference, v_ref, measured)."""
    speed = () if regulator.position else ("v",)
    return ("reference", "v_ref", *(("p_a", "p_b") if regulator.compensated else ()), *speed, "y")


def is_sound(reference, v_ref, measured, regulator):
    """Whether every input that the law reads is finite."""
    p_a, p_b, v, y = measured
    speed = np.isfinite(v) | regulator.position
    pressures = (np.isfinite(p_a) & np.isfinite(p_b)) | (not regulator.compensated)
    return np.isfinite(reference) & np.isfinite(v_ref) & np.isfinite(y) & speed & pressures


def is_finite(memory):
    """Whether the command and every state are finite."""
    return (
        np.isfinite(memory.integral)
        & np.isfinite(memory.derivative)
        & np.isfinite(memory.last)
        & np.isfinite(memory.notch_1)
        & np.isfinite(memory.notch_2)
        & np.isfinite(memory.x)
        & np.isfinite(memory.section_1)
        & np.isfinite(memory.section_2)
        & np.isfinite(memory.filtered)
    )


def sample(reference, v_ref, measured, memory, regulator):
    """The whole law for one sample: lookup at (memory's x, y), then `regulate`. Returns the new
    memory, AT_REST after a fault.

    measured = (p_a, p_b, v, y); of the pressures only a compensation reads, of v only a velocity
    loop.
    """
    if not is_sound(reference, v_ref, measured, regulator):
        return AT_REST
    gains = gains_at(memory.x, measured[3], regulator)
    new = regulate(reference, feed_forward(v_ref, regulator), measured, gains, memory, regulator)
    return new if is_finite(new) else AT_REST


def start(x, reference, v_ref, measured, regulator):
    """The memory from which the next sample, with these inputs, gives the command x: a bumpless
    start, or change of schedule.

    x is clipped to [-1, 1]. Filters stand in their steady state. Without an integral nothing can
    hold x: its memory is 0, and the command jumps to what the law asks for. With an input that is
    not finite the law starts from rest. A state that is not finite is left for the next sample to
    find.
    """
    if not (is_sound(reference, v_ref, measured, regulator) and np.isfinite(x)):
        return AT_REST
    raised = np.where(x < -1.0, -1.0, x)
    x = np.where(raised > 1.0, 1.0, raised)
    gains = gains_at(x, measured[3], regulator)
    return held(x, reference, feed_forward(v_ref, regulator), measured, gains, regulator)


def held(x, reference, forward, measured, gains, regulator):
    """The memory of `start` for |x| <= 1, free of branches; the arguments are those of
    `regulate`."""
    kp, _, _, wn = gains
    p_a, p_b, v, y = measured
    m = np.where(regulator.position, y, v)
    slope = 1.0 - regulator.inverse_depth
    middle = slope * regulator.inverse_width + regulator.inverse_depth * (
        1.0 + regulator.inverse_width
    )
    size = np.where(x < 0.0, -x, x)
    half = 0.5 * (middle - size)
    limited = (np.sqrt(half * half + slope * size * regulator.inverse_width) - half) / slope
    opening = np.where(x < 0.0, -limited, limited)
    opening = opening / pressure_ratio(opening, y, p_a, p_b, regulator)
    proportional = kp * (regulator.b * reference - m)
    integral = np.where(regulator.integrates, opening - forward - proportional, 0.0)
    u = proportional + integral
    w = np.tan(0.5 * wn * regulator.Ts)
    _, _, b2, a2 = notch_coefficients(w, regulator.zz, regulator.zp)
    _, b1, a1 = section_coefficients(w, regulator.sections[0])
    _, d1, c1 = section_coefficients(w, regulator.sections[1])
    rest = (b2 - a2) * u
    last = np.where(regulator.derives, regulator.c * reference - m, 0.0)
    return Memory(integral, 0.0, last, rest, rest, x, (b1 - a1) * u, (d1 - c1) * u, m, 1.0)
