"""Step-length control and output of an embedded method, compiled around `dormand_prince`, or around
`rodas` for stiff machines.

A method has `begin`, `attempt`, `growth` and `LATE`. `attempt` returns (new state, error estimate,
slope there, (r, s, q)) with the dense output z + theta ((new - z) + (1 - theta) (r + theta (s + (1
- theta) q))) at the fraction theta of the step.
"""

from __future__ import annotations

from math import inf, nan

from . import dormand_prince as method
from .motion import commanded, sizes

_SAFETY, _SHRINK, _GROW = 0.85, 0.2, 5.0
_SMALLEST = 1e-13
_SMALL = 1e-2
"""The part of its range below which the error of a state is absolute"""
_CLOSE, _MOST_STEPS = 1e-10, 100_000
CALLED = ("advance",)


def _ratio(z, new, error, scale):
    return abs(error) / max(abs(z), abs(new), scale)


def _error_norm(z, new, error, scales):
    """Largest error over the size of its state; infinite where the step left the numbers."""
    pressures = max(
        _ratio(z[0], new[0], error[0], scales[0]), _ratio(z[1], new[1], error[1], scales[1])
    )
    piston = max(
        _ratio(z[2], new[2], error[2], scales[2]), _ratio(z[3], new[3], error[3], scales[3])
    )
    spool = max(
        _ratio(z[4], new[4], error[4], scales[4]), _ratio(z[5], new[5], error[5], scales[5])
    )
    worst = max(max(pressures, piston), spool)
    finite = error[0] + error[1] + error[2] + error[3] + error[4] + error[5]
    return worst if finite - finite == 0.0 else inf


def _factor(size):
    """By how much the next step may be longer than one whose error was `size` tolerances."""
    return min(_GROW, max(_SHRINK, _SAFETY * method.growth(size))) if size > 0.0 else _GROW


def _small_sizes(p):
    size = sizes(p)
    return (
        _SMALL * size[0],
        _SMALL * size[1],
        _SMALL * size[2],
        _SMALL * size[3],
        _SMALL * size[4],
        _SMALL * size[5],
    )


def advance(z, x, load, p, h):
    """The state h seconds after z for constant x and load, each step within 1e-10; NaN where that
    takes too many."""
    scales = _small_sizes(p)
    start, left, length, steps = method.begin(z, x, load, p), h, h, 0
    while left > 0.0 and steps < _MOST_STEPS:
        new, error, end, _ = method.attempt(z, start, length, x, load, p)
        size = _error_norm(z, new, error, scales) / _CLOSE
        steps += 1
        if size <= 1.0:
            z, start, left = new, end, left - length
        length *= _factor(size)
        if length >= 0.99 * left:
            length = left
    lost = 0.0 if left <= 0.0 else nan
    return z[0] + lost, z[1] + lost, z[2] + lost, z[3] + lost, z[4] + lost, z[5] + lost


def _between(theta, z, new, r, s, q):
    """One state at the fraction theta of the step."""
    rest = 1.0 - theta
    return z + theta * (new - z + rest * (r + theta * (s + rest * q)))


def _write_dense(out, first, last, t, t0, h, z, new, dense, ideal):
    """The dense output of the step from t0, at the samples first ... last - 1; the spool of an
    `ideal` valve stands still."""
    r, s, q = dense
    for k in range(first, last):
        theta = (t[k] - t0) / h
        out[0, k] = _between(theta, z[0], new[0], r[0], s[0], q[0])
        out[1, k] = _between(theta, z[1], new[1], r[1], s[1], q[1])
        out[2, k] = _between(theta, z[2], new[2], r[2], s[2], q[2])
        out[3, k] = _between(theta, z[3], new[3], r[3], s[3], q[3])
        if ideal:
            out[4, k], out[5, k] = z[4], z[5]
        else:
            out[4, k] = _between(theta, z[4], new[4], r[4], s[4], q[4])
            out[5, k] = _between(theta, z[5], new[5], r[5], s[5], q[5])


def integrate(t, x, load, initial, p, rtol, most_steps, out):
    """Fill out (6, n) with the states at the times t for commands x and loads (N) held from t[k] to
    t[k+1].

    Starts anew where x or the load changes. Returns (number of steps, time reached); the time is
    below t[-1] where the step length or `most_steps` ran out.
    """
    scales, ideal = _small_sizes(p), p.spool.valve_natural_frequency == 0.0
    z = commanded(initial, x[0], p)
    out[0, 0], out[1, 0], out[2, 0], out[3, 0], out[4, 0], out[5, 0] = z
    steps, segment, h, growth = 0, 0, t[-1] - t[0], 1.0
    while segment < t.size - 1:
        end = segment + 1
        while end < t.size - 1 and x[end] == x[segment] and load[end] == load[segment]:
            end += 1
        now, written, command, force = t[segment], segment + 1, x[segment], load[segment]
        z = commanded(z, command, p)
        start = method.begin(z, command, force, p)
        while now < t[end]:
            final = now + 1.01 * h >= t[end]
            length = t[end] - now if final else h
            new, error, slope, dense = method.attempt(z, start, length, command, force, p)
            size = _error_norm(z, new, error, scales) / rtol
            steps += 1
            if size <= 1.0:
                reached = t[end] if final else now + length
                last = written
                while last <= end and t[last] <= reached:
                    last += 1
                _write_dense(out, written, last, t, now, length, z, new, dense, ideal)
                now, written, z, start = reached, last, new, slope
                if not final:
                    factor = _factor(size)
                    h, growth = (length * growth, factor) if method.LATE else (length * factor, 1.0)
            else:
                h, growth = length * _factor(size), 1.0
            if h <= _SMALLEST * (t[-1] - t[0]) or steps >= most_steps:
                return steps, now
        segment = end
    return steps, t[-1]
