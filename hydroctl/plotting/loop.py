"""Figures of one sampled loop of a schedule, at a chosen operating point: root locus, Nyquist,
Nichols."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import Normalize
from matplotlib.patches import Circle

from ..errors import InputError, unknown_name
from ..loop.margins import Loop, analyse
from ..loop.sampled_plant import frequency_grid
from ..regulator.linear import series
from ..schedule.schedule import GainSchedule
from .style import (
    BLACK,
    BLUE,
    GREY,
    ORANGE,
    VERMILLION,
    coloured_lines,
    footnote,
    key,
    one_axes,
    place,
    styled,
)

_FACTORS = np.geomspace(1e-1, 1e2, 121)
_LONGEST_STEP = 0.02
"""of a pole inside the window of the root locus, from one factor to the next"""
_BISECTIONS = 9
_WINDOW = 1.3
_DAMPINGS = (0.1, 0.2, 0.4, 0.6, 0.8)
_INFINITE = 1e6
"""a generalized eigenvalue beyond this is a zero at infinity"""
_GAIN_WINDOW = 30.0
"""dB above and below 0 in the Nichols chart"""


def design_loops(schedule: GainSchedule, x: float, y: float) -> tuple[tuple[str, ...], Loop]:
    """(labels, loops): the loop at x and y (m) on every plant of the specification, shape
    (variants,); the first is nominal."""
    labels, plants = schedule.plants.labels, schedule.sampled_plants([x], [y])
    return labels, Loop(plants, schedule.gains(x, y).broadcast_to(plants.shape)).take(
        np.arange(len(labels))
    )


@styled
def root_locus(
    schedule: GainSchedule, x: float, y: float, ax: Axes | None = None, *, variant: str = "nominal"
) -> Axes:
    """Poles of the sampled closed loop at x and y (m) as the loop gain is multiplied by 0.1 ...
    100, in the z-plane.

    Crosses and circles are the poles and zeros of the open loop, squares the poles with the
    schedule's own gains. Grey: the unit circle and curves of constant damping ratio. `variant`
    names the plant. Returns the axes.
    """
    labels, loops = design_loops(schedule, x, y)
    if variant not in labels:
        raise InputError(unknown_name("variant", variant, labels))
    loop = loops.take([labels.index(variant)])
    factors, branches = _locus(loop)
    (start, zeros), present = _open_loop(loop), loop.poles()[0]
    ax = one_axes(ax, (6.6, 5.6), below=0.2)
    _damping_grid(ax)
    steps = np.stack([branches[:-1], branches[1:]], axis=-1)
    exponent = np.broadcast_to(np.log10(factors[1:, None]), steps.shape[:2])
    seen = np.abs(steps).max(axis=-1) < 2.0 * _WINDOW
    lines = coloured_lines(
        ax, steps[seen].real, steps[seen].imag, exponent[seen], Normalize(-1.0, 2.0)
    )
    lines.set(linewidth=1.6, capstyle="round", rasterized=False)
    ax.plot(start.real, start.imag, "x", color=BLACK, label="open-loop poles")
    ax.plot(
        zeros.real, zeros.imag, "o", color=BLACK, markerfacecolor="none", label="open-loop zeros"
    )
    ax.plot(
        present.real,
        present.imag,
        "s",
        color=VERMILLION,
        label="poles with the present gain",
        markersize=5,
    )
    margin = analyse(loop).gain_margin[0]
    ax.set(
        title=(
            f"Root locus of the {schedule.loop} loop, {schedule.structure}\n{place(x, y)}, gain"
            f" margin {margin:.3g}"
        ),
        xlabel="real part of z (1)",
        ylabel="imaginary part of z (1)",
        xlim=(-_WINDOW, _WINDOW),
        ylim=(-1.2, 1.2),
        aspect="equal",
    )
    footnote(ax, f"plant: {variant}")
    ax.legend(loc="lower left")
    bar = key(lines, ax, "factor on the loop gain (1)")
    bar.set_ticks([-1, 0, 1, 2], labels=["0.1", "1", "10", "100"])
    return ax


def _scaled(loop: Loop, factors: np.ndarray) -> Loop:
    """`loop` of shape (1,) once for each factor on its gain."""
    repeated = loop.take(np.zeros(len(factors), int))
    gains = {name: factors * getattr(repeated.regulators, name) for name in ("kp", "ki", "kd")}
    return Loop(repeated.plant, replace(repeated.regulators, **gains))


def _locus(loop: Loop) -> tuple[np.ndarray, np.ndarray]:
    """(factors (n,), poles (n, N)) with each column following one pole, dense where poles move fast
    inside the window."""
    factors = _FACTORS
    branches = _branches(_scaled(loop, factors).poles())
    for _ in range(_BISECTIONS):
        moved = np.where(
            np.abs(branches[1:]) < 2.0 * _WINDOW, np.abs(np.diff(branches, axis=0)), 0.0
        ).max(axis=1)
        wide = np.flatnonzero(moved > _LONGEST_STEP)
        if wide.size == 0:
            break
        between = np.sqrt(factors[wide] * factors[wide + 1])
        branches = _branches(np.insert(branches, wide + 1, _scaled(loop, between).poles(), axis=0))
        factors = np.insert(factors, wide + 1, between)
    return factors, branches


def _branches(poles: np.ndarray) -> np.ndarray:
    """Rows (n, N) of poles, reordered so that each column follows one pole."""
    from scipy.optimize import linear_sum_assignment

    ordered = [poles[0]]
    for row in poles[1:]:
        ordered.append(row[linear_sum_assignment(np.abs(ordered[-1][:, None] - row))[1]])
    return np.array(ordered)


def _open_loop(loop: Loop) -> tuple[np.ndarray, np.ndarray]:
    """(poles, finite zeros) of the open loop of shape (1,); a zero is where its system pencil loses
    rank."""
    from scipy.linalg import block_diag, eigvals

    A, B, C, _ = (
        part[0]
        for part in series(
            loop.regulators.state_space(), (*loop.plant.state_space(), np.zeros((1, 1, 1)))
        )
    )
    pencil = np.block([[A, B], [C, np.zeros((1, 1))]])
    zeros = eigvals(pencil, block_diag(np.eye(len(A)), 0.0))
    return np.linalg.eigvals(A), zeros[np.isfinite(zeros) & (np.abs(zeros) < _INFINITE)]


def _damping_grid(ax: Axes) -> None:
    """The unit circle and, inside, z = exp(omega Ts (-zeta +- j sqrt(1 - zeta^2))) for some
    zeta."""
    ax.add_patch(Circle((0.0, 0.0), 1.0, fill=False, edgecolor=GREY, linewidth=1.2))
    for zeta in _DAMPINGS:
        angle = np.linspace(0.0, np.pi, 100)
        z = np.exp(angle * (1j - zeta / np.sqrt(1.0 - zeta**2)))
        ax.plot(z.real, z.imag, color="#BBBBBB", linestyle="-", linewidth=0.7)
        ax.plot(z.real, -z.imag, color="#BBBBBB", linestyle="-", linewidth=0.7)
        ax.annotate(
            f"{zeta:g}", (z[45].real, z[45].imag), color=GREY, fontsize=7, ha="center", va="center"
        )
    ax.annotate(
        "damping ratio", (0.02, 0.97), xycoords="axes fraction", color=GREY, fontsize=7, va="top"
    )


@styled
def nyquist(schedule: GainSchedule, x: float, y: float, ax: Axes | None = None) -> Axes:
    """Nyquist plot of the loop at x and y (m) on every plant of the specification, with the circles
    that Ms and Mt forbid.

    Outside the Ms circle |S| < Ms, outside the Mt circle |T| < Mt. Returns the axes.
    """
    ax = one_axes(ax, (6.4, 5.2))
    for centre, radius, look in _forbidden(schedule):
        ax.add_patch(Circle((centre, 0.0), radius, **look))
    for curve, look in _responses(schedule, x, y):
        ax.plot(curve.real, curve.imag, **look)
    ax.plot(-1.0, 0.0, "+", color=BLACK, markersize=9)
    ax.set(
        title=f"Nyquist plot of the {schedule.loop} loop, {schedule.structure}\n{place(x, y)}",
        xlabel="real part of L (1)",
        ylabel="imaginary part of L (1)",
        xlim=(-2.2, 0.8),
        ylim=(-1.6, 1.0),
        aspect="equal",
    )
    ax.legend(loc="lower left")
    return ax


@styled
def nichols(schedule: GainSchedule, x: float, y: float, ax: Axes | None = None) -> Axes:
    """Nichols chart of the loop at x and y (m) on every plant of the specification: gain over
    phase, with the regions that Ms and Mt forbid around -180 degrees. Returns the axes.
    """
    ax = one_axes(ax)
    turn = np.exp(1j * np.linspace(0.0, 2.0 * np.pi, 361))
    for centre, radius, look in _forbidden(schedule):
        border = centre + radius * turn
        ax.fill(np.degrees(np.angle(-border)) - 180.0, 20.0 * np.log10(np.abs(border)), **look)
    for curve, look in _responses(schedule, x, y):
        phase = np.unwrap(np.angle(curve))
        phase -= 2.0 * np.pi * np.ceil(phase[0] / (2.0 * np.pi))
        ax.plot(np.degrees(phase), 20.0 * np.log10(np.abs(curve)), **look)
    ax.plot(-180.0, 0.0, "+", color=BLACK, markersize=9)
    ax.set(
        title=f"Nichols chart of the {schedule.loop} loop, {schedule.structure}\n{place(x, y)}",
        xlabel="phase of L (degrees)",
        ylabel="|L| (dB)",
        xlim=(-540.0, 0.0),
        ylim=(-_GAIN_WINDOW, _GAIN_WINDOW),
    )
    ax.xaxis.set_ticks(np.arange(-540.0, 1.0, 90.0))
    ax.legend(loc="upper left")
    return ax


def _forbidden(schedule: GainSchedule):
    """(centre, radius, how to draw it) of the circles about the real axis of the L-plane in which
    |S| > Ms and |T| > Mt."""
    Ms, Mt = schedule.specification.Ms, schedule.specification.Mt
    excess = Mt**2 - 1.0
    yield (
        -1.0,
        1.0 / Ms,
        {"color": ORANGE, "alpha": 0.35, "linestyle": "-", "label": f"Ms > {Ms:g}"},
    )
    look = {
        "fill": False,
        "edgecolor": ORANGE,
        "hatch": "//",
        "alpha": 0.6,
        "linestyle": "-",
        "label": f"Mt > {Mt:g}",
    }
    yield -(Mt**2) / excess, Mt / excess, look


def _responses(schedule: GainSchedule, x: float, y: float):
    """(L over the design's frequencies, how to draw it) for every plant: the variants thin, then
    the nominal one on top."""
    labels, loops = design_loops(schedule, x, y)
    nominal, *others = loops.frequency_response(frequency_grid(loops.plant))
    for i, curve in enumerate(others):
        yield (
            curve,
            {
                "color": GREY,
                "linestyle": "-",
                "linewidth": 0.7,
                "label": "_" if i else "its variants",
            },
        )
    yield nominal, {"color": BLUE, "linestyle": "-", "label": f"{labels[0]} plant"}
