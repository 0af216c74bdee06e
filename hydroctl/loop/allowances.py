"""What interpolated gains may exceed a limit by."""

from __future__ import annotations

from dataclasses import replace

from ..specification import Specification

ALLOWANCE = 0.02
"""for interpolated gains: of Ms and Mt, of a phase margin in rad, and as a share of gain margin and
crossover"""
_LEAST = 1e-6


def between_points(specification: Specification, share: float = 1.0) -> Specification:
    """The limits as they are to hold half-way between the design points, where the gains are
    interpolated; `share` of what is allowed there."""
    gain, phase, crossover = (
        getattr(specification, name) for name in ("gain_margin", "phase_margin", "min_crossover")
    )
    allowance = share * ALLOWANCE
    return replace(
        specification,
        Ms=specification.Ms + allowance,
        Mt=specification.Mt + allowance,
        gain_margin=None if gain is None else max(gain * (1.0 - allowance), 1.0 + _LEAST),
        phase_margin=None if phase is None else max(phase - allowance, _LEAST),
        min_crossover=None if crossover is None else crossover * (1.0 - allowance),
    )
