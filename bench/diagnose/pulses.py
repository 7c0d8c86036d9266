"""Pulses in the force channel: what rises at once and is gone some samples later, as surges on a line make it.

Longer than a stray sample or a burst of some (`channel`), so that neighbours tell nothing: half of them may be in it.
Told by its onset, which is far beyond what came before, and by its end, where the force is back (IEC 61000-4-5: surges
rise within a microsecond and fall within many).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from bench.felt_motion import resolution

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BEFORE = 8  # samples before a pulse that say where the force was
BACK = 3  # samples in a row that are there again
SHORTEST, LONGEST = 3, 40  # samples of a pulse: shorter ones are strays
ONSET = 12.0  # noise deviations of its first sample
ENDED = 5.0  # noise deviations within which the force is back
STEEP = 3.0  # times what the samples before differ by


def pulses(values: Array, good: Mask) -> Mask:
    """Samples (m,) of force or of what a model leaves, among the `good` ones, that a pulse has made."""
    mask = np.zeros(len(values), dtype=bool)
    index = np.flatnonzero(good)
    y = values[index]
    if len(y) < 2 * BEFORE + LONGEST:
        return mask
    bend = np.diff(y, 2)
    noise = 1.4826 * float(np.median(np.abs(bend - np.median(bend)))) / np.sqrt(6.0)
    noise = max(noise, resolution(values) / np.sqrt(12.0), 1e-12)
    windows = np.lib.stride_tricks.sliding_window_view(y, BEFORE)[:-1]
    level, differ = np.median(windows, axis=1), np.ptp(windows, axis=1)
    jump = np.abs(y[BEFORE:] - level)
    ends = 0
    for k in np.flatnonzero((jump > ONSET * noise) & (jump > STEEP * differ)):
        first = int(k) + BEFORE
        if first < ends:
            continue
        last = _end(y, first, float(level[k]), max(ENDED * noise, float(differ[k])))
        if last - first < SHORTEST or np.median(np.abs(y[first:last] - level[k])) < ONSET * noise:
            continue
        ends = last
        mask[index[first:ends]] = True
    return mask


def _end(y: Array, first: int, level: float, near: float) -> int:
    """Index behind a pulse that begins at `first`; `first` where it does not come back, or goes to the other side."""
    off = y[first : first + LONGEST + BACK] - level
    close = np.abs(off) < near
    for n in range(1, len(off) - BACK + 1):
        if close[n : n + BACK].all():
            return first + n
        if off[n] * off[0] < 0.0 and not close[n]:
            break
    return first
