"""Plants of one's own: what linear families, transfer functions, second-order models and surfaces
are worth to the tuner and the margins."""

from dataclasses import replace

import control
import numpy as np
import pytest
from scipy.optimize import brentq, minimize_scalar

import hydroctl as hc
from hydroctl.errors import InputError
from hydroctl.loop.margins import Loop
from hydroctl.loop.model_plants import GridPlants, SurfacePlants
from hydroctl.loop.quantity import POSITION, VELOCITY

TS, DELAY = 1e-3, 1.25
X, Y = np.array([-1.0, -0.3, 0.3, 1.0]), np.array([0.1, 0.25, 0.4])
NOMINAL = hc.Specification(uncertainty="nominal")
LAWS = [("velocity", "pi+notch"), ("velocity", "pid"), ("position", "p+notch")]
S = control.tf("s")
RATES = np.geomspace(1.0, 0.99 * np.pi / TS, 400)


@pytest.fixture(scope="module")
def linear(reference):
    return hc.linearize(reference, hc.find_operating_points(reference, X[:, None], Y))


@pytest.fixture(scope="module")
def reduced(linear):
    return hc.reduce_order(linear)


def fitted(machine):
    """Surfaces of the machine's own second-order models."""
    x, y = np.array([-1.0, -0.6, -0.3, 0.3, 0.6, 1.0]), np.linspace(0.1, 0.4, 5)
    points = hc.find_operating_points(machine, x[:, None], y)
    return hc.fit_surfaces(hc.reduce_order(hc.linearize(machine, points)), basis="volume")


@pytest.fixture(scope="module")
def surfaces(reference):
    return fitted(reference)


def systems(family, of="transfer_function"):
    """{(x, y): the model at each point}"""
    return {
        (float(x), float(y)): getattr(family[i, j], of)()
        for i, x in enumerate(family.points.x[:, 0])
        for j, y in enumerate(family.points.y[0])
    }


def held(system, quantity, delay=DELAY):
    """The response of a continuous model behind hold and delay, by python-control: fractions of a
    sample as the sum of two holds."""
    if quantity is POSITION:
        system = control.tf(1.0, [1.0, 0.0]) * system
    whole, part = int(delay), delay % 1.0
    z = np.exp(1j * RATES * TS)
    model = control.ss(system)
    fine = control.sample_system(model, TS * (1.0 - part), "zoh")
    full = control.sample_system(model, TS, "zoh")
    newest, older = fine.B, full.B - fine.B
    entry = [newest + older / point for point in z]
    inner = [
        full.C @ np.linalg.solve(p * np.eye(len(full.A)) - full.A, b)
        for p, b in zip(z, entry, strict=True)
    ]
    return np.array(inner)[:, 0, 0] * z**-whole


def of_control(schedule, family):
    """{margin: value (nx, ny)} of the schedule's loops on `family`, from L by python-control: the
    extremes over a grid, refined by scipy."""
    x, y = schedule.design_x, schedule.design_y
    found = []
    for a in x:
        for b in y:
            model = control.ss(family[float(a), float(b)])
            if schedule.quantity is POSITION:
                model = control.ss(control.tf(1.0, [1.0, 0.0])) * model
            delay = control.ss([[0.0]], [[1.0]], [[1.0]], 0.0, TS)
            plant = control.sample_system(model, TS, "zoh") * delay
            L = plant * control.ss(schedule.gains(a, b).transfer_function())
            found.append(_margins_of(lambda omega, L=L: L(np.exp(1j * omega * TS))))
    return {
        name: np.reshape(values, (x.size, y.size))
        for name, values in zip(
            ("Ms", "gain_margin", "phase_margin"), zip(*found, strict=True), strict=True
        )
    }


