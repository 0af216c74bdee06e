"""Maps over the grid of openings and positions: gains and margins of a schedule."""

from __future__ import annotations

import numpy as np
from matplotlib.axes import Axes
from matplotlib.colors import LogNorm, Normalize

from ..errors import InputError, unknown_name
from ..regulator.structures import STRUCTURES
from ..regulator.units import GAIN_UNITS
from ..schedule.margins import ScheduleMargins
from ..schedule.schedule import GainSchedule
from .style import (
    OPENING,
    POSITION,
    VERMILLION,
    coloured_lines,
    key,
    name_sides,
    norm_of,
    of_side,
    one_axes,
    place,
    several_axes,
    shades,
    styled,
)

_MARGINS = {
    "Ms": ("Ms = max |S|", 1.0),
    "Mt": ("Mt = max |T|", 1.0),
    "disk_margin": ("disk margin (1)", 1.0),
    "gain_margin": ("gain margin (dB)", None),
    "phase_margin": ("phase margin (degrees)", 180.0 / np.pi),
    "delay_margin": ("delay margin (ms)", 1e3),
    "crossover": ("crossover (Hz)", 0.5 / np.pi),
}
_LABELS_PER_AXIS = 10
_LOG_SPAN = 1e-3


@styled
def gain_surfaces(schedule: GainSchedule, ax=None) -> np.ndarray:
    """The gains over y at every node of x, coloured by x; dots are nodes. The lookup is linear
    along the curves and between them.

    `ax`: one axes for each gain that the structure uses, and one more for the notch frequency where
    there is a notch. Returns them.
    """
    units = GAIN_UNITS[schedule.loop]
    tables = {
        f"{name} ({units[name]})": getattr(schedule, name)
        for name in STRUCTURES[schedule.structure]
    }
    if schedule.zz != schedule.zp:
        tables["notch frequency (Hz)"] = schedule.notch_frequency / (2.0 * np.pi)
    axes = several_axes(ax, len(tables), (6.4, 1.2 + 1.8 * len(tables)), sharex=True)
    norm = norm_of(schedule.x)
    for each, (label, table) in zip(axes, tables.items(), strict=True):
        lines = coloured_lines(each, schedule.y, table, schedule.x, norm)
        lines.set(linewidth=1.4, linestyle=[of_side(x) for x in schedule.x])
        each.scatter(
            np.tile(schedule.y, len(schedule.x)),
            table,
            c=np.repeat(schedule.x, len(schedule.y)),
            cmap=shades(),
            norm=norm,
            s=12,
        )
        each.set_ylabel(label)
        each.set_ylim(1.08 * min(0.0, float(np.min(table))), 1.08 * max(0.0, float(np.max(table))))
    axes[0].set_title(f"Gains of the {schedule.loop} loop, {schedule.structure}")
    axes[-1].set_xlabel(POSITION)
    name_sides(axes[-1], schedule.x)
    key(lines, axes, OPENING)
    return axes


@styled
def margin_map(margins: ScheduleMargins, name: str, ax=None, *, limit: float | None = None) -> Axes:
    """The margin `name` of `Margins` over x and y, the worst of all variants at each point; the
    worst point of all is named.

    Unstable points are crossed out. `limit` in the margin's own unit appears in the title. Returns
    the axes.
    """
    if name not in _MARGINS:
        raise InputError(unknown_name("margin", name, _MARGINS))
    label, factor = _MARGINS[name]

    def shown(values):
        return 20.0 * np.log10(values) if factor is None else factor * values

    values = np.asarray(getattr(margins.margins, name))
    worst_of_variants = values.max(axis=0) if name in ("Ms", "Mt") else values.min(axis=0)
    ax = one_axes(ax, (6.8, 4.8), below=0.5)
    cells(
        ax,
        margins.x,
        margins.y,
        shown(worst_of_variants),
        label,
        crossed=~margins.margins.stable.all(axis=0),
    )
    worst = margins.worst(name)
    i, j = np.flatnonzero(margins.x == worst.x)[0], np.flatnonzero(margins.y == worst.y)[0]
    text = f"worst {shown(worst.value):.4g} at {place(worst.x, worst.y)}\n{worst.variant}"
    ax.plot(j, i, "*", color=VERMILLION, markeredgecolor="white", markersize=14, label=text)
    required = "" if limit is None else f", limit {shown(limit):.4g}"
    unstable = f", {margins.unstable} unstable" if margins.unstable else ""
    ax.set_title(f"{label}, worst of {len(margins.variants)} plants{required}{unstable}")
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14))
    return ax


def cells(ax: Axes, x, y, values, label: str, *, logarithmic: bool = False, crossed=None) -> None:
    """Coloured cells of equal size, one for each point (nx, ny) of the grid x by y; cells without a
    value stay grey.

    The axes count the points (cell [i, j] is centred on (j, i)), so that openings close to zero
    stay visible.
    """
    values = np.asarray(values, dtype=float)
    finite = values[np.isfinite(values)]
    norm = norm_of(finite) if finite.size else Normalize(0.0, 1.0)
    if logarithmic and finite.size and 0.0 < finite.min() < finite.max():
        norm = LogNorm(max(finite.min(), _LOG_SPAN * finite.max()), finite.max())
    ax.set_facecolor("#BBBBBB")
    ax.grid(False)
    edges = (np.arange(count + 1) - 0.5 for count in (len(y), len(x)))
    mesh = ax.pcolormesh(
        *edges,
        np.ma.masked_invalid(values),
        norm=norm,
        cmap="cividis",
        edgecolors="white",
        linewidth=0.3,
    )
    if crossed is not None and np.any(crossed):
        row, column = np.nonzero(crossed)
        ax.plot(column, row, "x", color=VERMILLION, markersize=5, markeredgewidth=1.2)
    _count(ax.xaxis, y)
    _count(ax.yaxis, x)
    ax.set(xlabel=POSITION, ylabel=OPENING)
    key(mesh, ax, label)


def _count(axis, values) -> None:
    """Ticks at the points that fit, labelled with the values there."""
    step = -(-len(values) // _LABELS_PER_AXIS)
    ticks = np.arange(0, len(values), step)
    axis.set_ticks(ticks, [f"{values[tick]:.3g}" for tick in ticks])
