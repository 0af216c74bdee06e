"""All figures of one design, by name, drawn when asked for."""

from __future__ import annotations

from collections.abc import Callable, Iterable

from matplotlib.figure import Figure

from ..linearization import LinearFamily
from ..reduction import SecondOrderFamily
from ..schedule import GainSchedule
from ..simulation import Scenario, Trajectory
from .family import bode, pole_zero_map, reduction_error_map, resonance_over_stroke
from .loop import nichols, nyquist, root_locus
from .maps import gain_surfaces, margin_map
from .motion import overlay


def design_figures(
    family: LinearFamily, reduced: SecondOrderFamily, schedule: GainSchedule, motions: Iterable[tuple[Scenario, Trajectory]] = ()
) -> dict[str, Callable[[], Figure]]:
    """By file name, functions that draw the figures of a design; `motions` are those of the validation, one figure for each kind
    of scenario.

    Root locus, Nyquist plot and Nichols chart are those of the operating point with the largest Ms.
    """
    worst, limits = schedule.margins.worst("Ms"), schedule.specification
    point = (schedule, worst.x, worst.y)
    figures = {
        "bode": lambda: bode(family)[0].figure,
        "pole-zero-map": lambda: pole_zero_map(family)[0].figure,
        "resonance": lambda: resonance_over_stroke(reduced)[0].figure,
        "reduction-error": lambda: reduction_error_map(reduced).figure,
        "gains": lambda: gain_surfaces(schedule)[0].figure,
        "margin-Ms": lambda: margin_map(schedule.margins, "Ms", limit=limits.Ms).figure,
        "root-locus": lambda: root_locus(*point, variant=worst.variant).figure,
        "nyquist": lambda: nyquist(*point).figure,
        "nichols": lambda: nichols(*point).figure,
    }
    kinds: dict[str, list] = {}
    for scenario, trajectory in motions:
        kinds.setdefault(scenario.kind, []).append((scenario, trajectory))
    for kind, group in kinds.items():
        figures[f"validation-{kind}"] = lambda group=group: overlay(group)[0].figure
    return figures
