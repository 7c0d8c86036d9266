"""The motion behind noisy positions: what friction, backlash or a moving mass answer to is not the encoder's noise.

Each position becomes the value of a local parabola over as many neighbours as agree with one: windows grow while the
intervals that they give for the value overlap and their scatter is that of the noise (the intersection of confidence
intervals: A. Goldenshluger, A. Nemirovski, Math. Methods Statist. 6, 1997, 135–170). So a hold is averaged over many
samples, a trapezoid's pieces are met exactly, and corners keep their place.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bench.identify.motion import jitter
from bench.motion_between import Moves, motion_between, planned_moves
from sim.jit import compiled

Array = NDArray[np.float64]

REACHES = np.array([2, 3, 4, 6, 8, 11, 15, 21, 29, 40, 56, 80, 112, 160], dtype=np.int64)
"""Half-widths of the windows, in samples."""
SHORTEST, EDGE = 30, 4  # samples of a hold that can show it to be at rest; samples at its ends that may still move
BLURRED = 0.3  # of a step: noise that makes a mean of readings better than one
TOGETHER = 20  # samples that share the error of a window, about
WIDTH = 2.2  # standard deviations on either side of a value


@compiled("void(float64[::1], float64[::1], float64, float64, int64[::1], int64, float64[::1], float64[::1])")
def _windows(
    t: Array, x: Array, sigma: float, width: float, reaches: NDArray[np.int64], side: int, out: Array, std: Array
) -> None:
    """Values by windows around each sample (`side` 0), after it (1) or before it (−1), where they are surer."""
    n = t.shape[0]
    for i in range(n):
        low, high = x[i] - width * sigma, x[i] + width * sigma
        s0 = 1.0
        s1 = s2 = s3 = s4 = 0.0
        x0 = x1 = x2 = xx = 0.0  # of x less x[i]
        done = 0
        for reach in reaches:
            first = i - reach if side == 0 else (i if side > 0 else i - 2 * reach)
            last = i + reach if side == 0 else (i + 2 * reach if side > 0 else i)
            if first < 0 or last >= n:
                break
            unit = t[last] - t[first]
            for k in range(done + 1, last - first - (reach if side == 0 else 0) + 1):
                for half in range(2 if side == 0 else 1):
                    j = i - k if (half == 1 or side < 0) else i + k
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
            done = reach if side == 0 else 2 * reach
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
            if error < std[i]:
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
    if step == 0.0 or step > 0.01 * np.ptp(position_mm):
        return jitter(position_mm)
    return float(max(jitter(position_mm), _hopping(position_mm, step), step / np.sqrt(12.0)))


def _hopping(position_mm: Array, step_mm: float) -> float:
    """Scatter about short lines, mm, where the motion passes no more than a step of the scale: where readings stay the
    same for a while the quietest stretches, which `jitter` goes by, have none."""
    n = len(position_mm) // 6
    if n < 4:
        return 0.0
    windows = position_mm[: 6 * n].reshape(n, 6)
    t = np.arange(6) - 2.5
    slope = windows @ t / (t @ t)
    slow = np.abs(slope) * 5.0 <= step_mm
    if np.count_nonzero(slow) < 4:
        return 0.0
    off = windows[slow] - windows[slow].mean(axis=1, keepdims=True) - slope[slow][:, None] * t
    return float(np.sqrt(np.sum(off**2) / (4.0 * np.count_nonzero(slow))))


def smoothed(time_s: Array, position_mm: Array) -> tuple[Array, Array]:
    """(positions without most of their noise (n,), standard deviation of what is left (n,)), mm.

    `time_s` (n,) increases strictly. Positions without noise come back as they are.
    """
    sigma = position_noise(position_mm)
    if sigma <= 1e-7 * max(float(np.ptp(position_mm)), 1e-9) or len(time_s) < 8:
        return position_mm, np.zeros(len(position_mm))
    time, position = np.ascontiguousarray(time_s), np.ascontiguousarray(position_mm)
    out, std = position.copy(), np.full(len(time), sigma)
    for side in (0, 1, -1):
        _windows(time, position, sigma, WIDTH, REACHES, side, out, std)
    return out, std


@dataclass(frozen=True)
class Felt:
    """The motion as the pad felt it: `time_s`, `position_mm` (k,) with nodes between samples where they matter;
    `std_mm` (k,): what is left of the noise; `noise_mm`: what it was. `stretch` (k,): nodes of one number share most of
    the error that is left."""

    time_s: Array
    position_mm: Array
    std_mm: Array
    noise_mm: float
    stretch: NDArray[np.intp]


def _coarse(position_mm: Array) -> float:
    """What no averaging takes away, mm: the error of a scale whose steps the noise does not blur."""
    step = resolution(position_mm)
    return step / np.sqrt(12.0) if jitter(position_mm) < BLURRED * step else 0.0


def _rested(
    position_mm: Array, clean_mm: Array, std_mm: Array, noise_mm: float, left_mm: float
) -> tuple[Array, Array, NDArray[np.intp]]:
    """Positions (n,), their standard deviations (n,), with one value for each hold whose samples are that of one; and
    the number of the hold, from 1 on; 0: none."""
    clean, std = clean_mm.copy(), std_mm.copy()
    hold = np.zeros(len(clean), dtype=np.intp)
    coarse, reached = _coarse(position_mm) > 0.0, dict[float, int]()
    # a coarse scale hops between two levels, and neither says which of them is nearer
    hop = resolution(position_mm) if coarse else 0.0
    noise_mm = max(noise_mm, 0.5 * hop)
    still = np.abs(np.diff(clean_mm)) <= max(6 * left_mm, 1e-5 * float(np.ptp(clean_mm)), 0.6 * hop)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(np.int8))).reshape(-1, 2)
    for number, (a, b) in enumerate(edges.tolist(), 1):
        inside = position_mm[a + EDGE : b + 1 - EDGE]
        n = len(inside)
        if n < SHORTEST:
            continue
        level = float(inside.mean())
        halves = abs(float(inside[: n // 2].mean() - inside[n // 2 :].mean())) / (2.0 * noise_mm / np.sqrt(n))
        if float(np.sum((inside - level) ** 2)) <= noise_mm**2 * (n + 4.0 * np.sqrt(2.0 * n)) and halves < 4.0:
            clean[a : b + 1] = level
            std[a : b + 1] = noise_mm / np.sqrt(n)
            # a coarse scale is off by as much whenever the same level is held
            again = reached.setdefault(float(np.median(inside)), number) if coarse else number
            hold[a : b + 1] = again
    return clean, std, hold


def felt(time_s: Array, position_mm: Array) -> Felt:
    """Smoothed positions, and the motion between them rebuilt (`bench.motion_between`).

    A move that is a planner's trapezoid, as far as its noisy samples tell, becomes that trapezoid: a moving mass and a
    lag feel accelerations and corners that no smoothing keeps.
    """
    clean, std = smoothed(time_s, position_mm)
    left = float(np.median(std)) if len(std) else 0.0
    noise = position_noise(position_mm)
    planned: Moves = {}
    stretch = -1 - np.arange(len(clean)) // TOGETHER
    if 0.0 < left < noise:
        step, coarse = resolution(position_mm), _coarse(position_mm)
        clean, std, hold = _rested(position_mm, clean, std, noise, left)
        stretch = np.where(hold > 0, hold, stretch)
        planned = planned_moves(time_s, position_mm, clean, noise, left)
        for (first, last), move in planned.items():
            inside = slice(first, last + 1)
            clean[inside] = move.position(time_s[inside])
            at_ends = max(float(std[first]), float(std[last]), 0.7 * coarse)
            std[inside] = max(2.0 * noise / np.sqrt(last - first + 1), at_ends)
            stretch[inside] = 1 + len(clean) + first
        # a coarse scale's error averages out over levels that are passed, not over readings of one
        std = np.where(np.abs(np.gradient(clean)) < 2.0 * step, np.maximum(std, coarse), std)
    time, position = motion_between(time_s, clean, noise_mm=left, planned=planned)
    before = np.clip(np.searchsorted(time_s, time, side="right") - 1, 0, len(clean) - 1)
    return Felt(time, position, np.asarray(np.interp(time, time_s, std)), noise, stretch[before])
