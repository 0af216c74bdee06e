"""The Runge-Kutta pair of Dormand and Prince, 5(4), with its dense output of order 4; see
`adaptive`.

Coefficients: J. R. Dormand, P. J. Prince, "A family of embedded Runge-Kutta formulae", J. Comput.
Appl. Math. 6 (1980), and E. Hairer, S. P. Norsett, G. Wanner, "Solving Ordinary Differential
Equations I", section II.6 for the dense output.
"""

from __future__ import annotations

from math import sqrt

from .motion import plus, slope

NAME = "Dormand-Prince 5(4)"
LATE = True
"""The length follows the error one step late, so that the processor can begin the next step before
the error is known."""
_A21 = 1 / 5
_A31, _A32 = 3 / 40, 9 / 40
_A41, _A42, _A43 = 44 / 45, -56 / 15, 32 / 9
_A51, _A52, _A53, _A54 = 19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729
_A61, _A62, _A63, _A64, _A65 = 9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656
_B1, _B3, _B4, _B5, _B6 = 35 / 384, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84
_E1, _E3, _E4, _E5, _E6, _E7 = (
    71 / 57600,
    -71 / 16695,
    71 / 1920,
    -17253 / 339200,
    22 / 525,
    -1 / 40,
)
_D1, _D3, _D4 = -12715105075 / 11282082432, 87487479700 / 32700410799, -10690763975 / 1880347072
_D5, _D6, _D7 = 701980252875 / 199316789632, -1453857185 / 822651844, 69997945 / 29380423
_NOTHING = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)


def growth(size):
    """By how much a step can grow whose error was `size` tolerances: the eighth root. Less eager
    than the fifth that the order of the method allows, it rejects fewer steps where stability
    limits them; and three square roots cost less than a power.
    """
    return 1.0 / sqrt(sqrt(sqrt(size)))


def begin(z, x, load, p):
    """The slope, which is the first stage of `attempt`."""
    return slope(z, x, load, p)


def attempt(z, k1, h, x, load, p):
    """(new state, error estimate, slope at the new state, dense output) of one step of length h."""
    k2 = slope(plus(z, h * _A21, k1), x, load, p)
    k3 = slope(plus(plus(z, h * _A31, k1), h * _A32, k2), x, load, p)
    k4 = slope(plus(plus(plus(z, h * _A41, k1), h * _A42, k2), h * _A43, k3), x, load, p)
    z5 = plus(plus(plus(plus(z, h * _A51, k1), h * _A52, k2), h * _A53, k3), h * _A54, k4)
    k5 = slope(z5, x, load, p)
    z6 = plus(
        plus(plus(plus(plus(z, h * _A61, k1), h * _A62, k2), h * _A63, k3), h * _A64, k4),
        h * _A65,
        k5,
    )
    k6 = slope(z6, x, load, p)
    new = plus(
        plus(plus(plus(plus(z, h * _B1, k1), h * _B3, k3), h * _B4, k4), h * _B5, k5), h * _B6, k6
    )
    k7 = slope(new, x, load, p)
    error = plus(plus(plus(_NOTHING, h * _E1, k1), h * _E3, k3), h * _E4, k4)
    error = plus(plus(plus(error, h * _E5, k5), h * _E6, k6), h * _E7, k7)
    q = plus(plus(plus(_NOTHING, h * _D1, k1), h * _D3, k3), h * _D4, k4)
    q = plus(plus(plus(q, h * _D5, k5), h * _D6, k6), h * _D7, k7)
    r = plus(plus(plus(_NOTHING, h, k1), -1.0, new), 1.0, z)
    s = plus(plus(plus(plus(_NOTHING, 1.0, new), -1.0, z), -h, k7), -1.0, r)
    return new, error, k7, (r, s, q)
