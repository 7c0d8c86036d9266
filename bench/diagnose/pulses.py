"""Pulses in the force channel: what is there at once and is gone some samples later, as surges on a line make it, or
bursts of wrong readings.

Longer than a stray sample or a burst of some (`channel`), so that neighbours tell nothing: half of them may be in it.
Told by its onset, which is far beyond what came before, and by its end, where the force is back (IEC 61000-4-5: surges
rise within a microsecond and fall within many).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BEFORE = 8  # samples before a pulse that say where the force was
BACK = 3  # samples in a row that are there again
SHORTEST, LONGEST = 3, 40  # samples of a pulse: shorter ones are strays
ONSET = 12.0  # noise deviations of its first sample
ENDED = 5.0  # noise deviations within which the force is back
STEEP = 3.0  # times what the samples before differ by
WHOLLY = 0.2  # of a burst that goes both ways, so much at the most is not far off: it jumps, and does not swing


def pulses(values: Array, good: Mask, step_N: float) -> Mask:
    """Samples (m,) of force or of what a model leaves, among the `good` ones, that a pulse has made. `step_N`: of the
    channel, of which what a model leaves has none."""
    mask = np.zeros(len(values), dtype=bool)
    index = np.flatnonzero(good)
    y = values[index]
    if len(y) < 2 * BEFORE + LONGEST:
        return mask
    bend = np.diff(y, 2)
    noise = 1.4826 * float(np.median(np.abs(bend - np.median(bend)))) / np.sqrt(6.0)
    noise = max(noise, step_N / np.sqrt(12.0), 1e-12)
    windows = np.lib.stride_tricks.sliding_window_view(y, BEFORE)[:-1]
    level, differ = np.median(windows, axis=1), np.ptp(windows, axis=1)
    jump = np.abs(y[BEFORE:] - level)
    ends = 0
    for k in np.flatnonzero((jump > ONSET * noise) & (jump > STEEP * differ)):
        first = int(k) + BEFORE
        if first < ends:
            continue
        last = _end(y, first, float(level[k]), max(ENDED * noise, float(differ[k])))
        off = y[first:last] - level[k]
        if last - first < SHORTEST or np.median(np.abs(off)) < ONSET * noise:
            continue
        if off.min() < 0.0 < off.max() and np.quantile(np.abs(off), WHOLLY) < ONSET * noise:
            continue  # what swings goes through the middle
        ends = last
        mask[index[first:ends]] = True
    return mask


def _end(y: Array, first: int, level: float, near: float) -> int:
    """Index behind a pulse that begins at `first`; `first` where it does not come back."""
    close = np.abs(y[first : first + LONGEST + BACK] - level) < near
    back = np.flatnonzero(np.convolve(close, np.ones(BACK), mode="valid") > BACK - 0.5)
    return first + int(back[0]) if len(back) else first
