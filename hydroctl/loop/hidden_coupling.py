"""Hidden coupling: the stability of the scheduled loop, whose gains move with x[k-1] and y, and not
only of its frozen loops.

Around a steady motion the command of the law varies by the frozen regulator's part and, for every
gain g, by

    dg/dx dx[k-1] + dg/dy dy    times the derivative of the law by g

The latter is (b r - m) for kp, e for ki, the filtered derivative for kd, and for wn what notch and
sections do to the held command u_0. With an integral e is 0, so that ki has no part: it multiplies
the error before the integral, which is stored in units of x. With b = 1 kp has none either. There
remain (b - 1) r dkp; without an integral u_0 dkp/kp; for a derivative on the measurement of a
moving cylinder -v_0 dkd; and the transients of notch and sections when wn moves under u_0. They are
collected by linearizing the law that runs, gain lookup included, by central differences, and are
closed over the sampled plants with the position as a state, which is exact for the plant: at an
operating point its slopes do not depend on y. (Rugh, Shamma: Research on gain scheduling.)

u_0 is the whole opening, as if nothing were fed forward: the worst case. Slopes jump at the nodes,
so that every cell of the table is looked at in its middle and just inside its edges. The motion of
a velocity loop leaves one pole at 1, the position itself, which is not counted.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from ..regulator import lead_lag, notch
from ..regulator.law import AT_REST, Memory, Regulator, regulate
from ..regulator.prepared import regulator_of
from ..regulator.scheduled import ScheduledRegulator
from .sampled_plant import SampledFamily

_STEP = 1e-6
"""of the command, or of a cell"""


@dataclass(frozen=True, eq=False)
class HiddenCoupling:
    """The scheduled loops, whose gains move, at openings x (mx,) and positions y (my,) in m, over
    variants of the plant."""

    variants: tuple[str, ...]
    x: np.ndarray
    y: np.ndarray
    pole_size: np.ndarray
    """(variants, mx, my): largest |pole|, the slopes of the gains included; stable below 1"""

    @property
    def unstable(self) -> int:
        """How many loops are unstable."""
        return int(np.count_nonzero(~(self.pole_size < 1.0)))

    @property
    def worst(self) -> tuple[float, str, float, float]:
        """(largest |pole|, variant, x, y)"""
        k, i, j = np.unravel_index(np.argmax(self.pole_size), self.pole_size.shape)
        return float(self.pole_size[k, i, j]), self.variants[k], float(self.x[i]), float(self.y[j])


def hidden_coupling(
    scheduled: ScheduledRegulator,
    variants: tuple[str, ...],
    x: np.ndarray,
    y: np.ndarray,
    plants: SampledFamily,
    speed: np.ndarray,
) -> HiddenCoupling:
    """The poles of the scheduled loops at x (mx,) by y (my,) m on `plants` (variants, mx, my), as
    in `moving_poles`."""
    poles = moving_poles(scheduled, x, y, plants, speed)
    if scheduled.measured == "v":
        neutral = np.argmin(np.abs(poles - 1.0), axis=-1)[..., None]
        np.put_along_axis(poles, neutral, 0.0, axis=-1)
    return HiddenCoupling(variants, x, y, np.abs(poles).max(axis=-1))


def moving_poles(
    scheduled: ScheduledRegulator,
    x: np.ndarray,
    y: np.ndarray,
    plants: SampledFamily,
    speed: np.ndarray,
) -> np.ndarray:
    """(variants, mx, my, n) complex poles of the scheduled loops at x (mx,) by y (my,) m on
    `plants`, which read the position.

    speed: (mx, my) m/s, of the steady motion at each point. Raises InputError for a regulator that
    the law cannot run.
    """
    law, by_m, by_y, command = _linear_law(scheduled, x, y, speed)
    A, B, read_y = plants.state_space()
    read_v = np.pad(plants.speed, (0, A.shape[-1] - plants.speed.size))[None]
    inputs = by_m @ {"v": read_v, "y": read_y}[scheduled.measured] + by_y @ read_y
    upper = np.concatenate([A + B @ inputs[..., [command], :], B @ law[..., [command], :]], axis=-1)
    lower = np.concatenate([inputs, law], axis=-1)
    return np.linalg.eigvals(
        np.concatenate([upper, np.broadcast_to(lower, (*A.shape[:-2], *lower.shape[-2:]))], axis=-2)
    )


def _linear_law(scheduled: ScheduledRegulator, x: np.ndarray, y: np.ndarray, speed: np.ndarray):
    """(by memory (mx, my, n, n), by m (mx, my, n, 1), by y (mx, my, n, 1), place of x in the
    memory): the law's new memory."""
    regulator = regulator_of(
        replace(scheduled, delay_samples=0.0, compensation=None, inverse_depth=0.0)
    )
    at_x, at_y = np.broadcast_arrays(x[:, None], y)
    memory, reference, m = _steady_state(scheduled, regulator, at_x, at_y, speed)
    used = _used_states(scheduled)

    def law(changed: Memory, m, y):
        g = scheduled.gains(changed.x, y)
        new = regulate(
            reference,
            0.0,
            (0.0, 0.0, m, m),
            (g.kp, g.ki, g.kd, g.notch_frequency),
            changed,
            regulator,
        )
        return np.stack(np.broadcast_arrays(*(getattr(new, name) for name in used)), axis=-1)

    frozen = scheduled.gains(at_x, at_y)
    direct = frozen.kp + frozen.kd / (scheduled.Tf + scheduled.Ts)
    direct = np.where(direct > 0.0, direct, 1.0)
    steps = dict.fromkeys(used, np.full(m.shape, _STEP)) | dict.fromkeys(
        ("last", "filtered"), _STEP / direct
    )
    steps["derivative"] = _STEP / np.where(frozen.kd > 0.0, frozen.kd, 1.0)
    columns = []
    for name in used:
        above, below = (
            memory._replace(**{name: getattr(memory, name) + sign * steps[name]})
            for sign in (1.0, -1.0)
        )
        columns.append((law(above, m, at_y) - law(below, m, at_y)) / (2.0 * steps[name])[..., None])
    h_m, h_y = _STEP / direct, _STEP * max(float(np.diff(scheduled.y).min(initial=1.0)), _STEP)
    by_m = (law(memory, m + h_m, at_y) - law(memory, m - h_m, at_y)) / (2.0 * h_m)[..., None]
    by_y = (law(memory, m, at_y + h_y) - law(memory, m, at_y - h_y)) / (2.0 * h_y)
    return np.stack(columns, axis=-1), by_m[..., None], by_y[..., None], used.index("x")


