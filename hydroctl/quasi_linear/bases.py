"""Sets of functions of x and y in which the coefficients a1, a2, b and the offset c of equation (3)
are linear.

    paper             a1: 1, x, y, x y, y^2;  the others: 1, x, y, y^2    (equation (3) as printed)
    quadratic         1, x, y, x^2, x y, y^2
    volume            {1, x} times {1, Va0/Va, Vb0/Vb}
    volume-leakage    {1, x, 1/x} times {1, Va0/Va, Vb0/Vb}
    constant          1

Va = volume_a + area_a y and Vb = volume_b - area_b y, with Va0, Vb0 their values at y = 0: a2 is
almost exactly (Ec/m)(area_a^2/Va + area_b^2/Vb). The terms in 1/x follow the leakage, whose share
of the flow grows as the valve closes. In the offset c of the volume bases x^2 stands in place of x,
because friction bends the speed by a term in x |x|.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import product

import numpy as np

from ..errors import InputError, unknown_name
from ..machine.actuator import Actuator

COEFFICIENTS = ("a1", "a2", "b", "offset")
"""Names of the coefficients of v'' + a1 v' + a2 v = b x + c, the offset c last."""

_VOLUMES = ("1", "Va0/Va", "Vb0/Vb")
_TERMS = {
    "paper": (("1", "1"), ("x", "1"), ("1", "y"), ("1", "y^2")),
    "quadratic": (("1", "1"), ("x", "1"), ("1", "y"), ("x^2", "1"), ("x", "y"), ("1", "y^2")),
    "volume": tuple(product(("1", "x"), _VOLUMES)),
    "volume-leakage": tuple(product(("1", "x", "1/x"), _VOLUMES)),
    "constant": (("1", "1"),),
}
_EXCEPTIONS = {
    ("paper", "a1"): (("1", "1"), ("x", "1"), ("1", "y"), ("x", "y"), ("1", "y^2")),
    ("volume", "offset"): tuple(product(("1", "x^2"), _VOLUMES)),
    ("volume-leakage", "offset"): tuple(product(("1", "x^2", "1/x"), _VOLUMES)),
}
BASES = tuple(_TERMS)
_POWERS = {"1": 0.0, "x": 1.0, "x^2": 2.0, "1/x": -1.0}


@dataclass(frozen=True)
class Basis:
    """One of the sets above, for one machine. Raises InputError for an unknown name, or "volume..."
    without an actuator."""

    name: str
    actuator: Actuator | None = None

    def __post_init__(self):
        if self.name not in BASES:
            raise InputError(unknown_name("basis", self.name, BASES))
        if self.name.startswith("volume") and self.actuator is None:
            raise InputError(
                f"basis = {self.name!r} needs the chamber volumes; give the actuator, or take"
                " basis='quadratic'."
            )

    def _pairs(self, coefficient: str) -> tuple[tuple[str, str], ...]:
        return _EXCEPTIONS.get((self.name, coefficient), _TERMS[self.name])

    def labels(self, coefficient: str) -> list[str]:
        """The n terms of a coefficient, as texts."""
        return [
            " ".join(part for part in pair if part != "1") or "1"
            for pair in self._pairs(coefficient)
        ]

    def terms(self, coefficient: str, x, y) -> np.ndarray:
        """(..., n): the terms of a coefficient at x and y (m), which broadcast. With terms in 1/x,
        x must not be 0."""
        x, y = np.broadcast_arrays(np.asarray(x, dtype=float), np.asarray(y, dtype=float))
        pairs = self._pairs(coefficient)
        of_x = {part: x ** _POWERS[part] for part in {pair[0] for pair in pairs}}
        of_y = {part: self._of_y(part, y) for part in {pair[1] for pair in pairs}}
        return np.stack([of_x[first] * of_y[second] for first, second in pairs], axis=-1)

    def separable_offset(self) -> list[int]:
        """Which terms of the offset b x does not hold already. In a measured response the others
        cannot be told from b."""
        held = {(_POWERS[of_x] + 1, of_y) for of_x, of_y in self._pairs("b")}
        pairs = enumerate(self._pairs("offset"))
        return [
            k
            for k, (of_x, of_y) in pairs
            if _POWERS[of_x] >= 0 and (_POWERS[of_x], of_y) not in held
        ]

    def _of_y(self, part: str, y: np.ndarray) -> np.ndarray:
        if part in ("1", "y", "y^2"):
            return y ** {"1": 0, "y": 1, "y^2": 2}[part]
        assert self.actuator is not None
        if part == "Va0/Va":
            return 1.0 / (1.0 + y * self.actuator.area_a / self.actuator.volume_a)
        return 1.0 / (1.0 - y * self.actuator.area_b / self.actuator.volume_b)
