"""The fixed-step method: its order conditions, one by one, and the orders that it shows."""

from itertools import combinations_with_replacement, product
from math import factorial

import numpy as np
import pytest
from plain import plain

from hydroctl.simulation.kernels import runge_kutta

STAGES = len(runge_kutta.B)
ONE = np.ones(STAGES)
A = np.zeros((STAGES, STAGES))
for i, row in enumerate(runge_kutta.A):
    A[i, :i] = row
B = np.array(runge_kutta.B)


def partitions(total, largest):
    """Falling rows of whole numbers that add up to `total`."""
    if total == 0:
        yield ()
    for first in range(min(total, largest), 0, -1):
        for rest in partitions(total - first, first):
            yield (first, *rest)


def trees(order):
    """The rooted trees with `order` nodes, each as the tuple of the trees that hang on its root."""
    for sizes in partitions(order - 1, order - 1):
        kinds = [
            combinations_with_replacement(list(trees(size)), sizes.count(size))
            for size in sorted(set(sizes))
        ]
        for choice in product(*kinds):
            yield tuple(branch for branches in choice for branch in branches)


def nodes(tree):
    return 1 + sum(map(nodes, tree))


def density(tree):
    return nodes(tree) * int(np.prod([density(branch) for branch in tree], dtype=int))


def weights(tree):
    """(stages,): the elementary weights of a tree."""
    return np.prod([A @ weights(branch) for branch in tree], axis=0, initial=1.0) * ONE


def test_there_are_as_many_rooted_trees_as_is_known():
    assert [len(list(trees(order))) for order in range(1, 8)] == [1, 1, 2, 4, 9, 20, 48]


@pytest.mark.parametrize("order", range(1, 7))
def test_the_conditions_of_order_six_hold(order):
    """b Phi(t) = 1/gamma(t) for every rooted tree t (Butcher; Hairer, Norsett and Wanner I, section
    II.2)."""
    for tree in trees(order):
        assert abs(B @ weights(tree) * density(tree) - 1.0) <= 1e-13, tree


def test_on_linear_equations_the_exponential_is_met_but_for_a_little_of_the_seventh_power():
    power = ONE
    for degree in range(1, STAGES + 1):
        wanted = 1.0 / factorial(degree) - (0.6 / factorial(9) if degree == 7 else 0.0)
        assert abs(B @ power / wanted - 1.0) <= 1e-13, degree
        power = A @ power
    assert STAGES == 8


@pytest.mark.parametrize("angle", [90.0, 95.0, 100.0, 105.0])
def test_a_mode_of_one_radian_a_step_errs_by_less_than_two_millionths(angle):
    """s = omega h (cos, sin)(angle): undamped to a damping of 0.26. By the remainder, |s|^7 |s^2 +
    0.6|/9! + |s|^10/10!."""
    s = np.linspace(0.01, 1.0, 100) * np.exp(1j * np.radians(angle))
    growth = np.array(
        [B @ np.linalg.solve(np.eye(STAGES) - value * A, ONE) * value + 1.0 for value in s]
    )
    bound = np.abs(s) ** 7 * np.abs(s**2 + 0.6) / factorial(9) + np.abs(s) ** 10 / factorial(10)
    assert (np.abs(growth - np.exp(s)) <= 1.01 * bound + 1e-15).all()
    assert np.abs(growth - np.exp(s)).max() <= 2.2e-6


def test_every_stage_lies_within_the_step():
    assert (A @ ONE >= 0.0).all()
    assert (A @ ONE <= 1.0 + 1e-15).all()


def orders(slope, start, exact, steps):
    """log2 of the errors' ratios as the number of steps over one second doubles."""
    method = plain(
        runge_kutta,
        plus=lambda z, w, k: tuple(a + w * b for a, b in zip(z, k, strict=True)),
        slope=slope,
    )
    errors = []
    for n in steps:
        z = start
        for _ in range(n):
            z = method.step(z, 0.0, 0.0, None, 1.0 / n)
        errors.append(np.linalg.norm(np.subtract(z, exact)))
    return np.log2(np.divide(errors[:-1], errors[1:]))


def test_a_nonlinear_equation_converges_with_order_six():
    """z' = z^2 from 1/2: z = 1/(2 - t)."""
    assert (orders(lambda z, *_: (z[0] * z[0],), (0.5,), (1.0,), (4, 8, 16)) >= 5.5).all()