def _margins_of(L):
    omega = np.geomspace(1.0, np.pi / TS, 6000)
    response = np.array([L(w) for w in omega])

    def crossings(f):
        values = np.array([f(value) for value in response])
        places = np.flatnonzero(values[:-1] * values[1:] < 0.0)
        return [L(brentq(lambda w: f(L(w)), omega[k], omega[k + 1], rtol=1e-14)) for k in places]

    k = int(np.argmin(np.abs(1.0 + response)))
    near = minimize_scalar(
        lambda w: abs(1.0 + L(w)),
        bounds=omega[[k - 1, min(k + 1, omega.size - 1)]],
        method="bounded",
    )
    real = [value.real for value in crossings(lambda value: value.imag) if -1.0 < value.real < 0.0]
    turn = [np.pi - abs(np.angle(value)) for value in crossings(lambda value: abs(value) - 1.0)]
    end = response[-1].real
    real += [end] if -1.0 < end < 0.0 else []
    return 1.0 / near.fun, min((-1.0 / value for value in real), default=np.inf), min(turn)


def require_margins_of_control(schedule, family):
    """The margins of the schedule are those of python-control's responses; each refines its
    extremes to better than 1e-6."""
    margins = schedule.margins
    here = np.ix_([0], np.isin(margins.x, schedule.design_x), np.isin(margins.y, schedule.design_y))
    for name, expected in of_control(schedule, family).items():
        found = getattr(margins.margins, name)[here][0]
        np.testing.assert_allclose(found, expected, rtol=1e-6, err_msg=name)


@pytest.mark.parametrize(("loop", "structure"), LAWS)
def test_the_models_of_a_machine_are_tuned_as_the_machine(reference, loop, structure):
    """A LinearFamily, transfer functions and state spaces of the same points give its gains."""
    machine = hc.tune(reference, X, Y, loop=loop, structure=structure, specification=NOMINAL)
    points = hc.find_operating_points(reference, machine.design_x[:, None], machine.design_y)
    family = hc.linearize(reference, points)
    for models in (family, systems(family), systems(family, "state_space")):
        found = hc.tune(models, loop=loop, structure=structure)
        for name in ("x", "y", "kp", "ki", "kd", "notch_frequency", "Tt"):
            np.testing.assert_allclose(getattr(found, name), getattr(machine, name), rtol=1e-9)
        where = machine.margins.designed
        worst = machine.margins.worst("Ms", where=where).value
        assert found.margins.worst("Ms").value == pytest.approx(worst, rel=1e-9)
        assert found.actuator is None
        assert found.specification.uncertainty == "nominal"


@pytest.mark.parametrize("quantity", [VELOCITY, POSITION], ids=lambda q: q.loop)
def test_transfer_functions_of_any_order_are_sampled_as_python_control_does(quantity):
    """Orders 1 to 5 side by side; those of lower order are filled up without a trace."""
    orders = {
        (0.1, 0.0): 3.0 / (S + 40.0),
        (0.1, 0.1): 5e3 / (S**2 + 20.0 * S + 9e3),
        (0.5, 0.0): 4e7 * (S / 300.0 + 1.0) / ((S**2 + 60.0 * S + 2.5e5) * (S + 310.0)),
        (0.5, 0.1): control.ss(2e9 / ((S**2 + 60.0 * S + 2.5e5) * (S + 90.0) ** 2)),
    }
    third, valve = orders[0.5, 0.0], 4e5 / (S**2 + 900.0 * S + 4e5)
    plants = hc.as_plant(orders | {(0.1, 0.2): third * valve, (0.5, 0.2): third}).sampled(
        [0.1, 0.5], [0.0, 0.1, 0.2], quantity, sample_time=TS, delay_samples=DELAY
    )
    found = plants.frequency_response(RATES)
    for (x, y), system in orders.items():
        place = (0, [0.1, 0.5].index(x), [0.0, 0.1, 0.2].index(y))
        expected = held(system, quantity)
        np.testing.assert_allclose(found[place], expected, atol=1e-9 * np.abs(expected).max())
    expected = held(third * valve, quantity)
    np.testing.assert_allclose(found[0, 0, 2], expected, atol=1e-9 * np.abs(expected).max())


