"""The linear plants of a machine: its own, at any operating point, and those that it varies by."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property, lru_cache
from typing import TypeAlias

import numpy as np

from ..errors import InputError
from ..machine.actuator import Actuator
from ..machine.variants import Ends, box_of, changed_plants, counted_changes, variant_label
from ..model.linearization import linearize
from ..model.operating_point import find_operating_points
from .plant_family import Box, Change, PlantFamily, SpeedGains
from .quantity import ControlledQuantity
from .sampled_plant import SampledFamily, sample

_Hashable: TypeAlias = "str | tuple[tuple[str, Ends], ...]"
_LOW_FLOW = 0.1
_FAMILIES = 4
"""of equal machines and variants, that share what was sampled"""


@dataclass(frozen=True, eq=False)
class MachinePlants(PlantFamily):
    """Tangent models of `machines` wherever they have operating points."""

    actuator: Actuator
    uncertainty: str | Mapping[str, Ends]
    """as in `Specification`"""
    changes: tuple[Change, ...]
    machines: Mapping[str, Actuator]
    """by label"""

    @property
    def labels(self) -> tuple[str, ...]:
        return tuple(self.machines)

    @property
    def grid(self) -> None:
        return None

    def defined(self, x, y) -> np.ndarray:
        return np.ones((np.size(x), np.size(y)), dtype=bool)

    def nearest(self, x, y) -> tuple[np.ndarray, np.ndarray]:
        return np.asarray(x, dtype=float), np.asarray(y, dtype=float)

    def _sampled(
        self, x: np.ndarray, y: np.ndarray, quantity: ControlledQuantity, Ts: float, delay: float
    ) -> SampledFamily:
        families = []
        for label, machine in self.machines.items():
            points = find_operating_points(machine, x[:, None], y)
            if not points.feasible.all():
                raise InputError(f"{label} plant: {points.reason[~points.feasible][0]}")
            family = linearize(machine, points)
            families.append(sample(family, loop=quantity.loop, sample_time=Ts, delay_samples=delay))
        return SampledFamily.stack(families)

    @property
    def knows_speed(self) -> bool:
        return True

    def speed(self, x, y) -> np.ndarray:
        return find_operating_points(self.actuator, np.asarray(x)[:, None], y).v

    def speed_gains(self) -> SpeedGains:
        """Through the operating points at a tenth of the flow and at full flow, at mid stroke."""
        machine = self.actuator
        low = machine.dead_band + _LOW_FLOW * (1.0 - machine.dead_band)
        openings = np.array([-1.0, -low, low, 1.0])
        points = find_operating_points(machine, openings, machine.stroke / 2.0)
        if not points.feasible.all():
            reason = points.reason[~points.feasible][0]
            raise InputError(
                "the feed-forward needs motion at full and at a tenth of the flow, either way: "
                f"{reason}"
            )
        x, v = points.x, points.v
        retract, extend = (v[1] - v[0]) / (x[1] - x[0]), (v[3] - v[2]) / (x[3] - x[2])
        return SpeedGains(
            gain_extend=float(extend),
            gain_retract=float(retract),
            offset_extend=float(x[2] - v[2] / extend),
            offset_retract=float(x[1] - v[1] / retract),
        )

    def pressure_drops(self, x) -> np.ndarray:
        machine, x = self.actuator, np.asarray(x, float)
        middles = [
            np.median(side) if (side := x[sign * x > 0.0]).size else sign for sign in (-1.0, 1.0)
        ]
        points = find_operating_points(machine, middles, machine.stroke / 2.0)
        if not points.feasible.all():
            reason = points.reason[~points.feasible][0]
            raise InputError(f"pressure_compensation needs a motion either way: {reason}")
        supply, tank = machine.supply_pressure, machine.tank_pressure
        (retract_a, extend_a), (retract_b, extend_b) = points.p_a, points.p_b
        return np.array(
            [[retract_a - tank, supply - retract_b], [supply - extend_a, extend_b - tank]]
        )

    @property
    def added_plants(self) -> tuple[Change, ...]:
        counted = counted_changes(self.actuator, self.uncertainty)
        return tuple(change for change in self.changes if change not in counted)

    @property
    def box(self) -> Box | None:
        return _box(self.actuator, _hashable(self.uncertainty))

    @cached_property
    def without_corners(self) -> MachinePlants:
        if self.box is None:
            return self
        return _family(self.actuator, self.uncertainty, self.added_plants)

    def varied(self, changes: Sequence[Change]) -> MachinePlants:
        return _family(self.actuator, self.uncertainty, (*self.changes, *changes))


def machine_plants(
    actuator: Actuator,
    uncertainty: str | Mapping[str, Ends] = "nominal",
    added_plants: Sequence[Change] = (),
) -> MachinePlants:
    """The nominal plant, those at the ends of what `uncertainty` states, then `added_plants`; the
    same object for equal arguments.

    Raises InputError for an uncertainty that varies nothing, and for values that no actuator can
    have.
    """
    added = tuple(tuple(change.items()) for change in added_plants)
    return _shared(actuator, _hashable(uncertainty), added)


@lru_cache(maxsize=_FAMILIES)
def _shared(actuator: Actuator, uncertainty: _Hashable, added: tuple) -> MachinePlants:
    stated = uncertainty if isinstance(uncertainty, str) else dict(uncertainty)
    counted = counted_changes(actuator, stated)
    return _family(actuator, stated, (*counted, *(dict(change) for change in added)))


@lru_cache(maxsize=_FAMILIES)
def _box(actuator: Actuator, uncertainty: _Hashable) -> Box | None:
    stated = uncertainty if isinstance(uncertainty, str) else dict(uncertainty)
    ends = box_of(actuator, stated)

    def plants(changes: Sequence[Change]) -> MachinePlants:
        machines = {
            variant_label(actuator, stated, change): actuator.replace(**change)
            for change in changes
        }
        return MachinePlants(actuator, stated, tuple(changes), machines)

    return Box(ends, tuple(counted_changes(actuator, stated)), plants) if ends else None


def _hashable(uncertainty: str | Mapping[str, Ends]) -> _Hashable:
    return uncertainty if isinstance(uncertainty, str) else tuple(uncertainty.items())


def _family(
    actuator: Actuator, uncertainty: str | Mapping[str, Ends], changes: Sequence[Change]
) -> MachinePlants:
    """The nominal plant and those that differ by `changes`."""
    machines = changed_plants(actuator, uncertainty, changes)
    return MachinePlants(actuator, uncertainty, tuple(changes), machines)
