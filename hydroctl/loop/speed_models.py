"""Continuous models from the valve opening to the speed, which sampling starts from.

All members share one number of states and one output: models that python-control describes are
brought to it by an orthogonal change of states, models of lower order by a state that neither acts
nor shows.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..errors import InputError
from ..model.characteristics import resonance
from ..model.linearization import LinearFamily
from ..quasi_linear.reduction import SecondOrderFamily
from .quantity import ControlledQuantity

if TYPE_CHECKING:
    import control

_PRESSURE_SCALE = 1e6
_AT_REST = 1e-9
"""of the fastest pole, below which a pole is that of an integrator"""


@dataclass(frozen=True, eq=False)
class SpeedModels:
    """dz/dt = A z + B x, v = C z, over a shape (...)."""

    A: np.ndarray
    """(..., n, n)"""
    B: np.ndarray
    """(..., n, 1)"""
    C: np.ndarray
    """(n,): m/s from the state"""
    resonance: np.ndarray
    """(..., 2): natural frequency (rad/s) and damping of the least damped mode, valve left out"""

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of the family."""
        return self.A.shape[:-2]

    @classmethod
    def stack(cls, families: Sequence[SpeedModels]) -> SpeedModels:
        """Families of one shape and number of states, along a new first axis."""
        A, B, modes = (
            np.stack([getattr(family, name) for family in families])
            for name in ("A", "B", "resonance")
        )
        return cls(A, B, families[0].C, modes)

    def at(self, index) -> SpeedModels:
        """The members that `index`, of arrays over the shape, selects."""
        return replace(self, A=self.A[index], B=self.B[index], resonance=self.resonance[index])

    def static_gain(self) -> np.ndarray:
        """(...) dv/dx in m/s at rest; not finite for a model with an integrator."""
        singular = np.linalg.matrix_rank(self.A) < self.C.size
        A = np.where(singular[..., None, None], np.eye(self.C.size), self.A)
        gain = -(np.linalg.solve(A, self.B)[..., 0] @ self.C)
        return np.where(singular, np.inf, gain)

    def behind_valve(self, natural_frequency: float | None, damping: float | None) -> SpeedModels:
        """The same models behind a valve w^2/(s^2 + 2 zeta w s + w^2), its spool and the spool's
        rate over w as further states; unchanged for a valve without a `natural_frequency`
        (rad/s)."""
        if natural_frequency is None or damping is None:
            return self
        n = self.C.size
        A, B = np.zeros((*self.shape, n + 2, n + 2)), np.zeros((*self.shape, n + 2, 1))
        A[..., :n, :n], A[..., :n, n : n + 1] = self.A, self.B
        A[..., n, n + 1] = natural_frequency
        A[..., n + 1, n:] = -natural_frequency, -2.0 * damping * natural_frequency
        B[..., n + 1, 0] = natural_frequency
        return replace(self, A=A, B=B, C=np.append(self.C, np.zeros(2)))

    def read_as(self, quantity: ControlledQuantity) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """(A, B, output (n,)) with `quantity` as the output: the position as a further state, the
        last, where it is that."""
        if not quantity.integrations:
            return self.A, self.B, self.C
        n = self.C.size
        A, B = np.zeros((*self.shape, n + 1, n + 1)), np.zeros((*self.shape, n + 1, 1))
        A[..., :n, :n], A[..., n, :n], B[..., :n, :] = self.A, self.C, self.B
        return A, B, np.eye(n + 1)[n]


def of_linear_family(family: LinearFamily) -> SpeedModels:
    """The models of `family`, pressures in MPa, behind the machine's valve.

    Raises InputError with the reason for the first point that is not feasible.
    """
    points = family.points
    if not points.feasible.all():
        raise InputError(str(points.reason[~points.feasible][0]))
    scale = np.array([_PRESSURE_SCALE, _PRESSURE_SCALE, 1.0])
    return SpeedModels(
        family.A * scale / scale[:, None],
        family.B / scale[:, None],
        family.C[0],
        np.stack(resonance(family), axis=-1),
    ).behind_valve(points.actuator.valve_natural_frequency, points.actuator.valve_damping)


def of_second_order(a1: np.ndarray, a2: np.ndarray, b: np.ndarray) -> SpeedModels:
    """v'' + a1 v' + a2 v = b x over the shape of a1 (rad/s), a2 (rad^2/s^2) and b (m/s^3); states v
    and v'/sqrt(a2).

    Raises InputError where a2 is not above 0, or a coefficient is not finite.
    """
    a1, a2, b = np.broadcast_arrays(a1, a2, b)
    finite = np.isfinite(a1) & np.isfinite(b)
    if not (finite & (a2 > 0.0) & np.isfinite(a2)).all():
        raise InputError(
            "a second-order model has a coefficient that is not finite, or a2 <= 0; leave such "
            "points out."
        )
    frequency = np.sqrt(a2)
    A, B = np.zeros((*a1.shape, 2, 2)), np.zeros((*a1.shape, 2, 1))
    A[..., 0, 1], A[..., 1, 0], A[..., 1, 1] = frequency, -frequency, -a1
    B[..., 1, 0] = b / frequency
    modes = np.stack([frequency, a1 / (2.0 * frequency)], axis=-1)
    return SpeedModels(A, B, np.array([1.0, 0.0]), modes)


def of_second_order_family(family: SecondOrderFamily) -> SpeedModels:
    """The models of `family` behind the machine's valve; errors as in `of_linear_family`."""
    points = family.points
    if not points.feasible.all():
        raise InputError(str(points.reason[~points.feasible][0]))
    models = of_second_order(family.a1, family.a2, family.b)
    return models.behind_valve(
        points.actuator.valve_natural_frequency, points.actuator.valve_damping
    )


