"""hydroctl: from the data sheet of a hydraulic servo cylinder to a proven gain schedule.

>>> import hydroctl as hc
>>> actuator = hc.load_actuator("reference")
>>> points = hc.find_operating_points(actuator, x=[[0.1], [1.0]], y=[0.1, 0.4])
>>> family = hc.linearize(actuator, points)
"""

from __future__ import annotations

import importlib

__version__ = "0.1.0"

_HOME = {
    "Actuator": "machine.actuator",
    "CampaignResult": "validation",
    "Design": "chain",
    "FailedChecksError": "errors",
    "GainSchedule": "schedule",
    "HydroctlError": "errors",
    "InfeasibleError": "errors",
    "InputError": "errors",
    "OperatingPointError": "errors",
    "ParallelForm": "regulator.forms",
    "Proof": "schedule",
    "PoorFitWarning": "quasi_linear",
    "Record": "identification",
    "Scenario": "simulation",
    "Sensors": "simulation",
    "SeriesForm": "regulator.forms",
    "SimulationError": "errors",
    "Specification": "specification",
    "StandardForm": "regulator.forms",
    "State": "simulation",
    "SynchronizationResult": "synchronization",
    "Trajectory": "simulation",
    "ValidationReport": "validation",
    "as_nonlinear_system": "model.plant",
    "as_plant": "loop.as_plant",
    "campaign": "validation",
    "characterize": "model.characteristics",
    "check_coupling": "schedule",
    "compare": "validation",
    "design": "chain",
    "export_coupling": "export",
    "export_plant": "export",
    "export_schedule": "export",
    "find_operating_points": "model.operating_point",
    "fit_surfaces": "quasi_linear",
    "identify": "identification",
    "linearize": "model.linearization",
    "list_actuators": "machine.datasheet",
    "load_actuator": "machine.datasheet",
    "load_schedule": "schedule",
    "prove": "proof",
    "read_record": "identification",
    "reduce_order": "quasi_linear",
    "replay": "validation",
    "rest_state": "simulation",
    "save_actuator": "machine.datasheet",
    "simulate": "simulation",
    "simulate_closed_loop": "simulation",
    "step_scenarios": "validation",
    "synchronize": "synchronization",
    "to_parallel": "regulator.forms",
    "to_series": "regulator.forms",
    "to_standard": "regulator.forms",
    "tracking_scenarios": "validation",
    "tune": "tuning",
    "tune_fast": "tuning",
    "tune_fixed": "tuning",
    "tune_search": "proof.searched_tuning",
    "validate": "validation",
}

__all__ = sorted(_HOME)


def __getattr__(name: str):
    if name not in _HOME:
        raise AttributeError(f"module 'hydroctl' has no attribute {name!r}")
    value = getattr(importlib.import_module(f".{_HOME[name]}", __name__), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return [*globals(), *__all__]
