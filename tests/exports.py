"""Schedules to export, and long random runs of their law in closed loop, for the tests of every
target."""

from __future__ import annotations

from dataclasses import replace
from functools import cache

import numpy as np
from plain import law, motion, runge_kutta

import hydroctl as hc
from hydroctl.export.contents import Contents, contents_of
from hydroctl.model import plant
from hydroctl.regulator.vectors import law_of
from hydroctl.schedule.schedule import GainSchedule

REFERENCE = hc.load_actuator("reference")
OVERLAPPED = REFERENCE.replace(dead_band=0.05, name="overlapped")
HOSTILE = '*/ #error "\n#error broken\\\n??/\n// *) END_IF; </script> é² "quoted" {pragma} $N \x00'
"""a name that ends comments, lines and strings wherever it can"""
STEP, RESET, START = 0.0, 1.0, 2.0


def exported(
    loop="velocity", structure="pi+notch", *, scale=1.0, actuator=REFERENCE, **settings
) -> GainSchedule:
    """A schedule with gains that differ at every node; `settings` go to its specification."""
    x, y = np.array([-1.0, -0.1, 0.1, 1.0]), np.array([0.0, 0.2, 0.5])
    spread = scale * (1.0 + 0.01 * np.arange(12).reshape(4, 3))
    kp, ki, kd = (0.8, 300.0, 4e-4) if loop == "velocity" else (40.0, 900.0, 0.02)
    notch, sections = (
        {"notch_damping": (0.2, 0.8), "notch_ratio": 0.9} if "notch" in structure else {},
        {"lead-lag": 2, "lead": 1},
    )
    count = next((n for name, n in sections.items() if name in structure), 0)
    gains = structure.split("+")[0]
    drops = (
        np.array([[2.2e7, 2.9e7], [2.8e7, 2.0e7]])
        if settings.get("pressure_compensation")
        else None
    )
    return GainSchedule(
        actuator=actuator,
        specification=hc.Specification(
            uncertainty="nominal", Ms=50.0, Mt=50.0, **notch, **settings
        ),
        loop=loop,
        structure=structure,
        x=x,
        y=y,
        design_x=x,
        design_y=y,
        kp=kp * spread,
        ki=ki * spread if "i" in gains else np.zeros((4, 3)),
        kd=kd * spread if "d" in gains else np.zeros((4, 3)),
        notch_frequency=540.0 + 4.0 * np.arange(12).reshape(4, 3),
        zz=0.2 if notch else 0.8,
        zp=0.8,
        sections=((0.5, 3.0), (0.05, 0.02))[:count],
        Tt=0.02,
        feed_forward=structure != "p",
        speed_gain_extend=0.1516,
        speed_gain_retract=0.1408,
        speed_offset_extend=0.0006,
        speed_offset_retract=-0.0006,
        pressure_drops=drops,
    )


def fitted(machine: str, loop: str, structure: str, **settings) -> GainSchedule:
    """`exported` for a shipped machine, with nodes, speeds and gains of its own size."""
    actuator = hc.load_actuator(machine)
    given = exported(loop, structure, actuator=actuator, **settings)
    p, y = plant.parameters(actuator), actuator.stroke * np.array([0.0, 0.4, 1.0])
    middle = 0.5 * actuator.stroke
    stiffness = p.chambers.area_a**2 / (
        p.chambers.volume_a + p.chambers.area_a * middle
    ) + p.chambers.area_b**2 / (p.chambers.volume_b - p.chambers.area_b * middle)
    frequency = np.sqrt(p.chambers.bulk_modulus * stiffness / actuator.mass)
    retract, extend = np.abs(hc.find_operating_points(actuator, [-1.0, 1.0], middle).v)
    faster = (0.1 * frequency if loop == "position" else 0.12) / retract / given.kp[0, 0]
    return replace(
        given,
        y=y,
        design_y=y,
        **{name: faster * getattr(given, name) for name in ("kp", "ki", "kd")},
        notch_frequency=given.notch_frequency
        / given.notch_frequency[0, 0]
        * min(frequency, 0.8 / given.Ts),
        speed_gain_extend=float(extend),
        speed_gain_retract=float(retract),
    )


