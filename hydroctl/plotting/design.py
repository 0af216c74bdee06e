"""All figures of one design, by name, drawn when asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from functools import partial

from matplotlib.figure import Figure

from ..model.linearization import LinearFamily
from ..schedule.schedule import GainSchedule
from ..simulation import Scenario, Trajectory
from .family import bode, pole_zero_map
from .loop import root_locus
from .maps import gain_surfaces, margin_map
from .motion import overlay


def design_figures(
    family: LinearFamily,
    schedule: GainSchedule,
    motions: Iterable[tuple[Scenario, Trajectory]] = (),
) -> dict[str, Callable[[], Figure]]:
    """By file name, functions that draw the figures of a design; `motions` are those of the
    validation, one figure for each kind of scenario.

    The root locus is that of the operating point with the largest Ms.
    """
    worst, limits = schedule.margins.worst("Ms"), schedule.specification
    figures = {
        "bode": lambda: bode(family)[0].figure,
        "pole-zero-map": lambda: pole_zero_map(family)[0].figure,
        "gains": lambda: gain_surfaces(schedule)[0].figure,
        "margin-Ms": lambda: margin_map(schedule.margins, "Ms", limit=limits.Ms).figure,
        "root-locus": lambda: root_locus(schedule, worst.x, worst.y, variant=worst.variant).figure,
    }
    kinds: dict[str, list] = {}
    for scenario, trajectory in motions:
        kinds.setdefault(scenario.kind, []).append((scenario, trajectory))
    for kind, group in kinds.items():
        figures[f"validation-{kind}"] = partial(_overlaid, group)
    return figures


def _overlaid(motions: Sequence[tuple[Scenario, Trajectory]]) -> Figure:
    return overlay(motions)[0].figure
