"""Margins of one sampled loop by a route that shares nothing with the product's: no partial
fractions, no frequency grid.

The plant is held exactly by scipy's matrix exponential, commands that wait are states, C is
evaluated from its formula. The frequencies are the angles of the eigenvalues of the open and of the
closed loop, with steps of a share of each one's width about it, between which crossings and peaks
are bracketed and then found by bisection and by golden section.
"""

import math
from dataclasses import dataclass

import numpy as np
from scipy.linalg import expm

PER_DECADE = 300
SCALE = np.array([1e6, 1e6, 1.0])


@dataclass
class Found:
    Ms: float
    Mt: float
    gain_margin: float
    gain_reduction_margin: float
    phase_margin: float
    delay_margin: float
    crossover: float
    stable: bool


def continuous(actuator, A, b, loop):
    """(A, B, c) of command to measured quantity, with the valve's lag, pressures in MPa."""
    frequency, damping = actuator.valve_natural_frequency, actuator.valve_damping
    A, b = A * SCALE / SCALE[:, None], np.reshape(b, 3) / SCALE
    if frequency is None:
        full, B = A, b
    else:
        full = np.block([[A, b[:, None], np.zeros((3, 1))], [np.zeros((2, 5))]])
        full[3, 4], full[4, 3], full[4, 4] = 1.0, -(frequency**2), -2.0 * damping * frequency
        full[:, 4] *= frequency  # the spool's rate in units of its natural frequency
        full[4] /= frequency
        B = np.array([0.0, 0.0, 0.0, 0.0, frequency])
    c = np.zeros(len(B))
    c[2] = 1.0
    if loop == "position":
        full = np.block([[full, np.zeros((len(B), 1))], [c[None, :], np.zeros((1, 1))]])
        B, c = np.append(B, 0.0), np.append(0.0 * c, 1.0)
    return full, B, c


def sampled(A, B, c, Ts, delay):
    """(F, G, c): the exact zero-order hold, a command that acts `delay` samples late."""
    n, whole = len(B), math.floor(delay)
    late = delay - whole

    def hold(t):
        block = expm(np.block([[A * t, B[:, None] * t], [np.zeros((1, n + 1))]]))
        return block[:n, :n], block[:n, n]

    (F, whole_step), (_, newest) = hold(Ts), hold(Ts * (1.0 - late))
    acts = (
        [newest] if late == 0.0 else [newest, whole_step - newest]
    )  # of the commands `whole`, `whole` + 1 samples old
    memory = whole + len(acts) - 1
    full, G = np.zeros((n + memory, n + memory)), np.zeros(n + memory)
    full[:n, :n] = F
    for age, effect in enumerate(acts, start=whole):
        if age == 0:
            G[:n] += effect
        else:
            full[:n, n + age - 1] += effect
    for k in range(memory):
        if k == 0:
            G[n] = 1.0
        else:
            full[n + k, n + k - 1] = 1.0
    return full, G, np.append(c, np.zeros(memory))


def regulator(z, Ts, kp, ki, kd, Tf, notch=None):
    """C(z); `notch` is (wn, zz, zp), Tustin's substitution prewarped at wn."""
    C = kp + ki * Ts / (z - 1.0) + kd * (1.0 - 1.0 / z) / (Tf * (1.0 - 1.0 / z) + Ts)
    if notch is not None:
        wn, zz, zp = notch
        s = wn / math.tan(wn * Ts / 2.0) * (z - 1.0) / (z + 1.0)
        C = C * (s * s + 2.0 * zz * wn * s + wn * wn) / (s * s + 2.0 * zp * wn * s + wn * wn)
    return C


def closed_poles(F, G, c, Ts, kp, ki, kd, Tf, notch=None):
    """Zeros of (denominator + numerator) of the loop, by a realization that is built block by
    block."""
    blocks = [(1.0, Ts * ki, 0.0)] if ki else []
    fade = Tf / (Tf + Ts)
    blocks += [(fade, -(1.0 - fade) * kd / (Tf + Ts), kd / (Tf + Ts))] if kd else []
    A, B = np.diag([b[0] for b in blocks]), np.array([b[1] for b in blocks])
    C, D = np.ones(len(blocks)), kp + sum(b[2] for b in blocks)
    if notch is not None:
        wn, zz, zp = notch
        q = wn / math.tan(wn * Ts / 2.0)
        top, bottom = (
            np.array(
                [
                    q * q + 2 * d * wn * q + wn * wn,
                    2 * (wn * wn - q * q),
                    q * q - 2 * d * wn * q + wn * wn,
                ]
            )
            for d in (zz, zp)
        )
        top, bottom = top / bottom[0], bottom / bottom[0]
        An, Bn = np.array([[-bottom[1], 1.0], [-bottom[2], 0.0]]), top[1:] - bottom[1:] * top[0]
        Cn, Dn, m = np.array([1.0, 0.0]), top[0], len(B)
        A = np.block([[A.reshape(m, m), np.zeros((m, 2))], [np.outer(Bn, C), An]])
        B, C, D = np.append(B, Bn * D), np.append(Dn * C, Cn), Dn * D
    m = len(B)
    loop = np.block([[A.reshape(m, m), -np.outer(B, c)], [np.outer(G, C), F - D * np.outer(G, c)]])
    return np.linalg.eigvals(loop)


