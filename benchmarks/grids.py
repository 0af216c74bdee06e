"""The work of J1 as a user of NumPy or numba writes it for this machine: x > 0, no load, no tank pressure, no dry friction."""

from __future__ import annotations

import numpy as np

from hydroctl import Actuator

_STEPS = 5


def grid_numpy(a: Actuator, x, y, roots):
    """(poles, everything else) over x (nx,) by y (ny,): operating points along x, the rest on the grid."""
    c, leakage, supply = a.flow_coefficient * x, a.leakage, a.supply_pressure
    cubes = a.area_a**3 + a.area_b**3
    drive = a.area_a * supply * c**2
    v = 2.0 * drive / (a.viscous_friction * c**2 + np.sqrt((a.viscous_friction * c**2) ** 2 + 4.0 * cubes * drive))
    q = np.zeros_like(v)
    for _ in range(_STEPS):
        u, w = (a.area_a * v + q) / c, (a.area_b * v + q) / c
        p_a, p_b = supply - u * u, w * w
        force, leak = a.area_a * p_a - a.area_b * p_b - a.viscous_friction * v, leakage * (p_a - p_b) - q
        du, dw = 2.0 * u / c, 2.0 * w / c
        f_v, f_q = a.area_a**2 * du + a.area_b**2 * dw + a.viscous_friction, a.area_a * du + a.area_b * dw
        l_v, l_q = leakage * f_q, leakage * (du + dw) + 1.0
        determinant = f_v * l_q - f_q * l_v
        v, q = v + (l_q * force - f_q * leak) / determinant, q + (f_v * leak - l_v * force) / determinant
    u, w = (a.area_a * v + q) / c, (a.area_b * v + q) / c
    p_a, p_b = supply - u * u, w * w
    stiff_a, stiff_b = a.bulk_modulus / (a.volume_a + a.area_a * y), a.bulk_modulus / (a.volume_b - a.area_b * y)
    gain_a, gain_b = (a.flow_coefficient * np.sqrt(supply - p_a))[:, None], (-a.flow_coefficient * np.sqrt(p_b))[:, None]
    drop_a, drop_b = ((c / (2.0 * np.sqrt(dp)))[:, None] for dp in (supply - p_a, p_b))
    a11, a12, a13 = -stiff_a * (drop_a + leakage), stiff_a * leakage, -stiff_a * a.area_a
    a21, a22, a23 = stiff_b * leakage, -stiff_b * (drop_b + leakage), stiff_b * a.area_b
    a31, a32, a33 = a.area_a / a.mass, -a.area_b / a.mass, -a.viscous_friction / a.mass
    b1, b2 = stiff_a * gain_a, stiff_b * gain_b
    n1, n0 = a31 * b1 + a32 * b2, a31 * (a12 * b2 - a22 * b1) + a32 * (a21 * b1 - a11 * b2)
    d2 = -(a11 + a22 + a33)
    d1 = a11 * a22 - a12 * a21 + a11 * a33 - a13 * a31 + a22 * a33 - a23 * a32
    d0 = -(a11 * (a22 * a33 - a23 * a32) - a12 * (a21 * a33 - a23 * a31) + a13 * (a21 * a32 - a22 * a31))
    zero = -n0 / n1
    poles = roots(d2, d1, d0, zero)
    slow = poles[..., 0].real
    a1, a2 = d2 + slow, d1 + slow * (d2 + slow)
    return poles, (p_a, p_b, v, n1, n0, d2, d1, d0, zero, a1, a2, a2 * n0 / d0)


def roots_by_eigvals(d2, d1, d0, near):
    """(..., 3) by NumPy's eigenvalues of companion matrices, the one nearest to `near` first."""
    companion = np.zeros((*d0.shape, 3, 3))
    companion[..., 1, 0] = companion[..., 2, 1] = 1.0
    companion[..., 0, 2], companion[..., 1, 2], companion[..., 2, 2] = -d0, -d1, -d2
    roots = np.linalg.eigvals(companion).astype(complex)
    order = np.argsort(np.abs(roots - near[..., None]), axis=-1)
    return np.take_along_axis(roots, order, axis=-1)


