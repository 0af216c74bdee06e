"""Peers of J1 that compile or build a function first: each factory gives a call that returns (poles
(nx, ny, 3), all the rest)."""

from __future__ import annotations

from functools import cache

import numba
import numpy as np

from .grids import join_poles, linear_model, operating_point, pair, second_order, slow_pole
from .peers import Plant

_BLOCK = 64


def _at_point(plant, edges, y, sqrt):
    """Entries of A and B, transfer function, a1, a2, b; then the real pole and the pair."""
    model = linear_model(plant, *edges, y)
    root = slow_pole(*model[8:])
    reduced = second_order(root, *model[9:])
    return (*model, *reduced), (root, *pair(*reduced[:2], sqrt))


@cache
def _numba_kernel():
    """rows(plant, x, y, points, models, poles): operating points along x; each row of the grid in
    vector code, then its poles as complex numbers."""

    @numba.njit(error_model="numpy", fastmath={"contract"})
    def rows(plant, x, y, points, models, poles):
        work = np.empty((20, _BLOCK))
        for i in range(x.size):
            p_a, p_b, v, gain_a, gain_b, drop_a, drop_b = operating_point(plant, x[i], np.sqrt)
            points[0, i], points[1, i], points[2, i] = p_a, p_b, v
            for start in range(0, y.size, _BLOCK):
                size = min(_BLOCK, y.size - start)
                for j in range(size):
                    model = linear_model(plant, gain_a, gain_b, drop_a, drop_b, y[start + j])
                    a11, a12, a13, a21, a22, a23, b1, b2, n1, n0, d2, d1, d0 = model
                    root = slow_pole(n1, n0, d2, d1, d0)
                    a1, a2, b = second_order(root, n0, d2, d1, d0)
                    middle, real, imaginary = pair(a1, a2, np.sqrt)
                    work[0, j], work[1, j], work[2, j], work[3, j], work[4, j], work[5, j] = (
                        a11,
                        a12,
                        a13,
                        a21,
                        a22,
                        a23,
                    )
                    (
                        work[6, j],
                        work[7, j],
                        work[8, j],
                        work[9, j],
                        work[10, j],
                        work[11, j],
                        work[12, j],
                    ) = (
                        b1,
                        b2,
                        n1,
                        n0,
                        d2,
                        d1,
                        d0,
                    )
                    work[13, j], work[14, j], work[15, j], work[16, j] = a1, a2, b, root
                    work[17, j], work[18, j], work[19, j] = middle + real, middle - real, imaginary
                for k in range(16):
                    for j in range(size):
                        models[i, k, start + j] = work[k, j]
                for j in range(size):
                    poles[i, start + j, 0] = work[16, j]
                    poles[i, start + j, 1] = complex(work[17, j], work[19, j])
                    poles[i, start + j, 2] = complex(work[18, j], -work[19, j])

    return rows


def grid_numba(plant: Plant, x, y):
    """Compiled by numba."""
    points, models, poles = (
        np.empty((3, x.size)),
        np.empty((x.size, 16, y.size)),
        np.empty((x.size, y.size, 3), dtype=complex),
    )
    _numba_kernel()(plant, x, y, points, models, poles)
    return poles, (points, models)


@cache
def _jax_grid(plant: Plant):
    import jax
    import jax.numpy as jnp

    jax.config.update("jax_enable_x64", True)

    def column(x, y):
        point = operating_point(plant, x, jnp.sqrt)
        rest, (root, middle, real, imaginary) = jax.vmap(
            lambda y: _at_point(plant, point[3:], y, jnp.sqrt)
        )(y)
        poles = (
            root + 0j,
            jax.lax.complex(middle + real, imaginary),
            jax.lax.complex(middle - real, -imaginary),
        )
        return jnp.stack(poles, axis=-1), (jnp.stack(point[:3]), jnp.stack(rest))

    return jax.jit(jax.vmap(column, in_axes=(0, None)))


def grid_jax(plant: Plant, x, y):
    """JAX: vmap along x of an operating point and, along y, of the rest; in double precision."""
    import jax

    poles, rest = jax.block_until_ready(_jax_grid(plant)(x, y))
    return np.asarray(poles), rest


@cache
def _casadi_maps(plant: Plant, nx: int, ny: int):
    import casadi

    x, y, edges = casadi.SX.sym("x"), casadi.SX.sym("y"), casadi.SX.sym("edges", 4)
    point = casadi.Function("point", [x], [casadi.vertcat(*operating_point(plant, x, casadi.sqrt))])
    rest, poles = _at_point(plant, casadi.vertsplit(edges), y, casadi.sqrt)
    model = casadi.Function("model", [edges, y], [casadi.vertcat(*poles), casadi.vertcat(*rest)])
    return point.map(nx), model.map(nx * ny)


def grid_casadi(plant: Plant, x, y):
    """CasADi: functions of one point, mapped along x and over the grid."""
    point, model = _casadi_maps(plant, x.size, y.size)
    points = np.array(point(x))
    poles, rest = model(np.repeat(points[3:], y.size, axis=1), np.tile(y, x.size))
    return join_poles(*np.array(poles).reshape(4, x.size, y.size)), (points, rest)
