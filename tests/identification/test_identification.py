"""Identification: what it recovers, how well it knows it, and what it refuses to claim."""

import os
from pathlib import Path

import numpy as np
import pytest

import hydroctl as hc
from hydroctl.quasi_linear.second_order import respond, transition

TS = 1e-3


def prbs(rng, n, least=2, most=9):
    """A random binary signal of +-1 whose holds last `least` to `most` samples."""
    holds = rng.integers(least, most + 1, n)
    return np.repeat(rng.choice([-1.0, 1.0], n), holds)[:n]


def truth(actuator, x, y):
    """(a1, a2, b) of the reduced tangent models."""
    reduced = hc.reduce_order(hc.linearize(actuator, hc.find_operating_points(actuator, x, y)))
    return reduced.a1, reduced.a2, reduced.b


@pytest.fixture(scope="module")
def local_record(reference):
    """3 s around x = 0.1 on the nonlinear plant, without noise."""
    t = np.arange(3001) * TS
    x = 0.1 + 0.02 * prbs(np.random.default_rng(1), len(t))
    rest = hc.find_operating_points(reference, 0.1, 0.1)
    start = hc.State(float(rest.p_a), float(rest.p_b), float(rest.v), 0.1)
    motion = hc.simulate(reference, t, x, initial=start, rtol=1e-9)
    return t, x, motion.v, motion.y


def noisy_result(local_record, rng):
    """Of one identification with 20 % of noise."""
    t, x, v, y = local_record
    return hc.identify(
        t, x, v + 0.2 * v.std() * rng.normal(size=len(v)), y, basis="constant", hold_out=0.0
    )


def test_noise_leaves_the_mean_unbiased_and_scatters_as_the_covariance_states(
    reference, local_record
):
    """50 seeds of 20 % of noise on the nonlinear plant; the deviation of a scatter of 50 is itself
    known to 10 %."""
    rng = np.random.default_rng(2)
    results = [noisy_result(local_record, rng) for _ in range(50)]
    found = np.array([result.parameters[:3] for result in results])
    expected = np.array(truth(reference, np.array([0.1]), local_record[3].mean()))[:, 0]
    np.testing.assert_allclose(found.mean(axis=0), expected, rtol=0.01)
    stated = np.array([np.sqrt(np.diag(result.covariance)[:3]) for result in results]).mean(axis=0)
    ratio = found.std(axis=0, ddof=1) / stated
    assert ((ratio > 0.7) & (ratio < 1.4)).all()


def test_least_squares_on_differences_is_biased_where_srivc_is_not(reference, local_record):
    t, x, v, y = local_record
    expected = np.array(truth(reference, np.array([0.1]), y.mean()))[:, 0]
    noisy = v + 0.2 * v.std() * np.random.default_rng(3).normal(size=len(v))
    error = {
        method: np.abs(
            hc.identify(t, x, noisy, y, basis="constant", method=method).parameters[:3] / expected
            - 1.0
        )
        for method in ("least-squares", "srivc")
    }
    assert error["least-squares"].min() > 0.1
    assert error["srivc"].max() < 0.03


@pytest.fixture(scope="module")
def own_record(reference):
    """18 s that a quasi-linear model of the volume basis makes itself, both signs: (model, t, x, v,
    y)."""
    x = np.geomspace(0.02, 1.0, 11)
    x = np.concatenate([-x[::-1], x])[:, None]
    family = hc.linearize(
        reference, hc.find_operating_points(reference, x, np.linspace(0.0, 0.5, 11))
    )
    made = hc.fit_surfaces(hc.reduce_order(family))
    for surface in made.surfaces.values():
        surface.coefficients["offset"][3:] = 0.0  # the terms in x^2, which b x holds too
    rng = np.random.default_rng(4)
    levels = np.repeat(rng.uniform(0.1, 0.9, 180), 100) * (1.0 + 0.1 * prbs(rng, 18_000))
    opening = levels * np.repeat([1.0, -1.0] * 3, 3000)
    t = np.arange(len(opening)) * TS
    record = made.simulate(t, opening, 0.1)
    return made, t, opening, record.v, record.y


def test_a_model_is_recovered_from_its_own_record(reference, own_record):
    made, t, x, v, y = own_record
    result = hc.identify(t, x, v, y, basis="volume", actuator=reference)
    at = np.array([-0.6, -0.3, 0.3, 0.6])
    for found, expected in zip(
        result.model.evaluate(at, 0.25), made.evaluate(at, 0.25), strict=True
    ):
        np.testing.assert_allclose(found, expected, rtol=2e-3)
    assert result.fit.estimation > 99.9
    assert result.fit.hold_out > 99.9


