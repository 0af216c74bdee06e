"""`design_coupling`: the largest gains of a coupling, up to those wanted, with which the loops of
the differences keep Ms."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING

import numpy as np

from ..digits import apart
from ..errors import InputError, unknown_name
from ..loop.machine_plants import machine_plants
from ..loop.margins import Loop, peaks
from ..loop.plant_family import PlantFamily
from ..loop.quantity import POSITION
from ..loop.sampled_plant import SampledFamily, frequency_grid
from ..machine.actuator import Actuator
from ..regulator.linear import series
from .checks import group_faults
from .coupling import COUPLINGS, Coupling, CouplingEvidence, coupling_matrix

if TYPE_CHECKING:
    from ..schedule.schedule import GainSchedule

WANTED_KC, WANTED_KI = 0.5, 40.0
_HALVINGS, _ROUNDS = 30, 4
_POSITIONS = 3


@dataclass(frozen=True, eq=False)
class DifferenceLoop:
    """The loops (1 + kc + ki Ts/(z - 1)) C G over the shape (...) of kc and ki, for
    `margins.analyse`."""

    loop: Loop
    kc: np.ndarray
    ki: np.ndarray
    """1/s; all above 0, or all 0"""

    @property
    def shape(self) -> tuple[int, ...]:
        """The shape of the loops."""
        return self.loop.shape

    @property
    def plant(self) -> SampledFamily:
        """The plants, whose resonances set the frequency grid."""
        return self.loop.plant

    def frequency_response(self, omega) -> np.ndarray:
        """(..., n) complex at omega in rad/s."""
        return self.loop.frequency_response(omega) * (1.0 + self.addition(omega))

    def addition(self, omega) -> np.ndarray:
        """(..., n) complex kc + ki Ts/(z - 1)."""
        Ts = self.plant.sample_time
        z = np.exp(1j * np.asarray(omega) * Ts)
        return self.kc[..., None] + self.ki[..., None] * Ts / (z - 1.0)

    def take(self, indices) -> DifferenceLoop:
        """The loops at flat `indices`, along one axis."""
        return DifferenceLoop(
            self.loop.take(indices), self.kc.reshape(-1)[indices], self.ki.reshape(-1)[indices]
        )

    def scaled(self, factor: float) -> DifferenceLoop:
        """The same loops with this part of the gains."""
        return replace(self, kc=factor * self.kc, ki=factor * self.ki)

    def poles(self) -> np.ndarray:
        """(..., n) complex poles of the closed loops."""
        n = int(np.any(self.ki))
        one, D = np.ones((*self.shape, 1, 1)), 1.0 + self.kc[..., None, None]
        B, C = one[..., :n, :] * self.plant.sample_time * self.ki[..., None, None], one[..., :, :n]
        A, B, C, D = series((one[..., :n, :n], B, C, D), self.loop.regulators.state_space())
        A_plant, B_plant, C_plant = self.plant.state_space()
        A, B, C, _ = series((A, B, C, D), (A_plant, B_plant, C_plant, np.zeros((1, 1))))
        return np.linalg.eigvals(A - B @ C)


def design_coupling(
    actuators: Sequence[Actuator],
    schedules: Sequence[GainSchedule],
    name: str = "mean",
    *,
    kc: float = WANTED_KC,
    ki: float = WANTED_KI,
    Ms: float = 2.0,
) -> Coupling:
    """The coupling `name` with the largest part, up to all, of the wanted kc and ki (1/s) with
    which the differences keep `Ms`.

    Their loops are those of every cylinder at the design points of its schedule, on every plant of
    its specification, for every eigenvalue of M that is not 0. Both gains are scaled alike; 0 where
    even the uncoupled loops do not keep `Ms`, which `evidence.kept` tells. "independent" and
    "master-slave" have no gains to choose. Raises InputError, all faults at once.
    """
    faults = group_faults(actuators, schedules)
    gains = {"kc": kc, "ki": ki}
    faults += [
        f"{key} = {gain!r} must be a finite number of at least 0."
        for key, gain in gains.items()
        if not 0.0 <= gain < np.inf
    ]
    faults += [] if name in COUPLINGS else [unknown_name("coupling", name, COUPLINGS)]
    faults += [] if 1.0 < Ms < np.inf else [f"Ms = {Ms!r} must be a finite number above 1."]
    if name in ("mean", "ring"):
        faults += _law_faults(schedules)
    if faults:
        raise InputError(faults)
    matrix = coupling_matrix(name, len(actuators))
    values = np.linalg.eigvalsh(matrix) if name in ("mean", "ring") else np.zeros(1)
    modes = np.unique(np.round(values[values > 1e-9], 12))
    wanted = (
        {"kc": kc, "ki": ki} if modes.size else {"kc": float(name == "master-slave"), "ki": 0.0}
    )
    different = {
        (a.fingerprint(), id(s)): i
        for i, (a, s) in reversed(list(enumerate(zip(actuators, schedules, strict=True))))
    }
    loops = {
        i: _loops(actuators[i], schedules[i], modes, **wanted) for i in sorted(different.values())
    }
    uncoupled = _worst({i: loop.scaled(0.0) for i, (_, loop) in loops.items()})
    factor, worst = (
        _largest({i: loop for i, (_, loop) in loops.items()}, Ms, uncoupled)
        if modes.size
        else (1.0, uncoupled)
    )
    coupling = Coupling(
        name=name, matrix=matrix, kc=factor * wanted["kc"], ki=factor * wanted["ki"]
    )
    peak, i, index = worst
    labels, loop = loops[i]
    _, variant, row, column = np.unravel_index(index, loop.shape)
    evidence = CouplingEvidence(
        wanted_kc=wanted["kc"],
        wanted_ki=wanted["ki"],
        Ms_limit=Ms,
        Ms=peak,
        Ms_uncoupled=uncoupled[0],
        cylinder=i,
        variant=labels[variant],
        x=float(schedules[i].design_x[row]),
        y=float(schedules[i].design_y[column]),
        largest_pole=largest_pole(actuators, schedules, coupling),
    )
    return replace(coupling, evidence=evidence)


def _law_faults(schedules) -> list[str]:
    """The coupling enters by the reference; it must act in the loop as the measurement does."""
    found = []
    for i, s in enumerate(schedules):
        for name, value, needed in (
            ("set_point_weight", s.b, 1.0),
            ("measurement_filter", s.Tm, 0.0),
        ):
            if value != needed:
                given, wanted = apart(value, needed)
                found.append(
                    f"schedule {i + 1} has {name} = {given}: a coupling with gains needs {wanted};"
                    " tune it so."
                )
        if np.any(s.kd) and s.c != 1.0:
            found.append(
                f'schedule {i + 1} has derivative_on = "measurement": a coupling with gains needs'
                ' "error"; tune it so.'
            )
    return found


def _loops(actuator: Actuator, schedule: GainSchedule, modes, kc: float, ki: float):
    """(labels of the plants, loops over (modes, plants, x, y)); without modes one loop,
    uncoupled."""
    s = schedule.specification
    family = machine_plants(actuator, s.uncertainty, s.added_plants)
    plants = _positions(family, schedule.design_x, schedule.design_y, schedule)
    plants = SampledFamily.stack([plants] * max(1, modes.size))
    regulators = schedule.gains(schedule.design_x[:, None], schedule.design_y).broadcast_to(
        plants.shape
    )
    weights = modes if modes.size else np.zeros(1)
    weights = np.broadcast_to(weights[:, None, None, None], plants.shape)
    return family.labels, DifferenceLoop(Loop(plants, regulators), kc * weights, ki * weights)


def _positions(family: PlantFamily, x, y, schedule: GainSchedule) -> SampledFamily:
    """(variants, mx, my) models from x[k] to the position, sampled as by the schedule."""
    return family.sampled(
        x, y, POSITION, sample_time=schedule.Ts, delay_samples=schedule.delay_samples
    )


def _worst(loops: Mapping[int, DifferenceLoop]) -> tuple[float, int, int]:
    """(largest |S|, which cylinder, flat index of the loop); infinite where a loop is unstable."""
    found = []
    for i, loop in loops.items():
        Ms = peaks(loop, [lambda L: 1.0 / np.abs(1.0 + L)])[0][..., 0]
        Ms = np.where(np.abs(loop.poles()).max(axis=-1) < 1.0, Ms, np.inf)
        found.append((float(Ms.max()), i, int(np.argmax(Ms))))
    return max(found)


def _largest(loops: Mapping[int, DifferenceLoop], limit: float, uncoupled):
    """(largest factor up to 1 on the gains that keeps `limit`, the worst loop there); 0 where
    nothing does.

    Halving on a grid of frequencies finds the factor; the exact peak then corrects the limit that
    the grid has to keep.
    """
    worst = _worst(loops)
    if worst[0] <= limit:
        return 1.0, worst
    responses = []
    for loop in loops.values():
        omega = frequency_grid(loop.plant)
        L = loop.loop.frequency_response(omega)
        responses.append((1.0 + L, L * loop.addition(omega)))
    aim = limit
    for _ in range(_ROUNDS):
        low, high = 0.0, 1.0
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            kept = all(
                (np.abs(alone + middle * added) >= 1.0 / aim).all() for alone, added in responses
            )
            low, high = (middle, high) if kept else (low, middle)
        worst = _worst({i: loop.scaled(low) for i, loop in loops.items()})
        if worst[0] <= limit:
            return low, worst
        aim *= 0.9995 * limit / worst[0]
    return 0.0, uncoupled


def largest_pole(
    actuators: Sequence[Actuator], schedules: Sequence[GainSchedule], coupling: Coupling
) -> float:
    """Largest |pole| of all nominal cylinders together, coupled, at the ends of either side of x
    and three positions.

    All stand at the same x and y. Directions that the integrals of the coupling cannot reach are
    left out.
    """
    design_x = schedules[0].design_x
    sides = [side for side in (design_x[design_x < 0.0], design_x[design_x > 0.0]) if side.size]
    x, y = (
        np.unique([side[[0, -1]] for side in sides]),
        np.linspace(0.0, actuators[0].stroke, _POSITIONS),
    )
    cylinders = []
    for actuator, schedule in zip(actuators, schedules, strict=True):
        plants = _positions(machine_plants(actuator), x, y, schedule)
        regulators = schedule.gains(x[:, None], y).broadcast_to(plants.shape)
        A, B, C = plants.state_space()
        cylinders.append(series(regulators.state_space(), (A, B, C, np.zeros((1, 1)))))
    return float(np.abs(group_poles(cylinders, coupling, schedules[0].Ts)).max())


def group_poles(cylinders, coupling: Coupling, Ts: float) -> np.ndarray:
    """(..., n) complex poles of N loops, each opened as (A, B, C, 0) from error to position over
    (...), closed and coupled."""
    shape = cylinders[0][0].shape[:-2]
    sizes = [system[0].shape[-1] for system in cylinders]
    total, count = sum(sizes), len(cylinders)
    A, B, C = (
        np.zeros((*shape, total, total)),
        np.zeros((*shape, total, count)),
        np.zeros((*shape, count, total)),
    )
    start = 0
    for i, (A_i, B_i, C_i, _) in enumerate(cylinders):
        part = slice(start, start + sizes[i])
        A[..., part, part], B[..., part, i], C[..., i, part] = A_i, B_i[..., 0], C_i[..., 0, :]
        start += sizes[i]
    error = -(np.eye(count) + coupling.kc * coupling.matrix)
    if coupling.ki == 0.0:
        return np.linalg.eigvals(A + B @ error @ C)
    U, singular, V = np.linalg.svd(coupling.matrix)
    rank = int((singular > 1e-9).sum())
    reached, driving = U[:, :rank], -(Ts * coupling.ki * singular[:rank])[:, None] * V[:rank]
    top = np.concatenate(
        [A + B @ error @ C, B @ np.broadcast_to(reached, (*shape, count, rank))], axis=-1
    )
    bottom = np.concatenate(
        [driving @ C, np.broadcast_to(np.eye(rank), (*shape, rank, rank))], axis=-1
    )
    return np.linalg.eigvals(np.concatenate([top, bottom], axis=-2))
