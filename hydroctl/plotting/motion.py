"""Figures of motions in time: what the plant did in a scenario, and several regulators in the same
one."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np

from ..simulation import Scenario, Trajectory
from .style import BLACK, BLUE, POSITION, SPEED, TIME, VERMILLION, several_axes, styled

_OPENING = "valve opening x\n(of full)"
_LABELS = (POSITION, SPEED, _OPENING, "pressure a (bar)", "pressure b (bar)")
_PASCAL_PER_BAR = 1e5


@styled
def traces(trajectory: Trajectory, scenario: Scenario | None = None, ax=None) -> np.ndarray:
    """Position, speed, valve opening and chamber pressures of one motion over time; with the
    scenario its reference and name.

    The spool is drawn where it does not follow its command at once. `ax`: four axes; returns them.
    """
    axes = several_axes(ax, 4, (6.4, 6.6), sharex=True)
    t, (y, v, x, p_a, p_b) = trajectory.t, _signals(trajectory)
    for each, values, label in zip(axes, (y, v, x), _LABELS, strict=False):
        each.plot(t, values, color=BLUE, label="motion")
        each.set_ylabel(label)
    if scenario is not None:
        controlled = axes[_LABELS.index(scenario.quantity.label)]
        _reference(controlled, scenario)
        controlled.legend(loc="best")
    axes[2].lines[0].set(drawstyle="steps-post", label="command")
    if (trajectory.spool != x).any():
        axes[2].plot(t, trajectory.spool, color=VERMILLION, linestyle="--", label="spool")
        axes[2].legend(loc="best")
    axes[3].plot(t, p_a, color=BLUE, label="chamber a")
    axes[3].plot(t, p_b, color=VERMILLION, linestyle="--", label="chamber b")
    axes[3].legend(loc="best")
    axes[3].set(ylabel="pressure (bar)", xlabel=TIME, xlim=(t[0], t[-1]))
    axes[0].set_title("Motion" if scenario is None else scenario.name)
    return axes


@styled
def overlay(motions: Sequence[tuple[Scenario, Trajectory]], ax=None) -> np.ndarray:
    """Several motions, each in its own scenario, over each other: position, speed, valve opening,
    pressure in chamber a and in b.

    References are dotted. `ax`: five axes; returns them.
    """
    axes = several_axes(ax, 5, (6.4, 8.2), sharex=True, below=0.7)
    for scenario, trajectory in motions:
        _reference(axes[_LABELS.index(scenario.quantity.label)], scenario, linewidth=0.9)
        for each, values in zip(axes, _signals(trajectory), strict=True):
            each.plot(trajectory.t, values, label=scenario.name)
    for each, label in zip(axes, _LABELS, strict=True):
        each.set_ylabel(label)
    axes[0].set_title("Validation on the nonlinear plant")
    axes[-1].set_xlabel(TIME)
    axes[-1].legend(loc="upper center", bbox_to_anchor=(0.5, -0.42), ncols=2, fontsize=7)
    return axes


@styled
def comparison(trajectories: Mapping[str, Trajectory], scenario: Scenario, ax=None) -> np.ndarray:
    """The controlled quantity with its reference, the control error and the valve opening of
    several motions in one scenario, by name: a schedule beside a fixed regulator, for example.
    `ax`: three axes; returns them.
    """
    axes = several_axes(ax, 3, (6.4, 5.8), sharex=True)
    quantity = scenario.quantity
    _reference(axes[0], scenario)
    for key, trajectory in trajectories.items():
        values = getattr(trajectory, quantity.signal)
        axes[0].plot(trajectory.t, values, label=key)
        axes[1].plot(trajectory.t, scenario.reference - values, label=key)
        axes[2].plot(trajectory.t, trajectory.x, drawstyle="steps-post", label=key)
    axes[0].set(title=scenario.name, ylabel=quantity.label, xlim=(scenario.t[0], scenario.t[-1]))
    axes[1].set_ylabel(f"control error ({quantity.unit})")
    axes[2].set(xlabel=TIME, ylabel=_OPENING)
    axes[0].legend(loc="best")
    return axes


def _signals(trajectory: Trajectory) -> tuple[np.ndarray, ...]:
    """Position, speed, valve opening, and the pressures in bar."""
    t = trajectory
    return t.y, t.v, t.x, t.p_a / _PASCAL_PER_BAR, t.p_b / _PASCAL_PER_BAR


def _reference(axes, scenario: Scenario, **look) -> None:
    look = {"color": BLACK, "linestyle": ":", "linewidth": 1.2, "drawstyle": "steps-post"} | look
    axes.plot(scenario.t, scenario.reference, label="reference", **look)
