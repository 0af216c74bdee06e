"""The regulator law: against its transfer function, a plain route of its own, and the rules that it states."""

import numpy as np
import pytest
from loops import PlainRegulator, schedule
from scipy import signal

from hydroctl.errors import InputError
from hydroctl.simulation import law
from hydroctl.simulation.compiled import law as compiled
from hydroctl.simulation.regulator import regulator_of
from hydroctl.simulation.scalar import tan

ROUNDING = 1e-12


def constant(loop="velocity", *, kp, ki, kd, **changes):
    tables = {"kp": kp, "ki": ki, "kd": kd, "notch_frequency": 540.0}
    return schedule(loop, **{name: np.full((4, 3), value) for name, value in tables.items()}, **changes)


def run(functions, given, inputs):
    """Memory after every sample (n, 6) for rows of reference, v_ref, v, y."""
    regulator, memory, rows = regulator_of(given), law.AT_REST, []
    for row in inputs:
        memory = functions.sample(*map(float, row), memory, regulator)
        rows.append(memory)
    return np.array(rows, dtype=float)


def random_inputs(samples, size, seed=1):
    rng = np.random.default_rng(seed)
    return np.column_stack([size * rng.standard_normal((samples, 3)), rng.uniform(-0.1, 0.6, samples)])


@pytest.mark.parametrize("dampings", [(0.2, 0.8), (0.5, 0.5)], ids=["notch", "no notch"])
def test_unsaturated_law_is_the_transfer_function(dampings):
    """C(z) = kp + ki Ts/(z - 1) + kd (z - 1)/((Tf + Ts) z - Tf) times Tustin's notch, prewarped at wn, by scipy's filters."""
    kp, ki, kd, (zz, zp), wn = 0.7, 90.0, 1e-3, dampings, 540.0
    given = constant(kp=kp, ki=ki, kd=kd, zz=zz, zp=zp)
    Ts, Tf = given.Ts, given.Tf
    error = 1e-4 * np.random.default_rng(0).standard_normal(400)
    terms = [([kp], [1.0]), ([0.0, ki * Ts], [1.0, -1.0]), ([kd, -kd], [Tf + Ts, -Tf])]
    u = sum(signal.lfilter(b, a, error) for b, a in terms)
    notch = signal.bilinear([1, 2 * zz * wn, wn**2], [1, 2 * zp * wn, wn**2], fs=wn / (2.0 * np.tan(wn * Ts / 2.0)))
    expected = signal.lfilter(*notch, u)
    assert np.abs(expected).max() < 1.0
    inputs = np.column_stack([error, np.zeros((400, 3))])
    assert run(compiled, given, inputs)[:, 5] == pytest.approx(expected, rel=0, abs=ROUNDING)


@pytest.mark.parametrize("loop", ["velocity", "position"])
@pytest.mark.parametrize("forward", [False, True])
def test_scheduled_saturating_law_agrees_with_a_plain_route(loop, forward):
    given = schedule(loop, kd=np.full((4, 3), 2e-3), feed_forward=forward)
    inputs = random_inputs(600, 0.5)
    inputs[::5, 1] = 0.0
    if loop == "position":
        inputs[:, 0] = inputs[:, 3] + 0.04 * inputs[:, 0]
    plain = PlainRegulator(given)
    expected = np.array([plain.command(*row) for row in inputs])
    saturated = np.mean(np.abs(expected) == 1.0)
    assert 0.1 < saturated < 0.95
    assert run(compiled, given, inputs)[:, 5] == pytest.approx(expected, rel=0, abs=1e-10)


def test_compiled_law_and_the_same_lines_in_python_agree():
    given = schedule(kd=np.full((4, 3), 1e-3), feed_forward=True)
    inputs = random_inputs(200, 0.05)
    assert run(compiled, given, inputs) == pytest.approx(run(law, given, inputs), rel=0, abs=ROUNDING)


def test_equal_dampings_pass_the_command_on_unchanged():
    given = constant(kp=0.3, ki=0.0, kd=0.0, zz=0.6, zp=0.6)
    inputs = random_inputs(100, 0.5)
    error = inputs[:, 0] - inputs[:, 2]
    assert (run(compiled, given, inputs)[:, 5] == 0.3 * error).all()


