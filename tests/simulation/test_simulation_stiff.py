"""Rodas4: its order, its accuracy on stiff machines, and when it is chosen."""

import numpy as np
import pytest
from loops import accurate_hold

import hydroctl as hc
from hydroctl.model import plant
from hydroctl.simulation import rest_state, simulate
from hydroctl.simulation.kernels.builds import ALL_COMPONENTS, motion_build
from hydroctl.simulation.modes import fastest_mode, is_stiff

ACTUATOR = hc.load_actuator("reference")
STIFF = ACTUATOR.replace(
    name="stiff",
    volume_a=2e-5,
    volume_b=2e-5 + ACTUATOR.area_b * ACTUATOR.stroke,
    leakage=2e-8,
    mass=5.0,
    end_stop_stiffness=1e10,
    end_stop_damping=0.5,
)
"""Almost no dead volume, much leakage, a light piston and hard stops: at the ends of the stroke
modes of 1e5 rad/s and more."""


def test_rodas4_converges_with_order_four_and_its_dense_output_with_three():
    """Halving the step divides the error by 16 at the end and, to leading order, by 8 within a
    step."""
    actuator = ACTUATOR.replace(leakage=1e-10)
    p, rodas = plant.parameters(actuator), motion_build(ALL_COMPONENTS).stiff.method
    start, span = (*rest_state(actuator, 0.2)[:4], 0.3, 0.0), 4e-3
    exact = accurate_hold(actuator, start, 0.3, 0.0, span)
    size = np.ptp([start[:4], exact[:4]], axis=0)

    def error(steps):
        z, h = start, span / steps
        for _ in range(steps):
            z, *_ = rodas.attempt(z, rodas.begin(z, 0.3, 0.0, p), h, 0.3, 0.0, p)
        return (np.abs(np.array(z[:4]) - exact[:4]) / size).max()

    def dense_error(h):
        new, _, _, (r, s, _) = rodas.attempt(start, rodas.begin(start, 0.3, 0.0, p), h, 0.3, 0.0, p)
        half = [
            z + 0.5 * (e - z + 0.5 * (a + 0.5 * b))
            for z, e, a, b in zip(start, new, r, s, strict=True)
        ]
        return (
            np.abs(np.array(half[:4]) - accurate_hold(actuator, start, 0.3, 0.0, 0.5 * h)[:4])
            / size
        ).max()

    errors = [error(steps) for steps in (8, 16, 32)]
    assert np.log2(np.divide(errors[:-1], errors[1:])) == pytest.approx(4.0, abs=0.4)
    orders = np.log2([dense_error(2e-3) / dense_error(1e-3), dense_error(1e-3) / dense_error(5e-4)])
    assert (orders >= 3.4).all()


def test_stiff_machines_get_rodas4_and_the_result_says_so():
    t = np.linspace(0.0, 0.05, 51)
    assert is_stiff(STIFF, 1e-3)
    assert not is_stiff(ACTUATOR, 1e-3)
    assert simulate(STIFF, t, 0.1, initial=rest_state(STIFF, 0.25)).integrator.startswith(
        "Rodas4, rtol 1e-06"
    )
    assert simulate(ACTUATOR, t, 0.1).integrator.startswith("Dormand-Prince 5(4), rtol 1e-06")
    assert fastest_mode(STIFF) > 1e5


@pytest.mark.parametrize(
    ("y", "x", "load"),
    [(0.2, 0.4, 0.0), (0.4985, 1.0, 0.0), (0.002, -0.7, 3e5)],
    ids=["free", "upper stop", "lower stop"],
)
def test_rodas4_agrees_with_dop853_on_a_stiff_machine(y, x, load):
    """High leakage, small volumes, contact; the local error is held below rtol, the total is a
    small multiple of it."""
    t = np.linspace(0.0, 0.03, 61)
    start = rest_state(STIFF, y, load_force=load)
    found = simulate(STIFF, t, x, initial=start, load_force=load, rtol=1e-8)
    assert found.integrator.startswith("Rodas4")
    expected = accurate_hold(STIFF, start, x, load, t[-1], t)
    rows = np.array([found.p_a, found.p_b, found.v, found.y])
    assert (np.abs(rows - expected[:4]).max(axis=1) <= 3e-6 * np.ptp(expected[:4], axis=1)).all()
    if y != 0.2:
        assert found.y.max() > STIFF.stroke or found.y.min() < 0.0
