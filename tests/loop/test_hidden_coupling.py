"""The scheduled loop with the slopes of its own gains: against hand calculation, the frozen loops
and the nonlinear plant."""

from dataclasses import replace
from itertools import pairwise, product

import numpy as np
import pytest
from exports import exported
from loops import PlainRegulator

import hydroctl as hc
from hydroctl.loop.hidden_coupling import moving_poles
from hydroctl.loop.margins import Loop
from hydroctl.loop.quantity import POSITION
from hydroctl.proof.margin_verdicts import margin_verdicts
from hydroctl.schedule.schedule import check_coupling

X, Y = [-1.0, -0.02, 0.02, 1.0], [0.0, 0.25, 0.5]
AT = np.array([-0.4, 0.5]), np.array([0.1, 0.3])


@pytest.fixture(scope="module")
def schedules(reference):
    asked = {"loop": "position", "specification": hc.Specification(uncertainty="corners")}
    return {
        structure: hc.tune(reference, X, Y, structure=structure, **asked)
        for structure in ("p", "pi")
    }


def _poles(schedule, x, y, plants):
    speed = hc.find_operating_points(schedule.actuator, x[:, None], y).v
    return moving_poles(schedule.regulator, x, y, plants, speed)


def _weighted(schedule, b):
    return replace(schedule, specification=replace(schedule.specification, set_point_weight=b))


@pytest.mark.parametrize("structure", ["p", "pi+lead-lag", "pid+notch"])
@pytest.mark.parametrize(
    "settings",
    [{}, {"measurement_filter": 1e-3, "derivative_on": "measurement", "delay_samples": 1.4}],
)
def test_with_constant_gains_the_law_that_runs_has_the_poles_of_the_design_loop(
    reference, structure, settings
):
    """Beside them it has poles at 0."""
    specification = hc.Specification(uncertainty="nominal", **settings)
    fixed = hc.tune_fixed(
        reference, X, Y, loop="position", structure=structure, specification=specification
    )
    plants = fixed.sampled_plants(*AT, POSITION)
    found = _poles(fixed, *AT, plants)
    frozen = Loop(plants, fixed.gains(AT[0][:, None], AT[1]).broadcast_to(plants.shape)).poles()
    nearest = np.abs(frozen[..., :, None] - found[..., None, :]).min(axis=-1)
    assert nearest.max() < 1e-5
    for power in (1, 2):
        np.testing.assert_allclose(
            (found**power).sum(axis=-1), (frozen**power).sum(axis=-1), atol=1e-6
        )


def test_a_proportional_loop_feeds_its_command_back_through_the_slope_of_kp(schedules):
    """By hand: x = kp e, so that dx[k] = -kp dy[k] + (dkp/dx dx[k-1] + dkp/dy dy[k]) x_0/kp."""
    schedule = schedules["p"]
    steep = replace(
        schedule, kp=schedule.kp * (1.0 + 0.5 * np.abs(schedule.x)[:, None]) * (1.0 + schedule.y)
    )
    plants = steep.sampled_plants(*AT, POSITION)
    found = _poles(steep, *AT, plants)
    A, B, C = plants.state_space()
    for i, j in np.ndindex(2, 2):
        x, y, h = AT[0][i], AT[1][j], 1e-4
        kp = steep.gains(x, y).kp
        by_x, by_y = (steep.gains(x + h, y).kp - kp) / h, (steep.gains(x, y + h).kp - kp) / h
        back, straight = by_x * x / kp, by_y * x / kp - kp
        for k in range(len(A)):
            closed = np.block(
                [
                    [A[k, i, j] + B[k, i, j] * straight @ C, B[k, i, j] * back],
                    [straight * C, np.array([[back]])],
                ]
            )
            expected = np.linalg.eigvals(closed)
            assert np.abs(expected[:, None] - found[k, i, j]).min(axis=1).max() < 1e-5


