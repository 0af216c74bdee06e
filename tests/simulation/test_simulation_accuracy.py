"""The closed-loop kernel against DOP853 at 1e-12 on the scenario library of every shipped machine,
and its substep rule."""

import dataclasses
import os

import numpy as np
import pytest
from loops import accurate_closed_loop, schedule

import hydroctl as hc
from hydroctl.simulation import rest_state, simulate_closed_loop
from hydroctl.validation import library, scale_of

LONG = os.environ.get("HYDROCTL_LONG") == "1"
MACHINES = hc.list_actuators()
REDUCED = {"step": 1, "saturated": 1, "reversal": 1, "tracking": 6}
"""how many scenarios of each kind are tried unless all are"""
BEFORE, AFTER = 3, 40


def crude_schedule(actuator, loop):
    """A slow, stable regulator from the machine's own scales: a crossover near a tenth of its
    bandwidth, notch, feed-forward.

    Through the resonance, 1/(2 zeta) high, a velocity loop's kp passes at most half.
    """
    slowest = hc.find_operating_points(actuator, [actuator.dead_band + 0.02], 0.5 * actuator.stroke)
    resonance = hc.linearize(actuator, slowest).poles()[0, 1]
    damping = -resonance.real / abs(resonance)
    scale = scale_of(actuator, loop)
    speed, bandwidth = min(scale.extend_speed, scale.retract_speed), 1.0 / scale.time_constant
    spread = 1.0 + 0.1 * np.arange(12).reshape(4, 3) / 12
    if loop == "velocity":
        gains = {"kp": min(0.05, damping) / speed * spread, "ki": 0.1 * bandwidth / speed * spread}
    else:
        gains = {"kp": 0.1 * bandwidth / speed * spread, "ki": 1e-3 * bandwidth**2 / speed * spread}
    return schedule(
        loop,
        **gains,
        y=np.array([0.0, 0.4, 1.0]) * actuator.stroke,
        notch_frequency=min(bandwidth, 1000.0) * spread,
        Tt=10.0 / bandwidth,
        feed_forward=True,
        speed_gain_extend=scale.extend_speed,
        speed_gain_retract=scale.retract_speed,
        speed_offset_extend=actuator.dead_band,
        speed_offset_retract=-actuator.dead_band,
    )


def part_of(scenario):
    """A few samples around the last change of what is asked, from the scenario's own start."""
    if LONG:
        return scenario
    changes = np.flatnonzero(np.diff(scenario.reference) + 1j * np.diff(scenario.load_force))
    last = int(changes[-1]) + 1 if changes.size and scenario.kind != "tracking" else 0
    if "load" in scenario.name:
        last = int(changes[0]) + 1
    window = slice(max(0, last - BEFORE), last + AFTER)
    signals = {
        name: getattr(scenario, name)[window] for name in ("reference", "v_ref", "load_force")
    }
    return dataclasses.replace(scenario, **signals, settle_by=None)


def tried(actuator, loop):
    """The library, or as many of each kind as REDUCED says, from the end: end stops come last and
    are among them."""
    left = dict(REDUCED)
    for scenario in reversed(library(actuator, loop)):
        if LONG or left[scenario.kind] > 0:
            left[scenario.kind] -= 1
            yield part_of(scenario)


@pytest.mark.long
@pytest.mark.parametrize("loop", ["velocity", "position"])
@pytest.mark.parametrize("name", MACHINES)
def test_every_scenario_of_the_library_agrees_with_dop853_to_a_millionth_of_the_amplitude(
    name, loop
):
    """The amplitude is the range of the motion, but no less than what 1e-12 of DOP853 leaves
    uncertain over a thousand samples."""
    actuator = hc.load_actuator(name)
    given = crude_schedule(actuator, loop)
    floors = 1e-3 * np.array(
        [actuator.supply_pressure] * 2 + [scale_of(actuator, loop).extend_speed, actuator.stroke]
    )
    for asked in tried(actuator, loop):
        start = asked.initial or rest_state(
            actuator, asked.y, load_force=float(asked.load_force[0])
        )
        expected = accurate_closed_loop(actuator, given, asked, start)
        found = simulate_closed_loop(actuator, given, asked)
        for key, row, floor in zip(("p_a", "p_b", "v", "y"), expected[:4], floors, strict=True):
            error = np.abs(getattr(found, key) - row).max()
            assert error <= 1e-6 * max(np.ptp(row), floor), (asked.name, key, error / np.ptp(row))
