"""Figures of linear families: what the plant is over the grid of operating points."""

from __future__ import annotations

import numpy as np
from matplotlib.ticker import NullFormatter, StrMethodFormatter

from ..errors import InputError
from ..model.characteristics import resonance
from ..model.linearization import LinearFamily
from ..quasi_linear.reduction import SecondOrderFamily
from .maps import cells
from .style import (
    BLACK,
    FREQUENCY,
    MANY,
    OPENING,
    POSITION,
    VERMILLION,
    coloured_lines,
    footnote,
    key,
    left_out,
    name_sides,
    norm_of,
    note_height,
    of_side,
    one_axes,
    place,
    require_some,
    several_axes,
    shades,
    styled,
)

_BODE_SPAN = (0.01, 10.0)
_BODE_POINTS = 240


@styled
def bode(family: LinearFamily | SecondOrderFamily, ax=None, *, omega=None) -> np.ndarray:
    """Bode plot of v/x of every member, coloured by y. The member with the least damping ratio is
    drawn on top and named.

    `ax`: two axes, magnitude and phase. `omega` (n,) in rad/s; by default from 1/100 of the lowest
    to 10 times the highest natural frequency. Returns the two axes.
    """
    shown = require_some(family.points)
    natural, damping = _resonance(family)
    natural, damping, x, y = (
        values[shown] for values in (natural, damping, family.points.x, family.points.y)
    )
    if omega is None:
        omega = np.geomspace(
            _BODE_SPAN[0] * natural.min(), _BODE_SPAN[1] * natural.max(), _BODE_POINTS
        )
    with np.errstate(invalid="ignore"):
        response = family.frequency_response(omega)[shown]
    curves = 20.0 * np.log10(np.abs(response)), np.degrees(np.unwrap(np.angle(response), axis=-1))
    hertz = np.asarray(omega) / (2.0 * np.pi)
    note = left_out(family.points)
    axes = several_axes(ax, 2, (6.4, 5.4), sharex=True, below=note_height(note))
    worst = int(np.argmin(damping))
    for each, curve in zip(axes, curves, strict=True):
        each.set_xscale("log")
        each.xaxis.set_major_formatter(StrMethodFormatter("{x:g}"))
        each.xaxis.set_minor_formatter(NullFormatter())
        lines = coloured_lines(each, hertz, curve, y, norm_of(y))
        label = (
            f"least damped: {place(x[worst], y[worst])}\nζ = {damping[worst]:.3f},"
            f" {natural[worst] / (2 * np.pi):.1f} Hz"
        )
        each.plot(hertz, curve[worst], color=VERMILLION, linestyle="--", label=label)
        each.set_xlim(hertz[0], hertz[-1])
    axes[0].set(
        title=f"From valve opening to speed, {_order(family)}", ylabel="|v/x| (dB re 1 m/s)"
    )
    axes[0].legend(loc="lower left")
    axes[1].set(xlabel=FREQUENCY, ylabel="phase of v/x (degrees)")
    footnote(axes[1], note)
    key(lines, axes, POSITION)
    return axes


@styled
def pole_zero_map(family: LinearFamily, ax=None) -> np.ndarray:
    """Poles (crosses) and zeros (circles) of v/x over the grid, coloured by y.

    `ax`: two axes. The first shows the s-plane; the second the real pole and the zero that nearly
    cancel, over x. Returns both.
    """
    shown = require_some(family.points)
    poles, zeros = family.poles()[shown], family.zeros()[shown][:, 0]
    x, y = family.points.x[shown], family.points.y[shown]
    note = left_out(family.points)
    axes = several_axes(ax, 2, (8.4, 4.4), columns=2, below=note_height(note))
    colours = shades()(norm_of(y)(y))
    cross = {
        "marker": "x",
        "s": 22,
        "linewidths": 0.8,
        "norm": norm_of(y),
        "cmap": shades(),
        "rasterized": y.size > MANY,
    }
    ring = {
        "marker": "o",
        "s": 36,
        "linewidths": 0.8,
        "facecolors": "none",
        "edgecolors": colours,
        "rasterized": y.size > MANY,
    }
    axes[0].scatter(poles.real, poles.imag, c=np.repeat(y, 3), label="poles", **cross)
    axes[0].scatter(zeros, np.zeros_like(zeros), label="zero", **ring)
    marks = axes[1].scatter(poles[:, 0].real, x, c=y, label="real pole", **cross)
    axes[1].scatter(zeros, x, label="zero", **ring)
    axes[0].axvline(0.0, color=BLACK, linewidth=0.8)
    axes[0].set(
        title=f"Poles and zeros of v/x, {_order(family)}",
        xlabel="real part (rad/s)",
        ylabel="imaginary part (rad/s)",
    )
    axes[1].set(title="The pair that nearly cancels", xlabel="real part (rad/s)", ylabel=OPENING)
    for each in axes:
        each.legend(loc="best")
    footnote(axes[0], note)
    key(marks, axes, POSITION)
    return axes


