"""The Rosenbrock method Rodas4 of order 4(3), for stiff machines: stiffly accurate, L-stable, with
its dense output of order 3.

Coefficients: E. Hairer, G. Wanner, "Solving Ordinary Differential Equations II", section IV.7 and
the code RODAS. With W = 1/(gamma h) I - J and f the slope,

    W u_i = f(z + sum a_ij u_j) + sum c_ij/h u_j        i = 1 ... 6

the last two stages being the embedded and the final solution: the error is u_6. States are scaled
to their ranges, in which the Jacobian J, by central differences, and the inverse of W are well
conditioned.
"""

from __future__ import annotations

from math import sqrt

from numpy import array, empty, zeros
from numpy.linalg import inv

from .motion import sizes, slope

NAME = "Rodas4"
LATE = False
"""Its steps take so long that the error costs nothing beside them."""
CALLED = ("attempt", "_shifted_jacobian")
_GAMMA = 0.25
_STEP = 1e-6
_A = array(
    (
        (0.0, 0.0, 0.0, 0.0, 0.0),
        (1.544, 0.0, 0.0, 0.0, 0.0),
        (0.9466785280815826, 0.2557011698983284, 0.0, 0.0, 0.0),
        (3.314825187068521, 2.896124015972201, 0.9986419139977817, 0.0, 0.0),
        (1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950, 0.0),
        (1.221224509226641, 6.019134481288629, 12.53708332932087, -0.6878860361058950, 1.0),
    )
)
_C = array(
    (
        (0.0, 0.0, 0.0, 0.0, 0.0),
        (-5.6688, 0.0, 0.0, 0.0, 0.0),
        (-2.430093356833875, -0.2063599157091915, 0.0, 0.0, 0.0),
        (-0.1073529058151375, -9.594562251023355, -20.47028614809616, 0.0, 0.0),
        (7.496443313967647, -10.24680431464352, -33.99990352819905, 11.70890893206160, 0.0),
        (
            8.083246795921522,
            -7.981132988064893,
            -31.52159432874371,
            16.31930543123136,
            -6.058818238834054,
        ),
    )
)
_DENSE = array(
    (
        (
            10.12623508344586,
            -7.487995877610167,
            -34.80091861555747,
            -7.992771707568823,
            1.025137723295662,
        ),
        (
            -0.6762803392801253,
            6.087714651680015,
            16.43084320892478,
            24.76722511418386,
            -6.594389125716872,
        ),
    )
)


def growth(size):
    """By how much a step can grow whose error was `size` tolerances."""
    return 1.0 / sqrt(sqrt(size))


def begin(z, x, load, p):
    """What `attempt` wants to know of its start: the slope."""
    return slope(z, x, load, p)


def attempt(z, start, h, x, load, p):
    """(new state, error estimate, slope at the new state, dense output) of one step of length h;
    see `adaptive`."""
    size = sizes(p)
    inverse = inv(_shifted_jacobian(z, x, load, p, size, 1.0 / (_GAMMA * h)))
    origin, u, place, known = _scaled(z, size), zeros((6, 6)), zeros(6), _scaled(start, size)
    for i in range(6):
        for m in range(6):
            place[m] = origin[m]
            for j in range(i):
                place[m] += _A[i, j] * u[j, m]
        if i > 0:
            known = _scaled(slope(_state(place, size), x, load, p), size)
        for m in range(6):
            for j in range(i):
                known[m] += _C[i, j] / h * u[j, m]
        for m in range(6):
            for k in range(6):
                u[i, m] += inverse[m, k] * known[k]
    first, second = zeros(6), zeros(6)
    for m in range(6):
        place[m] += u[5, m]
        for j in range(5):
            first[m] += _DENSE[0, j] * u[j, m]
            second[m] += _DENSE[1, j] * u[j, m]
    new = _state(place, size)
    curves = _state(first, size), _state(second, size), (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
    return new, _state(u[5], size), slope(new, x, load, p), curves


def _scaled(z, size):
    values = empty(6)
    values[0], values[1], values[2] = z[0] / size[0], z[1] / size[1], z[2] / size[2]
    values[3], values[4], values[5] = z[3] / size[3], z[4] / size[4], z[5] / size[5]
    return values


def _state(v, size):
    return (
        v[0] * size[0],
        v[1] * size[1],
        v[2] * size[2],
        v[3] * size[3],
        v[4] * size[4],
        v[5] * size[5],
    )


def _shifted_jacobian(z, x, load, p, size, shift):
    """(6, 6): shift I - J of the scaled equations."""
    matrix, place = empty((6, 6)), _scaled(z, size)
    for k in range(6):
        middle = place[k]
        place[k] = middle + _STEP
        ahead = slope(_state(place, size), x, load, p)
        place[k] = middle - _STEP
        behind = slope(_state(place, size), x, load, p)
        place[k] = middle
        above, below = _scaled(ahead, size), _scaled(behind, size)
        for m in range(6):
            matrix[m, k] = (below[m] - above[m]) / (2.0 * _STEP)
        matrix[k, k] += shift
    return matrix
