"""Two lead-lag sections (s/(z wn) + 1)/(s/(p wn) + 1), z < p a lead and z > p a lag, Tustin's,
prewarped at wn, in the transposed direct form II; with z = p a section passes u on unchanged.
w = tan(wn Ts/2), wn Ts < pi."""

from __future__ import annotations

import numpy as np

MEMORY = {
    "section_1": "[1] state of lead-lag section 1",
    "section_2": "[1] state of lead-lag section 2",
}
SETTINGS = {"sections": "[1] (zero, pole) of each lead-lag section, times the notch frequency"}
_UNUSED = ((1.0, 1.0), (1.0, 1.0))


def settings(scheduled) -> dict:
    """The values of SETTINGS."""
    given = (tuple(map(float, section)) for section in scheduled.sections)
    return {"sections": (*given, *_UNUSED)[:2]}


def is_used(regulator) -> bool:
    """Whether any section acts."""
    return any(zero != pole for zero, pole in regulator.sections)


def coefficients(w, section):
    """(b0, b1, a1) of a section (z, p) for w = tan(wn Ts/2)."""
    zero = 1.0 / section[0]  # [1]
    pole = 1.0 / section[1]  # [1]
    b0 = (zero + w) / (pole + w)  # [1]
    b1 = (w - zero) / (pole + w)  # [1]
    a1 = (w - pole) / (pole + w)  # [1]
    return b0, b1, a1


def step(u, w, state, section):
    """Section (s/(zero wn) + 1)/(s/(pole wn) + 1), Tustin prewarped at wn."""
    b0, b1, a1 = coefficients(w, section)
    led = np.where(section[0] == section[1], u, b0 * u + state)  # [1]
    new_state = np.where(section[0] == section[1], 0.0, b1 * u - a1 * led)  # [1]
    return led, new_state


def absent_step(u, w, state, section):
    """`step` of a section without effect, to the last bit."""
    return u, 0.0


def rest(u, w, section):
    """Section after u has stood for long."""
    _, b1, a1 = coefficients(w, section)
    return np.where(section[0] == section[1], 0.0, (b1 - a1) * u)


def blocks(w, regulator) -> list:
    """(step of an input and the states, how many states) of each section as a linear block."""

    def block(section):
        def one(u, states):
            led, new_state = step(u, w, states[0], section)
            return led, [new_state]

        return one

    return [(block(section), 1) for section in regulator.sections]