LAWS = {
    "derivative of the measurement": {
        "loop": "position",
        "structure": "pid",
        "derivative_on": "measurement",
    },
    "derivative of the error": {"loop": "position", "structure": "pid"},
    "set-point weight": {"loop": "position", "structure": "pi", "set_point_weight": 0.8},
    "everything": {
        "loop": "position",
        "structure": "pid+lead-lag+notch",
        "derivative_on": "measurement",
        "set_point_weight": 0.9,
        "delay_samples": 1.4,
    },
    "no integral": {"loop": "position", "structure": "p+lead+notch"},
    "speed": {"loop": "velocity", "structure": "pid+notch", "derivative_on": "measurement"},
}


def _steep(schedule):
    """The schedule with gains that change by themselves and by half or more from node to node."""
    x, y = np.abs(schedule.x)[:, None], schedule.y
    return replace(
        schedule,
        kp=schedule.kp * (1.0 + 0.5 * x) * (1.0 + y),
        ki=schedule.ki * (1.0 + 0.3 * x) * (1.0 + 2.0 * y),
        kd=schedule.kd * (1.0 + 2.0 * x) * (1.0 + 4.0 * y),
        notch_frequency=schedule.notch_frequency * (1.0 + 0.2 * x) * (1.0 + 0.3 * y),
    )


class _SteadyMotion:
    """The plain regulator of tests/loops.py on a linear plant, around the motion in which it holds
    x."""

    def __init__(self, schedule, x, y):
        self.schedule, self.x, self.y = schedule, x, y
        plants = schedule.sampled_plants([x], [y], POSITION)
        spaces = plants.state_space()
        self.A, self.B, self.read_y = (part.reshape(part.shape[-2:]) for part in spaces)
        self.v = float(hc.find_operating_points(schedule.actuator, x, y).v)
        self.plain = PlainRegulator(schedule)
        self._hold()
        self.start = np.concatenate([np.zeros(len(self.A)), self._memory()])

    def _hold(self):
        """Give the regulator the memory that holds x. An integral leaves no error: the reference
        moves with the cylinder, or states its speed."""
        s, plain = self.schedule, self.plain
        plain.x = self.x
        kp, ki, kd, wn = plain.gains(self.y)
        m, rate = (self.y, self.v) if s.loop == "position" else (self.v, 0.0)
        self.reference = m if ki else (self.x / kp + m) / s.b
        plain.measured, plain.last = m, s.c * self.reference - m + (1.0 - s.c) * rate * s.Ts
        plain.derivative = -(1.0 - s.c) * rate
        plain.integral = self.x - kp * (s.b * self.reference - m) - kd * plain.derivative
        for _ in range(5000):
            plain.filtered(self.x, wn)

    @property
    def _used(self):
        """Whether the regulator has a derivative, an integral, and a notch."""
        return (
            bool(self.schedule.kd.any()),
            bool(self.schedule.ki.any()),
            self.schedule.zz != self.schedule.zp,
        )

    def _memory(self):
        plain, (derivative, integral, notch) = self.plain, self._used
        numbers = [*([plain.derivative, plain.last] * derivative), plain.measured, plain.x]
        numbers += [*np.ravel(plain.section_states), *([plain.integral] * integral)]
        return np.array([*numbers, *(plain.notch_states * notch)])

    def _recall(self, memory):
        plain, (derivative, integral, notch), numbers = (
            self.plain,
            self._used,
            iter(memory.tolist()),
        )
        plain.derivative, plain.last = (next(numbers), next(numbers)) if derivative else (0.0, 0.0)
        plain.measured, plain.x = next(numbers), next(numbers)
        plain.section_states = [[next(numbers)] for _ in plain.section_states]
        plain.integral = next(numbers) if integral else 0.0
        plain.notch_states = [next(numbers), next(numbers)] if notch else [0.0, 0.0]

    def after_a_sample(self, state):
        """The plant, as it is away from the motion, and the memory one sample later.

        The plant's third state is the speed.
        """
        z = state[: len(self.A)]
        self._recall(state[len(z) :])
        measured = 0.0, 0.0, self.v + z[2], self.y + (self.read_y @ z).item()
        command = self.plain.command(self.reference, 0.0, *measured)
        return np.concatenate([self.A @ z + self.B[:, 0] * (command - self.x), self._memory()])

    def poles(self, step=1e-6):
        """Eigenvalues of the central differences of `after_a_sample`."""
        steps = step * np.eye(self.start.size)
        above, below = (
            [self.after_a_sample(self.start + change) for change in each]
            for each in (steps, -steps)
        )
        return np.linalg.eigvals(np.subtract(above, below).T / (2.0 * step))


