"""Peers of J3: python-control, and those that run all cases at once or compile.

`by_...(plants, law, signals, start)` of the latter makes a call to y (samples, n). All of them run
the same two functions: the law of `PlainPID`, then the plant for one sample in two steps of
Runge-Kutta 4.
"""

from __future__ import annotations

from collections.abc import Callable
from functools import cache, partial
from typing import NamedTuple

import numba
import numpy as np

from hydroctl import Actuator, GainSchedule, Scenario, rest_state

from .measure import Contender
from .peers import (
    PlainPID,
    Plant,
    casadi_root,
    compilable,
    either,
    jax_root,
    moved,
    numpy_root,
    plant_of,
    runge_kutta_4,
    signed_root,
    slopes,
)

_SUBSTEPS = 2


class Law(NamedTuple):
    """The regulator's gains kp, ki, kd on nodes of x and y, and its constants. The lowest and
    highest node of either side of x."""

    x: np.ndarray
    y: np.ndarray
    tables: np.ndarray
    retract: tuple[float, float]
    extend: tuple[float, float]
    Tf: float
    Tt: float
    Ts: float


def contenders(
    machines: list[Actuator], schedule: GainSchedule, scenario: Scenario, error: Callable
) -> list[Contender]:
    """All that run cases at once or compile; `error(y)` is of the first machine's case."""
    plants, law = np.array([plant_of(machine) for machine in machines]).T, law_of(schedule)
    start = np.array([rest_state(machine, scenario.y)[:4] for machine in machines]).T
    signals = signals_of(schedule, scenario.reference, scenario.v_ref)

    def contender(name, make, *needs, most=1000):
        count = min(len(machines), most)
        made = cache(partial(make, Plant(*plants[:, :count]), law, signals, start[:, :count]))
        return Contender(
            f"{name}, {count} at once",
            lambda: made()(),
            lambda y: error(y[:, 0]),
            units=count,
            needs=needs,
        )

    return [
        contender("CasADi map", by_casadi, "casadi", most=100),
        contender("diffrax Tsit5 per sample, vmap", by_diffrax, "diffrax"),
        contender("NumPy over the scenarios", by_numpy),
        contender("JAX vmap and scan", by_jax, "jax"),
        contender("numba, one after the other", by_numba),
    ]


def law_of(schedule: GainSchedule) -> Law:
    """The law of `scheduled_pid`."""
    below, above = schedule.x[schedule.x < 0], schedule.x[schedule.x > 0]
    sides = (float(below[0]), float(below[-1])), (float(above[0]), float(above[-1]))
    tables = np.array([schedule.kp, schedule.ki, schedule.kd])
    return Law(schedule.x, schedule.y, tables, *sides, schedule.Tf, schedule.Tt, schedule.Ts)


def signals_of(schedule: GainSchedule, reference, v_ref):
    """(2, samples): reference and feed-forward."""
    gain = np.where(v_ref > 0, schedule.speed_gain_extend, schedule.speed_gain_retract)
    offset = np.where(v_ref > 0, schedule.speed_offset_extend, schedule.speed_offset_retract)
    return np.array([reference, np.where(v_ref == 0.0, 0.0, v_ref / gain + offset)])


@compilable
def limited(value, least, most, where):
    """`value` within [least, most]."""
    value = where(value < least, least, value)
    return where(value > most, most, value)


@compilable
def opening(law, x, where):
    """x within the nodes of its side."""
    least = where(x < 0, law.retract[0], law.extend[0])
    return limited(x, least, where(x < 0, law.retract[1], law.extend[1]), where)


@compilable
def regulate(law, memory, gains, reference, forward, y, where):
    """The memory (integral, derivative, error, x) after a sample; x is the new command."""
    integral, derivative, last, _ = memory
    kp, ki, kd = gains
    error = reference - y
    derivative = (law.Tf * derivative + error - last) / (law.Tf + law.Ts)
    wanted = kp * error + integral + kd * derivative + forward
    x = limited(wanted, -1.0, 1.0, where)
    return integral + law.Ts * (ki * error + (x - wanted) / law.Tt), derivative, error, x


@compilable
def advance(plant, z, x, Ts, where, root):
    """z after one sample."""
    for _ in range(_SUBSTEPS):
        z = runge_kutta_4(plant, z, x, Ts / _SUBSTEPS, where, root)
    return z


