"""The regulator law: against its transfer function, a plain route of its own, and the rules that it
states."""

import numpy as np
import pytest
from loops import PlainRegulator, schedule
from scipy import signal

from hydroctl import load_actuator
from hydroctl.compilation.scalar import tan
from hydroctl.errors import InputError
from hydroctl.model import plant, valve
from hydroctl.regulator import compensation, inverse, law
from hydroctl.regulator.prepared import regulator_of
from hydroctl.simulation.kernels.builds import law_build

ROUNDING = 1e-12
X = law.Memory._fields.index("x")
compiled = law_build("full")


def constant(loop="velocity", *, kp, ki, kd, **changes):
    tables = {"kp": kp, "ki": ki, "kd": kd, "notch_frequency": 540.0}
    return schedule(
        loop, **{name: np.full((4, 3), value) for name, value in tables.items()}, **changes
    )


def run(functions, given, inputs):
    """Memory after every sample (n, 10) for rows of reference, v_ref, v, y, p_a, p_b; pressures
    default to 0."""
    regulator, memory, rows = regulator_of(given.regulator), law.AT_REST, []
    for row in inputs:
        reference, v_ref, v, y, p_a, p_b = [*map(float, row), 0.0, 0.0][:6]
        memory = functions.sample(reference, v_ref, (p_a, p_b, v, y), memory, regulator)
        rows.append(memory)
    return np.array(rows, dtype=float)


def random_inputs(samples, size, seed=1):
    rng = np.random.default_rng(seed)
    return np.column_stack(
        [size * rng.standard_normal((samples, 3)), rng.uniform(-0.1, 0.6, samples)]
    )


@pytest.mark.parametrize("dampings", [(0.2, 0.8), (0.5, 0.5)], ids=["notch", "no notch"])
def test_unsaturated_law_is_the_transfer_function(dampings):
    """C(z) = kp + ki Ts/(z - 1) + kd (z - 1)/((Tf + Ts) z - Tf) times Tustin's notch, prewarped at
    wn, by scipy's filters."""
    kp, ki, kd, (zz, zp), wn = 0.7, 90.0, 1e-3, dampings, 540.0
    given = constant(kp=kp, ki=ki, kd=kd, zz=zz, zp=zp)
    Ts, Tf = given.Ts, given.Tf
    error = 1e-4 * np.random.default_rng(0).standard_normal(400)
    terms = [([kp], [1.0]), ([0.0, ki * Ts], [1.0, -1.0]), ([kd, -kd], [Tf + Ts, -Tf])]
    u = sum(signal.lfilter(b, a, error) for b, a in terms)
    notch = signal.bilinear(
        [1, 2 * zz * wn, wn**2], [1, 2 * zp * wn, wn**2], fs=wn / (2.0 * np.tan(wn * Ts / 2.0))
    )
    expected = signal.lfilter(*notch, u)
    assert np.abs(expected).max() < 1.0
    inputs = np.column_stack([error, np.zeros((400, 3))])
    assert run(compiled, given, inputs)[:, X] == pytest.approx(expected, rel=0, abs=ROUNDING)


@pytest.mark.parametrize("loop", ["velocity", "position"])
@pytest.mark.parametrize("forward", [False, True])
def test_scheduled_saturating_law_agrees_with_a_plain_route(loop, forward):
    given = schedule(loop, kd=np.full((4, 3), 2e-3), feed_forward=forward)
    inputs = random_inputs(600, 0.5)
    inputs[::5, 1] = 0.0
    if loop == "position":
        inputs[:, 0] = inputs[:, 3] + 0.04 * inputs[:, 0]
    plain = PlainRegulator(given)
    expected = np.array(
        [plain.command(reference, v_ref, 0.0, 0.0, v, y) for reference, v_ref, v, y in inputs]
    )
    saturated = np.mean(np.abs(expected) == 1.0)
    assert 0.1 < saturated < 0.95
    assert run(compiled, given, inputs)[:, X] == pytest.approx(expected, rel=0, abs=1e-10)


def test_compiled_law_and_the_same_lines_in_python_agree():
    given = schedule(kd=np.full((4, 3), 1e-3), feed_forward=True)
    inputs = random_inputs(200, 0.05)
    assert run(compiled, given, inputs) == pytest.approx(
        run(law, given, inputs), rel=0, abs=ROUNDING
    )


