"""Figures of several cylinders under one reference."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..synchronization import SynchronizationResult
from .style import BLACK, GREY, POSITION, TIME, several_axes, styled

_ERROR = "synchronisation\nerror (mm)"


@styled
def group_motion(result: SynchronizationResult, ax=None) -> np.ndarray:
    """Positions with the common reference, distances from it, the synchronisation error, and valve
    openings with the rate of the reference, over time. A stop is marked. `ax`: four axes; returns
    them.
    """
    axes = several_axes(ax, 4, (6.4, 7.2), sharex=True)
    t = result.t
    axes[0].plot(t, result.reference, color=BLACK, linestyle=":", linewidth=1.2, label="reference")
    for i, trajectory in enumerate(result.trajectories):
        name = f"cylinder {i + 1}"
        axes[0].plot(t, trajectory.y, label=name)
        axes[1].plot(t, 1e3 * (trajectory.y - result.reference), label=name)
        axes[3].plot(t, trajectory.x, drawstyle="steps-post", label=name)
    axes[2].plot(t, 1e3 * result.error, color=BLACK)
    axes[3].plot(t, result.rate, color=GREY, linestyle=":", label="rate")
    for each, label in zip(
        axes,
        (POSITION, "distance from the\nreference (mm)", _ERROR, "valve opening x,\nrate (of full)"),
        strict=True,
    ):
        each.set_ylabel(label)
        if result.stop is not None:
            each.axvline(result.stop.time, color=GREY, linewidth=0.8)
    axes[0].legend(loc="best", ncols=2, fontsize=7)
    axes[3].set(xlabel=TIME, xlim=(t[0], t[-1]))
    axes[0].set_title(f"{len(result.trajectories)} cylinders, coupling {result.coupling.name}")
    return axes


@styled
def synchronization_errors(results: Mapping[str, SynchronizationResult], ax=None) -> np.ndarray:
    """The synchronisation errors of several motions, by label, on a logarithmic axis, and their
    reference speeds. `ax`: two axes; returns them.
    """
    axes = several_axes(ax, 2, (6.4, 4.8), sharex=True, below=0.5)
    for label, result in results.items():
        error = 1e3 * np.where(result.error > 0.0, result.error, np.nan)
        axes[0].semilogy(result.t, error, label=f"{label}: rms {1e3 * result.metrics.rms:.3g} mm")
        axes[1].plot(result.t, result.v_ref, label=label)
    axes[0].set(ylabel=_ERROR, title="Largest less least position")
    axes[1].legend(
        *axes[0].get_legend_handles_labels(),
        loc="upper center",
        bbox_to_anchor=(0.5, -0.3),
        ncols=2,
        fontsize=7,
    )
    axes[1].set(xlabel=TIME, ylabel="reference\nspeed (m/s)")
    return axes