FULL = {
    "measurement_filter": 3e-4,
    "set_point_weight": 0.9,
    "derivative_on": "measurement",
    "pressure_compensation": True,
    "dead_band_inverse": 0.8,
    "actuator": OVERLAPPED,
}
CASES = {
    "velocity pi+notch": {},
    "velocity p": {"structure": "p"},
    "velocity pid+lead": {"structure": "pid+lead", "pressure_compensation": True},
    "position pid": {"loop": "position", "structure": "pid", "measurement_filter": 2e-4},
    "position pid+lead-lag+notch": {"loop": "position", "structure": "pid+lead-lag+notch", **FULL},
}


def closed_loop(schedules, samples: int, seed: int = 1):
    """(operations (n, 9), x (n,)): what happened in a closed loop of the plant in Python, and the
    law's answers.

    A row: STEP, RESET or START; which schedule; x of a START; reference, v_ref, p_a, p_b, v, y. A
    START is followed by a step with the same inputs; its x may lie beyond the limits. Now and then
    an input that the law reads is not finite. Every input is a number of single precision, which
    every target can read.
    """
    rng = np.random.default_rng(seed)
    actuator, loop = schedules[0].actuator, schedules[0].loop
    regulators = [law_of(schedule.regulator) for schedule in schedules]
    read = (
        [0, 1, 5] + [4] * (loop == "velocity") + [2, 3] * (schedules[0].pressure_drops is not None)
    )
    p = plant.parameters(actuator)
    stroke, speed, force = (
        actuator.stroke,
        schedules[0].speed_gain_retract,
        0.1 * actuator.area_b * actuator.supply_pressure,
    )
    lowest, highest = 0.1 * stroke, 0.9 * stroke
    z, which, memory = tuple(hc.rest_state(actuator, 0.5 * stroke)), 0, law.AT_REST
    size, target, v_ref, load = 0.7 * speed if loop == "velocity" else 0.008 * stroke, 0.0, 0.0, 0.0
    rows, answers = [], []
    for k in range(samples):
        if k % 40 == 0:
            target = size * rng.choice([0.2, 1.0, 3.0]) * rng.uniform(-1.0, 1.0)
            v_ref, load = (
                rng.choice([0.0, 0.35 * speed]) * rng.uniform(-1.0, 1.0),
                force * rng.uniform(-1.0, 1.0),
            )
        y_target = min(max(z[3] + target, lowest), highest)
        inward = 1.0 if lowest < z[3] < highest else -np.sign(target * (z[3] - 0.5 * stroke))
        reference = target * inward if loop == "velocity" else y_target
        inputs = np.array([reference, v_ref, *z[:4]])
        if rng.random() < 0.01:
            inputs[rng.choice(read)] = rng.choice([np.nan, np.inf, -np.inf])
        inputs = inputs.astype(np.float32).tolist()
        event = rng.random()
        if event < 0.005:
            rows.append([RESET, which, 0.0, *inputs])
            memory = law.AT_REST
            answers.append(0.0)
        elif event < 0.015 and np.isfinite(inputs).all():
            start = float(np.float32(rng.uniform(-1.3, 1.3)))
            if event < 0.01:
                which, start = 1 - which, float(np.float32(memory.x))
            rows.append([START, which, start, *inputs])
            memory = law.start(start, inputs[0], inputs[1], inputs[2:], regulators[which])
            answers.append(float(memory.x))
        rows.append([STEP, which, 0.0, *inputs])
        memory = law.sample(inputs[0], inputs[1], inputs[2:], memory, regulators[which])
        answers.append(float(memory.x))
        z = motion.commanded(z, answers[-1], p)
        z = runge_kutta.step(z, answers[-1], load, p, schedules[0].Ts)
    return np.array(rows, dtype=float), np.array(answers)


def exported_pair(case: str) -> tuple[GainSchedule, GainSchedule]:
    """Two schedules of a case, to change between."""
    return exported(**CASES[case]), exported(scale=0.7, **CASES[case])


@cache
def contents(case: str) -> Contents:
    """What an export of the first of the pair starts from."""
    return contents_of(exported(**CASES[case]), force=True)
