"""All figures of one design, by name, drawn when asked for."""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable

from matplotlib.figure import Figure

from ..linearization import LinearFamily
from ..reduction import SecondOrderFamily
from ..schedule import GainSchedule
from ..simulation import Scenario, Trajectory
from .family import bode, pole_zero_map, reduction_error_map, resonance_over_stroke
from .loop import nichols, nyquist, root_locus
from .maps import gain_surfaces, margin_map
from .motion import traces


def design_figures(
    family: LinearFamily, reduced: SecondOrderFamily, schedule: GainSchedule, runs: Iterable[tuple[Scenario, Trajectory]] = ()
) -> dict[str, Callable[[], Figure]]:
    """By file name, functions that draw the figures of a design; `runs` are the validation's scenarios and motions.

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
    for number, (scenario, trajectory) in enumerate(runs, 1):
        name = f"validation-{number:02d}-{re.sub('[^a-z0-9]+', '-', scenario.name.lower()).strip('-')}"
        figures[name] = lambda scenario=scenario, trajectory=trajectory: traces(trajectory, scenario)[0].figure
    return figures
