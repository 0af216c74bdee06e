"""Several cylinders under one reference, compiled: each with its own plant, load and regulator,
coupled by what they measure.

At sample k, with the path time s in samples, the common reference r = path(s), the path's speed and
the measured y_j:

    lag      = max_j (r - y_j) in the direction of motion
    wanted   = 1 - (lag - free)/span within [least, 1]
    rate    += Ts/(T + Ts) (wanted - rate),  at most ceiling(s)
    target_i = r + kp d_i + I_i,  d_i = sum_j M_ij (r - y_j)      what regulator i is given
    I_i     += Ts ki d_i, as long as no valve is fully open                   forward Euler
    v_ref    = rate * speed(s);  s += rate

From the sample on at which a position is not known, or is further from r than allowed, the group
stops: r is decelerated evenly to rest over the stated distance, target_i - r stays as it was, and a
cylinder whose valve is stuck is shut off (x = 0).
"""

from __future__ import annotations

from math import inf, nan

from numba.np.unsafe.ndarray import to_fixed_tuple

from ...compilation.written_out import maker
from ...model.chambers import Chambers
from ...model.end_stops import EndStops
from ...model.friction import Friction
from ...model.load import Load
from ...model.plant import Parameters
from ...model.spool import Spool
from ...model.supply import Supply
from ...model.valve import Valve
from ...regulator import law
from ...regulator.compensation import Compensation
from ...regulator.law import AT_REST, COUNTS, FLAGS, Regulator
from . import motion, stepping

ROWS = ("p_a", "p_b", "v", "y", "spool", "x", "command", "target")
COMMON_ROWS = ("reference", "v_ref", "rate")
SOUND, SENSOR, VALVE = 0, 1, 2
"""What fails in the cylinder that fails: nothing, the sensor of its position, its valve."""
Y, X, COMMAND, TARGET = 3, 5, 6, 7
REFERENCE, V_REF, RATE = 0, 1, 2
ARRAYS = ("x", "x_slope", "y", "y_slope", "table", "limits", "sections", "compensation")
"""The fields of a regulator that have tables of their own, in this order; the last table holds
those that are single numbers."""
NUMBERS = tuple(name for name in Regulator._fields if name not in ARRAYS)
_COMPONENTS = {
    "chambers": Chambers,
    "supply": Supply,
    "valve": Valve,
    "spool": Spool,
    "friction": Friction,
    "end_stops": EndStops,
    "load": Load,
}
_PAIRS = "(to_fixed_tuple(tables[{0}][i, 0], 2), to_fixed_tuple(tables[{0}][i, 1], 2))"


def _row(kind, table: int) -> str:
    """A record of numbers from row i of a table."""
    return f"{kind.__name__}(*to_fixed_tuple(tables[{table}][i], {len(kind._fields)}))"


def _number(name: str) -> str:
    text = f"tables[{len(ARRAYS)}][i, {NUMBERS.index(name)}]"
    return f"{text} != 0.0" if name in FLAGS else f"int({text})" if name in COUNTS else text


regulator_at = maker(
    "regulator_at",
    "i, tables",
    Regulator,
    {name: f"tables[{k}][i]" for k, name in enumerate(ARRAYS)}
    | {name: _number(name) for name in NUMBERS}
    | {
        "sections": _PAIRS.format(ARRAYS.index("sections")),
        "compensation": _row(Compensation, ARRAYS.index("compensation")),
    },
    to_fixed_tuple=to_fixed_tuple,
    Compensation=Compensation,
    __name__=__name__,
)
machine_at = maker(
    "machine_at",
    "i, tables",
    Parameters,
    {name: _row(_COMPONENTS[name], k) for k, name in enumerate(Parameters._fields)},
    to_fixed_tuple=to_fixed_tuple,
    **{kind.__name__: kind for kind in _COMPONENTS.values()},
    __name__=__name__,
)


def at(values, place):
    """`values` at the path time, linear between samples; the last one beyond the end."""
    k = min(int(place), values.size - 1)
    following = min(k + 1, values.size - 1)
    return values[k] + (place - k) * (values[following] - values[k])


def run_out(reference, v_ref, elapsed, distance):
    """(reference, speed) `elapsed` seconds after they were `reference` and `v_ref`: decelerated
    evenly to rest over `distance`."""
    if v_ref == 0.0:
        return reference, 0.0
    duration = 2.0 * distance / abs(v_ref)
    passed = min(elapsed, duration)
    return reference + v_ref * passed * (1.0 - 0.5 * passed / duration), v_ref * (
        1.0 - passed / duration
    )


def slowed(rate, reference, speed, seen, override, Ts):
    """The next rate; override = (free, span, T, least)."""
    free, span, time, least = override
    lag = -inf
    for y in seen:
        lag = max(lag, reference - y if speed > 0.0 else y - reference if speed < 0.0 else -inf)
    wanted = min(1.0, max(least, 1.0 - (lag - free) / span))
    return rate + Ts / (time + Ts) * (wanted - rate)


