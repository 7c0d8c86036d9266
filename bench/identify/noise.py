"""How noisy the data are, found without any model of the pad."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bench.recording.types import Measurement

from ._kernel import Array
from .motion import glanced, holds, jitter

LEVELS = 500_000  # samples whose resolution is looked at
HOLD = 3000  # samples of a hold that are looked at
SPARSE = 0.5  # of the noise found: no fit follows noise so far
LOUD = 0.2  # of the scatter of the force: no load cell is so noisy in a run that tells anything
FOLLOWED, AROUND = 0.2, 7  # of the square of what the force does from sample to sample, that so many of the motion tell
DEPTHS = 12  # bins of depth over which the stiffness is estimated


@dataclass(frozen=True)
class Noise:
    """Standard deviations. `floor_N`: of a simulated-output error with nothing left to explain, which is the force's
    own noise and what the position's noise makes through the stiffness. `from_holds`: else from motion (no hold)."""

    force_N: float
    position_mm: float
    floor_N: float
    from_holds: bool


def noise_of(measurements: list[Measurement] | tuple[Measurement, ...]) -> Noise:
    """Noise of the force about smooth curves through the holds, and of the position through the local stiffness.

    In a hold the curve is a sum of exponentials on a fixed log-spaced set of times, at most one term for eight samples,
    so noise of any colour much quicker than the hold stays in. Without holds: local parabolas over nine samples.
    The force's resolution counts as noise of step/√12.
    """
    squares, freedom = 0.0, 0.0
    errors: list[Array] = []
    for m in measurements:
        for stretch in holds(m.position_time_s, m.position_mm):
            t0, t1 = m.position_time_s[stretch.start], m.position_time_s[stretch.stop - 1]
            first, last = np.searchsorted(m.force_time_s, [t0, t1], side="left")
            first = max(int(first), int(last) - HOLD)  # the end of a long one: relaxation has gone quiet there
            error, free = _about_curve(m.force_time_s[first:last], m.force_N[first:last])
            if free > 0:
                errors.append(error * np.sqrt(len(error) / free))
                freedom += free
    from_holds = freedom >= 10
    if from_holds:
        squares = _trimmed_square(np.concatenate(errors))
    else:
        squares = float(np.mean([_about_parabolas(m.force_N[:LEVELS]) ** 2 for m in measurements]))
    resolution = min(_resolution(m.force_N[:LEVELS]) for m in measurements)
    force = float(np.sqrt(max(squares, resolution**2 / 12)))
    position = float(np.sqrt(np.mean([jitter(m.position_mm) ** 2 for m in measurements])))
    through = np.concatenate([stiffness_along(glanced(m)) for m in measurements]) if position > 0 else np.zeros(1)
    floor = float(np.sqrt(force**2 + position**2 * np.mean(through**2)))
    return Noise(force, position, floor, from_holds)


def no_louder(noise: Noise, error_N: float) -> Noise:
    """What was found, as far as it can be: where a simulation of the whole leaves far less, the samples lie too far
    apart for their noise to be seen beside each other, and it is no more than that error."""
    if not 0.0 < error_N < SPARSE * noise.floor_N:
        return noise
    louder = noise.floor_N / error_N
    return Noise(noise.force_N / louder, noise.position_mm / louder, error_N, noise.from_holds)


MOTION_FOR_NOISE = (
    "The force goes with the motion from sample to sample, and no rest shows its noise: what is taken for noise here is"
    " motion, so that nothing can be said to be down to it. (Rests, or more samples a second, would show it.)"
)


