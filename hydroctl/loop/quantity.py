"""What a loop controls: the speed or the position of the cylinder, as values.

Whatever depends on the kind of loop asks its `ControlledQuantity`; a new kind of loop is a new one
in the table below.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Literal

from ..errors import InputError, unknown_name
from ..regulator.units import GAIN_UNITS, MEASURED_UNITS

LoopName = Literal["velocity", "position"]


@dataclass(frozen=True, eq=False, kw_only=True)
class ControlledQuantity:
    """The quantity m that a loop measures and controls."""

    loop: LoopName
    """what a user calls the loop"""
    signal: Literal["v", "y"]
    """its name among the signals that a regulator and a trajectory have"""
    word: str
    """what it is called: "speed", "position\""""
    unit: str
    """of m and of its reference"""
    integral_unit: str
    """of m times a time, as an integral of |error|"""
    gain_units: Mapping[str, str]
    """of kp, ki, kd and notch_frequency, in this order"""
    integrations: Literal[0, 1]
    """integrators from the speed to m: 0 leaves the position free, a pole at 1 of the loop"""
    notch_damping: tuple[float, float]
    """(zz, zp) of a notch for which nothing else is stated"""
    formula_structure: str
    """the structure whose gains `tune_fast` has formulas for"""
    settling: float
    """time constants of the machine in which a step must have settled"""
    step: Callable[[float, float], float]
    """natural step, in `unit`, from the lower full speed in m/s and the stroke in m"""

    @property
    def label(self) -> str:
        """As it stands at an axis: "speed v (m/s)"."""
        return f"{self.word} {self.signal} ({self.unit})"

    @property
    def is_speed(self) -> bool:
        """Whether the reference is itself the speed that a feed-forward would need."""
        return self.integrations == 0


VELOCITY = ControlledQuantity(
    loop="velocity",
    signal="v",
    word="speed",
    unit=MEASURED_UNITS["v"],
    integral_unit="m",
    gain_units=GAIN_UNITS["v"],
    integrations=0,
    notch_damping=(0.12, 0.75),
    formula_structure="pid",
    settling=40.0,
    step=lambda full_speed, _: full_speed / 3.0,
)
POSITION = ControlledQuantity(
    loop="position",
    signal="y",
    word="position",
    unit=MEASURED_UNITS["y"],
    integral_unit="m*s",
    gain_units=GAIN_UNITS["y"],
    integrations=1,
    notch_damping=(0.2, 0.6),
    formula_structure="p+notch",
    settling=80.0,
    step=lambda _, stroke: 0.02 * stroke,
)
_BY_LOOP = {quantity.loop: quantity for quantity in (VELOCITY, POSITION)}
LOOPS = tuple(_BY_LOOP)


def controlled_quantity(loop: str) -> ControlledQuantity:
    """What the `loop` of that name controls. Raises InputError with the nearest known name."""
    if loop not in _BY_LOOP:
        raise InputError(unknown_name("loop", loop, LOOPS))
    return _BY_LOOP[loop]
