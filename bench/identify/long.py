"""Data of many million samples in memory that does not grow with them: block means for the search, pieces for the rest.

Averaging neighbours loses nothing that the model could feel: a block is short against the samples' own number, and its
samples lie within a small share of the depth of each other. So fast moves stay sample by sample, and holds shrink.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bench.recording.types import Measurement
from sim.grid import union

from ._kernel import Array
from .motion import LONG
from .runs import Run

ROWS = 200_000  # that it is shortened to, about
WITHIN = 1 / 400  # of the depth: what a block may span
PIECE = 1 << 17  # samples in memory at once


def is_long(m: Measurement) -> bool:
    """Whether a measurement is worked on in blocks."""
    return max(len(m.position_time_s), len(m.force_time_s)) > LONG


@dataclass(frozen=True)
class Stretch:
    """A piece of a measurement on its union grid; (n,). `at`: where its forces stand; `forces`: which those are."""

    time_s: Array
    position_mm: Array
    at: NDArray[np.intp]
    forces: slice


def stretches(m: Measurement) -> Iterator[Stretch]:
    """The measurement in pieces, in turn and without overlap."""
    tp, tf = m.position_time_s, m.force_time_s
    if len(tp) == len(tf) and all(np.array_equal(tp[s], tf[s]) for s in _slices(len(tp))):
        for s in _slices(len(tp)):
            yield Stretch(tp[s], m.position_mm[s], np.arange(s.stop - s.start), s)
        return
    edges = tp[:: max(1, PIECE * len(tp) // (len(tp) + len(tf)))]
    bounds = np.searchsorted(tp, edges)
    for k, first in enumerate(bounds):
        last = bounds[k + 1] if k + 1 < len(bounds) else len(tp)
        begin, end = tp[first], tp[last] if last < len(tp) else np.inf
        a, b = (int(i) for i in np.searchsorted(tf, [begin, end]))
        if not np.isfinite(end):
            b = len(tf)
        grid, at = union(tp[first:last], tf[a:b])
        reach = slice(max(first - 1, 0), last + 1)
        yield Stretch(grid, np.interp(grid, tp[reach], m.position_mm[reach]), at, slice(a, b))


def _slices(n: int) -> Iterator[slice]:
    for start in range(0, n, PIECE):
        yield slice(start, min(start + PIECE, n))


def shortened(m: Measurement, depth_mm: float, force_N: float) -> Run:
    """The run in blocks, each of the mean of its samples and of their number's weight."""
    total = max(len(m.position_time_s), len(m.force_time_s))
    length = -(-total // ROWS)
    counted = m.counted()
    parts: list[tuple[Array, ...]] = []
    first = True
    for s in stretches(m):
        y, w = np.zeros(len(s.time_s)), np.zeros(len(s.time_s))
        y[s.at] = m.force_N[s.forces] / force_N
        w[s.at[counted[s.forces]]] = 1.0
        u = s.position_mm / depth_mm
        owner = _owners(u, length)
        if first:  # a run's first sample stays alone: the jump from rest to it is part of the motion
            owner[1:] += len(owner) > 1 and owner[1] == owner[0]
            first = False
        weight = np.asarray(np.bincount(owner, w), dtype=np.float64)
        share = np.where(weight[owner] > 0, w, 1.0)
        count = np.bincount(owner, share)
        with np.errstate(invalid="ignore"):
            mean = np.where(weight > 0, np.bincount(owner, w * y) / weight, 0.0)
        parts.append(
            (np.bincount(owner, share * s.time_s) / count, np.bincount(owner, share * u) / count, mean, weight)
        )
    time, u, y, weight = (np.concatenate(column) for column in zip(*parts, strict=True))
    return Run(time, np.diff(time, prepend=time[0]), u, y, weight, stamp_std_s=m.stamp_std_s)


def _owners(u: Array, length: int) -> NDArray[np.intp]:
    """Which block each sample belongs to: of so many samples, fewer where they span much depth."""
    n = len(u)
    starts = np.arange(0, n, length)
    span = np.maximum.reduceat(u, starts) - np.minimum.reduceat(u, starts)
    pieces = np.clip(np.ceil(span / WITHIN), 1, length).astype(np.intp)
    block = np.arange(n) // length
    within = (np.arange(n) - block * length) * pieces[block] // length
    owner = within + (np.cumsum(pieces) - pieces)[block]
    return np.asarray(np.cumsum(np.diff(owner, prepend=0) > 0), dtype=np.intp)