def test_the_held_out_part_is_predicted_as_well_as_noise_allows_and_no_claim_goes_beyond_the_record(
    reference, own_record
):
    """With 5 % of noise a perfect model leaves 95 %."""
    _, t, x, v, y = own_record
    noisy = v + 0.05 * v.std() * np.random.default_rng(6).normal(size=len(v))
    result = hc.identify(t, x, noisy, y, basis="volume", actuator=reference)
    for fit in (result.fit.estimation, result.fit.hold_out, result.fit.one_step):
        assert fit == pytest.approx(95.0, abs=1.0)
    assert result.noise == pytest.approx(0.05 * v.std(), rel=0.05)
    for point in ((0.01, 0.25), (0.5, y.min() - 1e-3), (-0.5, y.max() + 1e-3), (1.0, 0.25)):
        assert not result.model.contains(*point)
        with pytest.raises(hc.InputError, match="outside the region"):
            result.model.evaluate(*point)
    assert any("cells of (x, y) are not excited enough" in text for text in result.restrictions)


def test_closed_loop_data_are_allowed():
    """Velocity feedback of the noisy measurement, one sample late; the mean of 20 results lies
    within 3 of its standard errors."""
    a1, a2, b, n = 200.0, 3e5, 4.5e4, 3000
    p = transition(np.array([a1]), np.array([a2]), np.array([TS]))[0]
    towards = np.array([1.0 - p[0, 0], -p[1, 0]]) * b / a2
    found, rng = [], np.random.default_rng(5)
    for _ in range(20):
        excitation, noise = 0.5 + 0.1 * prbs(rng, n + 1), 2e-3 * rng.normal(size=n + 1)
        state, x, v = np.array([0.5 * b / a2, 0.0]), np.empty(n + 1), np.empty(n + 1)
        for k in range(n + 1):
            v[k] = state[0] + noise[k]
            x[k] = excitation[k] - (2.0 * (v[k - 1] - 0.5 * b / a2) if k else 0.0)
            state = p @ state + towards * x[k]
        found.append(
            hc.identify(np.arange(n + 1) * TS, x, v, basis="constant", hold_out=0.0).parameters[:3]
        )
    found = np.array(found)
    error = np.abs(found.mean(axis=0) - [a1, a2, b])
    assert (error <= 3.0 * found.std(axis=0, ddof=1) / np.sqrt(20)).all()
    assert (error <= 0.01 * np.array([a1, a2, b])).all()


@pytest.fixture(scope="module")
def global_record(reference):
    """75 s over the whole stroke: levels of either sign, reversed near the ends, each with a random
    binary signal on top."""
    rng, n = np.random.default_rng(0), 75_001
    t, x, k, direction = np.arange(n) * TS, np.zeros(n), 0, 1.0
    state = hc.rest_state(reference, 0.25)
    v, y = [state.v], [state.y]
    while k < n - 1:
        direction = -1.0 if state.y > 0.47 else 1.0 if state.y < 0.03 else direction
        level = np.exp(rng.uniform(np.log(0.1), np.log(0.7)))
        room = (0.49 - state.y if direction > 0.0 else state.y - 0.01) / (0.16 * level)
        length = int(np.clip(min(rng.uniform(0.1, 0.4), room) / TS, 1, n - 1 - k))
        x[k : k + length] = direction * level * (1.0 + 0.4 * prbs(rng, length, 2, 14))
        motion = hc.simulate(reference, t[k : k + length + 1], x[k : k + length + 1], initial=state)
        state, k = motion.final, k + length
        v.extend(motion.v[1:])
        y.extend(motion.y[1:])
    return t, x, np.array(v), np.array(y)


def test_a_global_record_gives_a_surface_within_2_per_cent_where_it_is_excited(
    reference, global_record
):
    """With 5 % of noise."""
    t, x, v, y = global_record
    noisy = v + 0.05 * v.std() * np.random.default_rng(6).normal(size=len(v))
    result = hc.identify(t, x, noisy, y, basis="volume", actuator=reference, settling=0.2)
    for side, sign in (("+", 1.0), ("-", -1.0)):
        x, y = sign * np.linspace(0.05, 1.0, 39)[:, None], np.linspace(0.0, 0.5, 51)
        expected = truth(reference, x, y)
        x, y = np.broadcast_arrays(x, y)
        claimed = result.model.contains(x, y)
        assert claimed.mean() > 0.5, f"side {side}"
        for found, true in zip(
            result.model.evaluate(x[claimed], y[claimed]), expected, strict=True
        ):
            np.testing.assert_allclose(found, true[claimed], rtol=0.02)


def test_one_sign_only_is_stated_and_not_claimed(local_record):
    result = noisy_result(local_record, np.random.default_rng(8))
    assert list(result.model.surfaces) == ["+"]
    assert "no x < 0: the model says nothing about that side" in result.restrictions[0]
    assert not result.model.contains(-0.1, 0.12)
    np.testing.assert_allclose(
        result.standard_deviation(0.1, 0.12), np.sqrt(np.diag(result.covariance)[:3]), rtol=1e-12
    )