def is_lost(reference, seen, allowed):
    """Whether a position is not known or further than `allowed` from the reference."""
    lost = False
    for y in seen:
        lost |= not abs(reference - y) <= allowed
    return lost


def lead(k, place, rate, stopped, path, seen, override, stop, Ts, common):
    """Fill common[:, k]. Returns the new rate and the sample of the stop, -1 before it."""
    distance, allowed = stop
    if stopped < 0:
        reference, speed = at(path[0], place), at(path[1], place)
        if not is_lost(reference, seen, allowed):
            rate = min(slowed(rate, reference, speed, seen, override, Ts), at(path[2], place))
            common[REFERENCE, k], common[V_REF, k], common[RATE, k] = reference, rate * speed, rate
            return rate, -1
        stopped = k
    last = max(stopped - 1, 0)
    elapsed = (k - last) * Ts
    common[REFERENCE, k], common[V_REF, k] = run_out(
        common[REFERENCE, last], common[V_REF, last], elapsed, distance
    )
    common[RATE, k] = 0.0
    return 1.0, stopped


def couple(reference, seen, coupling, integrals, differences, offsets):
    """Fill the d_i, and what the coupling adds to the common reference."""
    matrix, kp, _ = coupling
    for i in range(seen.size):
        differences[i] = 0.0
        for j in range(seen.size):
            differences[i] += matrix[i, j] * (reference - seen[j])
        offsets[i] = kp * differences[i] + integrals[i]


def commands(i, k, stopped, failure, delay, out):
    """The commands that valve i gets in sample k, before and after its new one acts."""
    faulty, since, kind = failure
    if i == faulty and kind == VALVE and k >= since:
        held = 0.0 if stopped >= 0 or since == 0 else out[i, X, since - 1]
        return held, held
    return (out[i, COMMAND, k - delay - 1] if k > delay else 0.0), (
        out[i, COMMAND, k - delay] if k >= delay else 0.0
    )


def run(
    states, path, load, override, stop, failure, coupling, tables, machines, substeps, out, common
):
    """Fill out (N, 8, n) and common (3, n), rows as in ROWS and COMMON_ROWS. Returns (samples run,
    sample of the stop or -1, s).

    states (N, 6): where the cylinders start, then where they are one sample after the last; path
    (3, m): position, speed and the ceiling; load (N, n) in N; override = (free, span, T, least);
    stop = (distance, allowed); coupling = (M, kp, ki); failure = (cylinder, sample, kind); tables:
    a row for each regulator; machines: a table (N, ...) for each component of the plants. The run
    ends with the path, or after n samples.
    """
    count, samples = load.shape
    faulty, since, kind = failure
    regulators = [regulator_at(i, tables) for i in range(count)]
    plants = [machine_at(i, machines) for i in range(count)]
    memories = [AT_REST for _ in range(count)]
    seen, differences, integrals, offsets = (
        states[:, Y].copy(),
        0.0 * states[:, Y],
        0.0 * states[:, Y],
        0.0 * states[:, Y],
    )
    Ts = regulators[0].Ts
    stretches = [
        stepping.stretches(regulators[i].delay_fraction, Ts, substeps[i]) for i in range(count)
    ]
    place, rate, stopped = 0.0, 1.0, -1
    common[REFERENCE, 0], common[V_REF, 0] = path[0, 0], 0.0
    for k in range(samples):
        seen[:] = states[:, Y]
        if kind == SENSOR and k >= since:
            seen[faulty] = nan
        rate, stopped = lead(k, place, rate, stopped, path, seen, override, stop, Ts, common)
        reference, v_ref = common[REFERENCE, k], common[V_REF, k]
        if stopped < 0:
            couple(reference, seen, coupling, integrals, differences, offsets)
        open_wide = 0.0
        for i in range(count):
            z = to_fixed_tuple(states[i], 6)
            target = reference + offsets[i]
            memories[i] = law.sample(
                target, v_ref, (z[0], z[1], z[2], seen[i]), memories[i], regulators[i]
            )
            out[i, TARGET, k], out[i, COMMAND, k] = target, memories[i].x
            open_wide = max(open_wide, abs(memories[i].x))
            x = commands(i, k, stopped, failure, regulators[i].delay_samples, out)
            z = motion.commanded(z, x[1] if stretches[i][0][0] == 0 else x[0], plants[i])
            out[i, 0, k], out[i, 1, k], out[i, 2, k], out[i, Y, k], out[i, 4, k], _ = z
            out[i, X, k] = x[1]
            for part in range(2):
                steps, h = stretches[i][part]
                z = motion.commanded(z, x[part], plants[i])
                for _ in range(steps):
                    z = stepping.step(z, x[part], load[i, k], plants[i], h)
            states[i, 0], states[i, 1], states[i, 2], states[i, 3], states[i, 4], states[i, 5] = z
        if open_wide < 1.0:
            for i in range(count):
                integrals[i] += Ts * coupling[2] * differences[i]
        if place >= path.shape[1] - 1:
            return k + 1, stopped, place
        place += rate
    return samples, stopped, place
