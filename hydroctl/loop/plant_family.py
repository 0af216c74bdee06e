"""`PlantFamily`: linear plants over valve opening and position, the nominal one and its variants.

It is the one door through which tuning, margins, the check for hidden coupling, figures and tests
see linear plants, whatever these are made of: a machine (`machine_plants`) or models of one's own
(`model_plants`).
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections import OrderedDict
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np

from ..machine.actuator import Actuator
from .points import with_midpoints
from .quantity import ControlledQuantity
from .sampled_plant import SampledFamily

_KEPT = 8
"""sets of sampled plants that a family remembers"""
Change = Mapping[str, float]
"""What a plant differs by from the nominal machine: {parameter: value in SI}"""


class SpeedGains(NamedTuple):
    """The straight lines v = gain (x - offset) of the steady speed, extending and retracting."""

    gain_extend: float
    """dv/dx in m/s"""
    gain_retract: float
    offset_extend: float
    """x at which the motion starts"""
    offset_retract: float


@dataclass(frozen=True, eq=False)
class Box:
    """Ranges of a machine's parameters between which every plant counts; the same object for equal
    machines and ranges."""

    ends: Mapping[str, tuple[float, float]]
    """(lowest, highest value) in SI by parameter, the former below the latter"""
    corners: tuple[Change, ...]
    plants: Callable[[Sequence[Change]], PlantFamily]
    """the plants that differ by some changes, and no other"""


class PlantFamily(ABC):
    """Linear plants from the valve opening to the speed over openings x and positions y (m), one
    for each variant; the first variant is the nominal plant."""

    actuator: Actuator | None
    """the nominal machine; None for models of which no machine is known"""
    changes: tuple[Change, ...]
    """what the plants beside the nominal one differ by; empty for models without parameters"""

    @property
    @abstractmethod
    def labels(self) -> tuple[str, ...]:
        """What each variant is called; the first is "nominal"."""

    @property
    @abstractmethod
    def grid(self) -> tuple[np.ndarray, np.ndarray] | None:
        """(x (nx,), y (ny,) in m): the only points at which there are models; None where any may be
        asked for."""

    @abstractmethod
    def defined(self, x, y) -> np.ndarray:
        """(mx, my) bool: where, of x (mx,) by y (my,) m, the family claims to have a model."""

    @abstractmethod
    def nearest(self, x, y) -> tuple[np.ndarray, np.ndarray]:
        """(x (mx,), y (my,)): those at which there are models, nearest to these, sides of x
        apart."""

    @abstractmethod
    def _sampled(
        self, x: np.ndarray, y: np.ndarray, quantity: ControlledQuantity, Ts: float, delay: float
    ) -> SampledFamily:
        """What `sampled` returns, computed anew."""

    @property
    @abstractmethod
    def knows_speed(self) -> bool:
        """Whether the steady speeds are known, and not only what follows a small change of x."""

    @abstractmethod
    def speed(self, x, y) -> np.ndarray:
        """(mx, my) m/s: the steady speed of the nominal plant at x (mx,) by y (my,) m.

        Raises InputError where it is not known.
        """

    @abstractmethod
    def speed_gains(self) -> SpeedGains:
        """The straight lines of the feed-forward; where the speeds are not known, through 0 with
        the slope of the models.

        Raises InputError where the plant does not move both ways.
        """

    @abstractmethod
    def pressure_drops(self, x) -> np.ndarray:
        """(2, 2) in Pa: the drops over the open edges at A and B, retracting and extending, in the
        middle of the openings x (nx,) of each side.

        Raises InputError for plants whose pressures are not known.
        """

    @property
    @abstractmethod
    def added_plants(self) -> tuple[Change, ...]:
        """Those of `changes` that the uncertainty does not count by itself."""

    @property
    @abstractmethod
    def box(self) -> Box | None:
        """The box of which every plant counts; None where the plants are counted."""

    @property
    @abstractmethod
    def without_corners(self) -> PlantFamily:
        """The nominal plant and `added_plants` where there is a box, from which a search starts;
        else the family itself."""

    @abstractmethod
    def varied(self, changes: Sequence[Change]) -> PlantFamily:
        """The same family and further plants, which differ from the nominal one by `changes`.

        Raises InputError for models without parameters.
        """

    def sampled(
        self, x, y, quantity: ControlledQuantity, *, sample_time: float, delay_samples: float
    ) -> SampledFamily:
        """(variants, mx, my) models from x[k] to `quantity` at the openings x (mx,) by the
        positions y (my,) m, behind hold and delay; the last few sets are remembered.

        Raises InputError, with variant and reason, for a point without a linear model.
        """
        x, y = (np.atleast_1d(np.asarray(values, dtype=float)) for values in (x, y))
        key = (x.tobytes(), y.tobytes(), quantity.loop, sample_time, delay_samples)
        if key not in self._remembered:
            made = self._sampled(x, y, quantity, sample_time, delay_samples)
            self._remembered[key] = made
            if len(self._remembered) > _KEPT:
                self._remembered.popitem(last=False)
        self._remembered.move_to_end(key)
        return self._remembered[key]

    @cached_property
    def _remembered(self) -> OrderedDict[tuple, SampledFamily]:
        return OrderedDict()

    def between(self, x: np.ndarray, y: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(x, y): these points and those half-way between them, or these alone where the family
        has no models in between."""
        finer = with_midpoints(x), with_midpoints(y)
        return finer if self.defined(*finer).all() else (x, y)
