"""The integral gain of a box design against an optimum by other means, on the same plants.

Along a ray of fixed kp/ki and kd/ki the largest ki is known in closed form
(`oracle.allowed_scales`), so that an optimum is a search over the ratios alone. It is done at three
nodes, whose gains serve the points between the nodes as well.
"""

import itertools
import os

import numpy as np
import oracle
import pytest
from scipy.optimize import minimize

import hydroctl as hc
from hydroctl.machine.variants import variants
from hydroctl.tuning import default_points

LONG = os.environ.get("HYDROCTL_LONG") == "1"
FULL = list(
    itertools.product(
        hc.list_actuators(), ("velocity", "position"), ("pi", "pi+notch", "pid+notch")
    )
)
CASES = FULL if LONG else [("reference", "velocity", "pi+notch"), ("reference", "position", "pi")]


def responses(schedule, x, y):
    """[(plants, n)] of what kp, ki and kd contribute, notch included, and the plants (F, G, c)."""
    law = {"kp": 0.0, "ki": 0.0, "kd": 0.0, "Tf": schedule.Tf, "notch": None}
    if schedule.zz != schedule.zp:
        law["notch"] = float(schedule.gains(x, y).notch_frequency), schedule.zz, schedule.zp
    plants = []
    for machine in variants(
        schedule.actuator, schedule.specification.uncertainty, schedule.specification.added_plants
    ).values():
        family = hc.linearize(machine, hc.find_operating_points(machine, [x], [y]))
        model = oracle.continuous(machine, family.A[0], family.B[0], schedule.loop)
        plants.append(oracle.sampled(*model, schedule.Ts, schedule.delay_samples))
    z = np.exp(1j * _frequencies(plants, schedule.Ts) * schedule.Ts)
    G = np.array([_response(plant, z) for plant in plants])
    return (
        [G * oracle.regulator(z, schedule.Ts, **law | {name: 1.0}) for name in ("kp", "ki", "kd")],
        plants,
        law,
    )


def _frequencies(plants, Ts):
    """Dense about the modes of every plant: hundreds within a resonance."""
    nyquist, steps = np.pi / Ts, np.sinh(np.linspace(-4.0, 4.0, 161))
    omega = [np.geomspace(1e-4 * nyquist, nyquist, 900), np.linspace(1e-3, 1.0, 900) * nyquist]
    for F, _, _ in plants:
        poles = np.linalg.eigvals(F)
        for s in np.log(poles[np.abs(poles) > 1e-9].astype(complex)) / Ts:
            omega.append(abs(s.imag) + abs(s.real) * steps)
    omega = np.unique(np.concatenate(omega))
    return omega[(omega >= 1e-4 * nyquist) & (omega <= nyquist)]


def _response(plant, z):
    F, G, c = plant
    poles, vectors = np.linalg.eig(F)
    return ((c @ vectors) * np.linalg.solve(vectors, G) / (z[:, None] - poles)).sum(axis=1)


def largest_ki(schedule, x, y):
    """The largest ki over all ratios with which every plant keeps the limits and is stable."""
    (p, i, d), plants, law = responses(schedule, x, y)
    limits, derivative = schedule.specification, "d" in schedule.structure
    best = 0.0

    def stable(gains):
        return all(
            np.abs(oracle.closed_poles(*plant, schedule.Ts, **law | gains)).max() < 1.0
            for plant in plants
        )

    def loss(logs):
        nonlocal best
        ratios = np.exp(np.append(logs, -np.inf)[:2])
        L = (i + ratios[0] * p + ratios[1] * d).ravel()
        for _, ki in reversed(oracle.allowed_scales(L, limits.Ms, limits.Mt)):
            if np.isfinite(ki) and ki <= best:
                return -ki
            if np.isfinite(ki) and stable({"kp": ki * ratios[0], "ki": ki, "kd": ki * ratios[1]}):
                best = max(best, ki)
                return -ki
        return 0.0

    now = schedule.gains(x, y)
    centre = [np.log(max(float(now.kp) / float(now.ki), 1e-9))]
    centre += [np.log(max(float(now.kd) / float(now.ki), 1e-9))] * derivative
    steps = np.linspace(-5.0, 5.0, 9 if derivative else 25)
    grid = [np.add(centre, step) for step in itertools.product(steps, repeat=len(centre))]
    for start in sorted(grid, key=loss)[:3]:
        minimize(
            loss, start, method="Nelder-Mead", options={"maxfev": 120, "xatol": 1e-3, "fatol": 1e-6}
        )
    return best


@pytest.mark.long
@pytest.mark.parametrize("case", CASES, ids=" ".join)
def test_ki_is_within_three_per_cent_of_the_largest_on_the_same_plants(case, record_property):
    machine, loop, structure = case
    actuator = hc.load_actuator(machine)
    schedule = hc.tune(actuator, *default_points(actuator), loop=loop, structure=structure)
    for i, j in ((0, 0), (schedule.x.size // 2, schedule.y.size // 2), (-1, -1)):
        largest = largest_ki(schedule, schedule.x[i], schedule.y[j])
        record_property(f"share at {i}, {j}", float(schedule.ki[i, j] / largest))
        assert schedule.ki[i, j] >= 0.97 * largest
