"""Machines and independent formulas that several test files use."""

import math

import numpy as np
from hypothesis import strategies as st

from hydroctl import Actuator, load_actuator

REFERENCE = load_actuator("reference")
LOSSLESS = REFERENCE.replace(leakage=0.0)
DIFFERENTIAL_AREAS = np.pi / 4 * 0.1**2, np.pi / 4 * (0.1**2 - 0.056**2)
DIFFERENTIAL = Actuator(
    name="differential 100/56",
    area_a=DIFFERENTIAL_AREAS[0],
    area_b=DIFFERENTIAL_AREAS[1],
    stroke=1.0,
    volume_a=2e-4,
    volume_b=2e-4 + DIFFERENTIAL_AREAS[1],
    mass=200.0,
    viscous_friction=4000.0,
    bulk_modulus=1.5e9,
    leakage=2e-13,
    supply_pressure=210e5,
    tank_pressure=1e5,
    flow_coefficient=8.909e-7,
)


def mirrored(actuator: Actuator) -> Actuator:
    """The machine with its two sides exchanged: y counts from the other end, x and load change
    sign."""
    return actuator.replace(
        area_a=actuator.area_b,
        area_b=actuator.area_a,
        volume_a=actuator.volume_b - actuator.area_b * actuator.stroke,
        volume_b=actuator.volume_a + actuator.area_a * actuator.stroke,
        flow_coefficient=actuator.flow_coefficient_b,
        flow_coefficient_b=actuator.flow_coefficient,
        load_force=-actuator.load_force,
        inclination=-actuator.inclination,
    )


def total_load(actuator: Actuator) -> float:
    """The load and the axial part of the weight in N, positive against extension."""
    return actuator.load_force + 9.80665 * actuator.mass * math.sin(actuator.inclination)


def paper_closed_form(actuator: Actuator, x: float) -> tuple[float, float, float]:
    """(p_1n, p_2n, v_n) as section 3 of the source paper prints them: x > 0, no leakage, no load,
    tank at zero."""
    f1, f2, p0, b, s = (
        actuator.area_a,
        actuator.area_b,
        actuator.supply_pressure,
        actuator.viscous_friction,
        (x * actuator.flow_coefficient) ** 2,
    )
    cubes = f1**3 + f2**3
    root = np.sqrt(4 * f1 * cubes * p0 * s + b**2 * s**2)
    p_1 = (
        p0 * s
        - f1**3 * p0 * s / cubes
        - b**2 * f1**2 * s**2 / (2 * cubes**2)
        + b * f1**2 * s * root / (2 * cubes**2)
    ) / s
    p_2 = (
        f1 * f2**2 * p0 * s / cubes
        + b**2 * f2**2 * s**2 / (2 * cubes**2)
        - b * f2**2 * s * root / (2 * cubes**2)
    ) / s
    return p_1, p_2, (-b * s + root) / (2 * cubes)


def balances(actuator: Actuator, x, p_a, p_b, v, load_force=0.0):
    """The three equilibrium equations as the source paper writes them (sqrt of |dp|), each as the
    list of its terms."""
    if x >= 0:
        q_1, q_4 = (
            x * np.sqrt(abs(actuator.supply_pressure - p_a)),
            -x * np.sqrt(abs(p_b - actuator.tank_pressure)),
        )
    else:
        q_1, q_4 = (
            x * np.sqrt(abs(p_a - actuator.tank_pressure)),
            -x * np.sqrt(abs(actuator.supply_pressure - p_b)),
        )
    leak = actuator.leakage * (p_a - p_b)
    return (
        (actuator.flow_coefficient * q_1, -actuator.area_a * v, -leak),
        (actuator.flow_coefficient_b * q_4, actuator.area_b * v, leak),
        (
            actuator.area_a * p_a,
            -actuator.area_b * p_b,
            -actuator.viscous_friction * v,
            -load_force,
        ),
    )


def imbalance(*arguments, **keywords) -> float:
    """The largest sum of `balances` over its largest term."""
    return max(abs(sum(terms)) / max(map(abs, terms)) for terms in balances(*arguments, **keywords))


def made_machine(uniform) -> Actuator:
    """A physically valid machine of a size that is built: bores 25 to 500 mm, 50 to 350 bar, 1 kg
    to 100 t; `uniform(low, high)` draws each number."""

    def between(low, high):
        """Evenly in the logarithm."""
        return float(np.exp(uniform(np.log(low), np.log(high))))

    def perhaps(value):
        return value if uniform(0.0, 1.0) >= 0.5 else 0.0

    bore, stroke, supply = between(0.025, 0.5), between(0.05, 5.0), between(50e5, 350e5)
    area_a = np.pi / 4 * bore**2
    area_b = area_a * uniform(0.3, 1.0)
    dead_a, dead_b = between(0.01, 0.5) * area_a * stroke, between(0.01, 0.5) * area_b * stroke
    flow = (
        between(0.02, 1.0) * area_a / np.sqrt(supply / 2)
    )  # 0.02 to 1 m/s at half the supply pressure
    return Actuator(
        area_a=area_a,
        area_b=area_b,
        stroke=stroke,
        volume_a=dead_a,
        volume_b=dead_b + area_b * stroke,
        bulk_modulus=between(0.5e9, 2e9),
        leakage=perhaps(between(1e-5, 1e-2) * flow / np.sqrt(supply)),
        flow_coefficient=flow,
        flow_coefficient_b=flow * uniform(0.4, 1.5),
        supply_pressure=supply,
        tank_pressure=uniform(0.0, 10e5),
        mass=between(1.0, 1e5),
        viscous_friction=perhaps(between(10.0, 1e5)),
        load_force=uniform(-0.2, 0.2) * area_b * supply,
    )


def with_lag(machine: Actuator, uniform) -> Actuator:
    """`machine` with a valve of 10 to 300 Hz, some of them hardly damped."""
    frequency, damping = (
        np.exp(uniform(np.log(low), np.log(high))) for low, high in ((60.0, 2000.0), (0.002, 1.2))
    )
    return machine.replace(valve_natural_frequency=frequency, valve_damping=damping)


@st.composite
def machines(draw) -> Actuator:
    """Those of `made_machine`."""
    return made_machine(lambda low, high: draw(st.floats(low, high)))


@st.composite
def inclined_machines(draw) -> Actuator:
    """`machines` at any angle at which their weight is at most a fifth of the force of the rod
    side."""
    machine = draw(machines())
    most = 0.2 * machine.area_b * machine.supply_pressure / (9.80665 * machine.mass)
    return machine.replace(inclination=draw(st.floats(-1.0, 1.0)) * math.asin(min(most, 1.0)))


@st.composite
def dry_machines(draw) -> Actuator:
    """`machines` with dry friction up to a tenth of the force of the rod side, and overlap."""
    machine = draw(machines())
    coulomb = draw(st.floats(1e-4, 0.05)) * machine.area_b * machine.supply_pressure
    return machine.replace(
        coulomb_friction=coulomb,
        breakaway_friction=coulomb * draw(st.floats(1.0, 2.0)),
        stribeck_speed=draw(st.floats(2e-3, 5e-2)),
        creep_speed=draw(st.floats(1e-5, 1e-3)),
        dead_band=draw(st.sampled_from([0.0, 0.05])),
    )
