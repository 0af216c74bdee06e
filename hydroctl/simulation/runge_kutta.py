"""One step of a Runge-Kutta method of order 6 in 9 stages: straight-line code, whole, or stage by stage for lanes.

Between samples the plant is nearly linear, and what limits the step is its oscillation. On linear equations this method is of order
9: there it is the Taylor polynomial of the exponential, and errs by (omega h)^10/10! of the amplitude where Butcher's method of
order 6 in 7 stages errs by 3 (omega h)^7/7!. For the same error its steps are three times as long.

The coefficients solve the 37 conditions of order 6 and b A^(k-1) 1 = 1/k! for k = 7, 8, 9, found by Newton's method from Butcher's
(J. C. Butcher, "On Runge-Kutta processes of high order", J. Austral. Math. Soc. 4 (1964)) with as many of them zero as could be,
every stage within the step, and then to 30 digits.
"""

from __future__ import annotations

from .motion import plus, slope

A = (
    (),
    (0.11194287059941367,),
    (-0.3503722366642513, 0.7639349908574095),
    (0.0, 0.07353638654012987, -0.015886653968200704),
    (0.0, 1.6060641047969424, 0.24085008096413624, -1.1983639775941477),
    (0.0, 0.3787624382163985, 0.0, 0.0, 0.3886320606405093),
    (-0.7277281064472548, 2.2202169484743255, -0.9658082208927411, -0.5550980438295849, 0.668144862203324, -0.20085455939842164),
    (0.25148239785787496, 0.0, 0.0, 0.0, 0.20439491440198726, 0.0, -0.2569747541627864),
    (
        0.0,
        -0.7347362929420869,
        1.5204387836460704,
        0.031761882301187316,
        0.0,
        0.49002318007632933,
        -1.5137724280542166,
        1.2062848749727164,
    ),
)
"""Row i: the weights of the slopes before the place of slope i; below, those of the end."""
B = (
    0.0,
    0.0,
    0.567755946229938,
    0.1419357794945073,
    0.0,
    0.3519740126376915,
    -0.23695165756816283,
    0.10533357365776677,
    0.06995234554825928,
)


def second(z, h, k):
    """Where the second slope of a step of h seconds from z is taken; k holds the slopes before it. The next ones do the same."""
    return plus(z, h * A[1][0], k[0])


def third(z, h, k):
    return plus(plus(z, h * A[2][0], k[0]), h * A[2][1], k[1])


def fourth(z, h, k):
    return plus(plus(z, h * A[3][1], k[1]), h * A[3][2], k[2])


def fifth(z, h, k):
    return plus(plus(plus(z, h * A[4][1], k[1]), h * A[4][2], k[2]), h * A[4][3], k[3])


def sixth(z, h, k):
    return plus(plus(z, h * A[5][1], k[1]), h * A[5][4], k[4])


def seventh(z, h, k):
    part = plus(plus(plus(z, h * A[6][0], k[0]), h * A[6][1], k[1]), h * A[6][2], k[2])
    return plus(plus(plus(part, h * A[6][3], k[3]), h * A[6][4], k[4]), h * A[6][5], k[5])


def eighth(z, h, k):
    return plus(plus(plus(z, h * A[7][0], k[0]), h * A[7][4], k[4]), h * A[7][6], k[6])


def ninth(z, h, k):
    part = plus(plus(plus(z, h * A[8][1], k[1]), h * A[8][2], k[2]), h * A[8][3], k[3])
    return plus(plus(plus(part, h * A[8][5], k[5]), h * A[8][6], k[6]), h * A[8][7], k[7])


def end(z, h, k):
    """The end of the step."""
    part = plus(plus(plus(z, h * B[2], k[2]), h * B[3], k[3]), h * B[5], k[5])
    return plus(plus(plus(part, h * B[6], k[6]), h * B[7], k[7]), h * B[8], k[8])


def step(z, x, load, p, h):
    """The state h seconds after z for the valve command x and the load (N)."""
    k1 = slope(z, x, load, p)
    k2 = slope(second(z, h, (k1,)), x, load, p)
    k3 = slope(third(z, h, (k1, k2)), x, load, p)
    k4 = slope(fourth(z, h, (k1, k2, k3)), x, load, p)
    k5 = slope(fifth(z, h, (k1, k2, k3, k4)), x, load, p)
    k6 = slope(sixth(z, h, (k1, k2, k3, k4, k5)), x, load, p)
    k7 = slope(seventh(z, h, (k1, k2, k3, k4, k5, k6)), x, load, p)
    k8 = slope(eighth(z, h, (k1, k2, k3, k4, k5, k6, k7)), x, load, p)
    k9 = slope(ninth(z, h, (k1, k2, k3, k4, k5, k6, k7, k8)), x, load, p)
    return end(z, h, (k1, k2, k3, k4, k5, k6, k7, k8, k9))
