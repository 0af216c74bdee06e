"""Designs for all plants of a box: the search finds the worst of them, and what is tuned holds
there.

The plants here are machines with other parameters, linearized and sampled one by one, apart from
the search's own sample and climb. At full size (HYDROCTL_LONG=1) every shipped machine, both loops,
three structures, the default points and 2000 plants.
"""

import itertools
import os
from dataclasses import replace

import numpy as np
import oracle
import pytest
from scipy.optimize import minimize

import hydroctl as hc
from hydroctl.loop.margins import Loop, analyse, peaks
from hydroctl.loop.points import with_midpoints
from hydroctl.loop.sampled_plant import SampledFamily, sample
from hydroctl.machine.variants import box_of
from hydroctl.proof.margin_verdicts import margin_verdicts
from hydroctl.tuning import default_points
from hydroctl.tuning.box import search_box

LONG = os.environ.get("HYDROCTL_LONG") == "1"
LOOPS, STRUCTURES = ("velocity", "position"), ("pi", "pi+notch", "pid+notch")
FULL = list(itertools.product(hc.list_actuators(), LOOPS, STRUCTURES))
CASES = FULL if LONG else [("differential_100_56", "velocity", "pi+notch")]
PLANTS = 2000 if LONG else 200
HALVES = {"bulk_modulus": 0.3, "mass": 0.5, "supply_pressure": 0.2}
X, Y = [-1.0, -0.02, 0.02, 1.0], [0.0, 0.5, 1.0]
AT_ONCE = 20
EVERY = 3


@pytest.fixture(scope="module")
def machine():
    """The one whose design for the corners is worst between them."""
    return hc.load_actuator("differential_100_56")


@pytest.fixture(scope="module")
def for_corners(machine):
    """A design for the corners, which states the whole box."""
    made = hc.tune(
        machine, X, Y, structure="pi+notch", specification=hc.Specification(uncertainty="corners")
    )
    return replace(made, specification=replace(made.specification, uncertainty="box"))


@pytest.fixture(scope="module")
def for_the_box(machine):
    return hc.tune(machine, X, Y, structure="pi+notch")


def loops_on(schedule, changes, x, y):
    """The sampled loops (plants, x, y) of the machines that differ by `changes`."""
    specification, families = schedule.specification, []
    for change in changes:
        changed = schedule.actuator.replace(**change)
        family = hc.linearize(changed, hc.find_operating_points(changed, np.reshape(x, (-1, 1)), y))
        delay = {
            "sample_time": specification.sample_time,
            "delay_samples": specification.delay_samples,
        }
        families.append(sample(family, loop=schedule.loop, **delay))
    plants = SampledFamily.stack(families)
    return Loop(plants, schedule.gains(np.reshape(x, (-1, 1)), y).broadcast_to(plants.shape))


def random_plants(machine, box, count, seed):
    """Changes that are evenly distributed over `box`, {parameter: (low, high)}."""
    shares = np.random.default_rng(seed).uniform(size=(count, len(box)))
    return [
        {
            name: low + at * (high - low)
            for (name, (low, high)), at in zip(box.items(), row, strict=True)
        }
        for row in shares
    ]


def expected_box(machine):
    return {
        name: (getattr(machine, name) * (1 - half), getattr(machine, name) * (1 + half))
        for name, half in HALVES.items()
    }


