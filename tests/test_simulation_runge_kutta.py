"""The fixed-step method: its order conditions, one by one, and the orders that it shows."""

from itertools import combinations_with_replacement, product
from math import factorial

import numpy as np
import pytest
from plain import plain

from hydroctl.simulation import runge_kutta

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
        kinds = [combinations_with_replacement(list(trees(size)), sizes.count(size)) for size in sorted(set(sizes))]
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
    """b Phi(t) = 1/gamma(t) for every rooted tree t (Butcher; Hairer, Norsett and Wanner I, section II.2)."""
    for tree in trees(order):
        assert abs(B @ weights(tree) * density(tree) - 1.0) <= 1e-13, tree


def test_on_linear_equations_the_method_is_the_taylor_polynomial_of_degree_eight():
    power = ONE
    for degree in range(1, STAGES + 1):
        assert abs(B @ power * factorial(degree) - 1.0) <= 1e-13, degree
        power = A @ power
    assert STAGES == 8


def test_every_stage_lies_within_the_step():
    assert (A @ ONE >= 0.0).all()
    assert (A @ ONE <= 1.0 + 1e-15).all()


def orders(slope, start, exact, steps):
    """log2 of the errors' ratios as the number of steps over one second doubles."""
    method = plain(runge_kutta, plus=lambda z, w, k: tuple(a + w * b for a, b in zip(z, k, strict=True)), slope=slope)
    errors = []
    for n in steps:
        z = start
        for _ in range(n):
            z = method.step(z, 0.0, 0.0, None, 1.0 / n)
        errors.append(np.linalg.norm(np.subtract(z, exact)))
    return np.log2(np.divide(errors[:-1], errors[1:]))


def test_an_oscillation_converges_with_order_eight():
    """Both states in the same unit: the error turns round as the step shrinks."""
    omega = 12.0
    found = orders(lambda z, *_: (omega * z[1], -omega * z[0]), (1.0, 0.0), (np.cos(omega), -np.sin(omega)), (8, 16, 32))
    np.testing.assert_allclose(found, 8.0, atol=0.1)


def test_a_nonlinear_equation_converges_with_order_six():
    """z' = z^2 from 1/2: z = 1/(2 - t)."""
    assert (orders(lambda z, *_: (z[0] * z[0],), (0.5,), (1.0,), (4, 8, 16)) >= 5.5).all()
