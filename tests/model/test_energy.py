"""The first law along simulated motions of the whole plant: what the pump delivers is found again,
joule by joule."""

import numpy as np
import pytest
from machines import DIFFERENTIAL, REFERENCE
from scipy.integrate import simpson, solve_ivp

import hydroctl as hc
from hydroctl.model import chambers, end_stops, friction, plant, supply, valve

STOPS = {"end_stop_stiffness": 2e8, "end_stop_damping": 2.0}
DRY = DIFFERENTIAL.replace(
    coulomb_friction=800.0,
    breakaway_friction=1200.0,
    stribeck_speed=0.02,
    load_force=2e4,
    leakage=2e-12,
    **STOPS,
)


def _powers(actuator, z, x):
    """Powers in W at state z: in from the pump less out to the tank, and where they go (leakage and
    throttling are losses)."""
    p = plant.parameters(actuator)
    p_a, p_b, v, y, *_ = z
    opening = valve.effective_opening(x, p.valve)
    gain_a, gain_b = valve.flow_gains(p_a, p_b, opening, p.valve, p.supply)
    q_a, q_b = gain_a * opening, gain_b * opening
    drop_a, drop_b = supply.pressure_drops(p_a, p_b, opening, p.supply)
    extends = opening >= 0
    line_a, line_b = (
        (p.supply.supply_pressure, p.supply.tank_pressure)
        if extends
        else (p.supply.tank_pressure, p.supply.supply_pressure)
    )
    leak = p.chambers.leakage * (p_a - p_b)
    return {
        "supply": line_a * q_a + line_b * q_b,
        "throttling": abs(q_a) * drop_a + abs(q_b) * drop_b,
        "leakage": leak * (p_a - p_b),
        "friction": friction.force(v, p.friction) * v,
        "load": actuator.load_force * v,
        "end stops": -end_stops.force(y, v, p.end_stops) * v,
    }


def _compression(actuator, rates, z):
    """Power in W that compresses the oil, p V/Ec dp/dt of each chamber. V moves with y: no function
    of the state, so integrated."""
    stiff_a, stiff_b = chambers.stiffnesses(z[3], plant.parameters(actuator).chambers)
    return z[0] * rates[0] / stiff_a + z[1] * rates[1] / stiff_b


@pytest.mark.parametrize("x", [-0.7, 0.5])
@pytest.mark.parametrize("actuator", [REFERENCE, DRY], ids=["paper", "dry friction and stops"])
def test_energy_balance_closes_to_1e_6_of_the_throughput(actuator, x):
    p = plant.parameters(actuator)
    names = list(_powers(actuator, (1e6, 1e6, 0.0, 0.1), x))
    travel = 0.05 * actuator.stroke
    y = actuator.stroke - travel if x > 0 else travel

    def rates(t, z):
        motion = plant.rates(
            z[0], z[1], z[2], z[3], valve.effective_opening(x, p.valve), actuator.load_force, p
        )
        powers = _powers(actuator, z, x)
        return [
            *motion,
            z[2],
            *(powers[name] for name in names),
            _compression(actuator, motion, z),
            abs(powers["supply"]),
        ]

    start = [
        0.4 * p.supply.supply_pressure,
        0.5 * p.supply.supply_pressure,
        0.0,
        y,
        *np.zeros(len(names) + 2),
    ]
    speed = (
        abs(x)
        * p.valve.flow_coefficient_a
        * np.sqrt(p.supply.supply_pressure / 2)
        / p.chambers.area_a
    )
    duration = 1.5 * travel / speed  # long enough to run into a stop
    end = solve_ivp(rates, (0, duration), start, method="LSODA", rtol=1e-9, atol=1e-7).y[:, -1]
    work = dict(zip(names, end[4:], strict=False))
    compression, throughput = end[4 + len(names) :]
    kinetic = actuator.mass * end[2] ** 2 / 2
    spent = sum(value for name, value in work.items() if name != "supply")
    assert abs(work["supply"] - spent - compression - kinetic) <= 1e-6 * throughput
    if p.end_stops.end_stop_stiffness:
        depth = max(-end[3], end[3] - p.end_stops.stroke)
        assert depth > 0.0
        assert (
            work["end stops"] > p.end_stops.end_stop_stiffness * depth**2 / 2
        )  # the spring's share; the rest is lost in the contact


@pytest.mark.parametrize("x", [-0.7, 0.5])
@pytest.mark.parametrize("actuator", [REFERENCE, DRY], ids=["paper", "dry friction and stops"])
def test_energy_balance_of_simulate_closes_to_1e_6_of_the_throughput(actuator, x):
    """The motion of `simulate`, from pressures out of balance into steady travel; the powers by
    Simpson's rule along it."""
    p = plant.parameters(actuator)
    t = np.linspace(0.0, 0.25, 25_001)
    initial = hc.State(
        0.4 * p.supply.supply_pressure,
        0.5 * p.supply.supply_pressure,
        0.0,
        0.5 * p.end_stops.stroke,
    )
    motion = hc.simulate(actuator, t, np.full(t.size, x), initial=initial, rtol=1e-10)
    z = np.array([motion.p_a, motion.p_b, motion.v, motion.y])
    rates = plant.rates(*z, valve.effective_opening(x, p.valve), actuator.load_force, p)
    powers = _powers(actuator, z, x)
    work = {name: simpson(power, x=t) for name, power in powers.items()}
    stored = (
        simpson(_compression(actuator, rates, z), x=t)
        + actuator.mass * (motion.v[-1] ** 2 - motion.v[0] ** 2) / 2
    )
    spent = sum(value for name, value in work.items() if name != "supply")
    assert abs(work["supply"] - spent - stored) <= 1e-6 * simpson(np.abs(powers["supply"]), x=t)