def worst_of(schedule, changes):
    """((Ms, change, x, y), (Mt, change, x, y)) at the design points and half-way, where all loops
    must be stable.

    Every third position, from another one for each lot of plants.
    """
    x, y = with_midpoints(schedule.design_x), with_midpoints(schedule.design_y)
    best = [(0.0, None, 0.0, 0.0)] * 2
    for lot in range(0, len(changes), AT_ONCE):
        some, columns = changes[lot : lot + AT_ONCE], y[lot // AT_ONCE % EVERY % y.size :: EVERY]
        loops = loops_on(schedule, some, x, columns)
        assert np.abs(loops.poles()).max() < 1.0
        found = peaks(loops, [lambda L: 1.0 / np.abs(1.0 + L), lambda L: np.abs(L / (1.0 + L))])[0]
        for limit in range(2):
            k, i, j = np.unravel_index(np.argmax(found[..., limit]), loops.shape)
            best[limit] = max(
                best[limit],
                (found[k, i, j, limit], some[k], x[i], columns[j]),
                key=lambda place: place[0],
            )
    return best


def climbed(schedule, box, place, name):
    """The largest margin `name` that Nelder-Mead finds in the box at the place from its plant
    on."""
    _, change, x, y = place
    low, high = (np.array([ends[side] for ends in box.values()]) for side in (0, 1))

    def negative(shares):
        plant = dict(zip(box, low + shares * (high - low), strict=True))
        return -getattr(analyse(loops_on(schedule, [plant], [x], [y])), name).item()

    start = (np.array(list(change.values())) - low) / (high - low)
    options = {"maxfev": 80, "xatol": 1e-3, "fatol": 1e-5}
    return -minimize(
        negative, start, method="Nelder-Mead", bounds=[(0.0, 1.0)] * len(box), options=options
    ).fun


def test_the_box_is_that_of_the_documentation(machine):
    found = box_of(machine, hc.Specification().uncertainty)
    assert found == pytest.approx(
        {name: pytest.approx(ends) for name, ends in expected_box(machine).items()}
    )


def test_a_design_for_the_corners_is_worst_between_them_where_it_is_known_to_be(
    machine, for_corners
):
    """Bulk modulus up, mass near its own, supply up: there the natural frequency is half-way
    between those of the corners."""
    found = search_box(for_corners)
    plant = {name: value / getattr(machine, name) - 1.0 for name, value in found.worse[0].items()}
    assert found.worst["Ms"].value == pytest.approx(1.85, abs=0.03)
    assert plant["bulk_modulus"] > 0.2
    assert abs(plant["mass"]) < 0.25
    assert plant["supply_pressure"] > 0.14


def test_the_worst_that_is_found_is_what_the_oracle_finds_there(machine, for_corners):
    found = search_box(for_corners)
    at = found.worst["Ms"]
    changed = machine.replace(**found.worse[0])
    family, gains = (
        hc.linearize(changed, hc.find_operating_points(changed, at.x, at.y)),
        for_corners.gains(at.x, at.y),
    )
    plant = oracle.sampled(
        *oracle.continuous(changed, family.A, family.B, "velocity"),
        for_corners.Ts,
        for_corners.delay_samples,
    )
    law = {name: float(getattr(gains, name)) for name in ("kp", "ki", "kd")} | {
        "Tf": for_corners.Tf
    }
    notch = float(gains.notch_frequency), for_corners.zz, for_corners.zp
    assert oracle.margins(plant, for_corners.Ts, law | {"notch": notch}).Ms == pytest.approx(
        at.value, rel=1e-6
    )


def test_the_search_finds_at_least_the_worst_of_random_plants(machine, for_corners):
    found = search_box(for_corners).worst
    Ms, Mt = worst_of(for_corners, random_plants(machine, expected_box(machine), 300, seed=1))
    assert Ms[0] > 1.62, "there is something to find"
    assert found["Ms"].value >= Ms[0]
    assert found["Mt"].value >= Mt[0] * (1.0 - 1e-9)


def test_the_search_finds_at_least_the_worst_of_a_grid_where_it_is_worst(machine, for_corners):
    found = search_box(for_corners).worst["Ms"]
    axes = [
        np.linspace(*ends, count)
        for ends, count in zip(expected_box(machine).values(), (9, 9, 5), strict=True)
    ]
    plants = [dict(zip(HALVES, values, strict=True)) for values in itertools.product(*axes)]
    assert found.value >= analyse(loops_on(for_corners, plants, [found.x], [found.y])).Ms.max()


def boxed(case):
    """The design of `case` for the default box: at all default points, or at few of them."""
    name, loop, structure = case
    machine = hc.load_actuator(name)
    x, y = default_points(machine) if LONG else (X, [share * machine.stroke for share in Y])
    return hc.tune(machine, x, y, loop=loop, structure=structure)


@pytest.mark.long
@pytest.mark.parametrize("case", CASES, ids=" ".join)
def test_a_design_holds_on_random_plants_of_its_box_and_uphill_from_the_worst(
    case, record_property
):
    schedule = boxed(case)
    box = expected_box(schedule.actuator)
    worst = worst_of(schedule, random_plants(schedule.actuator, box, PLANTS, seed=2))
    for name, limit, place in zip(("Ms", "Mt"), (1.62, 1.32), worst, strict=True):
        top = climbed(schedule, box, place, name)
        record_property(f"largest {name}", float(top))
        assert max(top, place[0]) <= limit


@pytest.mark.parametrize(
    "verb",
    [hc.tune_fixed, lambda *at, **asked: hc.tune_fast(*at, **asked).schedule],
    ids=["fixed", "fast"],
)
@pytest.mark.parametrize("loop", LOOPS)
def test_one_regulator_and_gains_by_formula_hold_on_the_whole_box_too(machine, verb, loop):
    """At the design points: neither puts points between them. What is tolerated there is a fifth of
    0.02."""
    schedule = verb(machine, [-0.02, 0.02], [0.5, 0.75], loop=loop)
    plants = random_plants(machine, expected_box(machine), 60, seed=3)
    found = analyse(loops_on(schedule, plants, schedule.design_x, schedule.design_y))
    assert found.stable.all()
    assert found.Ms.max() <= 1.605
    assert found.Mt.max() <= 1.305


def test_a_fast_design_for_the_nominal_plant_does_not_hold_on_the_box(machine):
    """The test above can fail."""
    nominal = hc.Specification(uncertainty="nominal")
    schedule = hc.tune_fast(machine, [-0.02, 0.02], [0.5, 0.75], specification=nominal).schedule
    plants = random_plants(machine, expected_box(machine), 60, seed=3)
    assert analyse(loops_on(schedule, plants, schedule.design_x, schedule.design_y)).Ms.max() > 1.7


@pytest.mark.parametrize("uncertainty", ["nominal", "corners", "one-at-a-time"])
def test_plants_that_are_counted_are_not_searched_for_others(machine, uncertainty):
    schedule = hc.tune(
        machine, [0.5], [0.5], specification=hc.Specification(uncertainty=uncertainty)
    )
    assert schedule.specification.added_plants == ()
    assert not any("whole box" in verdict.name for verdict in margin_verdicts(schedule))
    with pytest.raises(hc.InputError, match=f"uncertainty = '{uncertainty}' counts its plants"):
        search_box(schedule)


def test_the_verdicts_on_a_box_say_what_the_search_found(for_corners, for_the_box):
    missed, kept = (
        {
            verdict.name: verdict
            for verdict in margin_verdicts(schedule)
            if "whole box" in verdict.name
        }
        for schedule in (for_corners, for_the_box)
    )
    assert (
        set(missed)
        == set(kept)
        == {"Ms on the whole box (searched)", "Mt on the whole box (searched)"}
    )
    assert all(verdict.passed for verdict in kept.values())
    verdict = missed["Ms on the whole box (searched)"]
    assert not verdict.passed
    assert verdict.achieved == search_box(for_corners).worst["Ms"].value


def test_added_plants_survive_the_file_with_the_margins_on_them(for_the_box, tmp_path):
    again = hc.load_schedule(for_the_box.save(tmp_path / "schedule.json"))
    added = for_the_box.specification.added_plants
    assert len(added) > 0
    assert again.specification.added_plants == added
    assert again.margins.variants == for_the_box.margins.variants
    assert len(again.margins.variants) == 1 + 2**3 + len(added)
    np.testing.assert_array_equal(again.margins.margins.Ms, for_the_box.margins.margins.Ms)


@pytest.mark.parametrize(
    ("stated", "box"),
    [
        ({"mass": (0.6, 1.4)}, lambda machine: {"mass": (0.6 * machine.mass, 1.4 * machine.mass)}),
        (
            {"load_force": ("-5 kN", "20 kN"), "mass": (0.7, 1.2)},
            lambda machine: {
                "load_force": (-5e3, 2e4),
                "mass": (0.7 * machine.mass, 1.2 * machine.mass),
            },
        ),
    ],
    ids=["mass", "load and mass"],
)
def test_ranges_of_ones_own_are_searched(machine, stated, box):
    """Of a design for the nominal plant at least the worst of a grid of plants is found; a design
    for the ranges holds on them."""
    asked = hc.Specification(uncertainty=stated)
    points = machine, [-0.02, 0.02], [0.5, 0.75]
    nominal = hc.tune(
        *points, structure="pi+notch", specification=replace(asked, uncertainty="nominal")
    )
    made = hc.tune(*points, structure="pi+notch", specification=asked)
    found = search_box(
        replace(nominal, specification=replace(nominal.specification, uncertainty=stated))
    ).worst["Ms"]
    axes = [np.linspace(*ends, 21 if len(stated) == 1 else 11) for ends in box(machine).values()]
    plants = [dict(zip(stated, values, strict=True)) for values in itertools.product(*axes)]
    assert found.value > 1.62
    assert found.value >= analyse(loops_on(nominal, plants, [found.x], [found.y])).Ms.max()
    Ms, Mt = worst_of(made, plants)
    assert Ms[0] <= 1.62
    assert Mt[0] <= 1.32


def test_the_search_and_the_design_are_deterministic(machine, for_corners, for_the_box):
    assert search_box(replace(for_corners)) == search_box(for_corners)
    again = hc.tune(machine, X, Y, structure="pi+notch")
    assert again.specification == for_the_box.specification
    for name in ("x", "y", "design_x", "design_y", "kp", "ki", "kd"):
        np.testing.assert_array_equal(getattr(again, name), getattr(for_the_box, name))
