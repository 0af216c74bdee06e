"""One step of the plant: Runge-Kutta 6 where the field is smooth, Dormand-Prince with error control
where it bends."""

from __future__ import annotations

import numpy as np

from . import adaptive, motion, runge_kutta


def step(z, x, load, p, h):
    """The state h seconds after z for the valve command x and the load (N)."""
    new = runge_kutta.step(z, x, load, p, h)
    return adaptive.advance(z, x, load, p, h) if motion.bends(z, new, x, p) else new


def stretches(delay_fraction, Ts, substeps):
    """((n, h), (n, h)): the steps of the two stretches of a sample, before its new command acts and
    after, none longer than Ts/substeps."""
    before, after = (
        int(np.ceil(substeps * delay_fraction)),
        int(np.ceil(substeps * (1.0 - delay_fraction))),
    )
    return (before, delay_fraction * Ts / max(before, 1)), (
        after,
        (1.0 - delay_fraction) * Ts / after,
    )
