"""The spool of a real valve: a second-order lag from command to position, with a rate limit."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .bends import passes


class Spool(NamedTuple):
    """A natural frequency of 0 means an ideal valve: the spool is the command."""

    valve_natural_frequency: float
    """rad/s"""
    valve_damping: float
    valve_rate_limit: float
    """1/s; infinite for none"""


def is_used(spool: Spool) -> bool:
    """Whether the spool lags."""
    return spool.valve_natural_frequency != 0.0


def rates(position, speed, command, spool: Spool):
    """(d position/dt, d speed/dt) in 1/s, 1/s^2 of the lag w^2/(s^2 + 2 zeta w s + w^2) from
    command to spool; not for an ideal valve.

    The command saturates at +-1. The lag is built as a speed loop, wanted speed w/(2 zeta) (command
    - position) and speed lag 1/(2 zeta w), so that the rate limit acts on the wanted speed, as a
    saturating pilot stage does: the spool speed never exceeds it, and without a limit the lag is
    exact.
    """
    wanted = wanted_speed(position, command, spool)
    limited = np.minimum(np.maximum(wanted, -spool.valve_rate_limit), spool.valve_rate_limit)
    return speed, 2.0 * spool.valve_damping * spool.valve_natural_frequency * (limited - speed)


def absent_rates(position, speed, command, spool):
    """An ideal valve's spool stands still between commands."""
    return 0.0, 0.0


def wanted_speed(position, command, spool: Spool):
    """The spool speed in 1/s that the valve's position loop asks for, before its limit."""
    return (
        spool.valve_natural_frequency
        / (2.0 * spool.valve_damping)
        * (np.minimum(np.maximum(command, -1.0), 1.0) - position)
    )


def commanded(position, command, spool: Spool):
    """The spool position at the instant of a new command: an ideal valve's jumps to it."""
    return np.where(spool.valve_natural_frequency == 0.0, command, position)


def bends(before, after, command, spool: Spool, dead_band):
    """Whether the spool passes 0, the dead band or its ends, or its wanted speed the rate limit,
    between two states of `motion`."""
    old, new = before[4], after[4]
    wanted, wants = wanted_speed(old, command, spool), wanted_speed(new, command, spool)
    return (
        passes(old, new, 0.0)
        | passes(np.abs(old), np.abs(new), dead_band)
        | passes(np.abs(old), np.abs(new), 1.0)
        | passes(np.abs(wanted), np.abs(wants), spool.valve_rate_limit)
    )


def absent_bends(before, after, command, spool, dead_band):
    """An ideal valve's spool stands still between commands."""
    return False
