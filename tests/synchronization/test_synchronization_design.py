"""Coupling gains: the loops of the differences by two routes, and the limit that they keep."""

import dataclasses

import numpy as np
import pytest
from groups import machines_of, pair, quartet, tuned

import hydroctl as hc
from hydroctl.errors import InputError
from hydroctl.loop.margins import Loop, analyse
from hydroctl.regulator.linear import series
from hydroctl.synchronization import Coupling, design_coupling
from hydroctl.synchronization.coupling import COUPLINGS, coupling_matrix
from hydroctl.synchronization.design import DifferenceLoop, group_poles


def loops_of(schedule, y=None):
    """The loops (1, nx, ny) at the design openings, and at the design positions or at y."""
    y = schedule.design_y if y is None else np.array([y])
    plants = schedule.sampled_plants(schedule.design_x, y)
    return Loop(plants, schedule.gains(schedule.design_x[:, None], y).broadcast_to(plants.shape))


def opened(loop):
    """(A, B, C, 0) from error to position."""
    A, B, C = loop.plant.state_space()
    return series(loop.regulators.state_space(), (A, B, C, np.zeros((1, 1))))


@pytest.mark.parametrize("count", [2, 3, 6, 7])
def test_eigenvalues_of_the_couplings_are_the_known_ones(count):
    mean, ring = (
        np.sort(np.linalg.eigvalsh(coupling_matrix(name, count))) for name in ("mean", "ring")
    )
    assert mean == pytest.approx(np.r_[0.0, np.ones(count - 1)], abs=1e-12)
    assert ring == pytest.approx(
        np.sort(1.0 - np.cos(2.0 * np.pi * np.arange(count) / count)), abs=1e-12
    )
    assert coupling_matrix("mean", count) @ np.ones(count) == pytest.approx(0.0, abs=1e-12)
    assert not coupling_matrix("independent", count).any()


def test_without_integral_the_difference_loop_is_the_loop_with_larger_gains():
    """(1 + kc) C for kc = 0.3, by scaling kp and ki of the regulators."""
    loop = loops_of(pair()[0])
    r = loop.regulators
    scaled = dataclasses.replace(r, kp=1.3 * r.kp, ki=1.3 * r.ki, kd=1.3 * r.kd)
    expected = analyse(Loop(loop.plant, scaled))
    found = analyse(DifferenceLoop(loop, np.full(loop.shape, 0.3), np.zeros(loop.shape)))
    for name in ("Ms", "Mt", "phase_margin", "gain_margin", "crossover"):
        assert getattr(found, name) == pytest.approx(getattr(expected, name), rel=1e-9), name


@pytest.mark.parametrize(
    ("name", "kc", "ki"),
    [("mean", 0.4, 30.0), ("ring", 0.3, 20.0), ("mean", 0.4, 0.0), ("master-slave", 1.0, 0.0)],
)
def test_poles_of_equal_coupled_cylinders_are_those_of_their_modes(name, kc, ki):
    """Four cylinders at once, against one loop for each eigenvalue."""
    loop = loops_of(pair()[1])
    matrix = coupling_matrix(name, 4)
    whole = group_poles(
        [opened(loop)] * 4, Coupling(name=name, matrix=matrix, kc=kc, ki=ki), loop.plant.sample_time
    )
    values = np.linalg.eigvals(matrix).real
    modes = [
        DifferenceLoop(
            loop,
            np.full(loop.shape, kc * value),
            np.full(loop.shape, ki * value if value > 1e-9 else 0.0),
        ).poles()
        for value in values
    ]
    separate = np.concatenate(modes, axis=-1)
    assert whole.shape == separate.shape
    # a pole that n equal loops share is known to the n-th root of the rounding error only;
    # coefficients do not suffer from that
    for z in (1.1, 0.3 + 0.8j, -0.7j):
        assert np.prod(z - whole, axis=-1) == pytest.approx(
            np.prod(z - separate, axis=-1), rel=1e-6
        )


@pytest.mark.parametrize("name", ["mean", "ring"])
@pytest.mark.parametrize("Ms", [1.7, 2.0])
def test_the_gains_are_the_largest_that_keep_the_limit(name, Ms):
    schedules = quartet()
    found = design_coupling(machines_of(schedules), schedules, name, kc=0.5, ki=40.0, Ms=Ms)
    evidence = found.evidence
    assert evidence.kept
    assert 0.995 * Ms <= evidence.Ms <= Ms
    assert found.ki / found.kc == pytest.approx(80.0)
    assert 0.0 < found.kc < 0.5

    def worst(factor):
        largest = 0.0
        for schedule in schedules:
            loop = loops_of(schedule)
            for value in {"mean": (1.0,), "ring": (1.0, 2.0)}[name]:
                kc, ki = (
                    np.full(loop.shape, factor * value * gain) for gain in (found.kc, found.ki)
                )
                largest = max(largest, analyse(DifferenceLoop(loop, kc, ki)).Ms.max())
        return largest

    assert worst(1.0) == pytest.approx(evidence.Ms, rel=1e-4)
    assert worst(1.02) > Ms
    named = schedules[evidence.cylinder]
    row, column = (
        np.flatnonzero(named.design_x == evidence.x)[0],
        np.flatnonzero(named.design_y == evidence.y)[0],
    )
    loop = loops_of(named)
    top = 1.0 if name == "mean" else 2.0
    there = analyse(
        DifferenceLoop(
            loop, np.full(loop.shape, top * found.kc), np.full(loop.shape, top * found.ki)
        )
    ).Ms[0, row, column]
    assert there == pytest.approx(evidence.Ms, rel=1e-4)