def test_integrator_holds_the_opening_so_a_change_of_ki_makes_no_step():
    """The integral is stored in units of x: with e = 0 the command stays what it was, whatever ki has become."""
    given = constant(kp=0.0, ki=100.0, kd=0.0, zz=0.5, zp=0.5)
    memory = (0.25, 0.0, 0.0, 0.0, 0.0, 0.25)
    for ki in (1.0, 1e4):
        changed = regulator_of(constant(kp=0.0, ki=ki, kd=0.0, zz=0.5, zp=0.5))
        assert compiled.sample(0.0, 0.0, 0.0, 0.1, memory, changed)[5] == 0.25
    assert regulator_of(given).table[0, 0, 1] == 100.0


def test_back_calculation_bounds_the_integral_and_its_absence_does_not():
    """In saturation the integral settles where Ts ki e = Ts (w - 1)/Tt, i.e. at w = 1 + Tt ki e."""
    inputs = np.tile([0.05, 0.0, 0.0, 0.1], (2000, 1))
    bounded = run(compiled, constant(kp=1.0, ki=100.0, kd=0.0, zz=0.5, zp=0.5), inputs)
    assert bounded[-1, 0] + 0.05 == pytest.approx(1.0 + 0.02 * 100.0 * 0.05, rel=1e-9)
    runaway = run(compiled, constant(kp=1.0, ki=100.0, kd=0.0, zz=0.5, zp=0.5, Tt=np.inf), inputs)
    assert runaway[-1, 0] == pytest.approx(2000 * 1e-3 * 100.0 * 0.05, rel=1e-9)


def test_lookup_never_crosses_zero_and_is_clipped_at_the_nodes():
    kp = np.array([[1.0], [2.0], [30.0], [40.0]]) * np.ones(3)
    regulator = regulator_of(schedule(kp=kp, ki=0 * kp, zz=0.5, zp=0.5))
    for x, expected in ((-1.0, 1.0), (-0.55, 1.5), (-0.1, 2.0), (-1e-9, 2.0), (0.0, 30.0), (0.05, 30.0), (0.55, 35.0), (1.0, 40.0)):
        memory = (0.0, 0.0, 0.0, 0.0, 0.0, x)
        assert compiled.sample(1e-3, 0.0, 0.0, 0.3, memory, regulator)[5] == pytest.approx(expected * 1e-3, rel=1e-12)


def test_tables_of_one_node_are_constant():
    given = schedule(x=np.array([0.1]), y=np.array([0.2]), **{n: np.ones((1, 1)) for n in ("kp", "ki", "kd", "notch_frequency")})
    regulator = regulator_of(given)
    for x, y in ((-0.7, 0.0), (0.0, 0.5), (1.0, 0.2)):
        memory = compiled.sample(1e-3, 0.0, 0.0, y, (0.0, 0.0, 0.0, 0.0, 0.0, x), regulator)
        assert memory[0] == pytest.approx(1e-6, rel=1e-12)


def test_feed_forward_vanishes_at_rest_and_keeps_the_leakage_offset_of_each_side():
    regulator = regulator_of(schedule(feed_forward=True))
    assert compiled.feed_forward(0.0, regulator) == 0.0
    assert compiled.feed_forward(0.03, regulator) == pytest.approx(0.03 / 0.1516 + 0.0006, rel=1e-15)
    assert compiled.feed_forward(-0.03, regulator) == pytest.approx(-0.03 / 0.1408 - 0.0006, rel=1e-15)


def test_compiled_tangent_is_accurate_up_to_the_nyquist_frequency():
    angles = np.linspace(0.0, 1.57, 4001)[1:]
    error = np.array([tan(angle) for angle in angles]) / np.tan(angles) - 1.0
    condition = angles / (np.sin(angles) * np.cos(angles))
    assert (np.abs(error) <= 8 * np.finfo(float).eps * condition).all()


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"x": np.array([-1.0, 0.0, 0.1, 1.0])}, "no node of x may be 0"),
        ({"y": np.array([0.0, 0.5, 0.2])}, "must ascend"),
        ({"kp": np.full((4, 3), np.nan)}, "not finite"),
        ({"notch_frequency": np.full((4, 3), 4000.0)}, "Nyquist"),
        ({"delay_samples": 0.5}, "whole number"),
    ],
)
def test_unusable_schedules_are_refused(changes, words):
    with pytest.raises(InputError, match=words):
        regulator_of(schedule(**changes))
