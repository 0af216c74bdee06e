"""Validation on the nonlinear plant: scenarios, metrics, requirements and the verdict on each."""

from .campaigns import CampaignResult, campaign, replay
from .comparison import Comparison, compare
from .metrics import Metrics, measure
from .report import Run, ValidationReport, validate
from .scenarios import Scale, scale_of, step_scenarios, tracking_scenarios
from .verdict import Requirement, Verdict, default_requirements

__all__ = [
    "CampaignResult",
    "Comparison",
    "Metrics",
    "Requirement",
    "Run",
    "Scale",
    "ValidationReport",
    "Verdict",
    "campaign",
    "compare",
    "default_requirements",
    "measure",
    "replay",
    "scale_of",
    "step_scenarios",
    "tracking_scenarios",
    "validate",
]
