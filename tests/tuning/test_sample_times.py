"""Position loops with P at the sample times of a PLC, where resonances are folded: true Ms, and
gains against a closed form.

For one plant the largest kp is known in closed form (`oracle.allowed_scales`).
"""

import math
import os

import numpy as np
import oracle
import pytest

import hydroctl as hc
from hydroctl.tuning import default_points

LONG = os.environ.get("HYDROCTL_LONG") == "1"
TIMES = (1e-3, 2e-3, 5e-3, 8e-3, 10e-3)
FULL = [(machine, Ts) for machine in hc.list_actuators() for Ts in TIMES]
CASES = FULL if LONG else [("symmetric_servo", 8e-3), ("fast_50_28", 10e-3), ("crane_80_45", 2e-3)]
BETWEEN = 300 if LONG else 30
NODES = 10**6 if LONG else 40


def sampled_plant(actuator, x, y, Ts):
    """(F, G, c) of the position loop with one sample of delay."""
    family = hc.linearize(actuator, hc.find_operating_points(actuator, [x], [y]))
    return oracle.sampled(
        *oracle.continuous(actuator, family.A[0], family.B[0], "position"), Ts, 1.0
    )


def largest_gain(plant, Ts, Ms, Mt):
    """The largest kp from 0 on with which nowhere |S| > Ms or |T| > Mt."""
    F, G, c = plant
    poles, vectors = np.linalg.eig(F)
    weights = (c @ vectors) * np.linalg.solve(vectors, G)

    def response(omega):
        return (weights / (np.exp(1j * omega * Ts)[:, None] - poles)).sum(axis=1)

    omega = np.union1d(oracle.frequencies(poles, Ts), np.linspace(1e-4, 1.0, 2001) * math.pi / Ts)
    for _ in range(3):
        (_, kp), *_ = oracle.allowed_scales(response(omega), Ms, Mt)
        loop = kp * response(omega)
        nearest = np.minimum(np.abs(1.0 + loop) * Ms, Mt * np.abs(1.0 + 1.0 / loop))
        k = int(np.argmin(nearest))
        omega = np.linspace(omega[max(k - 1, 0)], omega[min(k + 1, omega.size - 1)], 2001)
    return kp


@pytest.fixture(
    scope="module", params=CASES, ids=[f"{machine} {1e3 * Ts:g} ms" for machine, Ts in CASES]
)
def schedule(request):
    machine, Ts = request.param
    actuator = hc.load_actuator(machine)
    specification = hc.Specification(uncertainty="nominal", sample_time=Ts)
    return hc.tune(
        actuator,
        *default_points(actuator),
        loop="position",
        structure="p",
        specification=specification,
    )


@pytest.mark.long
def test_the_gain_at_every_node_is_the_largest_that_the_limits_allow(schedule, record_property):
    nodes = list(np.ndindex(schedule.kp.shape))
    share = []
    for i, j in nodes[:: math.ceil(len(nodes) / NODES)]:
        plant = sampled_plant(schedule.actuator, schedule.x[i], schedule.y[j], schedule.Ts)
        share.append(schedule.kp[i, j] / largest_gain(plant, schedule.Ts, 1.6, 1.3))
    record_property("least share", float(min(share)))
    assert min(share) >= 0.97
    assert max(share) <= 1.001, "the tuner's grid leaves 1e-4 of Ms"


@pytest.mark.long
def test_anywhere_between_the_points_Ms_stays_below_1_62(schedule, record_property):
    rng, largest = np.random.default_rng(6), 0.0
    for _ in range(BETWEEN):
        side = schedule.x[schedule.x < 0.0] if rng.random() < 0.5 else schedule.x[schedule.x > 0.0]
        x, y = rng.uniform(side[0], side[-1]), rng.uniform(schedule.y[0], schedule.y[-1])
        law = {"kp": float(schedule.gains(x, y).kp), "ki": 0.0, "kd": 0.0, "Tf": 1e-3}
        found = oracle.margins(
            sampled_plant(schedule.actuator, x, y, schedule.Ts), schedule.Ts, law
        )
        assert found.stable
        largest = max(largest, found.Ms)
    record_property("largest Ms", float(largest))
    assert largest <= 1.62
