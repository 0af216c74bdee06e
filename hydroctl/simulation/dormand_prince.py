"""The Runge-Kutta pair of Dormand and Prince, 5(4), with its dense output of order 4, compiled around the plant.

Coefficients: J. R. Dormand, P. J. Prince, "A family of embedded Runge-Kutta formulae", J. Comput. Appl. Math. 6 (1980), and
E. Hairer, S. P. Norsett, G. Wanner, "Solving Ordinary Differential Equations I", section II.6 for the dense output.
"""

from __future__ import annotations

from math import inf

from .motion import plus, slope, told

_A21 = 1 / 5
_A31, _A32 = 3 / 40, 9 / 40
_A41, _A42, _A43 = 44 / 45, -56 / 15, 32 / 9
_A51, _A52, _A53, _A54 = 19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729
_A61, _A62, _A63, _A64, _A65 = 9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656
_B1, _B3, _B4, _B5, _B6 = 35 / 384, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84
_E1, _E3, _E4, _E5, _E6, _E7 = 71 / 57600, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40
_D1, _D3, _D4 = -12715105075 / 11282082432, 87487479700 / 32700410799, -10690763975 / 1880347072
_D5, _D6, _D7 = 701980252875 / 199316789632, -1453857185 / 822651844, 69997945 / 29380423
_NOTHING = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
_SAFETY, _SHRINK, _GROW = 0.9, 0.2, 5.0
_SMALLEST = 1e-13


def _step(z, k1, h, x, load, p):
    """(new state, error estimate, slopes k1 and k3 ... k7) of one step of length h."""
    k2 = slope(plus(z, h * _A21, k1), x, load, p)
    k3 = slope(plus(plus(z, h * _A31, k1), h * _A32, k2), x, load, p)
    k4 = slope(plus(plus(plus(z, h * _A41, k1), h * _A42, k2), h * _A43, k3), x, load, p)
    z5 = plus(plus(plus(plus(z, h * _A51, k1), h * _A52, k2), h * _A53, k3), h * _A54, k4)
    k5 = slope(z5, x, load, p)
    z6 = plus(plus(plus(plus(plus(z, h * _A61, k1), h * _A62, k2), h * _A63, k3), h * _A64, k4), h * _A65, k5)
    k6 = slope(z6, x, load, p)
    new = plus(plus(plus(plus(plus(z, h * _B1, k1), h * _B3, k3), h * _B4, k4), h * _B5, k5), h * _B6, k6)
    k7 = slope(new, x, load, p)
    error = plus(plus(plus(_NOTHING, h * _E1, k1), h * _E3, k3), h * _E4, k4)
    error = plus(plus(plus(error, h * _E5, k5), h * _E6, k6), h * _E7, k7)
    return new, error, (k1, k3, k4, k5, k6, k7)


def _ratio(z, new, error, scale):
    return abs(error) / max(abs(z), abs(new), scale)


def _error_norm(z, new, error, scales):
    """Largest error over the size of its state; infinite where the step left the numbers."""
    worst = max(_ratio(z[0], new[0], error[0], scales[0]), _ratio(z[1], new[1], error[1], scales[1]))
    worst = max(worst, _ratio(z[2], new[2], error[2], scales[2]), _ratio(z[3], new[3], error[3], scales[3]))
    worst = max(worst, _ratio(z[4], new[4], error[4], scales[4]), _ratio(z[5], new[5], error[5], scales[5]))
    finite = error[0] + error[1] + error[2] + error[3] + error[4] + error[5]
    return worst if finite - finite == 0.0 else inf


def _interpolate(theta, h, z, new, k1, k7, end):
    """One state at the fraction theta of the step."""
    change = new - z
    start = h * k1 - change
    bend = change - h * k7 - start
    rest = 1.0 - theta
    return z + theta * (change + rest * (start + theta * (bend + rest * end)))


def _write_dense(out, first, last, t, t0, h, z, new, slopes):
    """The interpolant of the step from t0, at the samples first ... last - 1."""
    k1, k3, k4, k5, k6, k7 = slopes
    ends = plus(plus(plus(_NOTHING, h * _D1, k1), h * _D3, k3), h * _D4, k4)
    ends = plus(plus(plus(ends, h * _D5, k5), h * _D6, k6), h * _D7, k7)
    for k in range(first, last):
        theta = (t[k] - t0) / h
        out[0, k] = _interpolate(theta, h, z[0], new[0], k1[0], k7[0], ends[0])
        out[1, k] = _interpolate(theta, h, z[1], new[1], k1[1], k7[1], ends[1])
        out[2, k] = _interpolate(theta, h, z[2], new[2], k1[2], k7[2], ends[2])
        out[3, k] = _interpolate(theta, h, z[3], new[3], k1[3], k7[3], ends[3])
        out[4, k] = _interpolate(theta, h, z[4], new[4], k1[4], k7[4], ends[4])
        out[5, k] = _interpolate(theta, h, z[5], new[5], k1[5], k7[5], ends[5])


def integrate(t, x, load, initial, p, rtol, scales, most_steps, out):
    """Fill out (6, n) with the states at the times t for commands x and loads (N) held from t[k] to t[k+1].

    `scales` (6,): the size below which a state's error is absolute. Starts anew where x or the load changes. Returns
    (number of steps, time reached); the time is below t[-1] where the step length or `most_steps` ran out.
    """
    z = told(initial, x[0], p)
    out[0, 0], out[1, 0], out[2, 0], out[3, 0], out[4, 0], out[5, 0] = z
    steps, segment, h = 0, 0, t[-1] - t[0]
    while segment < t.size - 1:
        end = segment + 1
        while end < t.size - 1 and x[end] == x[segment] and load[end] == load[segment]:
            end += 1
        now, written, command, force = t[segment], segment + 1, x[segment], load[segment]
        z = told(z, command, p)
        k1 = slope(z, command, force, p)
        while now < t[end]:
            final = now + 1.01 * h >= t[end]
            length = t[end] - now if final else h
            new, error, slopes = _step(z, k1, length, command, force, p)
            size = _error_norm(z, new, error, scales) / rtol
            steps += 1
            if size <= 1.0:
                reached = t[end] if final else now + length
                last = written
                while last <= end and t[last] <= reached:
                    last += 1
                _write_dense(out, written, last, t, now, length, z, new, slopes)
                now, written, z, k1 = reached, last, new, slopes[5]
            factor = min(_GROW, max(_SHRINK, _SAFETY * size**-0.2)) if size > 0.0 else _GROW
            if not final or size > 1.0 or factor < 1.0:
                h = length * factor
            if h <= _SMALLEST * (t[-1] - t[0]) or steps >= most_steps:
                return steps, now
        segment = end
    return steps, t[-1]
