"""J4: the largest integral gains of PI + notch at 60 points of the reference machine, held over
nominal plant and four corners.

Times are per point; the peers, which tune every point for itself, are timed at one. Errors are by
how much the largest Ms or Mt of all plants exceeds its limit there, relative; NaN where a loop is
unstable. Last the whole design, for the whole box, with the times of its stages.
"""

from __future__ import annotations

import tempfile
import time
from dataclasses import replace

import numpy as np
from scipy.optimize import minimize

import hydroctl as hc
from hydroctl.loop.margins import Loop, analyse
from hydroctl.loop.sampled_plant import SampledFamily, frequency_grid
from hydroctl.regulator.structures import Regulators

from .measure import Contender, Row, compare

_STRUCTURE = "pi+notch"


def rows(*, smallest: bool) -> list[Row]:
    """Six openings by ten positions and a whole design, or two by two and none."""
    actuator, specification = hc.load_actuator("reference"), hc.Specification(uncertainty="corners")
    x = np.array([-1.0, 1.0] if smallest else [-1.0, -0.3, -0.02, 0.02, 0.3, 1.0])
    y = np.linspace(0.0, 0.5, 2 if smallest else 10)
    best = hc.tune(actuator, x, y, structure=_STRUCTURE, specification=specification)
    plants = best.sampled_plants(x, y)
    first = plants.shape[1] * plants.shape[2] * np.arange(plants.shape[0])
    point = _Point(plants.take(first), best.specification)

    def tuned():
        schedule = hc.tune(actuator, x, y, structure=_STRUCTURE, specification=specification)
        return _excess(
            plants, schedule.gains(x[:, None], y).broadcast_to(plants.shape), specification
        )

    def share(method):
        return (
            f"ki {point.largest(method).ki.item() / best.gains(x[0], y[0]).ki:.2f} of the tuner's"
        )

    contenders = [
        Contender(
            f"scipy {method}, point by point",
            lambda method=method: point.error(method),
            note=share(method),
        )
        for method in ("SLSQP", "Nelder-Mead")
    ]
    count = x.size * y.size
    contenders.append(Contender(f"hydroctl tune, {count} points", tuned, units=count))
    found = compare("J4", contenders, 1 if smallest else 5)
    return found if smallest else [*found, _whole_design(actuator)]


class _Point:
    """Largest ki at one point by general-purpose optimizers, on the plants (variants,) there, from
    a small gain."""

    def __init__(self, plants: SampledFamily, specification: hc.Specification):
        self.plants, self.specification = plants, specification
        self.omega = frequency_grid(plants)
        notch = specification.notch_ratio * plants.resonance[:1, 0]
        self.unit = Regulators(
            specification.sample_time,
            *np.zeros((3, 1)),
            notch,
            specification.Tf,
            *specification.notch_damping,
        )
        self.terms = (
            plants.frequency_response(self.omega)[..., None] * self.unit.terms(self.omega)[..., :2]
        )
        self.scale = 1.0 / np.median(np.abs(self.terms), axis=(0, 1))

    def slack(self, gains):
        """What is left to the limits of Ms and Mt; not negative where they hold."""
        L = self.terms @ (gains * self.scale)
        S, T = 1.0 / np.abs(1.0 + L), np.abs(L / (1.0 + L))
        return np.array(
            [1.0 - S.max() / self.specification.Ms, 1.0 - T.max() / self.specification.Mt]
        )

    def largest(self, method: str) -> Regulators:
        """The regulator that `method` ends with."""
        start = np.array([0.01, 0.01])
        if method == "SLSQP":
            constraint = {"type": "ineq", "fun": self.slack}
            gains = minimize(
                lambda g: -g[1],
                start,
                method=method,
                constraints=constraint,
                bounds=[(0.0, 50.0)] * 2,
            ).x
        else:
            gains = minimize(
                lambda g: -g[1] - 1e3 * np.minimum(self.slack(g), 0.0).sum(), start, method=method
            ).x
        kp, ki = gains * self.scale
        return replace(self.unit, kp=np.array([kp]), ki=np.array([ki]))

    def error(self, method: str) -> float:
        """The excess of what `largest` finds."""
        return _excess(
            self.plants, self.largest(method).broadcast_to(self.plants.shape), self.specification
        )


def _excess(
    plants: SampledFamily, regulators: Regulators, specification: hc.Specification
) -> float:
    found = analyse(Loop(plants, regulators))
    if not found.stable.all():
        return np.nan
    return float(
        max(0.0, found.Ms.max() / specification.Ms - 1.0, found.Mt.max() / specification.Mt - 1.0)
    )


def _whole_design(actuator: hc.Actuator) -> Row:
    """`hydroctl design` after a first one has compiled and loaded everything, files included."""
    for _ in range(2):
        start = time.perf_counter()
        found = hc.design(actuator)
        saving = time.perf_counter()
        with tempfile.TemporaryDirectory() as directory:
            found.save(directory)
        end = time.perf_counter()
    stages = found.seconds | {"files": end - saving}
    note = ", ".join(f"{name} {seconds:.2f} s" for name, seconds in stages.items())
    return Row("J4", "hydroctl design, whole, warm", end - start, np.nan, np.nan, note)
