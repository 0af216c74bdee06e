"""One look for all figures, and the parts that several share. Nothing here changes matplotlib's
settings outside a drawing call.

Colours: the palette of Okabe and Ito for separate things (they differ in line style too), viridis
without its lightest end for lines and marks, cividis for areas. All stay apart in grey print and
for colour-blind readers.
"""

from __future__ import annotations

import functools
import textwrap
from collections.abc import Callable
from typing import Literal

import matplotlib
import numpy as np
from cycler import cycler
from matplotlib.axes import Axes
from matplotlib.collections import LineCollection
from matplotlib.colorbar import Colorbar
from matplotlib.colors import Colormap, ListedColormap, LogNorm, Normalize
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.ticker import NullFormatter, StrMethodFormatter

from ..errors import InputError
from ..loop import quantity
from ..model.operating_point import OperatingPoints

BLACK, ORANGE, SKY, GREEN, BLUE, VERMILLION, PURPLE, GREY = (
    "#000000", "#E69F00", "#56B4E9", "#009E73", "#0072B2", "#D55E00", "#CC79A7", "#7F7F7F",
)  # fmt: skip
_CYCLE = cycler(color=[BLUE, VERMILLION, GREEN, ORANGE, PURPLE, SKY, BLACK]) + cycler(
    linestyle=["-", "--", "-.", ":", (0, (5, 1)), (0, (3, 1, 1, 1)), "-"]
)
STYLE = {
    "axes.axisbelow": True,
    "axes.edgecolor": "#404040",
    "axes.grid": True,
    "axes.labelsize": 9,
    "axes.prop_cycle": _CYCLE,
    "axes.titlesize": 10,
    "axes.titley": 1.0,
    "figure.facecolor": "white",
    "font.size": 9,
    "grid.alpha": 1.0,
    "grid.color": "#DDDDDD",
    "grid.linewidth": 0.6,
    "image.cmap": "cividis",
    "legend.fontsize": 8,
    "legend.framealpha": 0.9,
    "lines.linewidth": 1.4,
    "savefig.facecolor": "white",
    "svg.fonttype": "none",
    "svg.hashsalt": "hydroctl",
    "xtick.labelsize": 8,
    "ytick.labelsize": 8,
}

POSITION, SPEED = quantity.POSITION.label, quantity.VELOCITY.label
OPENING = "valve opening x (of full)"
FREQUENCY = "frequency (Hz)"
TIME = "time (s)"
_MARGINS = (0.85, 0.2, 0.6, 0.5)
"""left, right, bottom and top of a new figure in inches"""
_KEY_WIDTH = 1.0
"""of a colour bar with its labels, in inches"""
_NOTE_LINE = 110
"""characters"""
MANY = 300
"""lines or marks beyond which a figure holds them as pixels, in SVG too"""


def styled(draw: Callable) -> Callable:
    """A drawing function that runs under `STYLE` and leaves matplotlib's settings as they were."""

    @functools.wraps(draw)
    def wrapper(*arguments, **keywords):
        with matplotlib.rc_context(STYLE):
            return draw(*arguments, **keywords)

    return wrapper


def one_axes(ax: Axes | None, size=(6.4, 4.4), *, below: float = 0.0) -> Axes:
    """`ax`, or the axes of a new figure of `size` inches with `below` more under the axis label."""
    return several_axes(ax, 1, size, below=below)[0]


