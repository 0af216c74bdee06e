"""The closed loop of many cases at once, compiled: blocks of 32 cases side by side, one row of numbers per quantity.

All rows of a block lie in one buffer at constant distances, and every pass over its lanes is straight-line code, so that the
compiler makes vector code of it. Each lane does what `sampled.run` does, with the same functions and the same rounding, and
adds up the metrics of its motion as it goes.
"""

from __future__ import annotations

from math import inf

from ..plant import Parameters
from . import butcher, careful, law, motion, sensing

LANES = 32
VARIED = ("bulk_modulus", "mass", "supply_pressure", "viscous_friction", "load_force")
"""What a case has of its own besides its initial state; `load_force` is added to the scenario's."""
SUMS = (
    "start",
    "per_step",
    "rise_10",
    "rise_90",
    "last_outside",
    "most",
    "late_least",
    "late_most",
    "late_sum",
    "iae",
    "ise",
    "largest_error",
    "peak_pressure",
    "lowest_pressure",
    "cavitation_time",
    "total_variation",
    "saturation_time",
    "least_y",
    "most_y",
)
"""What is added up per case; the first nine concern the last step of the reference."""
P_A, P_B, V, Y, SPOOL, SPOOL_RATE = (LANES * row for row in range(6))
BULK, MASS, SUPPLY, VISCOUS, LOAD = (LANES * row for row in range(6, 11))
INTEGRAL, DERIVATIVE, LAST, NOTCH_1, NOTCH_2, X, SECTION_1, SECTION_2, FILTERED, RUNNING = (LANES * row for row in range(11, 21))
KP, KI, KD, WN, TOLD, I_X, I_Y = (LANES * row for row in range(21, 28))
SEEN_A, SEEN_B, SEEN_V, SEEN_Y = (LANES * row for row in range(28, 32))
OLD = LANES * 32
"""six rows: the state before a substep"""
FIRST_SUM = 38
ROWS = FIRST_SUM + len(SUMS)
(START, PER_STEP, RISE_10, RISE_90, OUTSIDE, MOST, LATE_LEAST, LATE_MOST, LATE_SUM) = (
    LANES * row for row in range(FIRST_SUM, FIRST_SUM + 9)
)
(IAE, ISE, LARGEST, PEAK, LOWEST, CAVITATION, VARIATION, SATURATION, LEAST_Y, MOST_Y) = (
    LANES * row for row in range(FIRST_SUM + 9, ROWS)
)


def _varied(w, i, p):
    """The parameters of lane i: its own where they vary."""
    return Parameters(
        p.area_a,
        p.area_b,
        p.volume_a,
        p.volume_b,
        w[BULK + i],
        p.leakage,
        p.flow_coefficient_a,
        p.flow_coefficient_b,
        w[SUPPLY + i],
        p.tank_pressure,
        w[MASS + i],
        w[VISCOUS + i],
        p.coulomb_friction,
        p.breakaway_friction,
        p.stribeck_speed,
        p.creep_speed,
        p.stroke,
        p.end_stop_stiffness,
        p.end_stop_damping,
        p.valve_natural_frequency,
        p.valve_damping,
        p.valve_rate_limit,
        p.dead_band,
    )


def _walk(nodes, value, index):
    """`law.interval`, found from a guess."""
    while index + 1 < nodes.size and value >= nodes[index + 1]:
        index += 1
    while index > 0 and value < nodes[index]:
        index -= 1
    return index


def _see(w, k, sensors):
    for i in range(LANES):
        values = (w[P_A + i], w[P_B + i], w[V + i], w[Y + i])
        w[SEEN_A + i], w[SEEN_B + i], w[SEEN_V + i], w[SEEN_Y + i] = sensing.seen(values, k, sensors)


def _look_up(w, regulator):
    """Gains of every lane. Gathering from a table is no vector code; the search starts from the last sample's cell."""
    for i in range(LANES):
        x, y = law.clipped_opening(w[X + i], regulator), law.clipped_position(w[SEEN_Y + i], regulator)
        row, column = _walk(regulator.x, x, int(w[I_X + i])), _walk(regulator.y, y, int(w[I_Y + i]))
        w[I_X + i], w[I_Y + i] = float(row), float(column)
        fraction_x = (x - regulator.x[row]) * regulator.x_slope[row]
        fraction_y = (y - regulator.y[column]) * regulator.y_slope[column]
        w[KP + i] = law.interpolate(regulator.table, row, column, fraction_x, fraction_y, 0)
        w[KI + i] = law.interpolate(regulator.table, row, column, fraction_x, fraction_y, 1)
        w[KD + i] = law.interpolate(regulator.table, row, column, fraction_x, fraction_y, 2)
        if regulator.shaped:
            w[WN + i] = law.interpolate(regulator.table, row, column, fraction_x, fraction_y, 3)


def _regulate(w, reference, forward, regulator):
    for i in range(LANES):
        gains = (w[KP + i], w[KI + i], w[KD + i], w[WN + i])
        memory = law.Memory(
            w[INTEGRAL + i],
            w[DERIVATIVE + i],
            w[LAST + i],
            w[NOTCH_1 + i],
            w[NOTCH_2 + i],
            w[X + i],
            w[SECTION_1 + i],
            w[SECTION_2 + i],
            w[FILTERED + i],
            w[RUNNING + i],
        )
        seen = (w[SEEN_A + i], w[SEEN_B + i], w[SEEN_V + i], w[SEEN_Y + i])
        new = law.regulate(reference, forward, seen, gains, memory, regulator)
        w[VARIATION + i] += abs(new.x - w[X + i])
        w[INTEGRAL + i], w[DERIVATIVE + i], w[LAST + i], w[NOTCH_1 + i], w[NOTCH_2 + i] = new[:5]
        w[X + i], w[SECTION_1 + i], w[SECTION_2 + i], w[FILTERED + i], w[RUNNING + i] = new[5:]