@pytest.mark.parametrize("law", LAWS)
def test_the_poles_are_those_of_a_plain_regulator_around_a_steady_motion(law):
    """Another law, another lookup, another steady state, linearized together with the plant:
    nothing is collected term by term."""
    steep = _steep(exported(**LAWS[law]))
    plants = steep.sampled_plants(*AT, POSITION)
    found = _poles(steep, *AT, plants)[0]
    for i, j in np.ndindex(2, 2):
        expected = _SteadyMotion(steep, AT[0][i], AT[1][j]).poles()
        for power in (1, 2, 3):
            assert (expected**power).sum() == pytest.approx((found[i, j] ** power).sum(), abs=1e-5)
        assert np.abs(found[i, j][:, None] - expected).min(axis=1).max() < 1e-4


def _middles(nodes):
    return np.array([(a + b) / 2.0 for a, b in pairwise(nodes) if a * b >= 0.0])


def test_a_loop_that_is_unstable_only_at_the_edges_of_its_cells_along_x_is_found():
    """kp falls along a cell from 100 to 30. The command comes back by x dkp/dx / kp, which in the
    middle is 0.66 and at the outer edge 2.6: a pole of that size."""
    falling = np.array([30.0, 100.0, 100.0, 30.0])[:, None] * np.ones(3)
    schedule = replace(exported(loop="position", structure="p"), kp=falling)
    middles = _middles(schedule.x), _middles(schedule.y)
    plants = schedule.sampled_plants(*middles, POSITION)
    assert np.abs(_poles(schedule, *middles, plants)).max() < 1.0
    coupled = check_coupling(schedule)
    size, _, x, _ = coupled.worst
    slope = 70.0 / 0.9
    assert size == pytest.approx(slope * abs(x) / (30.0 + slope * (1.0 - abs(x))), rel=0.01)
    unstable = (coupled.pole_size >= 1.0).any(axis=(0, 2))
    assert set(coupled.x[unstable].round(2)) == {-1.0, 1.0}
    assert coupled.unstable == 2 * coupled.y.size


def test_a_loop_that_is_unstable_only_at_the_edges_of_its_cells_along_y_is_found():
    """kp = 4 at a node and 14 at its neighbours. A rise of y closes the valve by kp and opens it by
    x_0 dkp/dy / kp: the position runs away where the latter is more. It is next to the node only,
    on that side of it whose slope has the sign of x."""
    dipped = np.array([14.0, 4.0, 14.0]) * np.ones((4, 1))
    schedule = replace(exported(loop="position", structure="p"), kp=dipped)
    middles = _middles(schedule.x), _middles(schedule.y)
    plants = schedule.sampled_plants(*middles, POSITION)
    assert np.abs(_poles(schedule, *middles, plants)).max() < 1.0
    coupled = check_coupling(schedule)
    slope = np.where(coupled.y < 0.2, -10.0 / 0.2, 10.0 / 0.3)
    expected = coupled.x[:, None] * slope > schedule.gains(coupled.x[:, None], coupled.y).kp ** 2
    np.testing.assert_array_equal(coupled.pole_size[0] >= 1.0, expected)
    assert 0 < coupled.unstable == np.count_nonzero(expected)
    assert set(coupled.y[expected.any(axis=0)].round(3)) == {0.2}