def test_the_natural_frequency_is_that_of_the_least_damped_mode():
    lag = 400.0 / (S + 400.0)
    soft, stiff = (w**2 / (S**2 + 2.0 * d * w * S + w**2) for w, d in ((300.0, 0.3), (900.0, 0.05)))
    models = {(0.5, 0.0): soft * stiff * lag, (0.5, 0.1): lag * 30.0 / (S + 30.0), (0.5, 0.2): lag}
    found = hc.as_plant(models).models.resonance[0, 0]
    expected = [(900.0, 0.05), (np.sqrt(30.0 * 400.0), 430.0 / 2.0 / np.sqrt(12e3)), (400.0, 1.0)]
    np.testing.assert_allclose(found, expected, rtol=1e-9)


@pytest.mark.parametrize(("loop", "structure"), LAWS)
def test_a_second_order_family_has_the_margins_that_python_control_finds(reduced, loop, structure):
    schedule = hc.tune(reduced, loop=loop, structure=structure)
    models = {
        (float(x), float(y)): control.tf(
            [reduced.b[i, j]], [1.0, reduced.a1[i, j], reduced.a2[i, j]]
        )
        for i, x in enumerate(X)
        for j, y in enumerate(Y)
    }
    require_margins_of_control(schedule, models)


def test_a_quasi_linear_model_has_the_margins_that_python_control_finds(surfaces):
    schedule = hc.tune(surfaces, [0.3, 1.0], [0.1, 0.4], structure="pi+notch")
    a1, a2, b = surfaces.evaluate(schedule.design_x[:, None], schedule.design_y)
    models = {
        (float(x), float(y)): control.tf([b[i, j]], [1.0, a1[i, j], a2[i, j]])
        for i, x in enumerate(schedule.design_x)
        for j, y in enumerate(schedule.design_y)
    }
    require_margins_of_control(schedule, models)
    assert schedule.margins.x.size > schedule.design_x.size


def test_surfaces_that_were_fitted_stand_behind_the_valve_of_their_machine(reference):
    """The response is that without a valve times w^2/(s^2 + 2 zeta w s + w^2): at frequencies far
    below the sample rate the hold does not tell them apart."""
    w, damping = 700.0, 0.8
    slow = reference.replace(valve_natural_frequency=w, valve_damping=damping)
    sampled = [
        hc.as_plant(hc.reduce_order(hc.linearize(a, hc.find_operating_points(a, X[:, None], Y))))
        .sampled([0.3], [0.25], VELOCITY, sample_time=1e-6, delay_samples=0.0)
        .frequency_response([100.0, 400.0])[0, 0, 0]
        for a in (reference, slow)
    ]
    s = 1j * np.array([100.0, 400.0])
    valve = w**2 / (s**2 + 2.0 * damping * w * s + w**2)
    np.testing.assert_allclose(sampled[1] / sampled[0], valve, rtol=1e-3)
    surfaces = fitted(slow)
    bare = replace(
        surfaces,
        surfaces={side: replace(s, fit_error={}) for side, s in surfaces.surfaces.items()},
    )
    orders = [
        hc.as_plant(model).sampled([0.3], [0.25], VELOCITY, sample_time=TS, delay_samples=0.0)
        for model in (surfaces, bare)
    ]
    assert [order.transition.shape[-1] for order in orders] == [4, 2]


def test_surfaces_know_the_speeds_of_the_operating_points(reference):
    """Behind a dead band the speed is not in proportion to x: the offset holds the rest."""
    late = reference.replace(dead_band=0.2)
    x, y = [-0.5, 0.4, 0.6], [0.15, 0.3]
    expected = hc.find_operating_points(late, np.array(x)[:, None], y).v
    prompt = hc.find_operating_points(reference, np.array(x)[:, None], y).v
    plants = hc.as_plant(fitted(late))
    assert np.abs(expected / prompt - 1.0).min() > 0.05
    np.testing.assert_allclose(plants.speed(x, y), expected, rtol=0.01)
    found, own = plants.speed_gains(), hc.as_plant(late).speed_gains()
    full = np.array([1.0, -1.0])
    gains = np.array([[f.gain_extend, f.gain_retract] for f in (found, own)])
    offsets = np.array([[f.offset_extend, f.offset_retract] for f in (found, own)])
    np.testing.assert_allclose(*(gains * (full - offsets)), rtol=0.02)