UNEQUAL = load_actuator("reference").replace(
    area_b=0.7 * load_actuator("reference").area_b,
    flow_coefficient_b=0.6 * load_actuator("reference").flow_coefficient,
    tank_pressure=4e5,
    dead_band=0.05,
)
"""a machine whose two sides have nothing in common"""
KD = 2e-4 * (1.0 + 0.1 * np.arange(12).reshape(4, 3))
EFFECTS = {
    "filter": {"Tm": 3e-3},
    "weights": {"b": 0.6, "c": 0.0},
    "lead": {"sections": ((0.5, 3.0),)},
    "lead-lag": {"sections": ((0.5, 3.0), (0.05, 0.02))},
    "lead-lag without notch": {"sections": ((0.5, 3.0), (0.05, 0.02)), "zz": 0.8},
    "pressures": {"pressure_drops": np.array([[9e6, 11e6], [10e6, 8e6]]), "actuator": UNEQUAL},
    "dead band": {"dead_band_inverse": 0.85, "actuator": UNEQUAL},
}
EFFECTS["all"] = {
    name: value for effect in list(EFFECTS.values())[:-2] for name, value in effect.items()
} | {
    "zz": 0.2,
    "pressure_drops": EFFECTS["pressures"]["pressure_drops"],
    **EFFECTS["dead band"],
}


def disturbed_inputs(loop):
    """Random inputs with saturation, sensors that fail now and then, and pressures beyond supply
    and tank."""
    inputs = np.column_stack(
        [random_inputs(400, 0.5), np.random.default_rng(3).uniform(-2e6, 23e6, (400, 2))]
    )
    inputs[::5, 1] = 0.0
    if loop == "position":
        inputs[:, 0] = inputs[:, 3] + 0.01 * inputs[:, 0]
    for column, row in enumerate(range(50, 350, 50)):
        inputs[row : row + 3, column] = (np.nan, np.inf, -np.inf)
    return inputs


@pytest.mark.parametrize("loop", ["velocity", "position"])
@pytest.mark.parametrize("effect", EFFECTS)
def test_every_effect_of_the_law_agrees_with_a_plain_route(loop, effect):
    given = schedule(loop, kd=KD, feed_forward=True, **EFFECTS[effect])
    inputs = disturbed_inputs(loop)
    plain = PlainRegulator(given)
    expected = np.array([plain.command(*row[:2], *row[4:], *row[2:4]) for row in inputs])
    assert 0.05 < np.mean(np.abs(expected) == 1.0) < 0.95
    assert run(compiled, given, inputs)[:, X] == pytest.approx(expected, rel=0, abs=1e-10)


@pytest.mark.parametrize("effect", EFFECTS)
def test_a_start_holds_the_command_that_it_is_given(effect):
    given = schedule(kd=KD, feed_forward=True, **EFFECTS[effect])
    regulator, measured = regulator_of(given.regulator), (6e6, 7e6, 0.013, 0.2)
    for x in (-1.0, -0.3, -1e-3, 0.0, 0.04, 0.7, 1.0):
        memory = compiled.start(x, 0.02, 0.02, measured, regulator)
        assert compiled.sample(0.02, 0.02, measured, memory, regulator).x == pytest.approx(
            x, abs=1e-12
        )


def test_a_start_clips_the_command_and_begins_at_rest_where_an_input_is_unknown():
    regulator, measured = regulator_of(schedule().regulator), (0.0, 0.0, 0.013, 0.2)
    for beyond, end in ((1.7, 1.0), (-1.7, -1.0)):
        clipped = compiled.start(end, 0.02, 0.0, measured, regulator)
        assert compiled.start(beyond, 0.02, 0.0, measured, regulator) == clipped
    assert compiled.start(np.nan, 0.02, 0.0, measured, regulator) == law.AT_REST
    assert compiled.start(0.3, 0.02, 0.0, (0.0, 0.0, np.nan, 0.2), regulator) == law.AT_REST


def test_a_start_without_integral_lets_the_law_decide():
    regulator = regulator_of(constant(kp=2.0, ki=0.0, kd=0.0).regulator)
    measured = (0.0, 0.0, 0.01, 0.2)
    memory = compiled.start(0.9, 0.03, 0.0, measured, regulator)
    assert compiled.sample(0.03, 0.0, measured, memory, regulator).x == pytest.approx(
        0.04, rel=1e-12
    )


@pytest.mark.parametrize("column", range(4))
def test_a_broken_sensor_closes_the_valve_and_the_next_sound_sample_is_a_start(column):
    inputs = random_inputs(40, 0.05)
    inputs[20, column] = np.nan
    rows = run(compiled, schedule(), inputs)
    assert (rows[20] == law.AT_REST).all()
    assert (rows[21:] == run(compiled, schedule(), inputs[21:])).all()


