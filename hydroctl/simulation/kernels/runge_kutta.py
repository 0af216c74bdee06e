"""One step of a Runge-Kutta method of order 6 in 8 stages: straight-line code, whole, or stage by
stage for lanes.

Between samples the plant is nearly linear, and what limits the step is its oscillation. For s = i
omega h the step multiplies by 1 + s + ... + s^8/8! - 0.6 s^7/9!, and errs by some s^7 (s^2 +
0.6)/9!: a millionth of the amplitude at omega h = 1, where Butcher's method of order 6 in 7 stages
errs by 3/7! = 6e-4. For the same error its steps are more than twice as long.

The coefficients solve the 37 conditions of order 6 and those of the two powers above, found by
Newton's method from Butcher's (J. C. Butcher, "On Runge-Kutta processes of high order", J. Austral.
Math. Soc. 4 (1964)) with as many of them zero as could be, every stage within the step, and then to
30 digits.
"""

from __future__ import annotations

from .motion import plus, slope

A = (
    (),
    (0.20081335606146652,),
    (0.0, 0.4468336711324459),
    (0.0, 0.36246712477308424, -0.06161899120722905),
    (0.0, 0.466963540269869, 0.6546511842262596, -0.39228045240890813),
    (0.0, 0.21468312482207366, 0.0, 0.35574692027244337, 0.14732024875921465),
    (
        -0.28774017413709396,
        1.2218935188106739,
        0.0,
        -0.5415796133250185,
        0.5005550941869917,
        -0.5332907356105894,
    ),
    (
        0.23709282370238033,
        -0.4949994672611312,
        0.456800818205691,
        1.9235332865938382,
        0.5967295007287108,
        0.0,
        -1.719156961969489,
    ),
)
"""Row i: the weights of the slopes before the place of slope i; below, those of the end."""
B = (
    0.0854932262178371,
    0.0,
    0.0,
    0.6276246829779845,
    0.0,
    0.4295799143125706,
    -0.22735966797217802,
    0.08466184446378588,
)


def second(z, h, k):
    """Where the second slope of a step of h seconds from z is taken; k holds the slopes before
    it."""
    return plus(z, h * A[1][0], k[0])


def third(z, h, k):
    """The place of the third slope."""
    return plus(z, h * A[2][1], k[1])


def fourth(z, h, k):
    """The place of the fourth slope."""
    return plus(plus(z, h * A[3][1], k[1]), h * A[3][2], k[2])


def fifth(z, h, k):
    """The place of the fifth slope."""
    return plus(plus(plus(z, h * A[4][1], k[1]), h * A[4][2], k[2]), h * A[4][3], k[3])


def sixth(z, h, k):
    """The place of the sixth slope."""
    return plus(plus(plus(z, h * A[5][1], k[1]), h * A[5][3], k[3]), h * A[5][4], k[4])


def seventh(z, h, k):
    """The place of the seventh slope."""
    part = plus(plus(z, h * A[6][0], k[0]), h * A[6][1], k[1])
    return plus(plus(plus(part, h * A[6][3], k[3]), h * A[6][4], k[4]), h * A[6][5], k[5])


def eighth(z, h, k):
    """The place of the eighth slope."""
    part = plus(plus(plus(z, h * A[7][0], k[0]), h * A[7][1], k[1]), h * A[7][2], k[2])
    return plus(plus(plus(part, h * A[7][3], k[3]), h * A[7][4], k[4]), h * A[7][6], k[6])


def end(z, h, k):
    """The end of the step."""
    return plus(
        plus(plus(plus(plus(z, h * B[0], k[0]), h * B[3], k[3]), h * B[5], k[5]), h * B[6], k[6]),
        h * B[7],
        k[7],
    )


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
    return end(z, h, (k1, k2, k3, k4, k5, k6, k7, k8))
