"""Noise of the force that is louder while the probe moves, as where a motor's current or the screw's balls shake the
cell: σ² = σ_rest² (1 + Σ b min(v/V, 1)²), of speeds V from 0 on.

Told from the force itself by third differences, of single samples and of pairs: what a smooth force, a wave or a mode
that rings leaves of those differs from what noise does, and then nothing is told. What goes with the rate of the force
is none of this: a force that was felt at uncertain times scatters so.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bench.felt_motion import resolution
from bench.identify.motion import holds
from bench.recording.types import Measurement

from .uneven import likeliest

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

WEIGHTS = np.array([1.0, -3.0, 3.0, -1.0])
PIECE = 16  # samples that are looked at together
FEWEST = 10  # pieces at rest, and in motion
APART = 4.0  # squares that say as much as one of noise whose tails may be heavy
SETTLES_S = 0.15  # after a motion, that what still rings is none
SMOOTH, ALIKE = 1.8, (0.6, 1.25)  # times the power of pairs over that of samples at rest: of a piece; of all, median
FASTEST, SHARES = 0.95, (1e-3, 0.1, 0.25, 0.5, 1.0)  # quantile of the speeds, and the shares of that which V may be
PAYS = 60.0  # twice the log-likelihood that it must gain
ENOUGH = 0.3  # of the pieces in motion, that must be clear of corners
LEAST, LARGEST = 0.5, 30.0  # times the power at rest: less is not worth it, and more is no noise
AS_AT_REST = 1.3  # times the power that rest alone tells, may what is told with motion be there
FINE = 2.0  # times its deviation at rest may a channel's step be: coarser, rest and motion round it otherwise


def louder_in_motion(m: Measurement, good: Mask) -> Array:
    """By how much the noise of each force sample (m,) is louder than at rest; ones where it is not. `good` (m,): those
    that are no channel faults."""
    even = np.ones(len(m.force_N))
    t, force = m.force_time_s, m.force_N
    if len(t) < 4 * PIECE:
        return even
    rest, settling = _resting(m)
    speed = np.abs(np.gradient(np.interp(t, m.position_time_s, m.position_mm), t))
    fastest = float(np.quantile(speed[~rest], FASTEST)) if (~rest).any() else 0.0
    if fastest <= 0.0:
        return even
    speed = np.where(rest, 0.0, np.minimum(speed / fastest, 1.0))
    one, two = _differences(force, 1), _differences(force, 2)
    told = np.isfinite(two) & ~settling
    told &= np.convolve(~good, np.ones(8), "same") < 0.5
    pieces = [p for p in _pieces(rest, told) if one[p].any()]  # a piece without any stands still in its channel
    if not pieces:
        return even
    square, of_pairs = (np.array([np.mean(d[p] ** 2) for p in pieces]) for d in (one, two))
    still = np.array([rest[p[0]] for p in pieces])
    quiet, slow = float(np.mean(square[still])) if still.any() else 0.0, of_pairs / np.maximum(square, 1e-300)
    if still.sum() < FEWEST or quiet <= (resolution(force) / FINE) ** 2 * float(WEIGHTS @ WEIGHTS):
        return even
    usual = float(np.mean(of_pairs[still])) / quiet
    kept = still | (slow < SMOOTH * usual)
    moving = kept & ~still
    if moving.sum() < max(FEWEST, ENOUGH * (~still).sum()):
        return even
    if not ALIKE[0] * usual < float(np.median(slow[moving])) < ALIKE[1] * usual:
        return even
    rate = np.gradient(force, t)
    goes = np.array([np.mean(rate[p]) ** 2 for p in pieces])
    runs = np.array([np.mean(speed[p]) for p in pieces])
    amounts = _told(square[kept], still[kept], runs[kept], goes[kept])
    more = np.where(rest, 0.0, _grown(speed) @ amounts)
    return np.asarray(np.sqrt(1.0 + more)) if LEAST < more.max() < LARGEST else even


def said(louder: Array) -> list[str]:
    """A sentence on noise that is louder in motion; none where it is not."""
    most = float(louder.max(initial=1.0))
    if most == 1.0:
        return []
    return [
        f"the force is up to {most:.2g} times as noisy in motion as at rest, and that is taken for noise: does the "
        "motor's cable run beside the cell's, is the screw dry?"
    ]


def _grown(speed: Array) -> Array:
    """min(v/V, 1)² (k, shares)."""
    return np.asarray(np.minimum(speed[:, None] / np.array(SHARES), 1.0) ** 2)


def _told(square: Array, still: Mask, speed: Array, rate2: Array) -> Array:
    """b (shares,) that makes the squares of pieces (k,) likeliest; 0: the noise is as loud everywhere."""
    weight = np.full(len(square), PIECE / APART)
    ones, rates = np.ones(len(square)), rate2 / max(float(rate2.max()), 1e-300)
    even = likeliest(ones[:, None], square, weight)[1]
    by_rate = likeliest(np.stack([ones, rates], axis=1), square, weight)[1]
    grown = np.where(still[:, None], 0.0, _grown(speed))
    (rest, _, *more), deviance = likeliest(np.column_stack([ones, rates, grown]), square, weight)
    alone = float(np.mean(square[still]))
    if min(even, by_rate) - deviance < PAYS or not alone / AS_AT_REST < rest < alone * AS_AT_REST:
        return np.zeros(len(SHARES))
    return np.asarray(np.array(more) / rest)


def _resting(m: Measurement) -> tuple[Mask, Mask]:
    """Which force samples (m,) are of a hold, and which of those just after a motion."""
    rest, settling = np.zeros(len(m.force_time_s), dtype=bool), np.zeros(len(m.force_time_s), dtype=bool)
    for stretch in holds(m.position_time_s, m.position_mm):
        t0, t1 = m.position_time_s[stretch.start], m.position_time_s[stretch.stop - 1]
        first, settled, last = np.searchsorted(m.force_time_s, [t0, min(t0 + SETTLES_S, t1), t1])
        rest[first:last] = True
        settling[first:settled] = True
    return rest, settling


def _differences(force: Array, count: int) -> Array:
    """Third differences (m,) of means of `count` neighbours, about their middles; nan at the ends."""
    out = np.full(len(force), np.nan)
    kernel = np.repeat(WEIGHTS, count) / count
    inner = np.convolve(force, kernel[::-1], "valid")
    first = (len(kernel) - 1) // 2
    out[first : first + len(inner)] = inner
    return out


def _pieces(rest: Mask, told: Mask) -> list[NDArray[np.intp]]:
    """Runs of `PIECE` samples, each all of rest or all of motion, and clear of where one becomes the other."""
    apart = np.convolve(np.abs(np.diff(rest.astype(np.float64), prepend=float(rest[0]))), np.ones(9), "same") < 0.5
    use = np.flatnonzero(told & apart)
    breaks = np.flatnonzero((np.diff(use) > 1) | (np.diff(rest[use].astype(np.int8)) != 0)) + 1
    out = []
    for run in np.split(use, breaks):
        out += [run[k * PIECE : (k + 1) * PIECE] for k in range(len(run) // PIECE)]
    return out