def frequencies(poles, Ts):
    """Logarithmic, and about the angle of each of `poles` in steps of a tenth of its width and then
    ever wider ones."""
    nyquist = math.pi / Ts
    omega = [np.geomspace(1e-11 * nyquist, nyquist, 11 * PER_DECADE)]
    for pole in poles:
        if abs(pole) > 1e-9:
            s = np.log(complex(pole)) / Ts
            width = max(abs(s.real), 1e-12 * nyquist)
            steps = 0.1 * np.concatenate([np.arange(100), 100 * 1.05 ** np.arange(1, 400)])
            omega += [abs(s.imag) + sign * width * steps for sign in (-1.0, 1.0)]
    omega = np.unique(np.concatenate(omega))
    return omega[(omega > 0.0) & (omega <= nyquist)]


def margins(plant, Ts, law) -> Found:
    """Of the sampled plant (F, G, c) with the gains and settings `law` of `regulator`."""
    F, G, c = plant
    poles, at_zero = np.linalg.eig(F)
    left = c @ at_zero
    right = np.linalg.solve(at_zero, G) if np.linalg.cond(at_zero) < 1e8 else None

    def L(omega):
        z = np.exp(1j * np.asarray(omega, float) * Ts)
        if right is None:
            P = np.linalg.solve(z[..., None, None] * np.eye(len(G)) - F, G[:, None])[..., 0] @ c
        else:
            P = (left * right / (z[..., None] - poles)).sum(axis=-1)
        return P * regulator(z, Ts, **law)

    closed = closed_poles(F, G, c, Ts, **law)
    omega = frequencies([*poles, *closed], Ts)
    values = L(omega)

    def crossings(function):
        sign = np.signbit(function(values))
        k = np.nonzero(sign[1:] != sign[:-1])[0]
        low, high, left_sign = omega[k], omega[k + 1], sign[k]
        for _ in range(80):
            middle = 0.5 * (low + high)
            same = np.signbit(function(L(middle))) == left_sign if k.size else np.zeros(0, bool)
            low, high = np.where(same, middle, low), np.where(same, high, middle)
        return low

    def highest(function):
        best = 0.0
        heights = function(values)
        for k in np.argsort(heights)[-5:]:
            low, high = omega[max(k - 1, 0)], omega[min(k + 1, len(omega) - 1)]
            for _ in range(60):
                a, b = low + 0.381966 * (high - low), low + 0.618034 * (high - low)
                low, high = (
                    (low, b)
                    if function(L(np.array([a])))[0] > function(L(np.array([b])))[0]
                    else (a, high)
                )
            best = max(best, heights[k], function(L(np.array([0.5 * (low + high)])))[0])
        return float(best)

    gains, real = crossings(lambda v: np.abs(v) - 1.0), crossings(np.imag)
    on_axis = np.concatenate(
        [L(real) if real.size else np.zeros(0, complex), L(np.array([math.pi / Ts]))]
    )
    factors = -1.0 / on_axis.real[(on_axis.real < 0.0) & (on_axis.real > -1e9)]
    phases = np.angle(-L(gains)) if gains.size else np.zeros(0)
    lags = np.where(phases > 0.0, phases, phases + 2.0 * math.pi) / gains
    return Found(
        Ms=highest(lambda v: 1.0 / np.abs(1.0 + v)),
        Mt=highest(lambda v: np.abs(v / (1.0 + v))),
        gain_margin=float(factors[factors > 1.0].min(initial=math.inf)),
        gain_reduction_margin=float(factors[factors < 1.0].max(initial=0.0)),
        phase_margin=float(np.abs(phases).min(initial=math.inf)),
        delay_margin=float(lags.min(initial=math.inf)),
        crossover=float(gains.max(initial=0.0)),
        stable=bool(np.abs(closed).max() < 1.0),
    )


def allowed_scales(L, Ms, Mt):
    """[(lowest, highest)]: the factors k > 0 on the loop gains L (n,) with which nowhere |S| > Ms
    or |T| > Mt, in closed form.

    |1 + k L| = 1/Ms and |k L| = Mt |1 + k L| are quadratic in k: each frequency forbids what lies
    between its two roots.
    """
    size, real, forbidden = np.abs(L) ** 2, np.real(L), []
    for a, b, c in (
        (size, 2.0 * real, 1.0 - Ms**-2),
        (size * (Mt**2 - 1.0), 2.0 * Mt**2 * real, Mt**2),
    ):
        inside = b * b - 4.0 * a * c
        some = (inside > 0.0) & (b < 0.0)
        root = np.sqrt(inside[some])
        forbidden.append(np.stack([-b[some] - root, -b[some] + root]) / (2.0 * a[some]))
    low, high = np.concatenate(forbidden, axis=1)
    order = np.argsort(low)
    low, reached = low[order], np.concatenate([[0.0], np.maximum.accumulate(high[order])])
    gaps = np.append(low, np.inf) > reached
    return [
        (float(a), float(b))
        for a, b in zip(reached[gaps], np.append(low, np.inf)[gaps], strict=True)
    ]
