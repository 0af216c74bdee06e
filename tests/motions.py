"""Motions with known answers, and the verdicts on a single one."""

import math
from types import SimpleNamespace

import numpy as np

import hydroctl as hc
from hydroctl.simulation import Scenario, Trajectory
from hydroctl.validation import default_requirements, scale_of
from hydroctl.validation.verdict import judge

ACTUATOR = hc.load_actuator("reference")
ZETA, OMEGA, TS = 0.4, 50.0, 1e-4


def second_order_answer(t, zeta=ZETA):
    """Unit step of omega^2/(s^2 + 2 zeta omega s + omega^2)."""
    damped = math.sqrt(1 - zeta**2)
    return 1 - np.exp(-zeta * OMEGA * t) * (
        np.cos(OMEGA * damped * t) + zeta / damped * np.sin(OMEGA * damped * t)
    )


def trajectory_of(y, command, p_a=1e7, p_b=2e7):
    """The positions y in m with these commands and pressures in Pa, a sample every TS."""
    n = y.size
    rows = {
        name: np.broadcast_to(np.asarray(value, float), n)
        for name, value in (("p_a", p_a), ("p_b", p_b))
    }
    return Trajectory(
        TS * np.arange(n),
        command,
        y,
        np.zeros(n),
        **rows,
        spool=command,
        integrator="",
        final=None,
        command=command,
    )


def step_of_second_order(size=0.02, first=100, samples=6000, zeta=ZETA, **changes):
    """(scenario, y): a step of `size` m at sample `first`, answered without delay."""
    t = TS * (np.arange(samples) - first)
    y = 0.1 + size * np.where(t > 0, second_order_answer(np.maximum(t, 0), zeta), 0.0)
    reference = 0.1 + size * (t >= -1e-12)
    asked = Scenario(
        name="step",
        loop="position",
        Ts=TS,
        reference=reference,
        y=0.1,
        **{"kind": "step"} | changes,
    )
    return asked, y


def zeta_of(overshoot):
    """The damping of a second-order loop that overshoots by exp(-pi zeta/sqrt(1 - zeta^2)) of its
    step."""
    return -math.log(overshoot) / math.hypot(math.pi, math.log(overshoot))


def verdicts_of(asked, metrics, **design):
    """The default requirements' verdicts on one run, by name."""
    run = SimpleNamespace(
        scenario=asked, variant="nominal", actuator=ACTUATOR, metrics=metrics, reason=""
    )
    requirements = default_requirements(scale_of(ACTUATOR, asked.loop), asked.loop, **design)
    return {verdict.name: verdict for verdict in judge(requirements, [run])}
