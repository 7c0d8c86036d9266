"""What a channel says, in digits: the step of its values, runs of one value, and channels that are read more often than
they convert."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

ODD_STEPS = 0.05  # share of the steps between a coarse channel's values that may be less: not all values are its own
BLUR = 0.02  # of a step between values, by which it may be off
MANY = 30  # new values that leap, by which it is told
LEAP = 1.5  # steps of the channel's digits: a slow move through coarse ones goes by single steps
RARE = 0.01  # of those, that may be followed by another too soon: strays, lost conversions
LONG_RUN, USUAL = 8, 5.0  # samples of a run of one value that are no chance; and times the length of most runs
COARSE = 0.5  # of the noise: a channel of coarser digits repeats itself by chance
NO_STEP = 1e-3  # of the noise, into such a run and out of it
IN_THE_PAD = 0.05  # of the depth reached
PART = 0.1  # of all samples that such values stand for: else they are moves between rests


def resolution(values: Array) -> float:
    """Step of a quantised channel, 0 where its values are (nearly) all different."""
    levels = np.unique(values)
    if levels.size < 2 or levels.size > 0.3 * values.size:
        return 0.0
    steps = np.diff(levels)
    steps = steps[steps > 1e-9 * np.ptp(values)]
    return float(np.quantile(steps, ODD_STEPS, method="lower")) if steps.size else float(np.ptp(values))


def spacing(values: Array) -> float:
    """Step of a quantised channel so little of which is seen that nearly all its values differ (no `resolution`): they
    stand by whole steps apart, which digits that a file cuts off blur a little. Else 0."""
    between = np.diff(np.unique(values))
    between = between[between > 1e-9 * np.ptp(values)]
    if between.size < MANY:
        return 0.0
    step = float(np.mean(between[between < LEAP * np.quantile(between, ODD_STEPS, method="lower")]))
    steps = between[between < 0.25 * step / BLUR] / step
    whole = np.abs(steps - np.rint(steps)) < BLUR * steps
    return step if len(steps) >= MANY and np.mean(whole) > 1.0 - ODD_STEPS else 0.0


def runs(values: Array) -> tuple[NDArray[np.intp], NDArray[np.intp]]:
    """(first sample, length) of every run of equal values."""
    first = np.flatnonzero(np.concatenate([[True], values[1:] != values[:-1]]))
    return first, np.diff(np.concatenate([first, [len(values)]]))


def rows_per_conversion(force: Array) -> int:
    """For how many samples each new value of a channel (m,) stands at the least; 1: none is known to stand longer.

    A converter slower than the rows that are written of it leaves runs of equal values, none of them shorter than what
    it takes; noise, digits and samples that stick by chance leave short ones too.
    """
    first, length = runs(force)
    if len(first) < MANY + 2:
        return 1
    change = np.abs(np.diff(force[first]))[:-1]  # into every run but the first and the last, which were cut
    leaps = change > LEAP * resolution(force)
    if np.count_nonzero(leaps) < MANY:
        return 1
    rows = int(np.quantile(length[1:-1][leaps], RARE, method="lower"))
    return rows if rows * np.count_nonzero(leaps) >= PART * len(force) else 1


def copies(force: Array) -> Mask:
    """Which samples (m,) of a channel that is read more often than it converts only repeat the one before; where it
    stands longer than it takes, one each so often counts as new, with the same value. None, if it is no such channel.
    """
    rows = rows_per_conversion(force)
    if rows == 1:
        return np.zeros(len(force), dtype=bool)
    first, length = runs(force)
    single = length[(length >= rows) & (length <= rows + 1)]
    every = rows + int(np.mean(single) > rows + RARE)  # between two whole numbers: the later one holds a new value
    since = np.arange(len(force)) - np.repeat(first, length)
    return np.asarray(since % every != 0)


def said_of(again: Mask) -> str:
    """What a note says of copies that were left out."""
    every = round(len(again) / np.count_nonzero(~again), 1)
    return f"a new one every {every:g} samples only: those between, which repeat it, were left out"


def ceiling(force: Array) -> float | None:
    """The level of saturation: a long run exactly at the largest magnitude, where runs elsewhere are short."""
    top = float(np.abs(force).max())
    if top == 0:
        return None
    first, length = runs(force)
    at_top = np.abs(force[first]) >= top * (1 - 1e-12)
    longest = int(length[at_top].max())
    elsewhere = length[~at_top]
    usual = float(np.quantile(elsewhere, 0.99)) if len(elsewhere) else 1.0
    return float(force[first][at_top][0]) if longest >= max(10, USUAL * usual) else None


def drop_outs(force: Array, depth_mm: Array, noise_N: float) -> Mask:
    """Which samples (m,) of a channel whose digits are finer than its noise repeat the one before in long runs of one
    value, in the pad (depths, (m,)) and below its ceiling. A run of zeros is none: a pad that has let go, in
    data that were computed.
    """
    none = np.zeros(len(force), dtype=bool)
    steps = np.abs(np.diff(force))
    moved = steps[steps > 0]
    if moved.size < 20 or float(np.quantile(moved, 0.01)) > COARSE * noise_N:
        return none
    first, length = runs(force)
    long = (length >= max(LONG_RUN, USUAL * float(np.quantile(length, 0.95)))) & (force[first] != 0)
    long &= depth_mm[first] > IN_THE_PAD * depth_mm.max()
    into, out = np.append(np.inf, steps)[first], np.append(steps, np.inf)[first + length - 1]
    long &= np.minimum(into, out) > NO_STEP * noise_N  # what comes to rest by itself has no noise that should show
    level = ceiling(force)
    if level is not None:
        long &= force[first] != level
    again = np.repeat(long, length)
    again[first] = False
    return again