def test_wanted_gains_are_kept_where_the_limit_allows_them():
    schedules = pair()
    found = design_coupling(machines_of(schedules), schedules, "mean", kc=0.1, ki=2.0, Ms=2.0)
    assert (found.kc, found.ki) == (0.1, 2.0)
    assert found.evidence.Ms_uncoupled < found.evidence.Ms < 2.0


def test_plants_that_were_added_to_one_cylinder_count_for_its_differences_alone():
    """The poles of the group are those of the nominal cylinders; a plant of twice the supply raises
    Ms."""
    schedules = pair()
    harder = {"supply_pressure": 2.0 * schedules[0].actuator.supply_pressure}
    specification = dataclasses.replace(schedules[0].specification, added_plants=(harder,))
    added = [dataclasses.replace(schedules[0], specification=specification), schedules[1]]
    machines = machines_of(schedules)
    plain, found = (
        design_coupling(machines, some, "mean", kc=0.1, ki=2.0, Ms=4.0).evidence
        for some in (schedules, added)
    )
    assert found.largest_pole == plain.largest_pole
    assert found.Ms > 1.2 * plain.Ms
    assert (found.cylinder, found.variant) == (0, "supply_pressure +100 %")


def test_a_limit_below_the_uncoupled_loops_leaves_no_gain_and_says_so():
    schedules = pair()
    found = design_coupling(machines_of(schedules), schedules, "mean", Ms=1.5)
    assert (found.kc, found.ki) == (0.0, 0.0)
    assert not found.evidence.kept
    assert "NOT KEPT" in str(found.evidence)


def test_corners_of_the_specification_are_in_the_design():
    """The schedules of a design over the corners: the limit is kept on every plant, and one of the
    corners binds."""
    machine = hc.load_actuator("reference")
    asked = {
        "loop": "position",
        "structure": "pi+notch",
        "specification": hc.Specification(uncertainty="corners"),
    }
    schedule = hc.tune(machine, [-1.0, -0.1, 0.1, 1.0], [0.0, 0.25, 0.5], **asked)
    found = design_coupling([machine] * 2, [schedule] * 2, "mean")
    loop = loops_of(schedule)
    Ms = analyse(
        DifferenceLoop(loop, np.full(loop.shape, found.kc), np.full(loop.shape, found.ki))
    ).Ms
    assert Ms.max() == pytest.approx(found.evidence.Ms, rel=1e-4)
    assert Ms.max() <= 2.0
    assert found.evidence.variant != "nominal"


@pytest.mark.parametrize("name", COUPLINGS)
def test_designed_groups_are_stable_and_undesigned_gains_are_not(name):
    schedules = quartet()
    machines = machines_of(schedules)
    assert design_coupling(machines, schedules, name).evidence.largest_pole < 1.0
    cylinders = [opened(loops_of(schedule, y=0.25)) for schedule in schedules]
    wild = Coupling(name="mean", matrix=coupling_matrix("mean", 4), kc=5.0, ki=0.0)
    assert np.abs(group_poles(cylinders, wild, 1e-3)).max() > 1.0


def test_a_design_names_all_its_faults():
    schedules = pair()
    other = dataclasses.replace(
        schedules[1],
        specification=hc.Specification(
            uncertainty="nominal", set_point_weight=0.5, measurement_filter=1e-3
        ),
    )
    with pytest.raises(InputError) as caught:
        design_coupling(
            [*machines_of(schedules), schedules[0].actuator],
            [schedules[0], other],
            "ring",
            kc=-1.0,
            ki=np.nan,
            Ms=0.9,
        )
    assert len(caught.value.faults) == 6
    with pytest.raises(InputError, match="coupling 'men' is unknown"):
        design_coupling(machines_of(schedules), schedules, "men")


def test_master_slave_needs_no_gain_and_takes_any_law():
    schedule = tuned(1.2e9, 500.0, 46e6)
    weighted = dataclasses.replace(
        schedule, specification=hc.Specification(uncertainty="nominal", set_point_weight=0.5)
    )
    found = design_coupling([schedule.actuator] * 2, [weighted] * 2, "master-slave")
    assert (found.kc, found.ki) == (1.0, 0.0)
    assert found.evidence.Ms == found.evidence.Ms_uncoupled
