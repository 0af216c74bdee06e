"""The convex sets that the loop gain L must stay out of, one for each limit of a specification.

    Ms              the disc |1 + L| < 1/Ms
    Mt              the disc |L - c| < r,  c = -Mt^2/(Mt^2 - 1),  r = Mt/(Mt^2 - 1)
    gain margin     the disc with the diameter -1 ... -1/gm on the real axis
    phase margin    the part of the unit disc with Re L < -cos(pm), slightly widened

The last two are sufficient: a loop that stays out of the disc does not cross the real axis on its
diameter, and one that stays out of the segment does not cross the unit circle within pm of -1. They
are imposed near the frequencies of crossings that miss the margin, so that a loop may enter them
elsewhere.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ..specification import Specification

_ROUNDING = 0.01


class Disc(NamedTuple):
    """A disc with its centre on the real axis."""

    centre: float
    radius: float

    @property
    def shallow(self) -> float:
        """From so little inside, the half-planes still let L out."""
        return 5e-3

    @property
    def gain_margin(self) -> float:
        """The factor above 1 that brings the end of the diameter beyond -1 to -1."""
        return -1.0 / (self.centre + self.radius)

    def intrusion(self, L: np.ndarray) -> np.ndarray:
        """How far inside each L lies, in units of L; not positive outside."""
        return self.radius - np.abs(L - self.centre)

    def half_planes(self, L: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """(normal, bound): Re(conj(normal) L') >= bound is the half-plane that touches the disc
        nearest to L."""
        normal = (L - self.centre) / np.abs(L - self.centre)
        return normal, normal.real * self.centre + self.radius


@dataclass(frozen=True)
class Segment:
    """The segment of the unit disc left of the chord between the points at `phase_margin` (rad)
    from -1, with rounded corners."""

    phase_margin: float

    @property
    def shallow(self) -> float:
        """As `Disc.shallow`: nearly none, because arc and chord push L in different directions."""
        return 1e-6

    @property
    def rounding(self) -> float:
        """By how much the segment is widened; less where its chord passes near 0, which must stay
        outside."""
        return min(_ROUNDING, 0.5 * float(np.cos(self.phase_margin)))

    def intrusion(self, L: np.ndarray) -> np.ndarray:
        """As `Disc.intrusion`."""
        return self.rounding - self._nearest(L)[1]

    def half_planes(self, L: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """As `Disc.half_planes`."""
        nearest, distance = self._nearest(L)
        on_border = distance == 0.0
        normal = np.where(on_border, 1.0, (L - nearest) / np.where(on_border, 1.0, distance))
        return normal, (normal.conj() * nearest).real + self.rounding

    def _nearest(self, L):
        """(nearest point of the border, distance from it, negative inside)."""
        chord, half = -np.cos(self.phase_margin), np.sin(self.phase_margin)
        size = np.abs(L)
        on_arc = L / np.where(size == 0.0, 1.0, size)
        inside = (size < 1.0) & (L.real < chord)
        nearer_arc = np.where(
            inside, 1.0 - size < chord - L.real, (size >= 1.0) & (on_arc.real <= chord)
        )
        nearest = np.where(nearer_arc, on_arc, chord + 1j * np.clip(L.imag, -half, half))
        return nearest, np.where(inside, -1.0, 1.0) * np.abs(L - nearest)


Limit = Disc | Segment


def circles(Ms: float, Mt: float) -> list[Disc]:
    """The discs of Ms and Mt."""
    return [Disc(-1.0, 1.0 / Ms), Disc(-(Mt**2) / (Mt**2 - 1.0), Mt / (Mt**2 - 1.0))]


def limits_of(specification: Specification) -> dict[str, Limit]:
    """The sets of a specification by the margin that they limit: "Ms" and "Mt", then those that are
    asked for beside them."""
    limits: dict[str, Limit] = dict(
        zip(("Ms", "Mt"), circles(specification.Ms, specification.Mt), strict=True)
    )
    if (gain := specification.gain_margin) is not None:
        limits["gain_margin"] = Disc(-(1.0 + 1.0 / gain) / 2.0, (1.0 - 1.0 / gain) / 2.0)
    if (phase := specification.phase_margin) is not None:
        limits["phase_margin"] = Segment(phase)
    return limits


def phrase(name: str, specification: Specification) -> str:
    """A limit in words, for example "Ms <= 1.6"."""
    relation, unit = (
        "<=" if name in ("Ms", "Mt") else ">=",
        " rad" if name == "phase_margin" else "",
    )
    return f"{name} {relation} {getattr(specification, name):g}{unit}"
