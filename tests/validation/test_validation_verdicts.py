"""Verdicts: what a motion may and may not do, on both sides of every limit."""

import dataclasses
import math
from types import SimpleNamespace

import numpy as np
import pytest
from loops import schedule
from motions import ACTUATOR, TS, step_of_second_order, trajectory_of, verdicts_of, zeta_of

import hydroctl as hc
from hydroctl.simulation import Scenario
from hydroctl.validation import (
    Metrics,
    default_requirements,
    measure,
    scale_of,
    step_scenarios,
    validate,
)
from hydroctl.validation.verdict import judge


@pytest.mark.parametrize(
    ("design", "allowed"), [({}, 0.3), ({"Mt": 1.15}, 0.15)], ids=["the default Mt", "Mt 1.15"]
)
@pytest.mark.parametrize("kind", ["step", "saturated"])
def test_a_motion_may_overshoot_by_what_the_designs_Mt_stands_above_one(kind, design, allowed):
    """A step by Mt - 1 of itself, a motion after saturation by Mt - 1 of the library's step: a
    hundredth less passes, a hundredth more fails.

    The loop's overshoot is that of its damping; sampled every OMEGA TS = 1/200 of a radian its peak
    is read to 1e-5 of the step.
    """
    name, size = {
        "step": ("overshoot of a step", 0.02),
        "saturated": ("overshoot after saturation", 0.02 * ACTUATOR.stroke),
    }[kind]
    for overshoot, passed in ((0.99 * allowed, True), (1.01 * allowed, False)):
        asked, y = step_of_second_order(size, zeta=zeta_of(overshoot), kind=kind, settle_by=0.5)
        verdicts = verdicts_of(
            asked, measure(ACTUATOR, asked, trajectory_of(y, np.zeros(y.size))), **design
        )
        assert verdicts[name].passed == passed
        assert verdicts[name].limit == pytest.approx(
            allowed * (1.0 if kind == "step" else size), rel=1e-12
        )


def test_a_validation_holds_a_schedule_to_the_Mt_that_it_was_designed_for():
    asked = [
        scenario for scenario in step_scenarios(ACTUATOR, "velocity") if scenario.kind == "step"
    ][:1]
    given = schedule(
        kp=np.full((4, 3), 0.3), ki=np.full((4, 3), 280.0), specification=SimpleNamespace(Mt=1.17)
    )
    limits = {
        verdict.name: verdict.limit
        for verdict in validate(ACTUATOR, given, scenarios=asked).verdicts
    }
    assert limits["overshoot of a step"] == pytest.approx(0.17, rel=1e-12)
    assert hc.Specification().Mt == 1.3, "what requirements without a design stand for"


REQUIREMENTS = default_requirements(scale_of(ACTUATOR, "position"), "position")
QUIET = dict.fromkeys((field.name for field in dataclasses.fields(Metrics)), 0.0)
"""a motion of which nothing can be said"""
EDGES = [
    ("settling time", "step", "settling_time", 0.2),
    ("settling time", "saturated", "settling_time", 0.2),
    ("settling time", "reversal", "settling_time", 0.2),
    ("residual oscillation", "reversal", "oscillation", 0.01),
    ("steady error", "step", "steady_error", 0.01),
    ("steady error", "step", "steady_error", -0.01),
    ("overtravel", "tracking", "beyond_stroke", 0.01 * ACTUATOR.stroke),
]


@pytest.mark.parametrize(("name", "kind", "field", "edge"), EDGES)
def test_a_requirement_fails_just_beyond_the_limit_that_it_states(name, kind, field, edge):
    """The time of the scenario; half of the settling band of 2 %, either way; 1 % of the stroke."""
    asked = Scenario(
        name=kind,
        loop="position",
        Ts=TS,
        reference=np.full(10, 0.1),
        y=0.1,
        kind=kind,
        settle_by=0.2,
    )
    for factor, passed in ((1.0 - 1e-9, True), (1.0 + 1e-9, False)):
        verdicts = verdicts_of(asked, Metrics(**QUIET | {field: factor * edge}))
        assert [v.name for v in verdicts.values() if not v.passed] == ([] if passed else [name])


@pytest.mark.parametrize(
    "worse", [0.2, math.nan], ids=["by a tenth of a second", "without such a number"]
)
def test_the_worst_run_is_the_one_furthest_beyond_its_own_limit(worse):
    """Not the one with the largest number; one that cannot be judged is worse than any."""
    times = {"patient": (0.4, 0.3), "hasty": (0.1, worse), "quick": (0.1, 0.05)}
    runs = []
    for name, (settle_by, settling) in times.items():
        asked = Scenario(
            name=name,
            loop="position",
            Ts=TS,
            reference=np.full(10, 0.1),
            y=0.1,
            kind="step",
            settle_by=settle_by,
        )
        metrics = Metrics(**QUIET | {"settling_time": settling})
        runs.append(
            SimpleNamespace(
                scenario=asked, variant="nominal", actuator=ACTUATOR, metrics=metrics, reason=""
            )
        )
    (settled,) = (
        verdict for verdict in judge(REQUIREMENTS, runs) if verdict.name == "settling time"
    )
    assert not settled.passed
    assert (settled.scenario, settled.limit) == ("hasty", 0.1)


def test_the_shortest_time_below_tank_pressure_is_cavitation():
    asked = Scenario(
        name="one sample",
        loop="position",
        Ts=TS,
        reference=np.full(10, 0.1),
        y=0.1,
        kind="tracking",
    )
    for drop, passed in ((0.0, True), (1e3, False)):
        p_a = np.where(np.arange(10) == 4, ACTUATOR.tank_pressure - drop, 1e7)
        metrics = measure(ACTUATOR, asked, trajectory_of(np.full(10, 0.1), np.zeros(10), p_a=p_a))
        assert verdicts_of(asked, metrics)["cavitation time"].passed == passed


def test_the_anti_windup_of_the_tuner_neither_stops_a_large_step_short_nor_lets_it_overshoot():
    """A tenth of its time, one sample, empties the integral at every touch of the limit; eight
    times its time leaves the integral full."""
    nominal = hc.Specification(uncertainty="nominal")
    tuned = hc.tune(
        ACTUATOR, [-1.0, -0.1, 0.1, 1.0], [0.0, 0.25, 0.5], loop="position", specification=nominal
    )
    asked = [
        scenario
        for scenario in step_scenarios(ACTUATOR, "position")
        if scenario.kind == "saturated"
    ]
    expected = {
        0.1: {"settling time", "steady error"},
        1.0: set(),
        8.0: {"overshoot after saturation"},
    }
    for factor, failed in expected.items():
        report = validate(
            ACTUATOR, dataclasses.replace(tuned, Tt=factor * tuned.Tt), scenarios=asked
        )
        assert {verdict.name for verdict in report.verdicts if not verdict.passed} == failed
