"""J3: closed-loop scenarios of 2 s at 1 kHz: a scheduled PID on a 21 by 11 table, random stiffness,
mass, supply, friction, load.

Times are per scenario. Errors are of y, relative to its range, in one scenario against DOP853 at
1e-12 from sample to sample. The bound is the time of two square roots and two divisions, in vector
code, for every evaluation of the plant.
"""

from __future__ import annotations

import os
import statistics
import time

import numpy as np
from scipy.integrate import solve_ivp

import hydroctl as hc
from hydroctl.validation import campaign, replay
from hydroctl.validation.cases import SPREAD

from . import closed_loop_peers as peers
from .measure import Contender, Row, compare
from .peers import PlainPID, scheduled_pid, slope_function

_STAGES = 8


def rows(*, smallest: bool) -> list[Row]:
    """A thousand scenarios of 2 s, or 32 of 20 ms."""
    count, samples = (32, 20) if smallest else (1000, 2000)
    actuator, schedule = hc.load_actuator("reference"), scheduled_pid()
    k = np.arange(samples)
    omega = 2.0 * np.pi * 1e-3
    sine = {"reference": 0.25 + 0.01 * np.sin(omega * k), "v_ref": 10.0 * omega * np.cos(omega * k)}
    asked = [hc.Scenario(name="sine", loop="position", Ts=1e-3, y=0.25, **sine)]
    given = {"scenarios": asked, "spread": SPREAD}
    machine, scenario, trajectory = replay(actuator, schedule, 1 << 32, **given)
    start = list(hc.rest_state(machine, 0.25))[:4]
    slope = slope_function(machine, machine.constant_load)

    def closed_loop(advance):
        pid, z, before, y = PlainPID(schedule), np.array(start), 0.0, []
        for k in range(samples):
            y.append(z[3])
            x, before = before, pid.command(scenario.reference[k], scenario.v_ref[k], z[3])
            z = advance(z, x)
        return np.array(y)

    def exact(z, x, method="DOP853", rtol=1e-12, atol=1e-12):
        return solve_ivp(
            lambda _, z: slope(z.tolist(), x), (0.0, 1e-3), z, method, rtol=rtol, atol=atol
        ).y[:, -1]

    expected = closed_loop(exact)

    def error(y):
        return float(np.abs(y - expected).max() / np.ptp(expected))

    def run_campaign(substeps, **where):
        campaign(
            actuator,
            schedule,
            count=count,
            chunk_size=max(32, count // 4),
            seed=1,
            substeps=substeps,
            **where,
            **given,
        )
        return substeps

    def replayed_error(substeps):
        return error(replay(actuator, schedule, 1 << 32, substeps=substeps, **given)[2].y)

    contenders = [
        *(
            Contender(
                f"python-control in {name}, one scenario",
                lambda sample=sample, pid=pid: peers.by_control(
                    schedule, scenario, start, slope, sample, pid(schedule)
                ),
                error,
            )
            for name, sample, pid in (
                ("NumPy", peers.arrays, peers.NumPyPID),
                ("plain floats", peers.floats, PlainPID),
            )
        ),
        Contender(
            "scipy RK45 per sample, one scenario",
            lambda: closed_loop(lambda z, x: exact(z, x, "RK45", 1e-6, 1e-6)),
            error,
        ),
        *peers.contenders(_machines(actuator, schedule, count, given), schedule, scenario, error),
    ]
    needed = int(trajectory.integrator.split()[2])
    threads = os.cpu_count()
    bound = _bound(5 if smallest else 4000)
    for substeps in sorted({1, needed}):
        for label, where, clock in (
            ("one thread", {"executor": _InPlace()}, time.process_time),
            (f"{threads} threads", {}, time.perf_counter),
        ):
            name = f"hydroctl campaign, {substeps} substep(s), {label}"
            limit = samples * substeps * _STAGES * bound
            note = f"bound {1e6 * limit:.3g} us" if label == "one thread" else ""
            contenders.append(
                Contender(
                    name,
                    lambda s=substeps, w=where: run_campaign(s, **w),
                    replayed_error,
                    count,
                    clock=clock,
                    note=note,
                )
            )
    return compare("J3", contenders, 1 if smallest else 5)


def _machines(actuator, schedule, count, given):
    """Those of the campaign's cases."""
    drawn = campaign(actuator, schedule, count=count, seed=1, **given).parameters
    drawn["load_force"] = drawn["load_force"] + actuator.load_force
    return [
        actuator.replace(**{name: float(row[k]) for name, row in drawn.items()})
        for k in range(count)
    ]


class _InPlace:
    """An executor that runs each task when it is submitted: one thread."""

    def submit(self, function, *args):
        from concurrent.futures import Future

        future = Future()
        future.set_result(function(*args))
        return future


def _bound(repeats: int) -> float:
    """Seconds for two square roots and two divisions per lane in compiled vector code, the median
    of seven."""
    import numba

    @numba.njit(error_model="numpy")
    def work(a, b, repeats):
        for _ in range(repeats):
            for i in range(a.size):
                p, q = a[i], b[i]
                a[i], b[i] = np.sqrt(p) / (q + 1.0) + 1.0, np.sqrt(q) / (p + 1.0) + 1.0

    a, b = np.full(1024, 2.0), np.full(1024, 3.0)
    work(a, b, 1)
    times = []
    for _ in range(7):
        begin = time.process_time()
        work(a, b, repeats)
        times.append((time.process_time() - begin) / repeats / a.size)
    return statistics.median(times)