def test_a_record_too_noisy_for_any_claim_is_not_evaluated(local_record):
    t, x, v, y = local_record
    noisy = v + 2.0 * v.std() * np.random.default_rng(9).normal(size=len(v))
    result = hc.identify(t, x, noisy, y, basis="constant")
    assert "no cell of (x, y) is known to 1%" in result.restrictions[-1]
    with pytest.raises(hc.InputError, match=r"outside the region of the fit .*empty"):
        result.model.evaluate(0.1, 0.12)
    with pytest.raises(hc.InputError, match="not known in any cell"):
        result.model.nearest(0.1, 0.12)


def test_progress_is_reported(local_record):
    t, x, v, y = local_record
    seen = []
    hc.identify(
        t, x, v, y, basis="constant", progress=lambda iteration, fit: seen.append((iteration, fit))
    )
    assert [iteration for iteration, _ in seen] == list(range(1, len(seen) + 1))
    assert seen[-1][1] > 90.0


def test_instruments_are_the_derivatives_of_the_simulated_speed():
    """Against central differences of the simulation itself, for every parameter."""
    rng, n = np.random.default_rng(7), 400
    a1, a2, h = np.full(n, 150.0), np.full(n, 2.5e5), np.full(n, 2e-4)
    forcing = rng.normal(size=(n, 1))
    zero = np.zeros((2, 1))
    answer = respond(a1, a2, h, forcing, zero)[..., 0]
    v, dv = ((answer[1:] + answer[:-1]) / 2.0).T
    derivative = respond(a1, a2, h, np.stack([-dv, -v], axis=1), np.zeros((2, 2)))[:, 0]
    for k, (step_1, step_2) in enumerate(((0.1, 0.0), (0.0, 100.0))):
        high, low = (
            respond(a1 + s * step_1, a2 + s * step_2, h, forcing, zero)[:, 0, 0]
            for s in (1.0, -1.0)
        )
        expected = (high - low) / (2.0 * (step_1 + step_2))
        np.testing.assert_allclose(derivative[:, k], expected, atol=2e-2 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"method": "srvic"}, "method 'srvic' is unknown; did you mean 'srivc'"),
        ({"hold_out": 1.0}, "hold_out = 1.0 must be between 0 and 0.9"),
        ({"settling": -1.0}, "settling = -1.0 must be a time"),
        ({"settling": 10.0}, "leaves 0 of 3001 samples"),
        ({"basis": "volume"}, "needs the chamber volumes; give the actuator"),
        (
            {"basis": "quadratic", "hold_out": 0.0},
            "does not determine the basis: it says nothing about the term '[+] .*apart",
        ),
        ({"basis": "quadratic", "y": None}, "basis = 'quadratic' needs the position y"),
    ],
)
def test_bad_arguments_are_refused_with_the_way_out(local_record, arguments, message):
    t, x, v, y = local_record
    given = {"y": y, "basis": "constant"} | arguments
    with pytest.raises(hc.InputError, match=message):
        hc.identify(t, x, v, **given)


def test_a_side_that_appears_only_in_the_held_out_part_is_refused(local_record):
    t, x, v, _ = local_record
    with pytest.raises(hc.InputError, match="side '-' appears only in the held-out part"):
        hc.identify(t, np.where(t > 2.5, -x, x), v, basis="constant")


DATA = (
    Path(os.environ.get("HYDROCTL_DATA", Path(__file__).parents[3] / "data"))
    / "robot_arm_actuator.csv"
)


@pytest.fixture(scope="module")
def arm():
    """Measured opening (in units of the largest), pressure and position of a robot arm (Sjoberg et
    al., Automatica 31 (1995))."""
    if not DATA.is_file():
        pytest.skip(f"{DATA.name} is not there; name its directory in HYDROCTL_DATA")
    table = np.genfromtxt(DATA, delimiter=",", names=True)
    largest = np.abs(table["u_valve"]).max()
    return table["k"], table["u_valve"] / largest, table["p_pressure"], table["x_position"], largest


def test_measured_pressure_is_predicted_better_than_by_the_published_linear_model(arm):
    """Free run on the second half: the linear ARX(3,2,1) model has RMSE 1.014."""
    k, x, pressure, _, _ = arm
    result = hc.identify(k, x, pressure, basis="constant", hold_out=0.5)
    scale = np.std(pressure[512:])
    free_run, one_step = (
        (1.0 - fit / 100.0) * scale for fit in (result.fit.hold_out, result.fit.one_step)
    )
    assert free_run <= 1.05
    assert one_step < 0.15
    assert "y was not given" in result.restrictions[-1]


def test_measured_position_is_the_integral_of_the_opening(arm):
    """The gain from opening to the position's rate, mean of both directions, against the published
    slope of -0.0246."""
    k, x, _, position, largest = arm
    result = hc.identify(k[:-1], x[:-1], np.diff(position), basis="constant", hold_out=0.5)
    coefficients = [result.model.coefficients(side) for side in "+-"]
    gains = [float(rows["b"][0] / rows["a2"][0]) / largest for rows in coefficients]
    assert np.mean(gains) == pytest.approx(-0.0246, rel=0.05)
