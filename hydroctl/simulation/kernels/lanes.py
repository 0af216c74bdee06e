"""The closed loop of many cases at once, compiled: blocks of 32 cases side by side, one row of
numbers per quantity.

All rows of a block lie in one buffer at constant distances, and every pass over its lanes is
straight-line code, so that the compiler makes vector code of it. Each lane does what `sampled.run`
does, with the same functions and the same rounding, and adds up the metrics of its motion as it
goes. A fault of the regulator ends a case: its total variation is infinite from then on.
"""

from __future__ import annotations

from itertools import count
from math import inf

from ...compilation.written_out import keeper, maker
from ...model import chambers, friction, supply
from ...model.load import Load
from ...model.plant import Parameters
from ...regulator import feed_forward, gains, law
from ...regulator.law import Memory
from .. import sensing
from . import adaptive, motion, runge_kutta, stepping

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
_rows = count()


def _take(rows: int) -> tuple[int, ...]:
    """Where the next rows of the buffer begin."""
    return tuple(LANES * next(_rows) for _ in range(rows))


P_A, P_B, V, Y, SPOOL, SPOOL_RATE = _take(6)
BULK, INVERSE_MASS, SUPPLY, VISCOUS, LOAD = _take(len(VARIED))
MEMORY = dict(zip(Memory._fields, _take(len(Memory._fields)), strict=True))
"""where each field of the law's memory stands"""
X = MEMORY["x"]
KP, KI, KD, WN, COMMAND = _take(5)
SEEN_A, SEEN_B, SEEN_V, SEEN_Y = _take(4)
X_IN, Y_IN, BENT, X_FROM, X_TO, X_SLOPE, Y_FROM, Y_TO, Y_SLOPE = _take(9)
"""the table's cell of each lane: where in it, its bounds, 1/(its widths); and 1 where a step wants
error control"""
CORNERS, *_ = _take(4 * 4)
"""four corners of each gain"""
NEW, K1, K2, K3, K4, K5, K6, K7, K8 = (_take(6)[0] for _ in range(9))
"""the state after a substep, and the slopes in it"""
SUM = dict(zip(SUMS, _take(len(SUMS)), strict=True))
"""where each sum stands"""
START, PER_STEP, RISE_10, RISE_90 = (
    SUM[name] for name in ("start", "per_step", "rise_10", "rise_90")
)
OUTSIDE, MOST, LATE_LEAST, LATE_MOST, LATE_SUM = (
    SUM[name] for name in ("last_outside", "most", "late_least", "late_most", "late_sum")
)
IAE, ISE, LARGEST, PEAK, LOWEST = (
    SUM[name] for name in ("iae", "ise", "largest_error", "peak_pressure", "lowest_pressure")
)
CAVITATION, VARIATION, SATURATION, LEAST_Y, MOST_Y = (
    SUM[name]
    for name in ("cavitation_time", "total_variation", "saturation_time", "least_y", "most_y")
)
FIRST_SUM = START
ROWS = next(_rows)

_PLACES = {name: f"w[{row} + i]" for name, row in MEMORY.items()}
_memory = maker("_memory", "w, i", Memory, _PLACES, __name__=__name__)
_keep = keeper("_keep", "w, i, memory", _PLACES, __name__=__name__)


def _varied(w, i, p):
    """The parameters of lane i: its own where they vary."""
    return Parameters(
        chambers=chambers.with_bulk_modulus(p.chambers, w[BULK + i]),
        supply=supply.with_pressure(p.supply, w[SUPPLY + i]),
        valve=p.valve,
        spool=p.spool,
        friction=friction.with_viscous_friction(p.friction, w[VISCOUS + i]),
        end_stops=p.end_stops,
        load=Load(w[INVERSE_MASS + i]),
    )


def _read(w, k, sensors):
    """The first of the four rows in which the regulator reads the plant: the plant's own where
    there are no sensors."""
    if sensors is None:
        return P_A
    for i in range(LANES):
        values = (w[P_A + i], w[P_B + i], w[V + i], w[Y + i])
        w[SEEN_A + i], w[SEEN_B + i], w[SEEN_V + i], w[SEEN_Y + i] = sensing.seen(
            values, k, sensors
        )
    return SEEN_A


def _look_up(w, seen, regulator):
    """Gains of every lane, from the corners of its cell of the table. Only a lane that left its
    cell reads the table."""
    left = 0
    for i in range(LANES):
        x, y = (
            gains.clipped_opening(w[X + i], regulator),
            gains.clipped_position(w[seen + 3 * LANES + i], regulator),
        )
        w[X_IN + i], w[Y_IN + i] = x, y
        left += 0 if _is_inside(w, i) else 1
    if left > 0:
        for i in range(LANES):
            if not _is_inside(w, i):
                _enter_cell(w, i, regulator)
    for i in range(LANES):
        fractions = (
            (w[X_IN + i] - w[X_FROM + i]) * w[X_SLOPE + i],
            (w[Y_IN + i] - w[Y_FROM + i]) * w[Y_SLOPE + i],
        )
        w[KP + i] = _between(w, i, 0, fractions)
        w[KI + i] = _between(w, i, 1, fractions)
        w[KD + i] = _between(w, i, 2, fractions)
        if regulator.shaped:
            w[WN + i] = _between(w, i, 3, fractions)