def several_axes(
    ax, count: int, size, *, columns: int = 1, below: float = 0.0, sharex: bool = False
) -> np.ndarray:
    """(count,) axes: those given, or those of a new figure of `size` inches. InputError for another
    number of axes.

    The margins of a new figure are set here, in inches: finding them from the texts takes longer
    than drawing the figure.
    """
    if ax is None:
        width, height = size
        rows = -(-count // columns)
        left, right, bottom, top = _MARGINS
        margins = {"left": left / width, "right": 1.0 - right / width, "top": 1.0 - top / height}
        gaps = {"hspace": 0.12 if sharex else 0.35, "wspace": 0.28}
        grid = {**margins, **gaps, "bottom": (bottom + below) / height}
        made = (
            Figure(figsize=size)
            .subplots(rows, columns, squeeze=False, sharex=sharex, gridspec_kw=grid)
            .reshape(-1)
        )
        for unused in made[count:]:
            unused.remove()
        return made[:count]
    given = np.atleast_1d(np.asarray(ax, dtype=object)).reshape(-1)
    if given.size != count:
        raise InputError(
            f"this figure needs {count} axes, {given.size} were given; pass as many, or none for a"
            " new figure."
        )
    return given


def shades() -> Colormap:
    """Viridis without its lightest part, which vanishes on white paper."""
    return ListedColormap(
        matplotlib.colormaps["viridis"](np.linspace(0.0, 0.88, 256)), name="viridis for lines"
    )


def coloured_lines(ax: Axes, x, curves, values, norm: Normalize) -> LineCollection:
    """Curves (m, n) over x (n,) or (m, n), each in the shade of its value (m,), in one
    collection."""
    x = np.broadcast_to(x, np.shape(curves))
    lines = LineCollection(
        list(np.stack([x, curves], axis=-1)), cmap=shades(), norm=norm, linewidths=0.8
    )
    lines.set_array(np.asarray(values, dtype=float))
    lines.set_rasterized(len(curves) > MANY)
    ax.add_collection(lines)
    ax.autoscale_view()
    return lines


def of_side(x: float) -> Literal["-", "--"]:
    """The line style that tells the two signs of x apart."""
    return "--" if x < 0.0 else "-"


def name_sides(ax: Axes, x) -> None:
    """A legend for `of_side`, where both signs occur."""
    if np.min(x) < 0.0 < np.max(x):
        ax.legend(
            handles=[
                Line2D(
                    [],
                    [],
                    color=GREY,
                    linestyle=of_side(sign),
                    label=f"x {'<' if sign < 0 else '>'} 0",
                )
                for sign in (-1, 1)
            ]
        )


def norm_of(values) -> Normalize:
    """From the least to the largest of the values, with some room where they are all equal."""
    low, high = float(np.min(values)), float(np.max(values))
    return Normalize(low, high) if high > low else Normalize(low - 0.5, high + 0.5)


def key(mappable, axes, label: str) -> Colorbar:
    """A colour bar beside all `axes` that says what the shades mean."""
    axes = np.atleast_1d(axes)
    width = axes[0].figure.get_figwidth()
    bar = axes[0].figure.colorbar(
        mappable, ax=list(axes), label=label, fraction=_KEY_WIDTH / width, pad=0.02, aspect=30
    )
    if isinstance(mappable.norm, LogNorm):
        bar.ax.yaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        bar.ax.yaxis.set_minor_formatter(NullFormatter())
    return bar


def left_out(points: OperatingPoints) -> str:
    """Empty, or how many points are not drawn and why the first is not, in short lines."""
    missing = ~points.feasible
    if not missing.any():
        return ""
    text = (
        f"{missing.sum()} of {missing.size} points are not drawn; the first:"
        f" {points.reason[missing][0]}"
    )
    return "\n".join(textwrap.wrap(text, _NOTE_LINE))


def note_height(text: str) -> float:
    """Inches that `footnote` takes for `text`."""
    return 0.13 * (text.count("\n") + 1) + 0.05 if text else 0.0


def require_some(points: OperatingPoints) -> np.ndarray:
    """The mask of the points that can be drawn. InputError where there is none."""
    if not points.feasible.any():
        raise InputError(f"nothing to draw: {left_out(points)}")
    return points.feasible


def footnote(ax: Axes, text: str) -> None:
    """Small lines under the axis label of `ax`."""
    if text:
        ax.annotate(
            text,
            (0.0, 0.0),
            fontsize=7,
            va="top",
            xycoords="axes fraction",
            xytext=(-40, -36),
            textcoords="offset points",
            annotation_clip=False,
        )


def place(x: float, y: float) -> str:
    """An operating point in words."""
    return f"x = {x:.3g}, y = {y:.3g} m"