def test_an_unstable_plant_is_not_called_tuned():
    with pytest.raises(hc.InfeasibleError, match="unstable loop"):
        hc.tune({(0.5, 0.1): 9e3 / (S**2 - 20.0 * S + 9e4)}, structure="pi")


def test_an_identified_model_is_tuned_where_it_is_known(surfaces):
    """Its plants are those of its model, without a further valve."""
    t = 1e-3 * np.arange(6000)
    rng = np.random.default_rng(5)
    x = 0.4 + 0.3 * np.repeat(rng.choice([-1.0, 1.0], 300), 20)
    true = (30.0, 9e4, 2.7e4)
    a1, a2, b = true
    v = control.forced_response(control.tf([b], [1.0, a1, a2]), t, x).outputs
    found = hc.identify(t, x, v, basis="constant")
    family = found.plant_family()
    assert family.surfaces["nominal"] is found.model
    schedule = hc.tune(found, [0.2, 0.6], [0.0], structure="pi")
    np.testing.assert_allclose(schedule.speed_gain_extend, b / a2, rtol=0.05)
    found_response = schedule.sampled_plants([0.2], [0.0]).frequency_response(RATES[:200])[0, 0, 0]
    expected = held(control.tf([b], [1.0, a1, a2]), VELOCITY, 1.0)[:200]
    np.testing.assert_allclose(found_response, expected, atol=0.05 * np.abs(expected).max())
    with pytest.raises(InputError, match="outside the region"):
        hc.tune(found, [-0.5], [0.0])


def test_variants_of_models_count_in_tuning_and_margins(linear):
    """A variant of one and a half times the gain takes two thirds of the gains."""
    nominal = systems(linear)
    larger = {place: 1.5 * system for place, system in nominal.items()}
    alone = hc.tune(nominal, structure="pi")
    both = hc.tune(hc.as_plant(nominal, variants={"large gain": larger}), structure="pi")
    assert both.margins.variants == ("nominal", "large gain")
    scaled = hc.tune(larger, structure="pi")
    np.testing.assert_allclose(scaled.ki, alone.ki / 1.5, rtol=1e-6)
    assert (both.ki <= scaled.ki * (1.0 + 1e-4)).all()
    assert both.margins.worst("Ms").variant == "large gain"


def test_between_the_points_of_a_grid_nothing_is_claimed(linear, reference):
    """Margins stand at the points alone; a finer grid than the design points is used between."""
    assert hc.tune(linear, structure="pi").margins.designed.all()
    fine = hc.linearize(
        reference, hc.find_operating_points(reference, [[0.3], [0.4], [0.5]], [0.1, 0.25, 0.4])
    )
    schedule = hc.tune(fine, [0.3, 0.5], [0.1, 0.4], structure="pi")
    assert schedule.margins.x.size == schedule.margins.y.size == 3


def test_hidden_coupling_of_a_linear_family_is_that_of_the_machine_at_its_points(reference):
    """The check looks 1e-3 of a cell inside the nodes, where the machine's poles differ from those
    at the nodes by about as much of their distance from 1."""
    machine = hc.tune(reference, X, Y, structure="pi", specification=NOMINAL)
    points = hc.find_operating_points(reference, machine.design_x[:, None], machine.design_y)
    models = hc.linearize(reference, points)
    found = hc.check_coupling(hc.tune(models, structure="pi"))
    expected = hc.check_coupling(machine)
    edges = np.ix_(
        [0],
        *(
            np.abs(s[:, None] - n).min(axis=1) < 2e-3
            for s, n in ((found.x, machine.x), (found.y, machine.y))
        ),
    )
    np.testing.assert_allclose(
        1.0 - found.pole_size[edges], 1.0 - expected.pole_size[edges], rtol=0.02
    )


def test_speeds_that_are_not_known_are_not_made_up(linear):
    schedule = hc.tune(systems(linear), loop="position", structure="p")
    assert not schedule.feed_forward
    with pytest.raises(InputError, match="steady speeds of these models are not known"):
        hc.check_coupling(schedule)
    known = hc.tune(linear, loop="position", structure="p")
    assert known.feed_forward
    v = linear.points.v[:, 1]
    lines = known.speed_gain_extend, known.speed_offset_extend
    np.testing.assert_allclose(lines[0] * (X[2:] - lines[1]), v[2:], rtol=1e-12)
    lines = known.speed_gain_retract, known.speed_offset_retract
    np.testing.assert_allclose(lines[0] * (X[:2] - lines[1]), v[:2], rtol=1e-12)