def _is_inside(w, i):
    """Whether lane i is in the cell that it entered last."""
    x, y = w[X_IN + i], w[Y_IN + i]
    return (w[X_FROM + i] <= x) & (x < w[X_TO + i]) & (w[Y_FROM + i] <= y) & (y < w[Y_TO + i])


def _enter_cell(w, i, regulator):
    """Take the bounds and corners of the cell in which lane i is."""
    row, column = gains.interval(regulator.x, w[X_IN + i]), gains.interval(regulator.y, w[Y_IN + i])
    w[X_FROM + i], w[X_TO + i], w[X_SLOPE + i] = _bounds(regulator.x, regulator.x_slope, row)
    w[Y_FROM + i], w[Y_TO + i], w[Y_SLOPE + i] = _bounds(regulator.y, regulator.y_slope, column)
    for gain in range(4):
        at = CORNERS + 4 * LANES * gain + i
        w[at], w[at + LANES], w[at + 2 * LANES], w[at + 3 * LANES] = gains.corners(
            regulator.table, row, column, gain
        )


def _bounds(nodes, slopes, index):
    return nodes[index], nodes[index + 1] if index + 1 < nodes.size else inf, slopes[index]


def _between(w, i, gain, fractions):
    at = CORNERS + 4 * LANES * gain + i
    return gains.bilinear(
        (w[at], w[at + LANES], w[at + 2 * LANES], w[at + 3 * LANES]), fractions[0], fractions[1]
    )


def _regulate(w, seen, reference, forward, regulator):
    for i in range(LANES):
        scheduled = (w[KP + i], w[KI + i], w[KD + i], w[WN + i])
        memory = _memory(w, i)
        measured = (
            w[seen + i],
            w[seen + LANES + i],
            w[seen + 2 * LANES + i],
            w[seen + 3 * LANES + i],
        )
        new = law.regulate(reference, forward, measured, scheduled, memory, regulator)
        sound = law.is_sound(reference, forward, measured, regulator) & law.is_finite(new)
        w[VARIATION + i] += abs(new.x - w[X + i]) if sound else inf
        _keep(w, i, new)


def _measure(w, k, first, late, measured, reference, target, p, Ts):
    """Add the motion at sample k to the sums. `first`: the sample of the last step; `late`: from
    where it should have settled."""
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
        w[CAVITATION + i] += Ts if lowest < p.supply.tank_pressure - 1e-9 * w[SUPPLY + i] else 0.0
        w[LEAST_Y + i] = min(w[LEAST_Y + i], w[Y + i])
        w[MOST_Y + i] = max(w[MOST_Y + i], w[Y + i])
    if k >= first:
        _measure_step(w, k - first, k >= late, measured, target)


def _measure_step(w, since, is_late, measured, target):
    """The same for the last step of the reference, `since` samples after it."""
    is_step, now = since == 0, float(since)
    for i in range(LANES):
        value = w[measured + i]
        w[START + i] = value if is_step else w[START + i]
        w[PER_STEP + i] = 1.0 / (target - value) if is_step else w[PER_STEP + i]
        progress = (value - w[START + i]) * w[PER_STEP + i]
        w[RISE_10 + i] = min(w[RISE_10 + i], now if progress >= 0.1 else inf)
        w[RISE_90 + i] = min(w[RISE_90 + i], now if progress >= 0.9 else inf)
        w[OUTSIDE + i] = now + 1.0 if abs(progress - 1.0) > 0.02 else w[OUTSIDE + i]
        w[MOST + i] = max(w[MOST + i], progress)
        w[LATE_LEAST + i] = min(w[LATE_LEAST + i], progress if is_late else inf)
        w[LATE_MOST + i] = max(w[LATE_MOST + i], progress if is_late else -inf)