class NumPyPID(PlainPID):
    """`PlainPID` that looks up its gains with NumPy, as most users write it."""

    def __init__(self, schedule: GainSchedule):
        super().__init__(schedule)
        self.law = law_of(schedule)

    def _gains(self, y):
        return gains_of_arrays(self.law, self.x, y, np)


def by_control(schedule: GainSchedule, scenario: Scenario, start, slope, sample, pid: PlainPID):
    """python-control: one discrete-time system that holds `pid` and the plant, with `slope(z, x)`
    of floats; one case."""
    import control

    def update(t, state, inputs, params):
        command = pid.command(*inputs.tolist(), float(state[3]))
        return [*sample(slope, state, schedule.Ts / _SUBSTEPS), command]

    system = control.nlsys(
        update,
        lambda t, state, inputs, params: state[3:4],
        states=5,
        inputs=2,
        outputs=1,
        dt=schedule.Ts,
    )
    signals = np.array([scenario.reference, scenario.v_ref])
    return control.input_output_response(system, scenario.t, signals, [*start, 0.0]).outputs.ravel()


def arrays(slope, state, h):
    """A sample of the plant as most users write it."""
    z, x = state[:4], state[4]
    for _ in range(_SUBSTEPS):
        k1 = np.array(slope(z, x))
        k2 = np.array(slope(z + 0.5 * h * k1, x))
        k3 = np.array(slope(z + 0.5 * h * k2, x))
        k4 = np.array(slope(z + h * k3, x))
        z = z + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)
    return z


def floats(slope, state, h):
    """The same with Python's own floats, which are faster than arrays of four."""
    *z, x = state.tolist()
    for _ in range(_SUBSTEPS):
        k1 = slope(z, x)
        k2 = slope(moved(z, 0.5 * h, k1), x)
        k3 = slope(moved(z, 0.5 * h, k2), x)
        k4 = slope(moved(z, h, k3), x)
        z = moved(moved(z, h / 6.0, k1), h / 3.0, moved(moved(k2, 1.0, k3), 0.5, k4))
    return z


def gains_of_arrays(law, x, y, m):
    """(3, ...): bilinear in the tables; m is NumPy or jax.numpy."""
    x, y = opening(law, x, m.where), m.clip(y, law.y[0], law.y[-1])
    i = m.clip(m.searchsorted(law.x, x, side="right") - 1, 0, law.x.size - 2)
    j = m.clip(m.searchsorted(law.y, y, side="right") - 1, 0, law.y.size - 2)
    f, g = (x - law.x[i]) / (law.x[i + 1] - law.x[i]), (y - law.y[j]) / (law.y[j + 1] - law.y[j])
    flat, first = law.tables.reshape(3, -1), i * law.y.size + j
    corners = [m.take(flat, first + step, axis=1) for step in (0, 1, law.y.size, law.y.size + 1)]
    low, high = (
        corners[0] + g * (corners[1] - corners[0]),
        corners[2] + g * (corners[3] - corners[2]),
    )
    return low + f * (high - low)


def by_numpy(plants: Plant, law: Law, signals, start):
    """NumPy: arrays over the cases."""

    def run():
        z, memory = tuple(start), (np.zeros_like(start[0]),) * 4
        y = np.empty((signals.shape[1], start.shape[1]))
        for k, (reference, forward) in enumerate(signals.T):
            y[k], x = z[3], memory[3]
            memory = regulate(
                law, memory, gains_of_arrays(law, x, z[3], np), reference, forward, z[3], np.where
            )
            z = advance(plants, z, x, law.Ts, np.where, numpy_root)
        return y

    return run


@compilable
def _gains(law, x, y):
    x, y = opening(law, x, either), limited(y, law.y[0], law.y[-1], either)
    i = j = 0
    for k in range(1, law.x.size - 1):
        i += x >= law.x[k]
    for k in range(1, law.y.size - 1):
        j += y >= law.y[k]
    f, g = (x - law.x[i]) / (law.x[i + 1] - law.x[i]), (y - law.y[j]) / (law.y[j + 1] - law.y[j])
    return (
        _bilinear(law.tables[0], i, j, f, g),
        _bilinear(law.tables[1], i, j, f, g),
        _bilinear(law.tables[2], i, j, f, g),
    )


@compilable
def _bilinear(table, i, j, f, g):
    low = table[i, j] + g * (table[i, j + 1] - table[i, j])
    high = table[i + 1, j] + g * (table[i + 1, j + 1] - table[i + 1, j])
    return low + f * (high - low)


