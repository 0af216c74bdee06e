"""How well the cylinders of a group stay together."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

SETTLING = 0.2
"""s after a load step that count apart: the oil gives way at once, by load over stiffness, before
any valve can act"""


@dataclass(frozen=True)
class SynchronizationMetrics:
    """The synchronisation error is the largest position less the least, at every sample; in m."""

    rms: float
    """outside the 0.2 s after each load step"""
    peak: float
    """outside the 0.2 s after each load step"""
    rms_after_load_steps: float
    """within these; NaN without a load step"""
    peak_after_load_steps: float
    rms_of_all: float
    """over the whole motion"""
    tracking_error: float
    """largest distance of a cylinder from the common reference, over the whole motion"""
    saturation_time: float
    """s in which some valve was fully open"""
    duration: float
    """s that the motion took"""


def measure_group(
    error: np.ndarray, lags: np.ndarray, commands: np.ndarray, load_steps: np.ndarray, Ts: float
):
    """The metrics of one motion: error (n,) m, lags (N, n) m, commands (N, n), load_steps (n,) True
    where a load steps."""
    since = np.arange(error.size) - np.maximum.accumulate(
        np.where(load_steps, np.arange(error.size), -error.size)
    )
    after = since < round(SETTLING / Ts)
    return SynchronizationMetrics(
        rms=_rms(error[~after]),
        peak=float(error[~after].max(initial=0.0)),
        rms_after_load_steps=_rms(error[after]),
        peak_after_load_steps=float(error[after].max()) if after.any() else np.nan,
        rms_of_all=_rms(error),
        tracking_error=float(np.abs(lags).max()),
        saturation_time=float(np.count_nonzero((np.abs(commands) >= 1.0).any(axis=0)) * Ts),
        duration=float(error.size * Ts),
    )


def _rms(error: np.ndarray) -> float:
    return float(np.sqrt(np.mean(error**2))) if error.size else np.nan
