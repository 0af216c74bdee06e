"""Groups of cylinders for the tests of synchronised motion, and an independent route to such
motions."""

from __future__ import annotations

import functools

import numpy as np
from loops import PlainRegulator, accurate_hold
from machines import total_load

import hydroctl as hc

X, Y = [-1.0, -0.1, 0.1, 1.0], [0.0, 0.125, 0.25, 0.375, 0.5]
NOMINAL = hc.Specification(uncertainty="nominal", Ms=1.6, Mt=1.3)


@functools.cache
def tuned(bulk_modulus: float, mass: float, supply_pressure: float):
    """A position PI with notch on such a variant of the reference actuator, nominal Ms 1.6."""
    machine = hc.load_actuator("reference").replace(
        bulk_modulus=bulk_modulus, mass=mass, supply_pressure=supply_pressure
    )
    return hc.tune(machine, X, Y, loop="position", structure="pi+notch", specification=NOMINAL)


def pair():
    """Two schedules: masses 500 and 800 kg, bulk moduli 1.2 and 1.0 GPa."""
    return [tuned(1.2e9, 500.0, 46e6), tuned(1.0e9, 800.0, 46e6)]


def quartet():
    """Four schedules: masses 400 to 800 kg, one supply of 42 MPa."""
    return [tuned(1.2e9, mass, 42e6) for mass in (400.0, 500.0, 650.0, 800.0)]


def machines_of(schedules):
    """Their actuators."""
    return [schedule.actuator for schedule in schedules]


def plain_differences(name: str, e: np.ndarray) -> np.ndarray:
    """d_i of a coupling from the errors e_i = r - y_i, in words rather than as a matrix."""
    n = e.size
    if name == "mean":
        return np.array([e[i] - sum(e) / n for i in range(n)])
    if name == "ring":
        return np.array([e[i] - (e[i - 1] + e[(i + 1) % n]) / 2.0 for i in range(n)])
    return np.array([0.0, *([-e[0]] * (n - 1))])


def accurate_group(actuators, schedules, profile, states, loads, *, name, kc, ki, override=None):
    """((N, n) positions, (N, n) speeds, rates): `PlainRegulator`, DOP853 from sample to sample, the
    coupling by its definition."""
    regulators = [PlainRegulator(schedule) for schedule in schedules]
    states, integrals = [np.array(state, dtype=float) for state in states], np.zeros(len(actuators))
    commands, found, rates = [], [], []
    last = profile.position.size - 1
    place, rate = 0.0, 1.0
    for k in range(loads.shape[1]):
        found.append(states)
        y = np.array([state[3] for state in states])
        reference, speed = (
            np.interp(place, np.arange(last + 1), path)
            for path in (profile.position, profile.speed)
        )
        if override is not None:
            lag = np.max(np.sign(speed) * (reference - y)) if speed != 0.0 else -np.inf
            wanted = np.interp(lag, [override.free, override.limit], [1.0, override.least])
            if lag > override.limit:
                wanted = max(
                    override.least,
                    1.0
                    - (lag - override.free)
                    / (override.limit - override.free)
                    * (1.0 - override.least),
                )
            rate += profile.Ts / (override.time_constant + profile.Ts) * (wanted - rate)
        d = plain_differences(name, reference - y)
        targets = reference + kc * d + integrals
        commands.append(
            [
                r.command(t, rate * speed, *z[:4])
                for r, t, z in zip(regulators, targets, states, strict=True)
            ]
        )
        if np.max(np.abs(commands[-1])) < 1.0:
            integrals = integrals + profile.Ts * ki * d
        told = [
            commands[k - s.delay_samples][i] if k >= s.delay_samples else 0.0
            for i, s in enumerate(schedules)
        ]
        states = [
            accurate_hold(actuator, z, x, load[k] + total_load(actuator), profile.Ts)
            for actuator, z, x, load in zip(actuators, states, told, loads, strict=True)
        ]
        rates.append(rate)
        if place >= last:
            break
        place += rate
    motion = np.array(found)
    return motion[:, :, 3].T, motion[:, :, 2].T, np.array(rates)
