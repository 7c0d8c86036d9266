"""Exact steps of linear systems of first and second order, for the blocks of several effects. No effect itself."""

from __future__ import annotations

import math

from sim.jit import compiled
from sim.kernel import ramp_gain


@compiled("UniTuple(float64, 2)(float64, float64, float64, float64, float64)")
def swing(dt: float, e: float, de: float, omega: float, damping: float) -> tuple[float, float]:
    """e and its derivative after dt of e'' + 2ζω e' + ω² e = 0, for a damping ratio ζ other than 1."""
    decay = damping * omega
    if damping > 1.0:  # no swing: two times, one of them long
        apart = omega * math.sqrt(damping * damping - 1.0)
        slow = math.exp(-omega * omega / (decay + apart) * dt)
        fast = math.exp(-(decay + apart) * dt)
        even, odd = 0.5 * (slow + fast), 0.5 * (slow - fast) / apart
        return e * even + (de + decay * e) * odd, de * even - (omega * omega * e + decay * de) * odd
    omega_d = omega * math.sqrt(1.0 - damping * damping)
    fade = math.exp(-decay * dt)
    c = math.cos(omega_d * dt)
    s = math.sin(omega_d * dt) / omega_d
    return fade * (e * c + (de + decay * e) * s), fade * (de * c - (omega * omega * e + decay * de) * s)


@compiled("UniTuple(float64, 2)(float64, float64, float64, float64, float64, float64, float64)")
def low_pass(
    dt: float, y: float, v: float, before: float, u: float, omega: float, damping: float
) -> tuple[float, float]:
    """Output y and its derivative v of ω²/(s² + 2ζω s + ω²), the input going linearly from `before` to `u` in dt."""
    if dt <= 0.0:
        return y, v
    slope = (u - before) / dt
    lag = 2.0 * damping * slope / omega
    e, de = swing(dt, y - before + lag, v - slope, omega, damping)
    return u - lag + e, slope + de


@compiled("float64(float64, float64, float64, float64, float64)")
def first_order(dt: float, y: float, before: float, u: float, tau: float) -> float:
    """Output y of 1/(1 + τs), the input going linearly from `before` to `u` in dt."""
    if dt <= 0.0:
        return y
    x = dt / tau
    gain = ramp_gain(x)
    decay = 1.0 - x * gain
    return decay * y + (gain - decay) * before + (1.0 - gain) * u
