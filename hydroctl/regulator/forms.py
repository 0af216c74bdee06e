"""PID forms and the conversions between them, each exact for the filtered derivative with its
filter time Tf.

    parallel    C(s) = kp + ki/s + kd s/(Tf s + 1)
    standard    C(s) = K (1 + 1/(Ti s) + Td s/(Tf s + 1))
    series      C(s) = K (1 + 1/(Ti s)) (1 + Td s/(Tf s + 1))

Ti = inf leaves the integral out. From standard to series, Td' is the smaller root of Td'^2/Ti - (1
- Tf/Ti) Td' + Td = 0, and K' = K (1 - Td'/Ti), Ti' = Ti - Td'. It is real and not negative only for
Ti - Tf >= 2 sqrt(Ti Td), which for Tf = 0 is Ti >= 4 Td: the series form has real zeros, the others
may have a complex pair. (Astrom and Hagglund: Advanced PID Control, 2006.)
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from numbers import Real

import numpy as np

from ..digits import apart
from ..errors import InputError


@dataclass(frozen=True)
class ParallelForm:
    """kp in units of u per unit of e, ki per second, kd times second; Tf in s. Gains of any
    sign."""

    kp: float
    ki: float = 0.0
    kd: float = 0.0
    Tf: float = 0.0

    def __post_init__(self):
        faults = [
            f"{name} = {getattr(self, name)!r} must be a finite number."
            for name in ("kp", "ki", "kd")
            if not _finite(self, name)
        ]
        _raise(faults + _filter_faults(self))

    def frequency_response(self, omega) -> np.ndarray:
        """(n,) complex C at omega in rad/s."""
        s = 1j * np.asarray(omega, dtype=float)
        return self.kp + self.ki / s + self.kd * s / (self.Tf * s + 1.0)


@dataclass(frozen=True)
class _TimeForm:
    """A form of one gain and three times."""

    K: float
    Ti: float = math.inf
    Td: float = 0.0
    Tf: float = 0.0

    def __post_init__(self):
        _raise(_time_faults(self) + _filter_faults(self))


@dataclass(frozen=True)
class StandardForm(_TimeForm):
    """K in units of u per unit of e, not 0; times in s: Ti > 0 (inf: no integral), Td >= 0, Tf >=
    0."""

    def frequency_response(self, omega) -> np.ndarray:
        """(n,) complex C at omega in rad/s."""
        s = 1j * np.asarray(omega, dtype=float)
        return self.K * (1.0 + 1.0 / self.Ti / s + self.Td * s / (self.Tf * s + 1.0))


@dataclass(frozen=True)
class SeriesForm(_TimeForm):
    """K, Ti, Td of the series form (K', Ti', Td' where both forms stand side by side), with the
    ranges of `StandardForm`."""

    def frequency_response(self, omega) -> np.ndarray:
        """(n,) complex C at omega in rad/s."""
        s = 1j * np.asarray(omega, dtype=float)
        return self.K * (1.0 + 1.0 / self.Ti / s) * (1.0 + self.Td * s / (self.Tf * s + 1.0))


Form = ParallelForm | StandardForm | SeriesForm


def to_parallel(form: Form) -> ParallelForm:
    """The same regulator in parallel form; always possible. kd is negative for a series form with
    Tf > Ti."""
    if isinstance(form, ParallelForm):
        return form
    ki = form.K / form.Ti
    if isinstance(form, StandardForm):
        return ParallelForm(form.K, ki, form.K * form.Td, form.Tf)
    return ParallelForm(form.K + ki * form.Td, ki, (form.K - ki * form.Tf) * form.Td, form.Tf)


def to_standard(form: Form) -> StandardForm:
    """The same regulator in standard form. InputError where kp is 0, or ki or kd has another sign
    than kp."""
    if isinstance(form, StandardForm):
        return form
    parallel = to_parallel(form)
    kp, ki, kd = parallel.kp, parallel.ki, parallel.kd
    if kp == 0.0:
        raise InputError(
            f"kp = 0 (ki = {ki:g}, kd = {kd:g}) has no standard form, in which K scales every term."
            " Keep the parallel form."
        )
    if ki * kp < 0.0 or kd * kp < 0.0:
        raise InputError(
            f"kp = {kp:g}, ki = {ki:g}, kd = {kd:g} differ in sign and have no standard form,"
            " because Ti or Td would be negative. Keep the parallel form."
        )
    return StandardForm(kp, kp / ki if ki else math.inf, kd / kp, parallel.Tf)


def to_series(form: Form) -> SeriesForm:
    """The same regulator in series form. InputError where its zeros are complex, or where it has no
    standard form."""
    if isinstance(form, SeriesForm):
        return form
    standard = to_standard(form)
    K, Ti, Td, Tf = standard.K, standard.Ti, standard.Td, standard.Tf
    remainder = 1.0 - Tf / Ti
    discriminant = remainder**2 - 4.0 * Td / Ti
    if remainder <= 0.0 or discriminant < 0.0:
        least = 4.0 * Td if Tf == 0.0 else Tf + 2.0 * Td + 2.0 * math.sqrt(Td * (Td + Tf))
        given, needed = apart(Ti, least)
        raise InputError(
            f"Ti = {given} s, Td = {Td:g} s, Tf = {Tf:g} s have no series form, which has real"
            f" zeros only: Ti must be at least {'4 Td = ' if Tf == 0.0 else ''}{needed} s. Raise"
            " Ti, lower Td or keep the standard form."
        )
    lead = 2.0 * Td / (remainder + math.sqrt(discriminant))
    return SeriesForm(K * (1.0 - lead / Ti), Ti - lead, lead, Tf)


def _time_faults(form: _TimeForm) -> list[str]:
    faults = (
        []
        if _finite(form, "K") and form.K != 0.0
        else [f"K = {form.K!r} must be a finite number other than 0."]
    )
    if not (isinstance(form.Ti, Real) and form.Ti > 0.0):
        faults.append(f"Ti = {form.Ti!r} must be above 0 s; math.inf leaves the integral out.")
    if not (_finite(form, "Td") and form.Td >= 0.0):
        faults.append(f"Td = {form.Td!r} must be a finite time of at least 0 s.")
    return faults


def _filter_faults(form: ParallelForm | _TimeForm) -> list[str]:
    return (
        []
        if _finite(form, "Tf") and form.Tf >= 0.0
        else [f"Tf = {form.Tf!r} must be a finite time of at least 0 s."]
    )


def _finite(form: ParallelForm | _TimeForm, name: str) -> bool:
    value = getattr(form, name)
    return isinstance(value, Real) and not isinstance(value, bool) and math.isfinite(value)


def _raise(faults: list[str]) -> None:
    if faults:
        raise InputError(faults)
