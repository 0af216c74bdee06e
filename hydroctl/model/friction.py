"""Friction of the piston: viscous, and dry with a smooth change of sign."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from .bends import turns


class Friction(NamedTuple):
    """Forces in N, speeds in m/s."""

    viscous_friction: float
    """N*s/m"""
    coulomb_friction: float
    breakaway_friction: float
    stribeck_speed: float
    creep_speed: float


def is_used(friction: Friction) -> bool:
    """Whether there is dry friction."""
    return friction.breakaway_friction != 0.0


def force(v, friction: Friction):
    """F_f(v) in N, against the motion: viscous friction B v and `dry_force`."""
    return friction.viscous_friction * v + dry_force(v, friction)


def absent_force(v, friction):
    """Viscous friction alone."""
    return friction.viscous_friction * v


def dry_force(v, friction: Friction):
    """(F_c + (F_s - F_c)/(1 + (v/v_s)^2)) v/sqrt(v^2 + v_c^2) in N, against the motion.

    Coulomb friction F_c, and breakaway friction F_s that falls half way to F_c at the Stribeck
    speed v_s (the Lorentzian form, e.g. Armstrong-Helouvry, Dupont and Canudas de Wit, Automatica
    30 (1994) 1083). The last factor makes the sign of v smooth: a piston held by dry friction under
    a force F < F_s creeps at about v_c F/sqrt(F_s^2 - F^2), that is 0.58 v_c at half of F_s. The
    largest dry force stays below F_s by up to 1.4 v_c/v_s of it. Both quotients stand over one
    denominator, because divisions and roots bound the speed of a simulation.
    """
    square, knee = v * v, friction.stribeck_speed**2
    excess = friction.breakaway_friction - friction.coulomb_friction
    dry = friction.coulomb_friction * (knee + square) + excess * knee
    return dry * v / ((knee + square) * np.sqrt(square + friction.creep_speed**2))


def slope(v, friction: Friction):
    """dF_f/dv in N*s/m; negative where breakaway friction falls faster than viscous friction
    rises."""
    return friction.viscous_friction + dry_slope(v, friction)


def dry_slope(v, friction: Friction):
    """Derivative of `dry_force` in N*s/m."""
    ratio = v / friction.stribeck_speed
    excess = (friction.breakaway_friction - friction.coulomb_friction) / (1.0 + ratio**2)
    root = np.sqrt(v * v + friction.creep_speed**2)
    falling = -2.0 * excess * ratio / (1.0 + ratio**2) / friction.stribeck_speed
    rising = (friction.coulomb_friction + excess) * friction.creep_speed**2 / root**3
    return falling * v / root + rising


def bends(before, after, friction: Friction):
    """Whether dry friction turns over between two states of `motion`."""
    is_dry = friction.breakaway_friction > 0.0
    return is_dry & turns(before[2], after[2], friction.creep_speed)


def absent_bends(before, after, friction):
    """Viscous friction is straight."""
    return False


def with_viscous_friction(friction: Friction, viscous_friction):
    """The same friction with another viscous part, N*s/m."""
    return Friction(
        viscous_friction,
        friction.coulomb_friction,
        friction.breakaway_friction,
        friction.stribeck_speed,
        friction.creep_speed,
    )
