"""Equation (1) of the source paper: flows, rates of change and the analytic Jacobian, as array
functions.

State z = (p_a, p_b, v) at a frozen position y for linearization, (p_a, p_b, v, y) for simulation;
input x in [-1, 1].

    V_a = volume_a + area_a y                          V_b = volume_b - area_b y
    V_a/Ec dp_a/dt = Q_a - area_a v - Kv (p_a - p_b)
    V_b/Ec dp_b/dt = Q_b + area_b v + Kv (p_a - p_b)
    m dv/dt = area_a p_a - area_b p_b - F_f(v) + F_e(y, v) - F        dy/dt = v
    x >= 0:  Q_a = c_a x r(p_s - p_a)    Q_b = -c_b x r(p_b - p_t)
    x <  0:  Q_a = c_a x r(p_a - p_t)    Q_b = -c_b x r(p_s - p_b)

r(dp) = sign(dp) sqrt|dp|, of which `valve` says why. The load F is
`Actuator.constant_load` and what a motion adds to it. With tank pressure p_t = 0, load F = 0, c_a =
c_b, friction F_f = B v and no end stops, F_e = 0, this is the paper's model; every further effect
vanishes exactly with its parameter.

Each term is a component, a value with its flow or force, its slope, where it bends, and what it
comes to when a machine lacks it: `valve` (flows, and x, the opening that the fluid sees at a
position of the spool), `spool`, `chambers`, `supply`, `friction`, `end_stops`, `load`.

Every function takes floats or arrays that broadcast; they also compile as they stand with numba, so
that the simulation kernels integrate these very lines.
"""

from __future__ import annotations

from collections.abc import Mapping
from functools import lru_cache
from types import ModuleType
from typing import TYPE_CHECKING, NamedTuple, TypeVar

import numpy as np

from ..machine.actuator import Actuator
from . import chambers, end_stops, friction, load, spool, valve
from .chambers import Chambers
from .end_stops import EndStops
from .friction import Friction
from .load import Load
from .spool import Spool
from .supply import Supply
from .valve import Valve

if TYPE_CHECKING:
    import control


Component = TypeVar("Component")


class Parameters(NamedTuple):
    """What the equations need of an `Actuator`, in SI, by component: floats, or arrays that
    broadcast. An effect that is absent has the value that makes it vanish: 0, but 1 for
    `valve_damping` and `stribeck_speed`, and an infinite `valve_rate_limit`.
    """

    chambers: Chambers
    supply: Supply
    valve: Valve
    spool: Spool
    friction: Friction
    end_stops: EndStops
    load: Load


OPTIONAL: tuple[ModuleType, ...] = (valve, spool, friction, end_stops)
"""Components that a machine may lack: `is_used` says whether it has them."""
_ABSENT = {
    "stribeck_speed": 1.0,
    "valve_natural_frequency": 0.0,
    "valve_damping": 1.0,
    "valve_rate_limit": np.inf,
}


@lru_cache(maxsize=256)
def parameters(actuator: Actuator) -> Parameters:
    """The plant's parameters of `actuator`."""
    derived = {"flow_coefficient_a": actuator.flow_coefficient, "inverse_mass": 1.0 / actuator.mass}
    given = _ABSENT | {
        name: value
        for name, value in (actuator.parameters() | derived).items()
        if value is not None
    }
    return Parameters(
        _of(Chambers, given),
        _of(Supply, given),
        _of(Valve, given),
        _of(Spool, given),
        _of(Friction, given),
        _of(EndStops, given),
        _of(Load, given),
    )


def _of(kind: type[Component], given: Mapping[str, float]) -> Component:
    """The component with those of the given values that it has fields for."""
    return kind(**{name: given[name] for name in kind.__annotations__})


@lru_cache(maxsize=256)
def components_used(p: Parameters) -> frozenset[str]:
    """The names of those of OPTIONAL that the machine has. A spool that lags may pass its ends,
    of which the law of the valve takes care."""
    names = (component.__name__.rpartition(".")[2] for component in OPTIONAL)
    used = {
        name
        for name, component in zip(names, OPTIONAL, strict=True)
        if component.is_used(getattr(p, name))
    }
    return frozenset(used | ({"valve"} if "spool" in used else set()))