def _measure(w, k, first, late, measured, reference, target, p, Ts):
    """Add the motion at sample k to the sums. `first`: the sample of the last step; `late`: from where it should have settled."""
    since, is_step, is_after, is_late = float(k - first), k == first, k >= first, k >= late
    for i in range(LANES):
        value, x = w[measured + i], w[X + i]
        error = reference - value
        w[IAE + i] += abs(error) * Ts
        w[ISE + i] += error * error * Ts
        w[LARGEST + i] = max(w[LARGEST + i], abs(error))
        w[SATURATION + i] += Ts if abs(x) >= 1.0 else 0.0
        lowest, highest = min(w[P_A + i], w[P_B + i]), max(w[P_A + i], w[P_B + i])
        w[PEAK + i] = max(w[PEAK + i], highest)
        w[LOWEST + i] = min(w[LOWEST + i], lowest)
        w[CAVITATION + i] += Ts if lowest < p.tank_pressure - 1e-9 * w[SUPPLY + i] else 0.0
        w[LEAST_Y + i] = min(w[LEAST_Y + i], w[Y + i])
        w[MOST_Y + i] = max(w[MOST_Y + i], w[Y + i])
        w[START + i] = value if is_step else w[START + i]
        w[PER_STEP + i] = 1.0 / (target - value) if is_step else w[PER_STEP + i]
        progress = (value - w[START + i]) * w[PER_STEP + i]
        w[RISE_10 + i] = min(w[RISE_10 + i], since if is_after and progress >= 0.1 else inf)
        w[RISE_90 + i] = min(w[RISE_90 + i], since if is_after and progress >= 0.9 else inf)
        w[OUTSIDE + i] = since + 1.0 if is_after and abs(progress - 1.0) > 0.02 else w[OUTSIDE + i]
        w[MOST + i] = max(w[MOST + i], progress if is_after else 0.0)
        w[LATE_LEAST + i] = min(w[LATE_LEAST + i], progress if is_late else inf)
        w[LATE_MOST + i] = max(w[LATE_MOST + i], progress if is_late else -inf)


def run(cases, initial, reference, v_ref, load, first, late, steady, sensors, regulator, p, substeps, w, queue, sums):
    """Fill sums (len(SUMS), n) for n cases of one scenario, n a multiple of LANES.

    cases (len(VARIED), n), initial (6, n); reference, v_ref, load (samples,); `first`, `late`, `steady`: samples from which the
    last step, its settled part and the steady part count; `sensors` as in `sensing`. Room to work in: w (ROWS * LANES,), queue
    (delay_samples + 2, LANES).
    """
    past = regulator.delay_samples + 2
    measured = Y if regulator.position else V
    parts = careful.parts(regulator.delay_fraction, regulator.Ts, substeps)
    for block in range(cases.shape[1] // LANES):
        _load_block(w, cases, initial, block)
        queue[:] = 0.0
        for k in range(reference.size):
            _see(w, k, sensors)
            _look_up(w, regulator)
            _regulate(w, reference[k], law.feed_forward(v_ref[k], regulator), regulator)
            _measure(w, k, first, late, measured, reference[k], reference[-1], p, regulator.Ts)
            if k >= steady:
                for i in range(LANES):
                    w[LATE_SUM + i] += (w[measured + i] - w[START + i]) * w[PER_STEP + i]
            for i in range(LANES):
                queue[k % past, i] = w[X + i]
            for part in range(2):
                count, h = parts[part]
                if count > 0:
                    _advance(w, queue, (k + 1 + part) % past, load[k], p, count, h)
        for row in range(len(SUMS)):
            for i in range(LANES):
                sums[row, block * LANES + i] = w[(FIRST_SUM + row) * LANES + i]


def _load_block(w, cases, initial, block):
    w[:] = 0.0
    for row in range(6):
        for i in range(LANES):
            w[P_A + row * LANES + i] = initial[row, block * LANES + i]
    for row in range(cases.shape[0]):
        for i in range(LANES):
            w[BULK + row * LANES + i] = cases[row, block * LANES + i]
    for i in range(LANES):
        w[RISE_10 + i], w[RISE_90 + i], w[LATE_LEAST + i], w[LOWEST + i], w[LEAST_Y + i] = inf, inf, inf, inf, inf
        w[LATE_MOST + i], w[PEAK + i], w[MOST_Y + i] = -inf, -inf, -inf


def _advance(w, queue, told, load, p, substeps, h):
    """Substeps under the commands in the row `told` of the queue."""
    for i in range(LANES):
        w[TOLD + i] = queue[told, i]
    for i in range(LANES):
        w[SPOOL + i] = motion.told(_state(w, P_A + i), w[TOLD + i], p)[4]
    for _ in range(substeps):
        for i in range(LANES):
            z = _state(w, P_A + i)
            _put(w, OLD + i, z)
            _put(w, P_A + i, butcher.step(z, w[TOLD + i], load + w[LOAD + i], _varied(w, i, p), h))
        for i in range(LANES):
            z, new, own = _state(w, OLD + i), _state(w, P_A + i), _varied(w, i, p)
            _put(w, P_A + i, careful.mended(z, new, w[TOLD + i], load + w[LOAD + i], own, h))


def _state(w, i):
    return w[i], w[i + LANES], w[i + 2 * LANES], w[i + 3 * LANES], w[i + 4 * LANES], w[i + 5 * LANES]


def _put(w, i, z):
    w[i], w[i + LANES], w[i + 2 * LANES], w[i + 3 * LANES], w[i + 4 * LANES], w[i + 5 * LANES] = z
