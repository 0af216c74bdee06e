"""Figures from results. A plot function takes a result and axes (or makes a figure), draws, and
returns the axes.

    ax = plotting.margin_map(schedule.margins, "Ms")
    plotting.save_figure(ax.figure, "figures", "Ms")

Figures do not register with pyplot. In a notebook, `%matplotlib inline` shows `ax.figure`.
"""

from .campaign import distributions
from .design import design_figures
from .family import bode, pole_zero_map, reduction_error_map, resonance_over_stroke
from .loop import nichols, nyquist, root_locus
from .maps import gain_surfaces, margin_map
from .motion import comparison, overlay, traces
from .output import save_figure, save_figures
from .synchronization import group_motion, synchronization_errors

__all__ = [
    "bode",
    "comparison",
    "design_figures",
    "distributions",
    "gain_surfaces",
    "group_motion",
    "margin_map",
    "nichols",
    "nyquist",
    "overlay",
    "pole_zero_map",
    "reduction_error_map",
    "resonance_over_stroke",
    "root_locus",
    "save_figure",
    "save_figures",
    "synchronization_errors",
    "traces",
]
