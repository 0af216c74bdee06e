"""Numbers with a verdict between them differ in print where they differ, in the order in which they
differ."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import hydroctl as hc
from hydroctl.digits import apart
from hydroctl.loop.margins import Loop
from hydroctl.model.operating_point import stall_force
from hydroctl.proof.margin_verdicts import margin_verdicts
from hydroctl.report.page import against_limit, page, shown_unit
from hydroctl.synchronization.coupling import CouplingEvidence
from hydroctl.testing import Disk, HalfPlane, assert_margins, assert_poles_in
from hydroctl.validation import Verdict, scale_of

FACTORS = (1.0, 1e-5, 1e3, 100.0, 180.0 / math.pi, 0.5 / math.pi)
LINE = re.compile(r"(pass|FAIL)  .*: (\S+) (<=|>=|<|>) (\S+)(?: (\S+))?  \((.*)\)")
HOLDS = {"<=": float.__le__, ">=": float.__ge__, "<": float.__lt__, ">": float.__gt__}


def numbers():
    return st.floats(-1e15, 1e15).filter(lambda value: value == 0.0 or abs(value) > 1e-15)


@st.composite
def pairs(draw):
    """Two numbers: any, or as near to each other as one to a million steps of the arithmetic."""
    one = draw(numbers())
    if draw(st.booleans()):
        return one, draw(numbers())
    near = one
    for _ in range(draw(st.integers(0, 3))):
        near = math.nextafter(near, draw(st.sampled_from([-math.inf, math.inf])))
    return draw(
        st.permutations(
            [one, near * (1.0 + draw(st.sampled_from([0.0, 1e-15, -1e-12, 1e-9, -1e-6])))]
        )
    )


def judged(achieved: float, limit: float, at_least: bool, unit: str) -> Verdict:
    passed = achieved >= limit if at_least else achieved <= limit
    return Verdict(
        "requirement", unit, "reason", limit, achieved, passed, "scenario", "variant", at_least
    )


def hair(value: float, direction: float) -> float:
    return math.nextafter(value, direction * math.inf)


def as_number(printed: str) -> float:
    """What the report prints, read back."""
    return float(printed.replace("−", "-").replace("∞", "inf"))


@given(pairs(), st.sampled_from(FACTORS), st.integers(3, 6))
def test_texts_differ_as_the_values_do_and_in_their_order(pair, factor, digits):
    one, other = apart(*pair, factor=factor, digits=digits)
    assert (float(one) < float(other)) == (pair[0] < pair[1])
    assert (one == other) == (pair[0] == pair[1])
    for text, value in zip((one, other), pair, strict=True):
        assert float(text) == pytest.approx(
            value * factor, rel=0.51 * 10.0 ** (1 - digits), abs=math.ulp(0.0)
        )


@pytest.mark.parametrize("factor", FACTORS[1:])
def test_neighbours_whose_products_are_one_number_are_still_told_apart(factor):
    """A product has no more digits than a factor: some neighbours among 1000 fall together."""
    ones = np.random.default_rng(7).uniform(1.0, 1e8, 1000).tolist()
    together = [(one, hair(one, 1.0)) for one in ones if one * factor == hair(one, 1.0) * factor]
    assert together
    for pair in together:
        lower, upper = map(float, apart(*pair, factor=factor))
        assert lower < upper


@given(st.lists(numbers(), min_size=1, max_size=5))
def test_any_count_of_values_keeps_its_order(values):
    order = np.argsort(values, kind="stable")
    texts = [float(text) for text in apart(*values)]
    assert list(np.argsort(texts, kind="stable")) == list(order)


@pytest.mark.parametrize(
    ("values", "texts"),
    [
        ((0.01, 0.02), ("0.01", "0.02")),
        ((0.01, 0.0100001), ("0.01", "0.0100001")),
        ((1.0, math.nextafter(1.0, 2.0)), ("1.0", "1.0000000000000002")),
        ((0.0, -0.0), ("0", "0")),
        ((math.inf, 1.5), ("inf", "1.5")),
        ((-math.inf, -math.inf), ("-inf", "-inf")),
        ((math.nan, 2.0), ("nan", "2")),
    ],
)
def test_no_more_digits_than_it_takes(values, texts):
    assert apart(*values, digits=4) == texts


@given(pairs(), st.booleans(), st.sampled_from(["", "s", "m/s", "Pa", "rad", "rad/s"]))
def test_a_verdict_prints_what_is_true_of_the_numbers_that_it_prints(pair, at_least, unit):
    verdict = judged(*pair, at_least, unit)
    if pair[0] == pair[1]:
        assert verdict.passed
        assert re.fullmatch(
            rf"pass  .*: \S+{' ' if unit else ''}{unit}, the limit  \(.*\)", str(verdict)
        )
        return
    word, achieved, sign, limit, printed, _ = LINE.fullmatch(str(verdict)).groups()
    assert HOLDS[sign](float(achieved), float(limit))
    assert (word == "pass") == verdict.passed == (sign in ("<=", ">="))
    assert achieved != limit
    assert (printed or "") == unit


@given(pairs(), st.booleans(), st.sampled_from(["", "1", "s", "Pa", "rad", "rad/s"]))
def test_a_row_of_the_report_does_so_in_the_unit_of_the_reader(pair, at_least, unit):
    verdict = judged(*pair, at_least, unit)
    reached, allowed = map(as_number, against_limit(verdict))
    assert verdict.passed == (reached >= allowed if at_least else reached <= allowed)
    assert (reached == allowed) == (pair[0] == pair[1])
    factor = {"Pa": 1e-5, "rad": 180.0 / math.pi, "rad/s": 0.5 / math.pi}.get(unit, 1.0)
    assert reached == pytest.approx(pair[0] * factor, rel=0.51e-3, abs=0.0)
    assert shown_unit(unit) == {"1": "", "Pa": "bar", "rad": "degrees", "rad/s": "Hz"}.get(
        unit, unit
    )


@pytest.fixture(scope="module")
def schedule(reference):
    return hc.tune(
        reference,
        [-1.0, 1.0],
        [0.0, 0.25, 0.5],
        specification=hc.Specification(uncertainty="nominal"),
    )


def test_a_design_that_fails_by_a_hair_says_so_in_every_output(reference, schedule):
    """Every requirement and every margin is set one step of the arithmetic, and 1e-9, on the wrong
    side of what is reached."""
    validation = hc.validate(reference, schedule)
    for step in (lambda value: hair(value, -1.0), lambda value: value - 1e-9 * abs(value)):
        missed = [
            replace(verdict, limit=step(verdict.achieved), passed=False)
            for verdict in (*margin_verdicts(schedule), *validation.verdicts)
            if verdict.achieved > 0.0
        ]
        assert len(missed) >= 6
        for verdict in missed:
            word, achieved, sign, limit, *_ = LINE.fullmatch(str(verdict)).groups()
            assert (word, sign) == ("FAIL", ">")
            assert float(achieved) > float(limit)
        rows = re.findall(
            r'fail</span></td>\s*<th scope="row">.*?</th>\s*<td class="number"><data'
            r' value="\S+">(\S+)</data></td>'
            r'\s*<td class="number">≤ <data value="\S+">(\S+)</data>',
            page(schedule, replace(validation, verdicts=tuple(missed))),
        )
        assert len(rows) == len(missed)
        assert all(as_number(reached) > as_number(allowed) for reached, allowed in rows)


def test_margins_that_a_users_test_misses_by_a_hair_are_told_apart(schedule):
    upper = {name: hair(schedule.margins.worst(name).value, -1.0) for name in ("Ms", "Mt")}
    lower = {
        name: hair(schedule.margins.worst(name).value, 1.0)
        for name in ("gain_margin", "phase_margin", "crossover")
    }
    with pytest.raises(AssertionError) as caught:
        assert_margins(schedule, **upper, **lower)
    told = re.findall(r"(\w+) is (\S+) at .*?: limit (\S+), off by", str(caught.value))
    assert [name for name, *_ in told] == [*upper, *lower]
    for name, reached, limit in told:
        assert float(reached) > float(limit) if name in upper else float(reached) < float(limit)


def test_a_pole_outside_by_a_hair_is_printed_outside(family, schedule):
    slowest = float(family.poles().real.max())
    for region in (HalfPlane(hair(slowest, -1.0)), HalfPlane(slowest - 1e-9 * abs(slowest))):
        with pytest.raises(AssertionError) as caught:
            assert_poles_in(family, region)
        assert complex(re.search(r"pole (\S+),", str(caught.value))[1]).real > region.right


def test_a_sampled_pole_outside_by_a_hair_is_printed_outside(reference, schedule):
    x, y = schedule.design_x, schedule.design_y
    plants = schedule.sampled_plants(x, y)
    largest = np.abs(
        Loop(plants, schedule.gains(x[:, None], y).broadcast_to(plants.shape)).poles()
    ).max()
    for radius in (hair(largest, -1.0), largest * (1.0 - 1e-9)):
        with pytest.raises(AssertionError) as caught:
            assert_poles_in(schedule, Disk(radius))
        assert abs(complex(re.search(r"pole (\S+),", str(caught.value))[1])) > radius


@pytest.mark.parametrize(
    ("Ms", "kept"), [(2.0, True), (2.002, True), (2.0000001, True), (hair(2.002, 1.0), False)]
)
def test_the_evidence_of_a_coupling_separates_what_it_reached_from_its_limit(Ms, kept):
    common = {
        "wanted_kc": 0.5,
        "wanted_ki": 40.0,
        "Ms_limit": 2.0,
        "Ms_uncoupled": 1.5,
        "cylinder": 0,
    }
    place = {"variant": "nominal", "x": 0.1, "y": 0.2}
    for pole, stable in ((0.9, True), (hair(1.0, -1.0), True), (1.0, False)):
        evidence = CouplingEvidence(Ms=Ms, largest_pole=pole, **common, **place)
        assert evidence.kept == (kept and stable)
        text = str(evidence)
        assert ("NOT KEPT" in text, "UNSTABLE" in text) == (not kept, not stable)
        reached = re.search(r"Ms = (\S+) of", text)[1]
        assert (float(reached) > 2.0) == (Ms > 2.0)
        assert (float(reached) > 2.002) == (Ms > 2.002)
        assert (float(re.search(r"group (\S+),", text)[1]) < 1.0) == stable


def refused(act) -> str:
    """What is said where `act` is refused."""
    with pytest.raises(hc.HydroctlError) as caught:
        act()
    return str(caught.value)


def crossover(actuator) -> float:
    """rad/s that the largest gains at the same point reach."""
    return hc.tune(actuator, [1.0], [0.2], specification=NOMINAL).margins.worst("crossover").value


NOMINAL = hc.Specification(uncertainty="nominal")
UP, DOWN = (lambda value: hair(value, 1.0)), (lambda value: hair(value, -1.0))
BY_A_HAIR = {
    "volume_b": (
        lambda a: a.replace(volume_b=DOWN(a.area_b * a.stroke)),
        r"volume_b = (\S+) m.* = (\S+) m\^3\)",
        float.__lt__,
    ),
    "pressures": (
        lambda a: a.replace(tank_pressure=UP(a.supply_pressure)),
        r"= (\S+) Pa is not below .* = (\S+) Pa",
        float.__gt__,
    ),
    "friction": (
        lambda a: a.replace(
            coulomb_friction=123.4, breakaway_friction=DOWN(123.4), stribeck_speed=0.01
        ),
        r"= (\S+) N is below .* = (\S+) N",
        float.__lt__,
    ),
    "a bound": (
        lambda a: a.replace(dead_band=UP(1.0)),
        r"dead_band = (\S+) must be below (\S+) ",
        float.__gt__,
    ),
    "stroke": (
        lambda a: hc.rest_state(a, UP(a.stroke)),
        r"y = (\S+) m is outside the stroke; give 0 to (\S+) m",
        float.__gt__,
    ),
    "stall force": (
        lambda a: hc.rest_state(a, load_force=UP(float(stall_force(a, 1.0)))),
        r"the load of (\S+) N .* and (\S+) N",
        float.__gt__,
    ),
    "sample time": (
        lambda a: hc.simulate_closed_loop(
            a,
            hc.tune(a, [1.0], [0.2], specification=NOMINAL),
            replace(hc.step_scenarios(a, "velocity")[0], Ts=1e-3 * (1.0 + 1e-9)),
        ),
        r"sampled every (\S+) s, the schedule every (\S+) s",
        float.__gt__,
    ),
    "stall force of a point": (
        lambda a: hc.find_operating_points(a, 1.0, 0.2, load_force=UP(float(stall_force(a, 1.0)))),
        r"the load of (\S+) N is at or beyond the stall force of (\S+) N",
        float.__gt__,
    ),
    "dead band": (
        lambda a: hc.find_operating_points(a.replace(dead_band=0.05), DOWN(0.05), 0.2),
        r"x=(\S+), y=.*dead band of (\S+), so",
        float.__lt__,
    ),
    "end of the stroke": (
        lambda a: hc.find_operating_points(a, 0.5, UP(a.stroke)),
        r"y=(\S+) m: .*0 to (\S+) m",
        float.__gt__,
    ),
    "full opening": (
        lambda a: hc.find_operating_points(a, UP(1.0), 0.2),
        r"x=(\S+), y=.* -1 and (1)\.",
        float.__gt__,
    ),
    "crossover": (
        lambda a: hc.tune(
            a, [1.0], [0.2], specification=replace(NOMINAL, min_crossover=UP(crossover(a)))
        ),
        r"cross over at (\S+) rad/s, below min_crossover = (\S+) ",
        float.__lt__,
    ),
    "longest sample time": (
        lambda a: hc.step_scenarios(a, "velocity", Ts=UP(scale_of(a, "velocity").settling / 20.0)),
        r"Ts = (\S+) must be a sample time between 0 and (\S+) s",
        float.__gt__,
    ),
    "valve opening": (
        lambda a: hc.simulate(a, [0.0, 0.1], UP(1.0)),
        r"x reaches (\S+) in size; a valve opening lies in \[-1, (1)\]",
        float.__gt__,
    ),
    "series form": (
        lambda a: hc.to_series(hc.StandardForm(1.0, DOWN(0.4), 0.1)),
        r"Ti = (\S+) s,.*4 Td = (\S+) s",
        float.__lt__,
    ),
}


@pytest.mark.parametrize("case", BY_A_HAIR)
def test_input_that_is_refused_by_a_hair_is_told_apart_from_its_bound(reference, case):
    act, pattern, relation = BY_A_HAIR[case]
    said = re.search(pattern, refused(lambda: act(reference)))
    assert relation(float(said[1]), float(said[2]))
