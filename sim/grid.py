"""Times of a simulation: checked once, joined from two channels, with what every run over them needs again."""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from functools import lru_cache

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim import kernel as k

Array = NDArray[np.float64]

SAME_INSTANT_S = 1e-9
"""Stamps closer than this are one instant: differences over less are rounding."""

MODES_KEPT, SETS_KEPT, WAYS_KEPT = 16, 4, 8

Report = tuple[int, tuple[float, ...]]
"""A block by which an encoder reports another position than the true one: its address, and its parameters."""


class Grid:
    """Times (n,) that do not fall, and the steps between them.

    A fit runs a plant many times over the same times, mostly with the same rates and the same encoder: what a mode
    keeps and gains in each step, and where the probe was, is worked out once for those last asked for. Raises
    ValueError for times that are not finite or fall.
    """

    def __init__(self, time_s: ArrayLike) -> None:
        self.time_s = k.as_vector(time_s)
        check_times(self.time_s, "position")
        self.dt_s = steps(self.time_s)
        self._mode = lru_cache(MODES_KEPT)(self._worked_out)
        self._set = lru_cache(SETS_KEPT)(self._stacked)
        self._ways: deque[tuple[tuple[Report, ...], Array, Array]] = deque(maxlen=WAYS_KEPT)

    def __reduce__(self) -> tuple[type[Grid], tuple[Array]]:
        return Grid, (self.time_s,)  # what is kept for speed stays behind

    def fades(self, rates_per_s: Sequence[float]) -> tuple[Array, Array]:
        """(decay, gain), (r, n) each, of relaxation modes in each step (`kernel.fade`)."""
        return self._set(tuple(rates_per_s))

    def true_mm(self, reports: tuple[Report, ...], reported_mm: Array, work_out: Callable[[Array], Array]) -> Array:
        """True positions (n,), not to be written, from reported ones: as last worked out, where that was for the same.

        Most numbers of a fit leave the encoder as it is.
        """
        for known, before, true in tuple(self._ways):  # a copy, as other threads add to them
            if known == reports and np.array_equal(before, reported_mm):
                return true
        true = work_out(reported_mm)
        self._ways.append((reports, reported_mm.copy(), true))
        return true

    def _worked_out(self, rate_per_s: float) -> tuple[Array, Array]:
        decay, gain = np.empty(self.dt_s.size), np.empty(self.dt_s.size)
        k.fade(rate_per_s, self.dt_s, decay, gain)
        return decay, gain

    def _stacked(self, rates_per_s: tuple[float, ...]) -> tuple[Array, Array]:
        modes = [self._mode(rate) for rate in rates_per_s]
        shape = len(modes), self.dt_s.size
        return np.reshape([decay for decay, _ in modes], shape), np.reshape([gain for _, gain in modes], shape)


def checked(time_s: ArrayLike, position_mm: ArrayLike) -> tuple[Array, Array]:
    """Both as vectors of one length; ValueError where they are not, are not finite, or time falls."""
    time = k.as_vector(time_s)
    position = of_one_length(time, position_mm)
    check_times(time, "position")
    return time, position


def of_one_length(time: Array, position_mm: ArrayLike) -> Array:
    """Positions as a vector, one for each time; ValueError where they are not, or are not finite."""
    position = k.as_vector(position_mm)
    if time.ndim != 1 or time.shape != position.shape:
        raise ValueError(f"time and position differ in shape: {time.shape} and {position.shape}")
    if not np.isfinite(position).all():
        raise ValueError("a position is not a finite number")
    return position


def check_times(time: Array, channel: str) -> None:
    """ValueError where times are not finite or fall."""
    if not np.isfinite(time).all():
        raise ValueError(f"a {channel} time is not a finite number")
    falls = np.flatnonzero(np.diff(time) < 0.0)
    if falls.size:
        raise ValueError(f"{channel} time falls at sample {falls[0] + 1}, {time[falls[0] + 1]:g} s")


def steps(time: Array) -> Array:
    """Time from each sample to the next, starting with 0; shape (n,)."""
    return np.diff(time, prepend=time[:1])


def union(first: Array, second: Array) -> tuple[Array, NDArray[np.intp]]:
    """Both rising grids as one without near duplicates, and where each element of `second` is in it.

    Where stamps of the two fall within a nanosecond the one from `first` stands.
    """
    if np.array_equal(first, second):
        return first, np.arange(first.size)
    after = np.searchsorted(first, second)
    low, high = np.maximum(after - 1, 0), np.minimum(after, first.size - 1)
    near = np.where(np.abs(first[low] - second) <= np.abs(first[high] - second), low, high)
    same = np.abs(first[near] - second) <= SAME_INSTANT_S
    snapped = np.where(same, first[near], second)
    fresh = snapped[~same]
    if fresh.size:
        fresh = fresh[np.append(True, np.diff(fresh) > SAME_INSTANT_S)]
    grid = np.sort(np.concatenate([first, fresh]), kind="stable")
    index = np.searchsorted(grid, snapped)
    # a stamp of `second` that was dropped for its close neighbour takes the neighbour's place
    index = np.minimum(index, grid.size - 1)
    before = np.maximum(index - 1, 0)
    closer = np.abs(grid[before] - snapped) < np.abs(grid[index] - snapped)
    return grid, np.where(closer, before, index)
