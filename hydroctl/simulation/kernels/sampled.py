"""The closed loop of one scenario, compiled: the regulator law each sample, the motion of the plant
in between."""

from __future__ import annotations

from ...regulator import law
from ...regulator.law import AT_REST
from .. import sensing
from . import motion, stepping

ROWS = ("p_a", "p_b", "v", "y", "spool", "x", "command")


def run(initial, reference, v_ref, load, sensors, regulator, p, substeps, out):
    """Fill out (7, n), rows as in ROWS, at the n sample instants; `sensors` as in `sensing`.
    Returns the state one sample after the last, and how many samples found a fault.
    """
    z = initial
    faults = 0
    memory = AT_REST
    delay = regulator.delay_samples
    stretches = stepping.stretches(regulator.delay_fraction, regulator.Ts, substeps)
    for k in range(reference.size):
        memory = law.sample(
            reference[k],
            v_ref[k],
            sensing.seen((z[0], z[1], z[2], z[3]), k, sensors),
            memory,
            regulator,
        )
        faults += memory.running == 0.0
        out[6, k] = memory.x
        commands = (
            out[6, k - delay - 1] if k > delay else 0.0,
            out[6, k - delay] if k >= delay else 0.0,
        )
        z = motion.commanded(z, commands[1] if stretches[0][0] == 0 else commands[0], p)
        out[0, k], out[1, k], out[2, k], out[3, k], out[4, k], _ = z
        out[5, k] = commands[1]
        for part in range(2):
            count, h = stretches[part]
            z = motion.commanded(z, commands[part], p)
            for _ in range(count):
                z = stepping.step(z, commands[part], load[k], p, h)
    return z, faults