@styled
def resonance_over_stroke(family: LinearFamily | SecondOrderFamily, ax=None) -> np.ndarray:
    """Natural frequency and damping ratio over y, one curve for each opening, coloured by x. `ax`:
    two axes; returns them."""
    shown = require_some(family.points)
    x, y = family.points.x[shown], family.points.y[shown]
    note = left_out(family.points)
    axes = several_axes(ax, 2, (6.4, 5.0), sharex=True, below=note_height(note))
    natural, damping = _resonance(family)
    for each, values in zip(axes, (natural[shown] / (2.0 * np.pi), damping[shown]), strict=True):
        for opening in np.unique(x):
            row = np.flatnonzero(x == opening)
            row = row[np.argsort(y[row])]
            lines = coloured_lines(each, y[row], values[None, row], [opening], norm_of(x))
            lines.set_linestyle(of_side(opening))
    axes[0].set(
        title=f"Resonance over the stroke, {_order(family)}", ylabel="natural frequency (Hz)"
    )
    axes[1].set(xlabel=POSITION, ylabel="damping ratio (1)")
    footnote(axes[1], note)
    name_sides(axes[0], x)
    key(lines, axes, OPENING)
    return axes


@styled
def reduction_error_map(reduced: SecondOrderFamily, ax=None):
    """Largest relative error of the second-order models over the grid, in per cent; the worst point
    is named, points that are not accepted are crossed out. `reduced` over a grid x[:, None] by y.
    Returns the axes.
    """
    require_some(reduced.points)
    x, y = _grid(reduced)
    ax = one_axes(ax, below=0.4)
    error, rejected = 100.0 * reduced.error, reduced.points.feasible & ~reduced.accepted
    cells(ax, x, y, error, "largest relative error (%)", logarithmic=True, crossed=rejected)
    i, j = np.unravel_index(np.nanargmax(error), error.shape)
    where = (
        f"worst {error[i, j]:.3g} % at {place(x[i], y[j])},"
        f" {reduced.error_frequency[i, j] / (2.0 * np.pi):.3g} Hz"
    )
    ax.plot(j, i, "*", color=VERMILLION, markeredgecolor="white", markersize=14, label=where)
    missing = np.count_nonzero(~reduced.points.feasible)
    grey = f", {missing} without an operating point (grey)" if missing else ""
    ax.set_title(
        f"Error of the second-order model\n{rejected.sum()} of {error.size} points above"
        f" {100 * reduced.tolerance:g} %{grey}"
    )
    ax.legend(loc="upper center", bbox_to_anchor=(0.5, -0.14))
    return ax


def _resonance(family) -> tuple[np.ndarray, np.ndarray]:
    """(natural frequency in rad/s, damping ratio) of the pair of poles that does not nearly cancel,
    over the grid."""
    if isinstance(family, SecondOrderFamily):
        return family.natural_frequency, family.damping
    return resonance(family)


def _order(family) -> str:
    return (
        "second-order models" if isinstance(family, SecondOrderFamily) else f"{family.form} models"
    )


def _grid(family) -> tuple[np.ndarray, np.ndarray]:
    """(x, y) of a family over x[:, None] by y; InputError for another arrangement."""
    points = family.points
    if len(points.shape) == 2:
        x, y = points.x[:, 0], points.y[0]
        if (points.x == x[:, None]).all() and (points.y == y).all():
            return x, y
    raise InputError(
        f"a map needs operating points over a grid, not of shape {points.shape}; find them at x[:,"
        " None] and y."
    )
