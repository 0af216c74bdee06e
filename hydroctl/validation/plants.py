"""The machines that a schedule is tried on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from ..errors import InputError, unknown_name
from ..machine.actuator import Actuator
from ..machine.variants import variants

if TYPE_CHECKING:
    from ..schedule.schedule import GainSchedule

NAMES = ("nominal", "design", "box")


def require_machine(actuator: object) -> None:
    """InputError for what has no nonlinear plant."""
    if not isinstance(actuator, Actuator):
        raise InputError(
            f"actuator = {type(actuator).__name__}: a validation moves the nonlinear plant, with"
            " its pressures, end stops and limits, which linear models do not have; give an"
            " Actuator."
        )


def plants_of(
    actuator: Actuator, schedule: GainSchedule, wanted: str | Mapping[str, Actuator]
) -> dict[str, Actuator]:
    """Machines by label, from their name or as given: "nominal" the machine alone; "design" those
    of the schedule's specification; "box" the nominal one and the eight corners of the box of
    `Specification`. Raises InputError.
    """
    if isinstance(wanted, Mapping):
        if not wanted or not all(isinstance(plant, Actuator) for plant in wanted.values()):
            raise InputError(
                "variants as a mapping must hold at least one Actuator by its label, and nothing"
                " else."
            )
        return dict(wanted)
    if wanted not in NAMES:
        raise InputError(unknown_name("variants", wanted, NAMES))
    if wanted == "nominal":
        return {"nominal": actuator}
    if wanted == "box":
        return variants(actuator, "box")
    return variants(
        actuator, schedule.specification.uncertainty, schedule.specification.added_plants
    )
