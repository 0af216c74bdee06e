"""What a regulator must hold, over which variations of the plant, and the settings of its law that
are not tuned."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass

from .errors import InputError, unknown_name
from .machine.variants import Ends, added_faults, is_number, is_pair, uncertainty_faults


@dataclass(frozen=True, kw_only=True)
class Specification:
    """Limits, sampling and settings of a design. Raises InputError with every fault at once."""

    sample_time: float = 1e-3
    """Ts in s"""
    delay_samples: float = 1.0
    """computational and communication delay in samples, fractions allowed"""
    Ms: float = 1.6
    """largest |S| allowed, above 1"""
    Mt: float = 1.3
    """largest |T| allowed, above 1"""
    uncertainty: str | Mapping[str, Ends] = "box"
    """"box" (bulk modulus +-30 %, mass +-50 %, supply +-20 %: all plants between its corners,
    searched), {parameter: (low, high)} for a box of your own, of which two numbers are factors on
    the machine's value and two texts with units values of either sign, such as ("-5 kN", "20 kN");
    or plants that are counted: "nominal", "corners" (nominal; bulk modulus +-30 % with mass +-50 %
    at supply +20 %), "one-at-a-time" (nominal; each of these alone, at nominal supply)"""
    added_plants: tuple[Mapping[str, float], ...] = ()
    """further plants, {parameter: value in SI} each, on which the limits must hold; `tune` adds
    those that it finds in a box"""
    gain_margin: float | None = None
    """least factor above 1 that may bring L to -1; None: no limit beside Ms and Mt"""
    phase_margin: float | None = None
    """least phase, of either sign, that may bring L to -1, in rad, below pi/2; None: no limit
    beside Ms and Mt"""
    high_frequency_gain: float | None = None
    """largest |C| at the Nyquist frequency, in x per m/s (velocity) or x per m (position); None: no
    limit"""
    min_crossover: float | None = None
    """least crossover that the tuned loop must reach on every plant, in rad/s; None: as low as the
    other limits demand"""
    Tf: float = 5e-4
    """derivative filter time in s"""
    notch_damping: tuple[float, float] | None = None
    """(zz, zp) of the notch; None: (0.12, 0.75) in a velocity loop and (0.2, 0.6) in a position
    loop"""
    notch_ratio: float | None = None
    """notch frequency over the nominal plant's natural frequency; None: 1, but where
    `notch_damping` is None, too, at most 1.22 times the lowest natural frequency of all plants"""
    lead_lag: tuple[tuple[float, float], tuple[float, float]] = ((0.5, 3.0), (0.05, 0.02))
    """(zero, pole) of the two sections of a lead-lag structure, as multiples of the notch
    frequency; the first is that of a lead"""
    measurement_filter: float = 0.0
    """Tm in s of a first-order filter of the measured quantity; 0: none"""
    derivative_on: str = "error"
    """"error" or "measurement\""""
    set_point_weight: float = 1.0
    """b: the share of the reference that kp sees"""
    pressure_compensation: bool = False
    """whether the command is multiplied by q_ref/q of the measured pressures, which undoes what the
    load does to the gain"""
    dead_band_inverse: float = 0.0
    """the share of the valve's dead band that the command jumps over, smoothly; 0.8 to 0.9 where
    the dead band is known; 0: none"""

    def __post_init__(self):
        faults = [
            fault
            for name, bound in _ABOVE.items()
            if (fault := _number_fault(name, getattr(self, name), bound))
        ]
        if not is_number(self.delay_samples) or self.delay_samples < 0.0:
            faults.append(
                f"delay_samples = {self.delay_samples!r} must be a finite number of at least 0."
            )
        optional = {
            name: bound
            for name, bound in _ABOVE_IF_GIVEN.items()
            if getattr(self, name) is not None
        }
        faults += [
            fault
            for name, bound in optional.items()
            if (fault := _number_fault(name, getattr(self, name), bound))
        ]
        if is_number(self.phase_margin) and self.phase_margin >= math.pi / 2:
            faults.append(
                f"phase_margin = {self.phase_margin!r} rad must be below pi/2 (90 degrees, the"
                " margin of an integrator)."
            )
        faults += uncertainty_faults(self.uncertainty)
        faults += added_faults(self.added_plants)
        damping = self.notch_damping
        if damping is not None and not (is_pair(damping) and 0 < damping[0] < damping[1]):
            faults.append(f"notch_damping = {damping!r} must be (zz, zp) with 0 < zz < zp.")
        faults += _law_faults(self)
        if faults:
            raise InputError(faults)


_ABOVE = {"sample_time": 0.0, "Ms": 1.0, "Mt": 1.0, "Tf": 0.0}
_ABOVE_IF_GIVEN = {
    "gain_margin": 1.0,
    "phase_margin": 0.0,
    "high_frequency_gain": 0.0,
    "min_crossover": 0.0,
    "notch_ratio": 0.0,
}


def _number_fault(name: str, value: object, bound: float) -> str | None:
    return (
        None
        if is_number(value) and value > bound
        else f"{name} = {value!r} must be a finite number above {bound:g}."
    )


def _law_faults(specification: Specification) -> list[str]:
    faults = []
    for name, lowest, highest in (
        ("measurement_filter", 0, math.inf),
        ("set_point_weight", 0, 1),
        ("dead_band_inverse", 0, 1),
    ):
        value = getattr(specification, name)
        if not (is_number(value) and lowest <= value <= highest):
            faults.append(
                f"{name} = {value!r} must be a finite number of at least"
                f" 0{'' if highest == math.inf else ' and at most 1'}."
            )
    sections = specification.lead_lag
    if not (
        isinstance(sections, tuple)
        and len(sections) == 2
        and all(is_pair(s) and min(s) > 0 for s in sections)
    ):
        faults.append(
            f"lead_lag = {sections!r} must be two pairs (zero, pole) of numbers above 0, multiples"
            " of the notch frequency."
        )
    if specification.derivative_on not in ("error", "measurement"):
        faults.append(
            unknown_name("derivative_on", specification.derivative_on, ("error", "measurement"))
        )
    if not isinstance(specification.pressure_compensation, bool):
        faults.append(
            f"pressure_compensation = {specification.pressure_compensation!r} must be True or"
            " False."
        )
    return faults
