"""The closed loop of one scenario, compiled: the regulator law each sample, Runge-Kutta 6 in between."""

from __future__ import annotations

from . import butcher, law, motion
from .law import AT_REST

ROWS = ("p_a", "p_b", "v", "y", "spool", "x", "command")


def run(initial, reference, v_ref, load, regulator, p, substeps, out):
    """Fill out (7, n), rows as in ROWS, at the n sample instants. Returns the state one sample after the last."""
    z = initial
    memory = AT_REST
    h = regulator.Ts / substeps
    delay = regulator.delay_samples
    for k in range(reference.size):
        memory = law.sample(reference[k], v_ref[k], (z[0], z[1], z[2], z[3]), memory, regulator)
        out[6, k] = memory.x
        x = out[6, k - delay] if k >= delay else 0.0
        z = motion.told(z, x, p)
        out[0, k], out[1, k], out[2, k], out[3, k], out[4, k], _ = z
        out[5, k] = x
        for _ in range(substeps):
            z = butcher.step(z, x, load[k], p, h)
    return z
