"""The reduced relaxation function g(t) = c_0 + Σ c_i e^(−ν_i t), equation (6), as function and as filter.

The filter is ramp-invariant: exact for an elastic force that is linear between samples, at any spacing. Mode i obeys
w_i' = −ν_i w_i + dF^e/dt, so over a step dt

    w_i+ = e^(−x) w_i + φ(x) (F^e+ − F^e),   φ(x) = (1 − e^(−x))/x,   x = ν_i dt,

and F = c_0 F^e + Σ c_i w_i.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.jit import compiled
from sim.kernel import as_vector, ramp_gain

Array = NDArray[np.float64]


@compiled("float64(float64, float64)")
def ramp_gain_slope(x: float, gain: float) -> float:
    """dφ/dx, given x and φ(x)."""
    if x < 0.02:
        return -0.5 + x * (1 / 3 + x * (-1 / 8 + x * (1 / 30 + x * (-1 / 144 + x / 840))))
    return (1.0 - x * gain - gain) / x


@compiled("void(float64[::1], float64[::1], float64[::1], float64[:, ::1])")
def _modes(time: Array, Fe: Array, nu: Array, w: Array) -> None:
    r = nu.size
    for i in range(r):
        last, now, then = 0.0, 0.0, time[0]
        step, decay, gain = 0.0, 1.0, 1.0
        for n in range(time.size):
            dt = time[n] - then
            then = time[n]
            if dt != step:
                step = dt
                gain = ramp_gain(nu[i] * dt)
                decay = 1.0 - nu[i] * dt * gain
            now = decay * now + gain * (Fe[n] - last)
            last = Fe[n]
            w[n, i] = now


@compiled("void(float64[::1], float64[::1], float64[::1], float64[:, ::1], float64[:, ::1])")
def _modes_and_slopes(time: Array, Fe: Array, nu: Array, w: Array, dw: Array) -> None:
    r = nu.size
    for i in range(r):
        last, now, slope, then = 0.0, 0.0, 0.0, time[0]
        step, decay, gain, gain_slope = 0.0, 1.0, 1.0, 0.0
        for n in range(time.size):
            dt = time[n] - then
            then = time[n]
            if dt != step:
                step = dt
                x = nu[i] * dt
                gain = ramp_gain(x)
                decay = 1.0 - x * gain
                gain_slope = dt * ramp_gain_slope(x, gain)
            slope = decay * (slope - dt * now) + gain_slope * (Fe[n] - last)
            now = decay * now + gain * (Fe[n] - last)
            last = Fe[n]
            w[n, i] = now
            dw[n, i] = slope


def _checked(time_s: ArrayLike, Fe_N: ArrayLike, rates: ArrayLike) -> tuple[Array, Array, Array]:
    time, Fe, nu = as_vector(time_s), as_vector(Fe_N), as_vector(rates)
    if time.shape != Fe.shape or time.ndim != 1:
        raise ValueError(f"time and elastic force differ in shape: {time.shape} and {Fe.shape}")
    return time, Fe, nu


def modes(time_s: ArrayLike, Fe_N: ArrayLike, rates: ArrayLike) -> Array:
    """Outputs w_i of the modes, shape (n, r), for an elastic force (n,) at times (n,) that do not fall.

    Before the first sample the pad is at rest without load; a first value other than 0 is a step.
    """
    time, Fe, nu = _checked(time_s, Fe_N, rates)
    w = np.empty((time.size, nu.size))
    if time.size:
        _modes(time, Fe, nu, w)
    return w


def modes_and_slopes(time_s: ArrayLike, Fe_N: ArrayLike, rates: ArrayLike) -> tuple[Array, Array]:
    """`modes`, and ∂w_i/∂ν_i of the same shape, exact."""
    time, Fe, nu = _checked(time_s, Fe_N, rates)
    w, dw = np.empty((time.size, nu.size)), np.empty((time.size, nu.size))
    if time.size:
        _modes_and_slopes(time, Fe, nu, w, dw)
    return w, dw


@dataclass(frozen=True)
class Relaxation:
    """Shares c_1 … c_r and rates ν_1 … ν_r (1/s) of the relaxation modes; c_0 is what is left of 1."""

    shares: tuple[float, ...] = ()
    rates: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        if len(self.shares) != len(self.rates):
            raise ValueError("shares and rates must have the same number of values")

    @property
    def order(self) -> int:
        """r, the number of modes."""
        return len(self.rates)

    @property
    def c_0(self) -> float:
        """The share that never relaxes."""
        return 1.0 - sum(self.shares)

    def reduced(self, time_s: ArrayLike) -> Array:
        """g(t), equation (6); 1 at t = 0. Any shape of times >= 0."""
        t = np.asarray(time_s, dtype=np.float64)
        result = np.full(t.shape, self.c_0)
        for c, nu in zip(self.shares, self.rates, strict=True):
            result += c * np.exp(-nu * t)
        return result

    def filter(self, time_s: ArrayLike, Fe_N: ArrayLike) -> Array:
        """Force (n,) of a bonded pad with elastic force (n,) at times (n,)."""
        return self.c_0 * as_vector(Fe_N) + modes(time_s, Fe_N, self.rates) @ as_vector(self.shares)
