"""Noise of the force that is louder while the probe moves, as where a motor's current or the screw's balls shake the
cell: σ² = σ_rest² (1 + Σ b min(v/V, 1)²), of speeds V from 0 on. And noise whose loudness at rest changes in the course
of the run, as while a pump runs or an amplifier warms up.

Told from the force itself by third differences, of single samples and of pairs: what a smooth force, a wave or a mode
that rings leaves of those differs from what noise does, and then nothing is told. What goes with the rate of the force
is none of this: a force that was felt at uncertain times scatters so.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bench.identify.motion import holds
from bench.readings import resolution
from bench.recording.types import Measurement

from .noise import SETTLED_S
from .uneven import likeliest

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

THIRD = np.array([1.0, -3.0, 3.0, -1.0])  # difference, of samples at even distances
PIECE = 16  # samples that are looked at together
FEWEST = 10  # pieces at rest, and in motion
APART = 4.0  # squares that say as much as one of noise whose tails may be heavy
SMOOTH, ALIKE = 1.8, (0.6, 1.25)  # times the power of pairs over that of samples at rest: of a piece; of all, median
FASTEST, SHARES = 0.95, (1e-3, 0.1, 0.25, 0.5, 1.0)  # quantile of the speeds, and the shares of that which V may be
PAYS = 60.0  # twice the log-likelihood that it must gain
ENOUGH = 0.3  # of the pieces in motion, that must be clear of corners
LEAST, LARGEST = 0.5, 30.0  # times the power at rest: less is not worth it, and more is no noise
AS_AT_REST = 1.3  # times the power that rest alone tells, may what is told with motion be there
TOGETHER, MOST_RUNS = 24, 40  # pieces that tell of one time; times
OF_FEW = (0.5, 1.7)  # as `ALIKE`, of so few pieces
A_RUN, A_PART = 6.0, 0.2  # twice the log-likelihood that each must gain besides; of all that there is
FINE = 2.0  # times its deviation at rest may a channel's step be: coarser, rest and motion round it otherwise


@dataclass(frozen=True)
class Loudness:
    """By how much the noise of each force sample (m,) is louder than at rest, and than in the mean of the run."""

    in_motion: Array
    in_time: Array

    @classmethod
    def even(cls, count: int) -> Loudness:
        """As loud everywhere, at so many samples."""
        return cls(np.ones(count), np.ones(count))

    @property
    def times(self) -> Array:
        """All in all (m,)."""
        return self.in_motion * self.in_time

    @property
    def loud_over_quiet(self) -> float:
        """Of the noise at rest, that of the loudest tenth of the run over that of the quietest."""
        quiet, loud = np.quantile(self.in_time, [0.1, 0.9]).tolist()
        return float(loud / quiet)

    @property
    def said(self) -> list[str]:
        """Sentences on it; none where it is as loud everywhere."""
        out = []
        if (most := float(self.in_motion.max(initial=1.0))) > 1.0:
            out.append(
                f"the force is up to {most:.2g} times as noisy in motion as at rest, and that is taken for noise: does "
                "the motor's cable run beside the cell's, is the screw dry?"
            )
        if (most := self.loud_over_quiet) > 1.0:
            out.append(
                f"at rest the force is at times {most:.2g} times as noisy as at others, and that is taken for "
                "noise: what runs in the room, did the amplifier warm up?"
            )
        return out


@dataclass(frozen=True)
class _Pieces:
    """Of pieces (k,) of the force: their samples (k, `PIECE`), the mean squares of their third differences, those of
    pairs over them, and whether they are at rest."""

    at: NDArray[np.intp]
    square: Array
    slow: Array
    still: Mask

    def of(self, values: Array) -> Array:
        """Means (k,) of values (m,)."""
        return np.asarray(values[self.at].mean(axis=1))


def loudness(m: Measurement, good: Mask) -> Loudness:
    """Of the noise of the force samples (m,); `good` (m,): those that are no channel faults."""
    even = Loudness.even(len(m.force_N))
    rest, settling = _resting(m)
    pieces = _pieces(m.force_N, rest, good & ~settling)
    if pieces is None:
        return even
    usual = float(np.median(pieces.slow[pieces.still]))
    quiet = float(np.mean(pieces.square[pieces.still]))
    if quiet <= (resolution(m.force_N) / FINE) ** 2 * float(THIRD @ THIRD):
        return even
    in_time = _course(m, pieces, usual)
    pieces = replace(pieces, square=pieces.square / pieces.of(in_time**2))
    return Loudness(_in_motion(m, rest, pieces, usual), in_time)


def _in_motion(m: Measurement, rest: Mask, pieces: _Pieces, usual: float) -> Array:
    t, even, still = m.force_time_s, np.ones(len(m.force_N)), pieces.still
    speed = np.abs(np.gradient(np.interp(t, m.position_time_s, m.position_mm), t))
    fastest = float(np.quantile(speed[~rest], FASTEST)) if (~rest).any() else 0.0
    kept = still | (pieces.slow < SMOOTH * usual)
    moving = kept & ~still
    if fastest <= 0.0 or moving.sum() < max(FEWEST, ENOUGH * (~still).sum()) or not _alike(pieces.slow[moving], usual):
        return even
    speed = np.where(rest, 0.0, np.minimum(speed / fastest, 1.0))
    goes = pieces.of(np.gradient(m.force_N, t)) ** 2
    amounts = _told(pieces.square[kept], still[kept], pieces.of(speed)[kept], goes[kept])
    more = np.where(rest, 0.0, _grown(speed) @ amounts)
    return np.asarray(np.sqrt(1.0 + more)) if LEAST < more.max() < LARGEST else even


def _alike(slow: Array, usual: float, band: tuple[float, float] = ALIKE) -> bool:
    """Whether pairs of samples say of some pieces what single ones do."""
    return band[0] * usual < float(np.median(slow)) < band[1] * usual


def _course(m: Measurement, pieces: _Pieces, usual: float) -> Array:
    """By how much each force sample (m,) is louder than the mean, as pieces at rest that follow each other tell."""
    even, still = np.ones(len(m.force_N)), np.flatnonzero(pieces.still)
    runs = np.array_split(still, min(len(still) // TOGETHER, MOST_RUNS)) if len(still) >= 2 * TOGETHER else []
    if len(runs) < 2 or not all(_alike(pieces.slow[run], usual, OF_FEW) for run in runs):
        return even
    level = np.array([np.median(pieces.square[run]) for run in runs])
    if not 1.0 + LEAST < level.max() / max(level.min(), 1e-300) < LARGEST:
        return even
    square, force2 = pieces.square[still], pieces.of(m.force_N)[still] ** 2
    weight = np.full(len(square), PIECE / APART)
    ones = np.ones(len(square))
    by_force = likeliest(np.stack([ones, force2 / max(float(force2.max()), 1e-300)], axis=1), square, weight)[1]
    steps = np.concatenate([np.full(len(run), value) for run, value in zip(runs, level, strict=True)])
    by_time = likeliest(steps[:, None], square, weight)[1]
    if by_force - by_time < max(PAYS + A_RUN * len(runs), A_PART * by_force):
        return even
    middle = np.array([float(np.mean(pieces.of(m.force_time_s)[run])) for run in runs])
    times = np.sqrt(np.interp(m.force_time_s, middle, level / float(np.mean(steps))))
    return np.asarray(times)


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
        first, settled, last = np.searchsorted(m.force_time_s, [t0, min(t0 + SETTLED_S, t1), t1])
        rest[first:last] = True
        settling[first:settled] = True
    return rest, settling


def _differences(force: Array, count: int) -> Array:
    """Third differences (m,) of means of `count` neighbours, about their middles; nan at the ends."""
    out = np.full(len(force), np.nan)
    kernel = np.repeat(THIRD, count) / count
    inner = np.convolve(force, kernel[::-1], "valid")
    first = (len(kernel) - 1) // 2
    out[first : first + len(inner)] = inner
    return out


def _pieces(force: Array, rest: Mask, use: Mask) -> _Pieces | None:
    """Runs of `PIECE` samples, each all of rest or all of motion, and clear of where one becomes the other and of
    samples not to `use`; None where too few are at rest."""
    if len(force) < 4 * PIECE:
        return None
    one, two = _differences(force, 1), _differences(force, 2)
    clear = np.isfinite(two) & (np.convolve(~use, np.ones(8), "same") < 0.5)
    clear &= np.convolve(np.abs(np.diff(rest.astype(np.float64), prepend=float(rest[0]))), np.ones(9), "same") < 0.5
    index = np.flatnonzero(clear)
    breaks = np.flatnonzero((np.diff(index) > 1) | (np.diff(rest[index].astype(np.int8)) != 0)) + 1
    runs = [run[: len(run) // PIECE * PIECE].reshape(-1, PIECE) for run in np.split(index, breaks)]
    at = np.concatenate([*runs, np.zeros((0, PIECE), dtype=np.intp)])
    at = at[one[at].any(axis=1)]  # a piece without any stands still in its channel
    if rest[at[:, 0]].sum() < FEWEST:
        return None
    square, of_pairs = np.mean(one[at] ** 2, axis=1), np.mean(two[at] ** 2, axis=1)
    return _Pieces(at, square, of_pairs / square, rest[at[:, 0]])