def test_the_nearest_point_of_a_grid_is_on_the_same_side(linear):
    x, y = hc.as_plant(linear).nearest([-0.01, 0.01, 0.7], [0.0, 0.3])
    np.testing.assert_array_equal(x, [-0.3, 0.3, 1.0])
    np.testing.assert_array_equal(y, [0.1, 0.25])


def test_plants_are_sampled_once_for_equal_machines_and_points(monkeypatch):
    """As the schedule that was saved and the one that was loaded are."""
    from hydroctl.loop import machine_plants

    counted = []
    original = machine_plants.sample
    monkeypatch.setattr(
        machine_plants, "sample", lambda *a, **k: counted.append(1) or original(*a, **k)
    )
    machine = hc.load_actuator("reference").replace(mass=321.0)
    twin = hc.load_actuator("reference").replace(mass=321.0)
    for actuator in (machine, twin):
        schedule = hc.as_plant(actuator, uncertainty="one-at-a-time")
        schedule.sampled(X, Y, VELOCITY, sample_time=TS, delay_samples=1.0)
    assert len(counted) == 5
    schedule.sampled(X, Y, POSITION, sample_time=TS, delay_samples=1.0)
    schedule.sampled(X, Y[:1], VELOCITY, sample_time=TS, delay_samples=1.0)
    schedule.sampled(X, Y, VELOCITY, sample_time=2.0 * TS, delay_samples=1.0)
    schedule.sampled(X, Y, VELOCITY, sample_time=TS, delay_samples=0.0)
    assert len(counted) == 25


def test_every_kind_of_plant_becomes_a_family(reference, linear, reduced, surfaces):
    assert hc.as_plant(reference).actuator is reference
    for models in (linear, reduced, systems(linear)):
        family = hc.as_plant(models)
        assert isinstance(family, GridPlants)
        assert hc.as_plant(family) is family
    assert isinstance(hc.as_plant(surfaces), SurfacePlants)


GOOD = {(0.5, 0.1): 9e3 / (S**2 + 20.0 * S + 9e4)}


@pytest.mark.parametrize(
    ("models", "text"),
    [
        (3.0, "plant = float cannot be used"),
        ({}, "the keys of the models must be"),
        ({0.5: GOOD[0.5, 0.1]}, "the keys of the models must be"),
        ({(0.0, 0.1): GOOD[0.5, 0.1]}, "x = 0 cannot be a node"),
        (GOOD | {(0.7, 0.2): GOOD[0.5, 0.1]}, "there is no model at x=0.5, y=0.2 m"),
        ({(0.5, 0.1): 2.0}, "x=0.5, y=0.1 m: float is no control.TransferFunction"),
        ({(0.5, 0.1): control.sample_system(GOOD[0.5, 0.1], 1e-3)}, "the model is sampled"),
        ({(0.5, 0.1): control.tf([1.0, 0.0], [1.0, 3.0])}, "x acts on v at once"),
        ({(0.5, 0.1): control.ss(-np.eye(2), np.eye(2), np.eye(2), 0.0)}, "2 inputs and 2 outputs"),
        ({(0.5, 0.1): control.ss(-1.0, np.inf, 1.0, 0.0)}, "a number that is not finite"),
        ({(0.5, 0.1): control.ss(-1.0, 0.0, 1.0, 0.0)}, "x does not act on v"),
        ({(0.5, 0.1): -1.0 * GOOD[0.5, 0.1]}, "the static gain is -0.1 m/s"),
        ({(0.5, 0.1): 1.0 / (S**2 + S)}, "the static gain is inf m/s"),
    ],
)  # fmt: skip
def test_models_that_cannot_be_used_are_refused(models, text):
    with pytest.raises(InputError, match=text):
        hc.as_plant(models)


