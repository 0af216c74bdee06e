"""Every margin against `oracle`: random machines, sample times, delays, regulators; resonances
above half the sample rate, too."""

import math
import os
from types import SimpleNamespace

import numpy as np
import oracle
import pytest
from machines import made_machine, with_lag

import hydroctl as hc
from hydroctl.loop.margins import MARGIN_UNITS, Loop, analyse
from hydroctl.loop.sampled_plant import sample
from hydroctl.regulator.structures import Regulators

CASES = 300 if os.environ.get("HYDROCTL_LONG") == "1" else 60
STRUCTURES = ("p", "pi", "pi+notch", "pid")


def random_case(seed: int):
    """A machine at an operating point, a loop, a sampling, and gains that cross over anywhere below
    half the sample rate."""
    rng = np.random.default_rng(seed)

    def logarithmic(low, high):
        return float(np.exp(rng.uniform(np.log(low), np.log(high))))

    while True:
        machine = made_machine(rng.uniform)
        machine = with_lag(machine, rng.uniform) if rng.random() < 0.5 else machine
        x, y = (
            float(rng.choice([-1.0, 1.0])) * logarithmic(0.02, 1.0),
            float(rng.uniform(0.0, machine.stroke)),
        )
        points = hc.find_operating_points(machine, [x], [y])
        if points.feasible.all():
            break
    loop, structure = ("velocity", "position")[seed % 2], STRUCTURES[seed // 2 % len(STRUCTURES)]
    Ts, delay = (
        logarithmic(5e-4, 15e-3),
        float(rng.choice([0.0, 1.0, 2.0, 3.0, rng.uniform(0.0, 3.0)])),
    )
    family = hc.linearize(machine, points)
    plant = sample(family, loop=loop, sample_time=Ts, delay_samples=delay)
    omega, wn = logarithmic(1e-6, 1.0) * math.pi / Ts, float(plant.resonance[0, 0])
    kp = logarithmic(0.03, 3.0) / float(np.abs(plant.frequency_response([omega]))[0, 0])
    law = {"kp": kp, "ki": 0.0, "kd": 0.0, "Tf": logarithmic(3e-4, 7e-3), "notch": None}
    if "i" in structure:
        law["ki"] = kp * omega * logarithmic(0.05, 3.0)
    if "d" in structure:
        law["kd"] = kp / omega * logarithmic(0.05, 1.0)
    if "notch" in structure and wn * Ts < 0.95 * math.pi:
        law["notch"] = wn, 0.12, 0.75
    return SimpleNamespace(
        machine=machine, family=family, plant=plant, loop=loop, Ts=Ts, delay=delay, law=law, wn=wn
    )


def found_by_product(case):
    one = np.ones(1)
    zz, zp = case.law["notch"][1:] if case.law["notch"] else (1.0, 1.0)
    gains = (case.law[name] * one for name in ("kp", "ki", "kd"))
    return analyse(
        Loop(case.plant, Regulators(case.Ts, *gains, case.wn * one, case.law["Tf"], zz, zp))
    )


def found_by_oracle(case):
    A, B, c = oracle.continuous(case.machine, case.family.A[0], case.family.B[0], case.loop)
    return oracle.margins(oracle.sampled(A, B, c, case.Ts, case.delay), case.Ts, case.law)


@pytest.mark.long
@pytest.mark.parametrize("block", range(6))
def test_every_margin_is_that_of_an_oracle_without_a_grid(block):
    for seed in range(block, CASES, 6):
        case = random_case(seed)
        found, expected = found_by_product(case), found_by_oracle(case)
        assert found.stable[0] == expected.stable, seed
        for name in MARGIN_UNITS:
            assert getattr(found, name)[0] == pytest.approx(getattr(expected, name), rel=5e-3), (
                seed,
                name,
            )


@pytest.mark.long
@pytest.mark.parametrize("block", range(6))
def test_no_margin_contradicts_another(block):
    """Where a factor g, or a phase, brings L to -1, S is at least 1/|1 - 1/g|, or 1/(2
    sin(phase/2))."""
    for seed in range(block, CASES, 6):
        found = found_by_product(random_case(seed))
        Ms, up, down = found.Ms[0], found.gain_margin[0], found.gain_reduction_margin[0]
        least = [1.0 / (1.0 - 1.0 / up)] if np.isfinite(up) else []
        least += [1.0 / (1.0 / down - 1.0)] if down > 0.0 else []
        least += (
            [0.5 / math.sin(found.phase_margin[0] / 2.0)]
            if np.isfinite(found.phase_margin[0])
            else []
        )
        assert Ms >= max(least, default=0.0) * (1.0 - 1e-9), seed


def test_a_resonance_above_half_the_sample_rate_counts_at_its_alias():
    """Both sharp: the alias of the machine's own pair, and that of a valve that is hardly
    damped."""
    machine = hc.load_actuator("symmetric_servo")
    for valve in (machine.valve_damping, 0.002):
        changed = machine.replace(valve_damping=valve, viscous_friction=10.0)
        family = hc.linearize(changed, hc.find_operating_points(changed, [0.02], [0.2]))
        case = SimpleNamespace(machine=changed, family=family, loop="position", Ts=0.015, delay=1.0)
        case.plant = sample(family, loop="position", sample_time=0.015, delay_samples=1.0)
        case.wn = float(case.plant.resonance[0, 0])
        assert case.wn * case.Ts > math.pi
        case.law = {"kp": 20.0, "ki": 0.0, "kd": 0.0, "Tf": 1e-3, "notch": None}
        assert found_by_product(case).Ms[0] == pytest.approx(found_by_oracle(case).Ms, rel=1e-4)
