"""The exact steps of the second-order system, against the matrix exponential."""

import numpy as np
import pytest
from scipy.linalg import expm

from hydroctl.quasi_linear.second_order import respond, transition


@pytest.mark.parametrize(
    "a1",
    [0.0, 100.0, 2.0 * np.sqrt(3e5), 3e3, 1e6],
    ids=["undamped", "damped", "critical", "over", "far over"],
)
def test_transition_is_the_matrix_exponential(a1):
    a2, h = 3e5, 1e-3
    scale = np.array([1.0, np.sqrt(a2)])
    expected = expm(np.array([[0.0, 1.0], [-a2, -a1]]) * h)
    found = transition(np.array([a1]), np.array([a2]), np.array([h]))[0]
    np.testing.assert_allclose(
        found / scale[:, None] * scale, expected / scale[:, None] * scale, atol=1e-9
    )


def test_response_with_changing_coefficients_is_that_of_each_step_in_turn():
    rng, n = np.random.default_rng(0), 20
    a1, a2, h = rng.uniform(50.0, 3e3, n), rng.uniform(2e5, 4e5, n), rng.uniform(1e-4, 1e-2, n)
    forcing, state = 1e5 * rng.normal(size=(n, 2)), rng.normal(size=(2, 2))
    found = respond(a1, a2, h, forcing, state)
    for k in range(n):
        p = expm(np.array([[0.0, 1.0], [-a2[k], -a1[k]]]) * h[k])
        rest = np.stack([forcing[k] / a2[k], np.zeros(2)])
        state = rest + p @ (state - rest)
        np.testing.assert_allclose(found[k + 1], state, rtol=1e-8, atol=1e-9)
