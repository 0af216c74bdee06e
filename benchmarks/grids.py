"""The work of J1 as a user of array libraries writes it for this machine: x > 0, no load, no tank
pressure, no dry friction.

The equations take floats, arrays or symbols, and the square root of whatever they are: NumPy,
numba, JAX and CasADi share them.
"""

from __future__ import annotations

import numpy as np

from .peers import Plant, compilable

_POINT_STEPS, _ROOT_STEPS = 3, 2
"""of Newton's method: enough for 1e-14, from starts that neglect the leakage and the fast poles"""


@compilable
def operating_point(m, x, sqrt):
    """(p_a, p_b, v, gain_a, gain_b, drop_a, drop_b) at the opening x: Newton's method on v and the
    leakage flow, without y; then the flow per opening and the flow lost per pressure at either
    edge."""
    c = m.flow_coefficient * x
    drive, viscous = m.area_a * m.supply_pressure * c * c, m.viscous_friction * c * c
    v = (
        2.0
        * drive
        / (viscous + sqrt(viscous * viscous + 4.0 * (m.area_a**3 + m.area_b**3) * drive))
    )
    q = 0.0
    for _ in range(_POINT_STEPS):
        u, w = (m.area_a * v + q) / c, (m.area_b * v + q) / c
        p_a, p_b = m.supply_pressure - u * u, w * w
        force, leak = (
            m.area_a * p_a - m.area_b * p_b - m.viscous_friction * v,
            m.leakage * (p_a - p_b) - q,
        )
        du, dw = 2.0 * u / c, 2.0 * w / c
        f_v, f_q = (
            m.area_a**2 * du + m.area_b**2 * dw + m.viscous_friction,
            m.area_a * du + m.area_b * dw,
        )
        l_v, l_q = m.leakage * f_q, m.leakage * (du + dw) + 1.0
        determinant = f_v * l_q - f_q * l_v
        v, q = (
            v + (l_q * force - f_q * leak) / determinant,
            q + (f_v * leak - l_v * force) / determinant,
        )
    u, w = (m.area_a * v + q) / c, (m.area_b * v + q) / c
    gain_a, gain_b = m.flow_coefficient * u, -m.flow_coefficient * w
    return m.supply_pressure - u * u, w * w, v, gain_a, gain_b, 0.5 * c / u, 0.5 * c / w


@compilable
def linear_model(m, gain_a, gain_b, drop_a, drop_b, y):
    """(a11, a12, a13, a21, a22, a23, b1, b2, n1, n0, d2, d1, d0): the entries of A and B that vary
    over the grid, and the transfer function (n1 s + n0)/(s^3 + d2 s^2 + d1 s + d0) from x to v."""
    stiff_a, stiff_b = (
        m.bulk_modulus / (m.volume_a + m.area_a * y),
        m.bulk_modulus / (m.volume_b - m.area_b * y),
    )
    a11, a12, a13 = -stiff_a * (drop_a + m.leakage), stiff_a * m.leakage, -stiff_a * m.area_a
    a21, a22, a23 = stiff_b * m.leakage, -stiff_b * (drop_b + m.leakage), stiff_b * m.area_b
    a31, a32, a33 = m.area_a / m.mass, -m.area_b / m.mass, -m.viscous_friction / m.mass
    b1, b2 = stiff_a * gain_a, stiff_b * gain_b
    n1, n0 = a31 * b1 + a32 * b2, a31 * (a12 * b2 - a22 * b1) + a32 * (a21 * b1 - a11 * b2)
    d2 = -(a11 + a22 + a33)
    d1 = a11 * a22 - a12 * a21 + a11 * a33 - a13 * a31 + a22 * a33 - a23 * a32
    d0 = -(
        a11 * (a22 * a33 - a23 * a32)
        - a12 * (a21 * a33 - a23 * a31)
        + a13 * (a21 * a32 - a22 * a31)
    )
    return a11, a12, a13, a21, a22, a23, b1, b2, n1, n0, d2, d1, d0


@compilable
def slow_pole(n1, n0, d2, d1, d0):
    """The real root of the denominator by Newton's method from the zero."""
    root = -n0 / n1
    for _ in range(_ROOT_STEPS):
        root = root - (((root + d2) * root + d1) * root + d0) / (
            (3.0 * root + 2.0 * d2) * root + d1
        )
    return root


@compilable
def second_order(root, n0, d2, d1, d0):
    """(a1, a2, b): what is left of the denominator without `root`, and the numerator of the same
    gain."""
    a1 = d2 + root
    a2 = d1 + root * a1
    return a1, a2, a2 * n0 / d0


@compilable
def pair(a1, a2, sqrt):
    """(middle, real, imaginary): the roots of s^2 + a1 s + a2 are middle +- (real + 1j imaginary),
    without a branch."""
    radicand = 0.25 * a1 * a1 - a2
    size = abs(radicand)
    return -0.5 * a1, sqrt(0.5 * (size + radicand)), sqrt(0.5 * (size - radicand))


def grid_numpy(plant: Plant, x, y, *, batched_eigvals: bool):
    """(poles (nx, ny, 3), all the rest) over x (nx,) by y (ny,): operating points along x, the rest
    on the grid."""
    point = operating_point(plant, x[:, None], np.sqrt)
    model = linear_model(plant, *point[3:], y)
    n1, n0, *denominator = model[8:]
    if batched_eigvals:
        poles = _by_eigvals(*denominator, -n0 / n1)
        root = poles[..., 0].real
        reduced = second_order(root, n0, *denominator)
    else:
        root = slow_pole(n1, n0, *denominator)
        reduced = second_order(root, n0, *denominator)
        poles = join_poles(root, *pair(*reduced[:2], np.sqrt))
    return poles, (point, model, -n0 / n1, reduced)


def join_poles(root, middle, real, imaginary):
    """(..., 3) complex."""
    poles = np.empty((*root.shape, 3), dtype=complex)
    poles[..., 0] = root
    poles.real[..., 1], poles.real[..., 2] = middle + real, middle - real
    poles.imag[..., 1], poles.imag[..., 2] = imaginary, -imaginary
    return poles


def _by_eigvals(d2, d1, d0, near):
    """(..., 3) by NumPy's eigenvalues of companion matrices, the one nearest to `near` first."""
    companion = np.zeros((*d0.shape, 3, 3))
    companion[..., 1, 0] = companion[..., 2, 1] = 1.0
    companion[..., 0, 2], companion[..., 1, 2], companion[..., 2, 2] = -d0, -d1, -d2
    roots = np.linalg.eigvals(companion).astype(complex)
    order = np.argsort(np.abs(roots - near[..., None]), axis=-1)
    return np.take_along_axis(roots, order, axis=-1)
