"""`Coupling`: how the cylinders of a group act on each other.

The common reference r goes to all; a coupling adds to the reference of cylinder i

    kc d_i + ki int d_i dt,       d_i = sum_j M_ij (r - y_j)

so that regulator i sees row i of (1 + (kc + ki/s) M)(r - y) as its error. With equal loops L, the
motions along the eigenvectors of M are those of single loops (1 + (kc + ki/s) lambda) L: the group
as a whole, lambda = 0, moves as without coupling.

    "independent"   M = 0
    "master-slave"  M_i1 = -1, kc = 1: cylinder 1 follows r, the others follow its measured position
    "mean"          M = 1 - 1/N: d_i is what y_i lacks to the mean of all; every lambda = 1
    "ring"          d_i is what y_i lacks to the mean of its two neighbours;
                    lambda = 1 - cos(2 pi n/N), at most 2
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..digits import apart

COUPLINGS = ("independent", "master-slave", "mean", "ring")


@dataclass(frozen=True, eq=False, kw_only=True)
class Coupling:
    """A coupling with its gains, and on what they were found to hold where `design_coupling` made
    it."""

    name: str
    matrix: np.ndarray
    """(N, N) M"""
    kc: float
    ki: float
    """1/s"""
    evidence: CouplingEvidence | None = None


@dataclass(frozen=True, kw_only=True)
class CouplingEvidence:
    """How the loops of the differences between cylinders stand, over all design points and plants
    of all schedules."""

    wanted_kc: float
    wanted_ki: float
    """1/s"""
    Ms_limit: float
    """largest |S| allowed in these loops"""
    Ms: float
    """largest |S| reached"""
    Ms_uncoupled: float
    """the same without the coupling"""
    cylinder: int
    """where `Ms` is reached, from 0"""
    variant: str
    x: float
    y: float
    """m"""
    largest_pole: float
    """largest |pole| of the sampled, coupled loops of all nominal cylinders together; stable below
    1"""

    @property
    def kept(self) -> bool:
        """Whether the limit is kept and the group is stable."""
        return self.Ms <= self.Ms_allowed and self.largest_pole < 1.0

    @property
    def Ms_allowed(self) -> float:
        """`Ms_limit`, and 0.1 % for the grid of frequencies on which the regulators were tuned."""
        return 1.001 * self.Ms_limit

    def __str__(self) -> str:
        where = (
            f"cylinder {self.cylinder + 1}, x = {self.x:.3g}, y = {self.y:.3g} m, {self.variant}"
            " plant"
        )
        reached, limit, _ = apart(self.Ms, self.Ms_limit, self.Ms_allowed, digits=4)
        pole, _ = apart(self.largest_pole, 1.0, digits=5)
        return (
            f"Ms = {reached} of the differences ({where}),"
            f" {'kept' if self.Ms <= self.Ms_allowed else 'NOT KEPT'}: limit {limit}, and 0.1 % for"
            f" the tuner's grid; without coupling {self.Ms_uncoupled:.3f}; largest pole of the"
            f" group {pole}, {'stable' if self.largest_pole < 1.0 else 'UNSTABLE'}"
        )


def coupling_matrix(name: str, count: int) -> np.ndarray:
    """(count, count) M of the coupling `name`, one of COUPLINGS."""
    one = np.eye(count)
    if name == "mean":
        return one - 1.0 / count
    if name == "ring":
        return one - 0.5 * (np.roll(one, 1, axis=0) + np.roll(one, -1, axis=0))
    matrix = np.zeros((count, count))
    if name == "master-slave":
        matrix[1:, 0] = -1.0
    return matrix
