"""The machines that a schedule is tried on."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING

from ..actuator import Actuator
from ..errors import InputError, unknown_name
from ..specification import Specification, variants

if TYPE_CHECKING:
    from ..schedule import GainSchedule

NAMES = ("nominal", "design", "box")


def plants_of(actuator: Actuator, schedule: GainSchedule, wanted: str | Mapping[str, Actuator]) -> dict[str, Actuator]:
    """Machines by label, from their name or as given: "nominal" the machine alone; "design" those of the schedule's
    specification; "box" the nominal one and the eight corners of the box of `Specification`. Raises InputError.
    """
    if isinstance(wanted, Mapping):
        if not wanted or not all(isinstance(plant, Actuator) for plant in wanted.values()):
            raise InputError("variants as a mapping must hold at least one Actuator by its label, and nothing else.")
        return dict(wanted)
    if wanted not in NAMES:
        raise InputError(unknown_name("variants", wanted, NAMES))
    if wanted == "nominal":
        return {"nominal": actuator}
    return variants(actuator, schedule.specification if wanted == "design" else Specification(uncertainty="box"))