@numba.njit(error_model="numpy")
def _case(plant, law, signals, z, y):
    memory = (0.0, 0.0, 0.0, 0.0)
    for k in range(y.size):
        y[k], x = z[3], memory[3]
        memory = regulate(
            law, memory, _gains(law, x, z[3]), signals[0, k], signals[1, k], z[3], either
        )
        z = advance(plant, z, x, law.Ts, either, signed_root)


def by_numba(plants: Plant, law: Law, signals, start):
    """numba: one case after the other."""
    cases = np.array(plants).T.tolist()

    def run():
        y = np.empty((len(cases), signals.shape[1]))
        for case, z, row in zip(cases, start.T.tolist(), y, strict=True):
            _case(Plant(*case), law, signals, tuple(z), row)
        return y.T

    return run


def _jax_run(plants, law, signals, start, make_advance):
    """vmap over the cases of a scan over the samples."""
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)
    advance_of = make_advance(jnp)
    law = law._replace(x=jnp.array(law.x), y=jnp.array(law.y), tables=jnp.array(law.tables))

    def case(plant, z):
        def sample(state, signal):
            z, memory = state
            x = memory[3]
            gains = gains_of_arrays(law, x, z[3], jnp)
            memory = regulate(law, memory, gains, signal[0], signal[1], z[3], jnp.where)
            return (advance_of(plant, z, x), memory), z[3]

        return jax.lax.scan(sample, (tuple(z), (0.0,) * 4), signals.T)[1]

    compiled = jax.jit(jax.vmap(case, in_axes=(0, 1), out_axes=1))
    return lambda: np.asarray(compiled(plants, start))


def by_jax(plants: Plant, law: Law, signals, start):
    """JAX: vmap and scan."""
    return _jax_run(
        plants,
        law,
        signals,
        start,
        lambda m: lambda p, z, x: advance(p, z, x, law.Ts, m.where, jax_root),
    )


def by_diffrax(plants: Plant, law: Law, signals, start):
    """JAX: vmap and scan, with two steps of diffrax's Tsit5 in every sample."""
    import diffrax

    def make_advance(m):
        term = diffrax.ODETerm(
            lambda t, z, given: slopes(*given[:1], z, given[1], m.where, jax_root)
        )
        options = {
            "saveat": diffrax.SaveAt(t1=True),
            "adjoint": diffrax.ForwardMode(),
            "max_steps": _SUBSTEPS,
        }

        def sample(plant, z, x):
            found = diffrax.diffeqsolve(
                term, diffrax.Tsit5(), 0.0, law.Ts, law.Ts / _SUBSTEPS, z, (plant, x), **options
            )
            return tuple(value[0] for value in found.ys)

        return sample

    return _jax_run(plants, law, signals, start, make_advance)


def by_casadi(plants: Plant, law: Law, signals, start):
    """CasADi: a function of one sample, mapped over the cases."""
    import casadi

    where, sizes = casadi.if_else, {"p": 13, "signal": 2, "z": 4, "memory": 4, "gains": 3}
    p, signal, z, memory, gains = (casadi.SX.sym(name, size) for name, size in sizes.items())
    at = casadi.vertcat(opening(law, memory[3], where), limited(z[3], law.y[0], law.y[-1], where))
    after = regulate(
        law, casadi.vertsplit(memory), casadi.vertsplit(gains), signal[0], signal[1], z[3], where
    )
    moved = advance(
        Plant(*casadi.vertsplit(p)), casadi.vertsplit(z), memory[3], law.Ts, where, casadi_root
    )
    find = casadi.Function("find", [z, memory], [at])
    move = casadi.Function(
        "move", [p, signal, z, memory, gains], [casadi.vertcat(*moved), casadi.vertcat(*after)]
    )
    table = casadi.interpolant("gains", "linear", [law.x, law.y], law.tables.ravel(order="F"))
    given = [casadi.MX.sym(name, size) for name, size in list(sizes.items())[:4]]
    sample = casadi.Function("sample", given, move(*given, table(find(*given[2:]))))
    mapped, cases = sample.map(start.shape[1]), casadi.DM(np.array(plants))

    def run():
        z, memory, y = casadi.DM(start), casadi.DM.zeros(*start.shape), []
        for now in signals.T:
            y.append(z[3, :])
            z, memory = mapped(cases, now, z, memory)
        return np.array(casadi.vertcat(*y))

    return run