def roots_in_closed_form(d2, d1, d0, near):
    """(..., 3): Newton's method on the real root nearest to `near`, then the quadratic that is left."""
    root = near
    for _ in range(_STEPS):
        root = root - (((root + d2) * root + d1) * root + d0) / ((3.0 * root + 2.0 * d2) * root + d1)
    half = -0.5 * (d2 + root)
    radicand = (half * half - (d1 - 2.0 * root * half)).astype(complex)
    spread = np.sqrt(radicand)
    return np.stack([root.astype(complex), half + spread, half - spread], axis=-1)


_COMPILED = []


def grid_numba(a: Actuator, x, y):
    """The same, one point after the other, compiled; (poles, a1 and a2)."""
    if not _COMPILED:
        import numba

        _COMPILED.append(numba.njit(_points, error_model="numpy"))
    machine = (a.area_a, a.area_b, a.volume_a, a.volume_b, a.bulk_modulus, a.leakage)
    machine += (a.flow_coefficient, a.supply_pressure, a.mass, a.viscous_friction)
    return _COMPILED[0](machine, x, y)


def _points(machine, x, y):
    area_a, area_b, volume_a, volume_b, bulk, leakage, flow, supply, mass, viscous = machine
    poles = np.empty((x.size, y.size, 3), dtype=np.complex128)
    others = np.empty((11, x.size, y.size))
    for i in range(x.size):
        c = flow * x[i]
        drive = area_a * supply * c**2
        v = 2.0 * drive / (viscous * c**2 + np.sqrt((viscous * c**2) ** 2 + 4.0 * (area_a**3 + area_b**3) * drive))
        q = 0.0
        for _ in range(_STEPS):
            u, w = (area_a * v + q) / c, (area_b * v + q) / c
            p_a, p_b = supply - u * u, w * w
            force, leak = area_a * p_a - area_b * p_b - viscous * v, leakage * (p_a - p_b) - q
            du, dw = 2.0 * u / c, 2.0 * w / c
            f_v, f_q = area_a**2 * du + area_b**2 * dw + viscous, area_a * du + area_b * dw
            l_v, l_q = leakage * f_q, leakage * (du + dw) + 1.0
            determinant = f_v * l_q - f_q * l_v
            v, q = v + (l_q * force - f_q * leak) / determinant, q + (f_v * leak - l_v * force) / determinant
        p_a, p_b = supply - ((area_a * v + q) / c) ** 2, ((area_b * v + q) / c) ** 2
        gain_a, gain_b = flow * np.sqrt(supply - p_a), -flow * np.sqrt(p_b)
        drop_a, drop_b = c / (2.0 * np.sqrt(supply - p_a)), c / (2.0 * np.sqrt(p_b))
        a31, a32, a33 = area_a / mass, -area_b / mass, -viscous / mass
        for j in range(y.size):
            stiff_a, stiff_b = bulk / (volume_a + area_a * y[j]), bulk / (volume_b - area_b * y[j])
            a11, a12, a13 = -stiff_a * (drop_a + leakage), stiff_a * leakage, -stiff_a * area_a
            a21, a22, a23 = stiff_b * leakage, -stiff_b * (drop_b + leakage), stiff_b * area_b
            b1, b2 = stiff_a * gain_a, stiff_b * gain_b
            n1, n0 = a31 * b1 + a32 * b2, a31 * (a12 * b2 - a22 * b1) + a32 * (a21 * b1 - a11 * b2)
            d2 = -(a11 + a22 + a33)
            d1 = a11 * a22 - a12 * a21 + a11 * a33 - a13 * a31 + a22 * a33 - a23 * a32
            d0 = -(a11 * (a22 * a33 - a23 * a32) - a12 * (a21 * a33 - a23 * a31) + a13 * (a21 * a32 - a22 * a31))
            root = -n0 / n1
            for _ in range(_STEPS):
                root -= (((root + d2) * root + d1) * root + d0) / ((3.0 * root + 2.0 * d2) * root + d1)
            half = -0.5 * (d2 + root)
            spread = np.sqrt(complex(half * half - (d1 - 2.0 * root * half)))
            poles[i, j, 0], poles[i, j, 1], poles[i, j, 2] = root, half + spread, half - spread
            a1 = d2 + root
            a2 = d1 + root * a1
            others[0, i, j], others[1, i, j], others[2, i, j] = p_a, p_b, v
            others[3, i, j], others[4, i, j], others[5, i, j], others[6, i, j], others[7, i, j] = n1, n0, d2, d1, d0
            others[8, i, j], others[9, i, j], others[10, i, j] = a1, a2, a2 * n0 / d0
    return poles, others