def rates(p_a, p_b, v, y, x, load_force, p: Parameters):
    """(dp_a/dt, dp_b/dt, dv/dt) in Pa/s, Pa/s, m/s^2: equation (1) at the effective opening x.
    dy/dt is v."""
    gain_a, gain_b = valve.flow_gains(p_a, p_b, x, p.valve, p.supply)
    stiff_a, stiff_b = chambers.stiffnesses(y, p.chambers)
    leak = chambers.leakage_flow(p_a, p_b, p.chambers)
    area_a, area_b = p.chambers.area_a, p.chambers.area_b
    force = (
        area_a * p_a
        - area_b * p_b
        - friction.force(v, p.friction)
        + end_stops.force(y, v, p.end_stops)
        - load_force
    )
    return (
        stiff_a * (gain_a * x - (area_a * v + leak)),
        stiff_b * (gain_b * x + (area_b * v + leak)),
        load.acceleration(force, p.load),
    )


def jacobian(p_a, p_b, v, y, x, p: Parameters):
    """(A, b): A (..., 3, 3) = d(rates)/d(p_a, p_b, v) and b (..., 3, 1) = d(rates)/dx, exact, at
    frozen y clear of the stops.

    Every entry lies contiguous in memory over the grid; arguments that are constant along an axis
    cost no more for its length.
    """
    gain_a, gain_b = valve.flow_gains(p_a, p_b, x, p.valve, p.supply)
    drop_a, drop_b = valve.pressure_gains(p_a, p_b, x, p.valve, p.supply)
    stiff_a, stiff_b = chambers.stiffnesses(y, p.chambers)
    slope, inverse_mass = friction.slope(v, p.friction), p.load.inverse_mass
    area_a, area_b, leakage = p.chambers.area_a, p.chambers.area_b, p.chambers.leakage
    shape = np.broadcast(gain_a, gain_b, drop_a, drop_b, stiff_a, stiff_b, slope).shape
    a = np.empty((3, 3, *shape))
    np.multiply(-stiff_a, drop_a + leakage, out=a[0, 0, ...])
    a[0, 1] = stiff_a * leakage
    a[0, 2] = -stiff_a * area_a
    a[1, 0] = stiff_b * leakage
    np.multiply(-stiff_b, drop_b + leakage, out=a[1, 1, ...])
    a[1, 2] = stiff_b * area_b
    a[2, 0] = area_a * inverse_mass
    a[2, 1] = -area_b * inverse_mass
    a[2, 2] = -slope * inverse_mass
    b = np.zeros((3, 1, *shape))
    np.multiply(stiff_a, gain_a, out=b[0, 0, ...])
    np.multiply(stiff_b, gain_b, out=b[1, 0, ...])
    order = (*range(2, a.ndim), 0, 1)
    return a.transpose(order), b.transpose(order)


def as_nonlinear_system(
    actuator: Actuator, *, pressure_unit: float = 1e5
) -> control.NonlinearIOSystem:
    """The whole plant for python-control: inputs x (valve command) and load_force (N, added to
    `actuator.constant_load`); states p_a, p_b, v (m/s), y (m) and, for a valve that is not ideal,
    spool and spool_rate (1/s); outputs p_a, p_b, v, y.

    Pressures are in `pressure_unit` Pa, bar by default: `control.linearize` takes one step of 1e-6
    for all states, which is lost in the rounding of a pressure in Pa (entries of A off by per cent)
    and right for one in bar.
    """
    import control

    p = parameters(actuator)
    ideal = actuator.valve_natural_frequency is None

    def update(t, state, inputs, params):
        p_a, p_b, v, y, *moving = state
        position = inputs[0] if ideal else moving[0]
        opening = valve.effective_opening(position, p.valve)
        dp_a, dp_b, dv = rates(
            p_a * pressure_unit,
            p_b * pressure_unit,
            v,
            y,
            opening,
            actuator.constant_load + inputs[1],
            p,
        )
        lag = () if ideal else spool.rates(*moving, inputs[0], p.spool)
        return np.array([dp_a / pressure_unit, dp_b / pressure_unit, dv, v, *lag])

    motion = ["p_a", "p_b", "v", "y"]
    return control.nlsys(
        update,
        lambda t, state, inputs, params: state[:4],
        states=motion if ideal else [*motion, "spool", "spool_rate"],
        inputs=["x", "load_force"],
        outputs=motion,
        name=actuator.name.replace(".", "_"),
    )