def test_a_sensor_that_the_loop_does_not_need_may_break():
    inputs = random_inputs(40, 0.01)
    sound = run(compiled, schedule("position"), inputs)
    inputs[20:, 2] = np.nan
    assert (run(compiled, schedule("position"), inputs) == sound).all()


def test_a_derivative_on_the_measurement_does_not_see_the_reference():
    given = constant(kp=0.0, ki=0.0, kd=1e-3, c=0.0)
    steps = np.array([[0.0, 0.0, 0.01, 0.1]] * 5 + [[0.5, 0.0, 0.01, 0.1]] * 5)
    assert (run(compiled, given, steps)[:, X] == 0.0).all()


@pytest.mark.parametrize("share", [0.8, 0.9])
def test_the_inverse_lets_a_dead_band_pass_nearly_what_is_asked(share):
    """Monotone, odd, exact at the ends; where the valve opens, the jump is over and the valve
    passes within a few percent of w."""
    machine = load_actuator("reference").replace(dead_band=0.05)
    regulator = regulator_of(schedule(dead_band_inverse=share, actuator=machine).regulator)
    w = np.linspace(-1.0, 1.0, 2001)
    x = inverse.step(w, regulator)
    assert (np.diff(x) > 0.0).all()
    assert x == pytest.approx(-x[::-1], abs=1e-15)
    assert (x[0], x[1000], x[-1]) == pytest.approx((-1.0, 0.0, 1.0), abs=1e-15)
    passed = valve.effective_opening(x, plant.parameters(machine).valve)
    bare = valve.effective_opening(w, plant.parameters(machine).valve)
    assert np.abs(passed - w).max() < 0.7 * np.abs(bare - w).max()


def test_the_ratio_is_one_at_the_design_and_takes_the_load_out_of_the_gain():
    """dv/dt per opening is proportional to q, so ratio x q does not depend on the pressures (inside
    the clip)."""
    drops, machine = np.array([[9e6, 11e6], [10e6, 8e6]]), UNEQUAL
    regulator = regulator_of(schedule(pressure_drops=drops, actuator=machine).regulator)
    supply, tank = machine.supply_pressure, machine.tank_pressure
    at_design = (
        (supply - drops[1, 0], tank + drops[1, 1]),
        (tank + drops[0, 0], supply - drops[0, 1]),
    )
    for opening, pressures in zip((0.3, -0.3), at_design, strict=True):
        assert compensation.step(opening, 0.2, *pressures, regulator) == pytest.approx(
            1.0, rel=1e-14
        )
    p = plant.parameters(machine)
    gains = []
    for p_a in (5e6, 8e6, 10e6):
        dp_a, dp_b, _ = np.subtract(
            plant.rates(p_a, 7e6, 0.0, 0.2, 0.1, 0.0, p),
            plant.rates(p_a, 7e6, 0.0, 0.2, 0.0, 0.0, p),
        )
        gains.append(
            compensation.step(0.1, 0.2, p_a, 7e6, regulator)
            * (machine.area_a * dp_a - machine.area_b * dp_b)
        )
    assert gains == pytest.approx([gains[0]] * 3, rel=1e-12)


@pytest.mark.parametrize("opening", [0.3, -0.3])
def test_the_ratio_is_held_between_four_tenths_and_three(opening):
    """Drops that are 1/r^2 of the design's over both open edges make the ratio r, wherever the
    piston is; with none left over either edge the gain would vanish, and the ratio is 3."""
    drops = np.array([[9e6, 11e6], [1e6, 8e5]])
    regulator, machine = (
        regulator_of(schedule(pressure_drops=drops).regulator),
        load_actuator("reference"),
    )
    supply, tank = machine.supply_pressure, machine.tank_pressure
    drop_a, drop_b = drops[int(opening > 0.0)]
    for r in (0.3, 0.39, 0.41, 1.7, 2.95, 3.05, 40.0, np.inf):
        a, b = drop_a / r**2, drop_b / r**2
        pressures = (supply - a, tank + b) if opening > 0.0 else (tank + a, supply - b)
        for y in (0.0, 0.2, 0.5):
            found = compensation.step(opening, y, *pressures, regulator)
            assert found == pytest.approx(min(max(r, 0.4), 3.0), rel=1e-9)


