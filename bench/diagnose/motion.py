"""The motion behind noisy positions: what friction, backlash or a moving mass answer to is not the encoder's noise.

Each position becomes the value of a local parabola over as many neighbours as agree with one: windows grow while the
intervals that they give for the value overlap and their scatter is that of the noise (the intersection of confidence
intervals: A. Goldenshluger, A. Nemirovski, Math. Methods Statist. 6, 1997, 135–170). So a hold is averaged over many
samples, a trapezoid's pieces are met exactly, and corners keep their place.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bench.identify.motion import jitter
from sim.jit import compiled

Array = NDArray[np.float64]

REACHES = np.array([2, 3, 4, 6, 8, 11, 15, 21, 29, 40, 56], dtype=np.int64)  # samples on either side
WIDTH = 2.2  # standard deviations on either side of a value


@compiled("void(float64[::1], float64[::1], float64, float64, int64[::1], float64[::1], float64[::1])")
def _windows(
    t: Array, x: Array, sigma: float, width: float, reaches: NDArray[np.int64], out: Array, std: Array
) -> None:
    n = t.shape[0]
    for i in range(n):
        out[i], std[i] = x[i], sigma
        low, high = x[i] - width * sigma, x[i] + width * sigma
        s0 = 1.0
        s1 = s2 = s3 = s4 = 0.0
        x0 = x1 = x2 = xx = 0.0  # of x less x[i]
        done = 0
        for reach in reaches:
            first, last = i - reach, i + reach
            if first < 0 or last >= n:
                break
            unit = t[last] - t[first]
            # Moments in units of the last window's width would need rescaling; times are small against 1 s here.
            for k in range(done + 1, reach + 1):
                for j in (i - k, i + k):
                    u = t[j] - t[i]
                    d = x[j] - x[i]
                    uu = u * u
                    s0 += 1.0
                    s1 += u
                    s2 += uu
                    s3 += uu * u
                    s4 += uu * uu
                    x0 += d
                    x1 += d * u
                    x2 += d * uu
                    xx += d * d
            done = reach
            # normal equations with u scaled to order one
            a1, a2, a3, a4 = s1 / unit, s2 / unit**2, s3 / unit**3, s4 / unit**4
            b0, b1, b2 = x0, x1 / unit, x2 / unit**2
            c00 = a2 * a4 - a3 * a3
            c01 = a2 * a3 - a1 * a4
            c02 = a1 * a3 - a2 * a2
            det = s0 * c00 + a1 * c01 + a2 * c02
            if det <= 0.0:
                break
            c11 = s0 * a4 - a2 * a2
            c12 = a1 * a2 - s0 * a3
            c22 = s0 * a2 - a1 * a1
            p0 = (c00 * b0 + c01 * b1 + c02 * b2) / det
            p1 = (c01 * b0 + c11 * b1 + c12 * b2) / det
            p2 = (c02 * b0 + c12 * b1 + c22 * b2) / det
            left = xx - p0 * b0 - p1 * b1 - p2 * b2
            freedom = s0 - 3.0
            if left > sigma * sigma * (freedom + 2.6 * np.sqrt(2.0 * freedom)):
                break
            value = x[i] + p0
            error = sigma * np.sqrt(c00 / det)
            low, high = max(low, value - width * error), min(high, value + width * error)
            if low > high:
                break
            out[i], std[i] = value, error


def resolution(values: Array) -> float:
    """Step of a quantised channel, 0 where its values are (nearly) all different."""
    levels = np.unique(values)
    if levels.size < 2 or levels.size > 0.3 * values.size:
        return 0.0
    steps = np.diff(levels)
    return float(np.min(steps[steps > 1e-9 * np.ptp(values)], initial=np.ptp(values)))


def position_noise(position_mm: Array) -> float:
    """Standard deviation of the reported position, rounding included, mm."""
    step = resolution(position_mm)
    return max(jitter(position_mm), 0.0 if step > 0.01 * np.ptp(position_mm) else step / np.sqrt(12.0))


def felt(time_s: Array, position_mm: Array) -> tuple[Array, Array]:
    """(positions without most of their noise (n,), standard deviation of what is left (n,)), mm.

    `time_s` (n,) increases strictly. Positions without noise come back as they are.
    """
    sigma = position_noise(position_mm)
    if sigma <= 1e-7 * max(float(np.ptp(position_mm)), 1e-9) or len(time_s) < 8:
        return position_mm, np.zeros(len(position_mm))
    time, position = np.ascontiguousarray(time_s), np.ascontiguousarray(position_mm)
    out, std = np.empty(len(time)), np.empty(len(time))
    _windows(time, position, sigma, WIDTH, REACHES, out, std)
    return out, std