def test_faults_of_several_models_are_told_at_once():
    with pytest.raises(InputError) as refused:
        hc.as_plant({(0.5, 0.1): 2.0, (0.5, 0.2): GOOD[0.5, 0.1], (0.5, 0.3): None})
    assert len(refused.value.faults) == 2


def test_what_belongs_to_a_machine_is_refused_for_models(linear, reference):
    with pytest.raises(InputError, match="vary the parameters of a machine"):
        hc.tune(linear, specification=hc.Specification(uncertainty="corners"))
    with pytest.raises(InputError, match="LinearFamily has no parameters"):
        hc.as_plant(linear, uncertainty="box")
    with pytest.raises(InputError, match="variants are for models"):
        hc.as_plant(reference, variants={"soft": linear})
    with pytest.raises(InputError, match="needs the pressures of a machine"):
        hc.tune(linear, specification=hc.Specification(pressure_compensation=True))
    with pytest.raises(InputError, match="need the pressures and the valve"):
        hc.tune(linear, specification=hc.Specification(dead_band_inverse=0.5))
    with pytest.raises(InputError, match="no parameters to vary"):
        hc.as_plant(linear).varied([{"mass": 1.0}])


def test_families_that_do_not_fit_are_refused(linear, reference, reduced):
    with pytest.raises(InputError, match="variant 'soft' is a SecondOrderFamily"):
        hc.as_plant(linear, variants={"soft": reduced})
    with pytest.raises(InputError, match="give them together with the models"):
        hc.as_plant(hc.as_plant(linear), variants={"soft": linear})
    with pytest.raises(InputError, match="variants hold 'nominal'"):
        hc.as_plant(linear, variants={"nominal": linear})
    secant = hc.linearize(reference, linear.points, form="secant")
    with pytest.raises(InputError, match="form = 'secant' is for simulation"):
        hc.as_plant(secant)
    other = hc.linearize(reference, hc.find_operating_points(reference, X[:, None], Y + 0.01))
    with pytest.raises(InputError, match="soft plant: its models stand at other points"):
        hc.as_plant(linear, variants={"soft": other})
    loads = hc.find_operating_points(reference, 0.5, 0.1, load_force=[0.0, 1e3])
    with pytest.raises(InputError, match="give one load"):
        hc.as_plant(hc.linearize(reference, loads))
    still = hc.find_operating_points(reference, [[0.5], [0.6]], [0.1, -0.1])
    with pytest.raises(InputError, match="y must be within the stroke"):
        hc.as_plant(hc.linearize(reference, still))


def test_points_are_asked_for_where_the_models_have_none(linear, reference, surfaces):
    for plant in (reference, surfaces):
        with pytest.raises(InputError, match="x nodes are missing"):
            hc.tune(plant)
    with pytest.raises(InputError, match=r"there is no model at x=0.31, y=0.1 m"):
        hc.tune(linear, [0.31], [0.1])
    np.testing.assert_array_equal(hc.tune(linear, [0.3]).design_y, Y)


def test_a_notch_needs_a_natural_frequency():
    lag = {(0.5, 0.1): 0.1 * 30.0 / (S + 30.0)}
    assert hc.tune(lag, structure="pi+notch").notch_frequency == pytest.approx(30.0)


def test_the_loop_of_a_schedule_of_models_is_stable_in_state_space(linear):
    """The margins' stability verdict, by the poles of python-control's own feedback."""
    schedule = hc.tune(systems(linear), structure="pi")
    plants = schedule.sampled_plants(X, Y)
    poles = Loop(plants, schedule.gains(X[:, None], Y).broadcast_to(plants.shape)).poles()
    for i, x in enumerate(X):
        A, B, C = (part[0, i, 0] if part.ndim > 2 else part for part in plants.state_space())
        plant = control.ss(A, B, C, 0.0, TS)
        C_z = control.ss(schedule.gains(x, Y[0]).transfer_function())
        expected = np.abs(control.feedback(plant * C_z, 1.0).poles()).max()
        np.testing.assert_allclose(np.abs(poles[0, i, 0]).max(), expected, rtol=1e-7)