def of_the_motion(m: Measurement, noise_N: float) -> bool:
    """Whether what was taken for noise of the force (N) goes with the motion from sample to sample, and is as large as
    what the force does at all: then these data show no noise, and no error is down to it. So it is where a motion
    without rests is as quick as its samples."""
    force = m.force_N[m.counted()]
    if not noise_N > LOUD * float(np.std(force)):
        return False
    bent_mm, bent_N = np.diff(m.position_at_forces_mm()[m.counted()], 2), np.diff(force, 2)
    if len(bent_N) < 100:
        return False
    around = np.lib.stride_tricks.sliding_window_view(bent_mm, AROUND)
    bent_N = bent_N[AROUND // 2 : -(AROUND // 2)]
    left = bent_N - around @ np.linalg.lstsq(around, bent_N, rcond=None)[0]
    return float(np.sum(left**2)) < (1.0 - FOLLOWED) * float(np.sum(bent_N**2))


def _about_curve(t: Array, y: Array) -> tuple[Array, float]:
    n = len(y)
    if n < 8:
        return np.zeros(0), 0.0
    terms = int(np.clip(n // 8, 1, 7))
    span, quick = t[-1] - t[0], t[2] - t[0]
    basis = [np.ones(n), (t - t[0]) / span]
    basis += [np.exp(-(t - t[0]) / tau) for tau in np.geomspace(1.5 * quick, span / 2, terms)]
    # A projection: near-parallel columns cost a degree of freedom each, and do no harm.
    Q, _ = np.linalg.qr(np.stack(basis, axis=1))
    left = y - y.mean()
    return left - Q @ (Q.T @ left), float(n - Q.shape[1])


def _trimmed_square(e: Array) -> float:
    """Mean square without the few that stand far out (spikes, ringing after a ramp)."""
    spread = 1.4826 * float(np.median(np.abs(e)))
    kept = e[np.abs(e) <= 5 * spread] if spread > 0 else e
    return float(np.mean(kept**2))


def _about_parabolas(y: Array) -> float:
    n = len(y) // 9
    if n < 2:
        return float(np.std(np.diff(y)) / np.sqrt(2))
    t = np.linspace(-1, 1, 9)
    A = np.stack([np.ones(9), t, t * t], axis=1)
    windows = y[: 9 * n].reshape(n, 9)
    error = windows - windows @ (A @ np.linalg.pinv(A)).T
    # Median of a χ² of 6 degrees: 5.348.
    return float(np.sqrt(np.median(np.sum(error**2, axis=1)) / 5.348))


def _resolution(y: Array) -> float:
    levels = np.unique(y)
    if len(levels) < 2 or len(levels) > 0.5 * len(y):
        return 0.0
    steps = np.diff(levels)
    return float(np.min(steps[steps > 1e-9 * np.ptp(y)], initial=np.ptp(y)))


def stiffness_along(m: Measurement) -> Array:
    """|dF/dδ|, N/mm, at every force sample, model-free: slopes over moves, median by depth; 0 above the surface."""
    depth = m.position_at_forces_mm()
    reach = float(np.ptp(depth))
    if reach == 0:
        return np.zeros(len(depth))
    # From each sample to the first one a thirtieth of the whole travel away.
    stride = _strides(depth, reach / 30)
    i = np.flatnonzero(stride > 0)
    if len(i) == 0:
        return np.zeros(len(depth))
    j = i + stride[i]
    quick = stride[i] <= np.quantile(stride[i], 0.7)  # in slow moves relaxation hides the stiffness
    i, j = i[quick], j[quick]
    slope = np.abs((m.force_N[j] - m.force_N[i]) / (depth[j] - depth[i]))
    middle = (depth[i] + depth[j]) / 2
    edges = np.linspace(depth.min(), depth.max(), DEPTHS + 1)
    number = np.clip(np.searchsorted(edges, middle) - 1, 0, DEPTHS - 1)
    filled = [k for k in range(DEPTHS) if np.any(number == k)]
    centre = [(edges[k] + edges[k + 1]) / 2 for k in filled]
    value = [float(np.median(slope[number == k])) for k in filled]
    return np.where(depth > 0, np.interp(depth, centre, value), 0.0)


def _strides(depth: Array, distance: float) -> NDArray[np.intp]:
    """How many samples on from each the depth is `distance` away; 0 where that takes more than 400 samples."""
    out = np.zeros(len(depth), dtype=np.intp)
    for k in (1, 2, 3, 5, 8, 13, 20, 32, 50, 80, 125, 200, 400):
        if k >= len(depth):
            break
        far = np.abs(depth[k:] - depth[:-k]) >= distance
        fresh = far & (out[:-k] == 0)
        out[:-k][fresh] = k
    return out