def run(
    cases,
    initial,
    reference,
    v_ref,
    load,
    first,
    late,
    steady,
    sensors,
    regulator,
    p,
    substeps,
    w,
    queue,
    sums,
):
    """Fill sums (len(SUMS), n) for n cases of one scenario, n a multiple of LANES.

    cases (len(VARIED), n), initial (6, n); reference, v_ref, load (samples,); `first`, `late`,
    `steady`: samples from which the last step, its settled part and the steady part count;
    `sensors` as in `sensing`. Room to work in: w (ROWS * LANES,), queue (delay_samples + 2, LANES).
    """
    past = regulator.delay_samples + 2
    measured = Y if regulator.position else V
    stretches = stepping.stretches(regulator.delay_fraction, regulator.Ts, substeps)
    for block in range(cases.shape[1] // LANES):
        _load_block(w, cases, initial, block)
        queue[:] = 0.0
        for k in range(reference.size):
            seen = _read(w, k, sensors)
            _look_up(w, seen, regulator)
            _regulate(w, seen, reference[k], feed_forward.step(v_ref[k], regulator), regulator)
            _measure(w, k, first, late, measured, reference[k], reference[-1], p, regulator.Ts)
            if k >= steady:
                for i in range(LANES):
                    w[LATE_SUM + i] += (w[measured + i] - w[START + i]) * w[PER_STEP + i]
            for i in range(LANES):
                queue[k % past, i] = w[X + i]
            for part in range(2):
                count, h = stretches[part]
                if count > 0:
                    _advance(w, queue, (k + 1 + part) % past, load[k], p, count, h)
        for row in range(len(SUMS)):
            for i in range(LANES):
                sums[row, block * LANES + i] = w[FIRST_SUM + row * LANES + i]


def _load_block(w, cases, initial, block):
    w[:] = 0.0
    for row in range(6):
        for i in range(LANES):
            w[P_A + row * LANES + i] = initial[row, block * LANES + i]
    for row in range(cases.shape[0]):
        for i in range(LANES):
            w[BULK + row * LANES + i] = cases[row, block * LANES + i]
    for i in range(LANES):
        w[INVERSE_MASS + i] = 1.0 / w[INVERSE_MASS + i]
        w[RISE_10 + i], w[RISE_90 + i], w[LATE_LEAST + i], w[LOWEST + i], w[LEAST_Y + i] = (
            inf,
            inf,
            inf,
            inf,
            inf,
        )
        w[LATE_MOST + i], w[PEAK + i], w[MOST_Y + i] = -inf, -inf, -inf


def _advance(w, queue, row, load, p, substeps, h):
    """Substeps under the commands in a row of the queue."""
    for i in range(LANES):
        w[COMMAND + i] = queue[row, i]
    for i in range(LANES):
        w[SPOOL + i] = motion.commanded(_state(w, P_A + i), w[COMMAND + i], p)[4]
    for _ in range(substeps):
        _step(w, load, p, h)
        bent = 0
        for i in range(LANES):
            bends = motion.bends(
                _state(w, P_A + i), _state(w, NEW + i), w[COMMAND + i], _varied(w, i, p)
            )
            w[BENT + i] = 1.0 if bends else 0.0
            bent += 1 if bends else 0
        if bent > 0:
            for i in range(LANES):
                if w[BENT + i] > 0.0:
                    _put(
                        w,
                        NEW + i,
                        adaptive.advance(
                            _state(w, P_A + i),
                            w[COMMAND + i],
                            load + w[LOAD + i],
                            _varied(w, i, p),
                            h,
                        ),
                    )
        for i in range(LANES):
            _put(w, P_A + i, _state(w, NEW + i))


def _step(w, load, p, h):
    """`runge_kutta.step` of every lane, each stage of all before the next: so the processor need
    not wait for one to end."""
    for i in range(LANES):
        _take_slope(w, K1, i, _state(w, P_A + i), load, p)
    for i in range(LANES):
        _take_slope(w, K2, i, runge_kutta.second(_state(w, P_A + i), h, _slopes(w, i)), load, p)
    for i in range(LANES):
        _take_slope(w, K3, i, runge_kutta.third(_state(w, P_A + i), h, _slopes(w, i)), load, p)
    for i in range(LANES):
        _take_slope(w, K4, i, runge_kutta.fourth(_state(w, P_A + i), h, _slopes(w, i)), load, p)
    for i in range(LANES):
        _take_slope(w, K5, i, runge_kutta.fifth(_state(w, P_A + i), h, _slopes(w, i)), load, p)
    for i in range(LANES):
        _take_slope(w, K6, i, runge_kutta.sixth(_state(w, P_A + i), h, _slopes(w, i)), load, p)
    for i in range(LANES):
        _take_slope(w, K7, i, runge_kutta.seventh(_state(w, P_A + i), h, _slopes(w, i)), load, p)
    for i in range(LANES):
        _take_slope(w, K8, i, runge_kutta.eighth(_state(w, P_A + i), h, _slopes(w, i)), load, p)
    for i in range(LANES):
        _put(w, NEW + i, runge_kutta.end(_state(w, P_A + i), h, _slopes(w, i)))


def _take_slope(w, k, i, z, load, p):
    """Put the slope of lane i at z into the rows k."""
    _put(w, k + i, motion.slope(z, w[COMMAND + i], load + w[LOAD + i], _varied(w, i, p)))


def _slopes(w, i):
    return (
        _state(w, K1 + i),
        _state(w, K2 + i),
        _state(w, K3 + i),
        _state(w, K4 + i),
        _state(w, K5 + i),
        _state(w, K6 + i),
        _state(w, K7 + i),
        _state(w, K8 + i),
    )


def _state(w, i):
    return (
        w[i],
        w[i + LANES],
        w[i + 2 * LANES],
        w[i + 3 * LANES],
        w[i + 4 * LANES],
        w[i + 5 * LANES],
    )


def _put(w, i, z):
    w[i], w[i + LANES], w[i + 2 * LANES], w[i + 3 * LANES], w[i + 4 * LANES], w[i + 5 * LANES] = z
