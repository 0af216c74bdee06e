"""Several cylinders, one reference: couplings with designed gains, and the motion of the group on
the nonlinear plants."""

from .campaign import SynchronizationCampaign, campaign, random_group
from .coupling import COUPLINGS, Coupling, CouplingEvidence
from .design import design_coupling
from .metrics import SynchronizationMetrics
from .motion import Stop, SynchronizationResult, synchronize
from .profile import MotionProfile, s_curve, standard_motion
from .rules import Failure, MotionLimits, RateOverride, StopStrategy

__all__ = [
    "COUPLINGS",
    "Coupling",
    "CouplingEvidence",
    "Failure",
    "MotionLimits",
    "MotionProfile",
    "RateOverride",
    "Stop",
    "StopStrategy",
    "SynchronizationCampaign",
    "SynchronizationMetrics",
    "SynchronizationResult",
    "campaign",
    "design_coupling",
    "random_group",
    "s_curve",
    "standard_motion",
    "synchronize",
]
