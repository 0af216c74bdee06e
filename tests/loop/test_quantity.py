"""What a loop controls, as a value: the numbers that belong to each kind of loop."""

import ast
from pathlib import Path
from typing import get_args

import numpy as np
import pint
import pytest

import hydroctl as hc
from hydroctl.errors import InputError
from hydroctl.loop.quantity import LOOPS, POSITION, VELOCITY, LoopName, controlled_quantity
from hydroctl.loop.sampled_plant import sample

PACKAGE = Path(hc.__file__).parent
QUANTITIES = [controlled_quantity(loop) for loop in LOOPS]


def test_every_loop_that_a_user_can_name_has_a_quantity():
    assert get_args(LoopName) == LOOPS
    assert [quantity.loop for quantity in QUANTITIES] == list(LOOPS)


def test_an_unknown_loop_is_refused_with_the_nearest_name():
    with pytest.raises(InputError, match="loop 'positon' is unknown; did you mean 'position'"):
        controlled_quantity("positon")


@pytest.mark.parametrize("quantity", QUANTITIES, ids=LOOPS)
def test_the_units_of_the_gains_bring_the_quantity_to_a_valve_opening(quantity):
    """kp m, ki times m s and kd times m/s are openings, which have no unit."""
    ureg, units = pint.UnitRegistry(), quantity.gain_units
    m, second = ureg(quantity.unit), ureg("s")
    assert (ureg(units["kp"]) * m).dimensionless
    assert (ureg(units["ki"]) * m * second).dimensionless
    assert (ureg(units["kd"]) * m / second).dimensionless
    assert ureg(units["notch_frequency"]).check("1/[time]")
    assert ureg(quantity.integral_unit).units == (m * second).units


def test_the_position_is_the_integral_of_the_speed():
    """Sampled without delay, the position's model is the speed's with one more pole, at 1."""
    machine = hc.load_actuator("reference")
    family = hc.linearize(machine, hc.find_operating_points(machine, [0.3], 0.2))
    poles = {
        quantity.loop: np.linalg.eigvals(
            sample(family, loop=quantity.loop, sample_time=1e-3).transition
        )[0]
        for quantity in QUANTITIES
    }
    added = POSITION.integrations - VELOCITY.integrations
    assert len(poles["position"]) - len(poles["velocity"]) == added == 1
    at_one = [np.isclose(poles[loop], 1.0, atol=1e-9).sum() for loop in ("velocity", "position")]
    assert at_one == [0, 1]


def test_no_other_module_compares_the_name_of_a_loop():
    """A new kind of loop is a new value, not a new branch."""
    compared = []
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.Compare):
                sides = [node.left, *node.comparators]
                named = [side for side in sides if isinstance(side, ast.Constant)]
                if any(side.value in LOOPS for side in named):
                    compared.append(f"{path.name}:{node.lineno}")
    assert compared == []