@pytest.mark.parametrize("build", ["notched", "plain"])
def test_leaving_out_unused_effects_changes_no_bit(build):
    given = schedule(kd=KD, feed_forward=True, zz=0.2 if build == "notched" else 0.8)
    inputs = random_inputs(300, 0.3)
    assert (run(law_build(build), given, inputs)[:, X] == run(compiled, given, inputs)[:, X]).all()


def test_equal_dampings_pass_the_command_on_unchanged():
    given = constant(kp=0.3, ki=0.0, kd=0.0, zz=0.6, zp=0.6)
    inputs = random_inputs(100, 0.5)
    error = inputs[:, 0] - inputs[:, 2]
    assert (run(compiled, given, inputs)[:, X] == 0.3 * error).all()


def test_integrator_holds_the_opening_so_a_change_of_ki_makes_no_step():
    """The integral is stored in units of x: with e = 0 the command stays what it was, whatever ki
    has become."""
    given = constant(kp=0.0, ki=100.0, kd=0.0, zz=0.5, zp=0.5)
    memory = law.AT_REST._replace(integral=0.25, x=0.25, running=1.0)
    for ki in (1.0, 1e4):
        changed = regulator_of(constant(kp=0.0, ki=ki, kd=0.0, zz=0.5, zp=0.5).regulator)
        assert compiled.sample(0.0, 0.0, (0.0, 0.0, 0.0, 0.1), memory, changed).x == 0.25
    assert regulator_of(given.regulator).table[0, 0, 1] == 100.0


def test_back_calculation_bounds_the_integral_and_its_absence_does_not():
    """In saturation the integral settles where Ts ki e = Ts (w - 1)/Tt, i.e. at w = 1 + Tt ki e."""
    inputs = np.tile([0.05, 0.0, 0.0, 0.1], (2000, 1))
    bounded = run(compiled, constant(kp=1.0, ki=100.0, kd=0.0, zz=0.5, zp=0.5), inputs)
    assert bounded[-1, 0] + 0.05 == pytest.approx(1.0 + 0.02 * 100.0 * 0.05, rel=1e-9)
    runaway = run(compiled, constant(kp=1.0, ki=100.0, kd=0.0, zz=0.5, zp=0.5, Tt=np.inf), inputs)
    assert runaway[-1, 0] == pytest.approx(2000 * 1e-3 * 100.0 * 0.05, rel=1e-9)


def test_lookup_never_crosses_zero_and_is_clipped_at_the_nodes():
    kp = np.array([[1.0], [2.0], [30.0], [40.0]]) * np.ones(3)
    regulator = regulator_of(schedule(kp=kp, ki=0 * kp, zz=0.5, zp=0.5).regulator)
    for x, expected in (
        (-1.0, 1.0),
        (-0.55, 1.5),
        (-0.1, 2.0),
        (-1e-9, 2.0),
        (0.0, 30.0),
        (0.05, 30.0),
        (0.55, 35.0),
        (1.0, 40.0),
    ):
        memory = law.AT_REST._replace(x=x)
        assert compiled.sample(
            1e-3, 0.0, (0.0, 0.0, 0.0, 0.3), memory, regulator
        ).x == pytest.approx(expected * 1e-3, rel=1e-12)


def test_tables_of_one_node_are_constant():
    given = schedule(
        x=np.array([0.1]),
        y=np.array([0.2]),
        **{n: np.ones((1, 1)) for n in ("kp", "ki", "kd", "notch_frequency")},
    )
    regulator = regulator_of(given.regulator)
    for x, y in ((-0.7, 0.0), (0.0, 0.5), (1.0, 0.2)):
        memory = compiled.sample(
            1e-3, 0.0, (0.0, 0.0, 0.0, y), law.AT_REST._replace(x=x), regulator
        )
        assert memory.integral == pytest.approx(1e-6, rel=1e-12)


def test_feed_forward_vanishes_at_rest_and_keeps_the_leakage_offset_of_each_side():
    regulator = regulator_of(schedule(feed_forward=True).regulator)
    assert compiled.feed_forward.step(0.0, regulator) == 0.0
    assert compiled.feed_forward.step(0.03, regulator) == pytest.approx(
        0.03 / 0.1516 + 0.0006, rel=1e-15
    )
    assert compiled.feed_forward.step(-0.03, regulator) == pytest.approx(
        -0.03 / 0.1408 - 0.0006, rel=1e-15
    )


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
        ({"delay_samples": -0.5}, "0 or more"),
    ],
)
def test_unusable_schedules_are_refused(changes, words):
    with pytest.raises(InputError, match=words):
        regulator_of(schedule(**changes).regulator)