def of_systems(
    systems: Sequence[control.TransferFunction | control.StateSpace], places: Sequence[str]
) -> SpeedModels:
    """Continuous python-control systems from x to v (m/s), over the shape (number of systems,).

    Raises InputError, all faults at once, each after its place of `places`, for what is no such
    system, is discrete, has more than one input or output, or lets x through at once.
    """
    faults, single = [], []
    for system, place in zip(systems, places, strict=True):
        fault = _system_fault(system)
        if fault:
            faults.append(f"{place}: {fault}")
        else:
            single.append(_single_output(system))
    if faults:
        raise InputError(faults)
    order = max(len(A) for A, _, _ in single)
    padded = [_padded(A, B, order) for A, B, _ in single]
    return SpeedModels(
        np.stack([A for A, _ in padded]),
        np.stack([B for _, B in padded]),
        np.eye(order)[0],
        np.array([mode for _, _, mode in single]),
    )


def _system_fault(system: object) -> str | None:
    import control

    if not isinstance(system, control.TransferFunction | control.StateSpace):
        return (
            f"{type(system).__name__} is no control.TransferFunction or control.StateSpace from x "
            "to v."
        )
    if system.ninputs != 1 or system.noutputs != 1:
        return f"{system.ninputs} inputs and {system.noutputs} outputs; give x to v alone."
    if not system.isctime():
        return "the model is sampled; give the continuous one, hold and delay are added here."
    model = _state_space(system)
    if not all(np.isfinite(part).all() for part in (model.A, model.B, model.C, model.D)):
        return "the model holds a number that is not finite."
    if model.D.item() != 0.0:
        return "x acts on v at once (as many zeros as poles); a cylinder has a mass."
    if model.nstates == 0 or not np.any(model.C) or not np.any(model.B):
        return "x does not act on v at all."
    return None


def _state_space(system) -> control.StateSpace:
    """Its states, in units of the time of its fastest pole, so that powers of it stay of one
    size."""
    import control

    if isinstance(system, control.StateSpace):
        return system
    numerator, denominator = (np.trim_zeros(part[0][0], "f") for part in (system.num, system.den))
    n = len(denominator) - 1
    if len(numerator) > n or n == 0:
        return control.ss([], [], [], [[1.0]])
    rate = np.abs(np.roots(denominator)).max() or 1.0
    powers = rate ** np.arange(n + 1)
    last = denominator / (denominator[0] * powers)
    first = np.zeros(n)
    first[n - len(numerator) :] = numerator / denominator[0]
    first /= powers[1:]
    A, C = np.eye(n, k=1), np.eye(n)[:1]
    A[:, 0] = -last[1:]
    return control.ss(rate * A, (rate * first)[:, None], C, [[0.0]])


def _single_output(system) -> tuple[np.ndarray, np.ndarray, tuple[float, float]]:
    """(A, B, (natural frequency, damping)) with the first state as the output: balanced, then
    turned by an orthogonal matrix."""
    from scipy.linalg import matrix_balance

    model = _state_space(system)
    A, scale = matrix_balance(model.A, permute=False)
    size = np.diag(scale)
    B, C = model.B / size[:, None], model.C[0] * size
    turn, length = _turned_to_first(C)
    A, B = turn @ A @ turn.T, turn @ B
    A[0, 1:], A[1:, 0], B[0] = A[0, 1:] * length, A[1:, 0] / length, B[0] * length
    return A, B, _mode(np.linalg.eigvals(model.A), model.zeros())


def _turned_to_first(row: np.ndarray) -> tuple[np.ndarray, float]:
    """(orthogonal matrix T, |row|) with row = |row| T[0]: a reflection."""
    length = float(np.linalg.norm(row))
    mirror = row / length
    mirror = mirror - np.eye(row.size)[0]
    square = mirror @ mirror
    if square == 0.0:
        return np.eye(row.size), length
    return np.eye(row.size) - 2.0 * np.outer(mirror, mirror) / square, length


def _padded(A: np.ndarray, B: np.ndarray, order: int) -> tuple[np.ndarray, np.ndarray]:
    """(A, B) with states up to `order` that decay as fast as the fastest of the model, do not act
    and are not acted on."""
    n = len(A)
    rate = np.abs(np.linalg.eigvals(A)).max() or 1.0
    larger, entry = -rate * np.eye(order), np.zeros((order, 1))
    larger[:n, :n], entry[:n] = A, B
    return larger, entry


def _mode(poles: np.ndarray, zeros: np.ndarray) -> tuple[float, float]:
    """(natural frequency in rad/s, damping) of the mode that a notch would stand at: the least
    damped pair; where all poles are real the two slowest that no zero and no integrator takes
    away; of a single one itself, critically damped."""
    pairs = poles[poles.imag > 0.0]
    if pairs.size:
        slowest = pairs[np.argmin(-pairs.real / np.abs(pairs))]
        return float(abs(slowest)), float(-slowest.real / abs(slowest))
    left = list(poles.real[np.abs(poles) > _AT_REST * np.abs(poles).max()])
    for zero in zeros[np.isfinite(zeros)].real:
        if len(left) > 2:
            left.remove(min(left, key=lambda pole: abs(pole - zero)))
    slowest = sorted(left, key=abs)[:2]
    if not slowest:
        return 0.0, 1.0
    frequency = float(np.sqrt(np.abs(np.prod(slowest)))) if len(slowest) > 1 else abs(slowest[0])
    return frequency, float(-np.mean(slowest) / frequency)
