"""`simulate`: the nonlinear plant's answer to a given valve opening."""

from __future__ import annotations

import numpy as np

from ..digits import apart
from ..errors import InputError, SimulationError
from ..machine.actuator import Actuator
from ..model import plant
from .modes import is_stiff
from .trajectory import State, Trajectory, require_motion, rest_state, state_of

_MOST_STEPS = 20_000_000


def simulate(
    actuator: Actuator, t, x, *, initial: State | None = None, load_force=0.0, rtol: float = 1e-6
) -> Trajectory:
    """The motion for the valve command x[k] held from t[k] to t[k+1]; t (n,) in s, rising; x a
    number or (n,) in [-1, 1].

    Starts from `initial` (default: `rest_state(actuator, load_force=...)`). `load_force` in N,
    positive against extension, a number or (n,) held like x, is added to the actuator's. `rtol`
    bounds the local error of every state relative to its size, or to 1 % of its range where it is
    smaller. The integration starts anew at every change of x or load, so that a step of x stays a
    step. The method is Dormand-Prince 5(4), or Rodas4 for a machine that is stiff at the mean
    spacing of t (see `modes.is_stiff`); `integrator` says which. Raises InputError for input that
    cannot be used, SimulationError where the motion could not be followed to the end.
    """
    t, x, load = _checked(t, x, load_force, rtol)
    start = (
        rest_state(actuator, load_force=float(load[0])) if initial is None else state_of(initial)
    )
    p = plant.parameters(actuator)
    out = np.empty((6, t.size))

    from .kernels.builds import motion_for

    kernels = motion_for(actuator)
    method = (
        kernels.stiff if is_stiff(actuator, (t[-1] - t[0]) / (t.size - 1)) else kernels.adaptive
    )
    steps, reached = method.integrate(
        t, x, load + actuator.constant_load, tuple(start), p, rtol, _MOST_STEPS, out
    )
    if reached < t[-1]:
        raise SimulationError(
            f"The motion could not be followed beyond t = {reached:g} s ({steps} steps): the"
            " equations have become too stiff or a chamber has no volume left. Keep y within the"
            f" stroke, 0 to {actuator.stroke:g} m, or raise rtol."
        )
    integrator = f"{method.method.NAME}, rtol {rtol:g}, {steps} steps"
    return require_motion(
        actuator,
        Trajectory(
            t, x, out[3], out[2], out[0], out[1], out[4], integrator, State(*map(float, out[:, -1]))
        ),
    )


def _checked(t, x, load_force, rtol) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    faults, arrays = [], []
    for name, value in (("t", t), ("x", x), ("load_force", load_force), ("rtol", rtol)):
        try:
            arrays.append(np.array(value, dtype=float))
        except (TypeError, ValueError):
            raise InputError(f"{name} is not a number or an array of numbers.") from None
        if not np.isfinite(arrays[-1]).all():
            faults.append(f"{name} holds a value that is not finite; remove it.")
    t, x, load, _ = arrays
    if t.ndim != 1 or t.size < 2 or not np.diff(t).min() > 0.0:
        faults.append(f"t of shape {t.shape} must be one row of at least two rising times.")
    for name, array in (("x", x), ("load_force", load)):
        if array.shape not in ((), t.shape):
            faults.append(
                f"{name} has shape {array.shape}; give one number or one for each of the {t.size}"
                " times."
            )
    if x.size and (x.max() > 1.0 or x.min() < -1.0):
        largest, _ = apart(np.abs(x).max(), 1.0)
        faults.append(f"x reaches {largest} in size; a valve opening lies in [-1, 1].")
    if arrays[3].shape != () or not 1e-13 <= rtol <= 1e-2:
        faults.append(f"rtol = {rtol!r} is outside 1e-13 ... 1e-2.")
    if faults:
        raise InputError(faults)
    return t, *(array if array.ndim else np.full(t.shape, array) for array in (x, load))
