"""hydroctl: from the data sheet of a hydraulic servo cylinder to a proven gain schedule.

>>> import hydroctl as hc
>>> actuator = hc.load_actuator("reference")
>>> points = hc.find_operating_points(actuator, x=[[0.1], [1.0]], y=[0.1, 0.4])
>>> family = hc.linearize(actuator, points)
"""

from __future__ import annotations

import importlib
import sys
import types

__version__ = "0.1.0"

_HOME = {
    "Actuator": "actuator",
    "CampaignResult": "validation",
    "Design": "design",
    "FailedChecksError": "errors",
    "GainSchedule": "schedule",
    "HydroctlError": "errors",
    "InfeasibleError": "errors",
    "InputError": "errors",
    "OperatingPointError": "errors",
    "ParallelForm": "forms",
    "PoorFitWarning": "surfaces",
    "Record": "records",
    "Scenario": "simulation",
    "Sensors": "simulation",
    "SeriesForm": "forms",
    "SimulationError": "errors",
    "Specification": "specification",
    "StandardForm": "forms",
    "State": "simulation",
    "SynchronizationResult": "synchronization",
    "Trajectory": "simulation",
    "ValidationReport": "validation",
    "as_nonlinear_system": "plant",
    "campaign": "validation",
    "characterize": "characteristics",
    "check_coupling": "coupling",
    "compare": "validation",
    "design": "design",
    "export_coupling": "export",
    "export_plant": "export",
    "export_schedule": "export",
    "find_operating_points": "operating_point",
    "fit_surfaces": "surfaces",
    "identify": "identification",
    "linearize": "linearization",
    "list_actuators": "datasheet",
    "load_actuator": "datasheet",
    "load_schedule": "schedule",
    "read_record": "records",
    "reduce_order": "reduction",
    "replay": "validation",
    "rest_state": "simulation",
    "save_actuator": "datasheet",
    "simulate": "simulation",
    "simulate_closed_loop": "simulation",
    "step_scenarios": "validation",
    "synchronize": "synchronization",
    "to_parallel": "forms",
    "to_series": "forms",
    "to_standard": "forms",
    "tracking_scenarios": "validation",
    "tune": "tuning",
    "tune_fast": "tuning",
    "tune_fixed": "tuning",
    "tune_search": "searched_tuning",
    "validate": "validation",
}

__all__ = sorted(_HOME)


class _Package(types.ModuleType):
    """Keeps public names callable: importing the submodule `hydroctl.design` must not replace the function `hydroctl.design`."""

    def __setattr__(self, name: str, value) -> None:
        if not (name in _HOME and isinstance(value, types.ModuleType)):
            super().__setattr__(name, value)


sys.modules[__name__].__class__ = _Package


def __getattr__(name: str):
    if name not in _HOME:
        raise AttributeError(f"module 'hydroctl' has no attribute {name!r}")
    value = getattr(importlib.import_module(f".{_HOME[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*globals(), *__all__]
