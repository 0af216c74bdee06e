"""Figures of many motions at once: how often a campaign stays below a value."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..errors import InputError, unknown_name
from .style import several_axes, styled

_METRICS = {
    "rise_time": ("rise time (s)", 1.0),
    "settling_time": ("settling time (s)", 1.0),
    "overshoot": ("overshoot (% of the step)", 100.0),
    "oscillation": ("residual oscillation (% of the step)", 100.0),
    "steady_error": ("steady error (% of the step)", 100.0),
    "peak_pressure": ("peak pressure (bar)", 1e-5),
    "lowest_pressure": ("lowest pressure (bar)", 1e-5),
    "cavitation_time": ("cavitation time (s)", 1.0),
    "saturation_time": ("time at full opening (s)", 1.0),
    "beyond_stroke": ("overtravel (m)", 1.0),
}


@styled
def distributions(
    campaigns: Mapping[str, Mapping[str, np.ndarray]],
    names: Sequence[str] = ("settling_time", "overshoot", "oscillation", "peak_pressure"),
    ax=None,
) -> np.ndarray:
    """The share of all cases at or below a value of each metric, one curve for each campaign.

    `campaigns`: by label, the metrics of every case (count,) in SI under the names of `Metrics`. A
    case without a finite value (failed, never settled, no step) counts among all, so that its curve
    ends below 1. `ax`: one axes for each name; returns them.
    """
    if faults := [unknown_name("metric", name, _METRICS) for name in names if name not in _METRICS]:
        raise InputError(faults)
    axes = several_axes(
        ax, len(names), (8.0, 0.6 + 2.7 * -(-len(names) // 2)), columns=min(2, len(names))
    )
    for each, name in zip(axes, names, strict=True):
        label, factor = _METRICS[name]
        for campaign, metrics in campaigns.items():
            values = np.asarray(metrics[name], dtype=float)
            finite = np.sort(values[np.isfinite(values)])
            share = np.arange(1, finite.size + 1) / values.size
            each.plot(
                factor * finite,
                share,
                drawstyle="steps-post",
                label=f"{campaign}: {finite.size} of {values.size} cases",
            )
        each.set(xlabel=label, ylabel="share of all cases (1)", ylim=(0.0, 1.02))
        each.legend(loc="lower right", fontsize=7)
    axes[0].set_title("Distribution over the campaign")
    return axes
