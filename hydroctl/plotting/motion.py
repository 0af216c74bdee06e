"""Figures of motions in time: what the plant did in a scenario, and several regulators in the same one."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from ..simulation import Scenario, Trajectory
from .style import BLACK, BLUE, TIME, VERMILLION, several_axes, styled

_CONTROLLED = {"velocity": ("v", "speed v (m/s)"), "position": ("y", "position y (m)")}
_PASCAL_PER_BAR = 1e5


@styled
def traces(trajectory: Trajectory, scenario: Scenario | None = None, ax=None) -> np.ndarray:
    """Position, speed, valve opening and chamber pressures of one motion over time; with the scenario its reference and name.

    The spool is drawn where it does not follow its command at once. `ax`: four axes; returns them.
    """
    axes = several_axes(ax, 4, (6.4, 6.6), sharex=True)
    t = trajectory.t
    for each, (name, label) in zip(axes, (_CONTROLLED["position"], _CONTROLLED["velocity"]), strict=False):
        each.plot(t, getattr(trajectory, name), color=BLUE, label=name)
        each.set_ylabel(label)
        if scenario is not None and _CONTROLLED[scenario.loop][0] == name:
            _reference(each, scenario)
            each.legend(loc="best")
    _opening(axes[2], trajectory, color=BLUE, label="command")
    if (trajectory.spool != trajectory.x).any():
        axes[2].plot(t, trajectory.spool, color=VERMILLION, linestyle="--", label="spool")
        axes[2].legend(loc="best")
    axes[3].plot(t, trajectory.p_a / _PASCAL_PER_BAR, color=BLUE, label="chamber a")
    axes[3].plot(t, trajectory.p_b / _PASCAL_PER_BAR, color=VERMILLION, linestyle="--", label="chamber b")
    axes[3].legend(loc="best")
    axes[3].set(ylabel="pressure (bar)", xlabel=TIME, xlim=(t[0], t[-1]))
    axes[0].set_title("Motion" if scenario is None else scenario.name)
    return axes


@styled
def comparison(trajectories: Mapping[str, Trajectory], scenario: Scenario, ax=None) -> np.ndarray:
    """The controlled quantity with its reference, the control error and the valve opening of several motions in one scenario, by
    name: a schedule beside a fixed regulator, for example. `ax`: three axes; returns them.
    """
    axes = several_axes(ax, 3, (6.4, 5.8), sharex=True)
    name, label = _CONTROLLED[scenario.loop]
    _reference(axes[0], scenario)
    for key, trajectory in trajectories.items():
        values = getattr(trajectory, name)
        axes[0].plot(trajectory.t, values, label=key)
        axes[1].plot(trajectory.t, scenario.reference - values, label=key)
        _opening(axes[2], trajectory, label=key)
    unit = label[label.index("(") :]
    axes[0].set(title=scenario.name, ylabel=label, xlim=(scenario.t[0], scenario.t[-1]))
    axes[1].set_ylabel(f"control error {unit}")
    axes[2].set_xlabel(TIME)
    axes[0].legend(loc="best")
    return axes


def _reference(axes, scenario: Scenario) -> None:
    axes.plot(scenario.t, scenario.reference, color=BLACK, linestyle=":", linewidth=1.2, drawstyle="steps-post", label="reference")


def _opening(axes, trajectory: Trajectory, **look) -> None:
    axes.plot(trajectory.t, trajectory.x, drawstyle="steps-post", **look)
    axes.set_ylabel("valve opening x\n(of full)")
