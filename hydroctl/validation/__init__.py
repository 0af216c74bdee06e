"""Validation on the nonlinear plant: scenarios, metrics, requirements and the verdict on each."""

from ..schedule.verdict import Verdict, failures
from .campaigns import CampaignResult, campaign, replay
from .cluster import connected
from .comparison import (
    Comparison,
    Standing,
    against_rivals,
    compare,
    compare_reports,
    fixed_rival,
    proportional_rivals,
    rivals,
    standings,
)
from .metrics import Metrics, measure
from .report import Run, ValidationReport, validate
from .scale import Scale, scale_of
from .scenarios import contact_scenarios, library, step_scenarios, tracking_scenarios
from .verdict import Requirement, default_requirements

__all__ = [
    "CampaignResult",
    "Comparison",
    "Metrics",
    "Requirement",
    "Run",
    "Scale",
    "Standing",
    "ValidationReport",
    "Verdict",
    "against_rivals",
    "campaign",
    "compare",
    "compare_reports",
    "connected",
    "contact_scenarios",
    "default_requirements",
    "failures",
    "fixed_rival",
    "library",
    "measure",
    "proportional_rivals",
    "replay",
    "rivals",
    "scale_of",
    "standings",
    "step_scenarios",
    "tracking_scenarios",
    "validate",
]
