"""What the regulator sees of the plant: `Sensors`, with quantization and noise, and its compiled
half."""

from __future__ import annotations

from dataclasses import dataclass, fields
from numbers import Integral, Real

import numpy as np

from ..errors import InputError

SEEN = ("p_a", "p_b", "v", "y")
_KINDS = ("noise", "resolution")


@dataclass(frozen=True, kw_only=True)
class Sensors:
    """Noise and resolution of what is measured; 0 leaves either out. Raises InputError, all faults
    at once.

    A reading is the value plus normal noise of the given standard deviation, rounded to whole steps
    of the resolution. The noise is white from sample to sample and the same in every run with the
    same `seed`: in each case of a campaign, too.
    """

    p_a_noise: float = 0.0
    """Pa"""
    p_b_noise: float = 0.0
    """Pa"""
    v_noise: float = 0.0
    """m/s"""
    y_noise: float = 0.0
    """m"""
    p_a_resolution: float = 0.0
    """Pa"""
    p_b_resolution: float = 0.0
    """Pa"""
    v_resolution: float = 0.0
    """m/s"""
    y_resolution: float = 0.0
    """m"""
    seed: int = 0

    def __post_init__(self):
        faults = []
        for name in (field.name for field in fields(self) if field.name != "seed"):
            value = getattr(self, name)
            if isinstance(value, bool) or not isinstance(value, Real) or not 0.0 <= value < np.inf:
                faults.append(f"{name} = {value!r} must be a finite number of at least 0.")
        if isinstance(self.seed, bool) or not isinstance(self.seed, Integral) or self.seed < 0:
            faults.append(f"seed = {self.seed!r} must be a whole number of at least 0.")
        if faults:
            raise InputError(faults)

    def signals(self, samples: int) -> tuple[np.ndarray, np.ndarray]:
        """(noise (4, samples), resolution (4,)) for the compiled half, rows as in SEEN."""
        sigma, resolution = (
            np.array([float(getattr(self, f"{name}_{kind}")) for name in SEEN])
            for kind in ("noise", "resolution")
        )
        return sigma[:, None] * np.random.default_rng(self.seed).standard_normal(
            (4, samples)
        ), resolution


def seen(values, k, sensors):
    """The readings of `values`, in the order of SEEN, at sample k; `sensors` is what
    `Sensors.signals` gives, or None."""
    if sensors is None:
        return values
    return (
        reading(values[0], 0, k, sensors),
        reading(values[1], 1, k, sensors),
        reading(values[2], 2, k, sensors),
        reading(values[3], 3, k, sensors),
    )


def reading(value, row, k, sensors):
    """One of them."""
    noise, resolution = sensors
    noisy, step = value + noise[row, k], resolution[row]
    return np.where(
        step == 0.0, noisy, step * np.floor(noisy / np.where(step == 0.0, 1.0, step) + 0.5)
    )