def test_a_node_without_a_neighbour_on_its_side_is_looked_at_itself():
    """As above, where x_0 dkp/dy = 0.5 x 50 and 0.5 x 33 are more than 4^2; on the other side is a
    cell."""
    base = exported(loop="position", structure="p")
    rows = np.array([0, 2, 3])
    tables = {name: getattr(base, name)[rows] for name in ("ki", "kd", "notch_frequency")}
    dipped = np.array([14.0, 4.0, 14.0]) * np.ones((3, 1))
    for x in (np.array([-0.5, 0.1, 0.2]), np.array([-0.2, -0.1, 0.5])):
        coupled = check_coupling(replace(base, x=x, kp=dipped, **tables))
        assert coupled.x.size == 1 + 3
        assert coupled.unstable == 1
        assert abs(coupled.worst[2]) == pytest.approx(0.5, rel=2e-3)


def test_every_plant_of_the_specification_is_looked_at_as_if_it_were_the_machine():
    schedule = _steep(exported(loop="position", structure="pi"))
    box = {"mass": (0.5, 1.5), "bulk_modulus": (0.7, 1.3)}
    asked = replace(schedule, specification=replace(schedule.specification, uncertainty=box))
    coupled, machine = check_coupling(asked), schedule.actuator
    assert coupled.variants[0] == "nominal"
    for found, factors in zip(
        coupled.pole_size, [(1.0, 1.0), *product(*box.values())], strict=True
    ):
        changes = {
            name: factor * getattr(machine, name) for name, factor in zip(box, factors, strict=True)
        }
        alone = check_coupling(replace(schedule, actuator=machine.replace(**changes)))
        np.testing.assert_allclose(found, alone.pole_size[0], rtol=1e-9)


def test_tuned_schedules_are_stable_with_the_slopes_of_their_gains(schedules):
    for schedule in schedules.values():
        verdicts = {verdict.name: verdict for verdict in margin_verdicts(schedule)}
        assert verdicts["unstable loops through hidden coupling"].passed
        assert check_coupling(schedule).unstable == 0


def test_a_set_point_weight_makes_a_loop_scheduled_on_x_oscillate(schedules):
    """The frozen loops do not know the weight; the coupled ones, and the nonlinear plant, do."""
    quiet, weighted = schedules["pi"], _weighted(schedules["pi"], 0.5)
    assert weighted.margins.unstable == 0
    coupled = check_coupling(weighted)
    size, variant, *_ = coupled.worst
    assert coupled.unstable > 0
    assert size > 1.0
    assert variant in coupled.variants
    assert not {v.name: v.passed for v in margin_verdicts(weighted)}[
        "unstable loops through hidden coupling"
    ]
    reference = np.where(np.arange(400) < 20, 0.45, 0.451)
    scenario = hc.Scenario(
        name="step of 1 mm",
        loop="position",
        Ts=1e-3,
        y=0.45,
        reference=reference,
        v_ref=np.zeros(400),
    )
    late = {
        name: _unrest(each, scenario) for name, each in (("quiet", quiet), ("weighted", weighted))
    }
    assert late["weighted"] > 20.0 * late["quiet"]


def _unrest(schedule, scenario):
    """The spread of the command in the last tenth of a second."""
    return float(np.ptp(hc.simulate_closed_loop(schedule.actuator, schedule, scenario).x[-100:]))


def test_the_combination_is_refused_with_its_reason_and_allowed_where_it_is_clean(reference):
    weighted = hc.Specification(uncertainty="nominal", set_point_weight=0.5)
    with pytest.raises(
        hc.InputError, match=r"set_point_weight = 0.5 with kp scheduled on x: .* tune_fixed"
    ):
        hc.tune(reference, X, Y, loop="position", specification=weighted)
    along_y = hc.tune(reference, [0.5], Y, loop="position", specification=weighted)
    fixed = hc.tune_fixed(reference, X, Y, loop="position", specification=weighted)
    velocity = hc.tune(reference, X, Y, specification=weighted)
    assert [check_coupling(schedule).unstable for schedule in (along_y, fixed, velocity)] == [
        0,
        0,
        0,
    ]
