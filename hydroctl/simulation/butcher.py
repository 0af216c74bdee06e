"""One step of Butcher's Runge-Kutta method of order 6 in 7 stages: straight-line code, whole, or stage by stage for lanes.

Coefficients: J. C. Butcher, "On Runge-Kutta processes of high order", J. Austral. Math. Soc. 4 (1964). At the accuracy that
the closed loop needs it takes half the evaluations of the classical method of order 4.
"""

from __future__ import annotations

from .motion import plus, slope

_A21 = 1 / 3
_A32 = 2 / 3
_A41, _A42, _A43 = 1 / 12, 1 / 3, -1 / 12
_A51, _A52, _A53, _A54 = -1 / 16, 9 / 8, -3 / 16, -3 / 8
_A62, _A63, _A64, _A65 = 9 / 8, -3 / 8, -3 / 4, 1 / 2
_A71, _A72, _A73, _A74, _A76 = 9 / 44, -9 / 11, 63 / 44, 18 / 11, -16 / 11
_B1, _B3, _B4, _B5, _B6, _B7 = 11 / 120, 27 / 40, 27 / 40, -4 / 15, -4 / 15, 11 / 120


def second(z, h, k):
    """Where the second slope of a step of h seconds from z is taken; k holds the slopes before it. The next ones do the same."""
    return plus(z, h * _A21, k[0])


def third(z, h, k):
    return plus(z, h * _A32, k[1])


def fourth(z, h, k):
    return plus(plus(plus(z, h * _A41, k[0]), h * _A42, k[1]), h * _A43, k[2])


def fifth(z, h, k):
    return plus(plus(plus(plus(z, h * _A51, k[0]), h * _A52, k[1]), h * _A53, k[2]), h * _A54, k[3])


def sixth(z, h, k):
    return plus(plus(plus(plus(z, h * _A62, k[1]), h * _A63, k[2]), h * _A64, k[3]), h * _A65, k[4])


def seventh(z, h, k):
    return plus(plus(plus(plus(plus(z, h * _A71, k[0]), h * _A72, k[1]), h * _A73, k[2]), h * _A74, k[3]), h * _A76, k[5])


def end(z, h, k):
    """The end of the step."""
    new = plus(plus(plus(z, h * _B1, k[0]), h * _B3, k[2]), h * _B4, k[3])
    return plus(plus(plus(new, h * _B5, k[4]), h * _B6, k[5]), h * _B7, k[6])


def step(z, x, load, p, h):
    """The state h seconds after z for the valve command x and the load (N)."""
    k1 = slope(z, x, load, p)
    k2 = slope(second(z, h, (k1,)), x, load, p)
    k3 = slope(third(z, h, (k1, k2)), x, load, p)
    k4 = slope(fourth(z, h, (k1, k2, k3)), x, load, p)
    k5 = slope(fifth(z, h, (k1, k2, k3, k4)), x, load, p)
    k6 = slope(sixth(z, h, (k1, k2, k3, k4, k5)), x, load, p)
    k7 = slope(seventh(z, h, (k1, k2, k3, k4, k5, k6)), x, load, p)
    return end(z, h, (k1, k2, k3, k4, k5, k6, k7))