def _used_states(scheduled: ScheduledRegulator) -> list[str]:
    """The fields of the memory that act: those of an absent integral, derivative, notch or section
    are 0."""
    absent = {"running"} | {f"section_{i + 1}" for i in range(len(scheduled.sections), 2)}
    absent |= set() if np.any(scheduled.ki) else {"integral"}
    absent |= set() if np.any(scheduled.kd) else {"derivative", "last"}
    absent |= set() if scheduled.zz != scheduled.zp else {"notch_1", "notch_2"}
    return [name for name in Memory._fields if name not in absent]


def _steady_state(scheduled: ScheduledRegulator, regulator: Regulator, x, y, v):
    """(memory, reference, measured quantity), arrays of the shape of x: the law holds the opening x
    while the cylinder moves."""
    g = scheduled.gains(x, y)
    if np.any(scheduled.ki):
        m = {"v": v, "y": y}[scheduled.measured]
        reference = m
    else:
        reference, m = np.zeros(x.shape), -x / g.kp
    speed = v if scheduled.measured == "y" and scheduled.c == 0.0 else np.zeros(x.shape)
    seen = scheduled.c * reference - m
    held = x - g.kp * (scheduled.b * reference - m) + g.kd * speed
    w = np.tan(0.5 * np.where(regulator.shaped, g.notch_frequency, 0.0) * scheduled.Ts)
    rest = notch.rest(x, w, regulator)
    rest_1, rest_2 = (lead_lag.rest(x, w, section) for section in regulator.sections)
    memory = AT_REST._replace(
        integral=held,
        derivative=-speed,
        last=seen + speed * scheduled.Ts,
        notch_1=rest,
        notch_2=rest,
        x=x,
        filtered=m,
        running=1.0,
    )
    return memory._replace(section_1=rest_1, section_2=rest_2), reference, m
