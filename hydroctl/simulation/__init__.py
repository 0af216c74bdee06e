"""The nonlinear plant in time: alone, and under a sampled regulator. The kernels are compiled with
numba at their first call."""

from .closed_loop import simulate_closed_loop
from .open_loop import simulate
from .scenario import Scenario
from .sensing import Sensors
from .trajectory import State, Trajectory, rest_state

__all__ = [
    "Scenario",
    "Sensors",
    "State",
    "Trajectory",
    "rest_state",
    "simulate",
    "simulate_closed_loop",
]
