"""What the data can tell of a channel that sticks: by how long it says one value, and no more is there.

Where its steps are as coarse as its noise a channel repeats itself by chance, one sample in three or so; which of the
short runs of equal values are stuck ones, nothing in the data says.
"""

from __future__ import annotations

import numpy as np

from bench.diagnose.stuck import runs

FLAGS_GOOD = 0.9
"""Precision and recall that are asked for."""


def told_by_runs(force_N: np.ndarray, stuck: np.ndarray) -> np.ndarray:
    """Of the stuck samples (n,) those in runs so long that nine in ten samples that repeat the one before, in runs as
    long or longer, are stuck ones."""
    first, length = runs(force_N)
    own = np.add.reduceat(stuck.astype(int), first)
    order = np.argsort(-length, kind="stable")  # longest first
    by_length = length[order]
    repeats, hit = np.cumsum(by_length - 1), np.cumsum(own[order])
    all_as_long = np.append(np.diff(by_length) != 0, True)
    enough = np.flatnonzero(all_as_long & (by_length > 1) & (hit > 0) & (hit >= FLAGS_GOOD * repeats))
    least = by_length[enough[-1]] if len(enough) else np.inf
    return np.asarray(stuck & np.repeat(length >= least, length))
