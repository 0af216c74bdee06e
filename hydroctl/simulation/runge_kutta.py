"""One step of a Runge-Kutta method of order 6 in 8 stages: straight-line code, whole, or stage by stage for lanes.

Between samples the plant is nearly linear, and what limits the step is its oscillation. On linear equations this method is of order
8: there it is the Taylor polynomial of the exponential, and errs by (omega h)^9/9! of the amplitude where Butcher's method of
order 6 in 7 stages errs by 3 (omega h)^7/7!. For the same error its steps are more than twice as long.

The coefficients solve the 37 conditions of order 6 and b A^(k-1) 1 = 1/k! for k = 7 and 8, found by Newton's method from Butcher's
(J. C. Butcher, "On Runge-Kutta processes of high order", J. Austral. Math. Soc. 4 (1964)) with as many of them zero as could be,
every stage within the step, and then to 30 digits.
"""

from __future__ import annotations

from .motion import plus, slope

A = (
    (),
    (0.20047367656021448,),
    (0.0, 0.44603409598322363),
    (0.0, 0.36261722248017125, -0.061004524825230666),
    (0.0, 0.4668797608164116, 0.6577233958605826, -0.39644660069141635),
    (0.0, 0.2171484320514011, 0.0, 0.35275049847509676, 0.14758837270366737),
    (-0.2792589600270638, 1.1965242536921628, 0.0, -0.5273798263680571, 0.48765211789640467, -0.5168869125456249),
    (
        0.23497982307160709,
        -0.49815892881732027,
        0.4569978981788854,
        1.9766948871367622,
        0.6040212856052928,
        0.0,
        -1.7745349651752274,
    ),
)
"""Row i: the weights of the slopes before the place of slope i; below, those of the end."""
B = (0.08557117433920491, 0.0, 0.0, 0.6346396889444931, 0.0, 0.4302085012770178, -0.2351372436003612, 0.0847178790396454)


def second(z, h, k):
    """Where the second slope of a step of h seconds from z is taken; k holds the slopes before it. The next ones do the same."""
    return plus(z, h * A[1][0], k[0])


def third(z, h, k):
    return plus(z, h * A[2][1], k[1])


def fourth(z, h, k):
    return plus(plus(z, h * A[3][1], k[1]), h * A[3][2], k[2])


def fifth(z, h, k):
    return plus(plus(plus(z, h * A[4][1], k[1]), h * A[4][2], k[2]), h * A[4][3], k[3])


def sixth(z, h, k):
    return plus(plus(plus(z, h * A[5][1], k[1]), h * A[5][3], k[3]), h * A[5][4], k[4])


def seventh(z, h, k):
    part = plus(plus(z, h * A[6][0], k[0]), h * A[6][1], k[1])
    return plus(plus(plus(part, h * A[6][3], k[3]), h * A[6][4], k[4]), h * A[6][5], k[5])


def eighth(z, h, k):
    part = plus(plus(plus(z, h * A[7][0], k[0]), h * A[7][1], k[1]), h * A[7][2], k[2])
    return plus(plus(plus(part, h * A[7][3], k[3]), h * A[7][4], k[4]), h * A[7][6], k[6])


def end(z, h, k):
    """The end of the step."""
    return plus(plus(plus(plus(plus(z, h * B[0], k[0]), h * B[3], k[3]), h * B[5], k[5]), h * B[6], k[6]), h * B[7], k[7])


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
