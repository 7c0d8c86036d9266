"""How an axis gives way to the pad's force until its servo has taken it up, seen in slow polls.

A servo with an integral is pushed back by F/k when a force comes, and returns within its time constant τ:
x = planned − (1/k) s/(s + 1/τ) F(t − λ), λ being what its damping delays. A controller that counts in hundredths of a
millimetre shows only the first of that; the rest, a few micrometres on a stiff pad, would be taken for a fast
relaxation. The force is recorded finely, and after a move the plan stands still: so the polls there tell these three
numbers, for all the moves of a run together. A poll says that the axis is within half a count of it, no more; every
set of numbers is weighed by how likely it makes the polls.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from bench.recording.types import Array

GRID_S = 1e-3
"""Steps in which the force is passed through the servo."""

TIMES_S = np.geomspace(8e-3, 0.3, 15)
LATER_S = np.array([0.0, 3e-3, 6e-3])
COMPLIANCES_MM_N = np.geomspace(2e-4, 5e-2, 45)
"""Time constants τ, delays λ and compliances 1/k that are weighed."""

FINER = 3
"""Times that they are weighed, each time on a finer grid about what is likely."""

CLEARLY = 8.0
"""Giving way counts when it makes the polls likelier than a stiff axis does, by so much in their logarithm."""

STRAY = 1e-3
"""Likelihood of a poll that nothing explains."""

TOLD = 1e-3
"""Sets of numbers less likely than this share of the best one's are left out."""


@dataclass(frozen=True)
class GivingWay:
    """What the axis gives way, mm, at `time_s` (k,): to be taken off the planned position; with its deviation."""

    time_s: Array
    way_mm: Array
    std_mm: Array
    compliance_mm_N: float

    def at(self, time_s: Array) -> Array:
        """The way at other times."""
        return np.asarray(np.interp(time_s, self.time_s, self.way_mm))

    def std_at(self, time_s: Array) -> Array:
        """Its standard deviation there."""
        return np.asarray(np.interp(time_s, self.time_s, self.std_mm))


def giving_way(
    time_s: Array, missed_mm: Array, force_time_s: Array, force_N: Array, count_mm: float, noise_mm: float
) -> GivingWay | None:
    """From what polls miss a plan that stands still, `missed_mm` (n,) = poll − planned; None where nothing gives way.

    `count_mm`: the steps in which the device counts; `noise_mm`: what the position jitters by before it is counted.
    """
    grid = np.arange(force_time_s[0], force_time_s[-1], GRID_S)
    if grid.size < 10 or time_s.size < 10:
        return None
    force = np.interp(grid, force_time_s, force_N)
    noise = max(noise_mm, 0.1 * count_mm, 1e-6)
    half = 0.5 * max(count_mm, 0.5 * noise)

    def likely(way_mm: Array) -> Array:
        off = missed_mm + way_mm
        return np.asarray(np.log(ndtr((off + half) / noise) - ndtr((off - half) / noise) + STRAY).sum(axis=-1))

    stiff = likely(np.zeros(time_s.size))
    times_s, later_s, compliances, weight = TIMES_S, LATER_S, COMPLIANCES_MM_N, np.zeros(0)
    for _ in range(FINER):
        if weight.size:
            among = weight.reshape(len(compliances), len(times_s), len(later_s))
            compliances, times_s, later_s = (
                _finer(values, among.sum(axis=others))
                for values, others in ((compliances, (1, 2)), (times_s, (0, 2)), (later_s, (0, 1)))
            )
        shapes = [(_passed(force, tau), later) for tau in times_s for later in later_s]
        at_polls = np.array([np.interp(time_s - later, grid, passed) for passed, later in shapes])
        told = np.array([likely(compliance * at_polls) for compliance in compliances])
        if told.max() < stiff + CLEARLY:
            return None
        weight = np.exp(told - told.max())
        weight[weight < TOLD] = 0.0
        weight /= weight.sum()
    mean, square = np.zeros(grid.size), np.zeros(grid.size)
    for j in np.flatnonzero(weight.any(axis=0)):
        passed, later = shapes[j]
        shape = np.interp(grid - later, grid, passed)
        mean += float(weight[:, j] @ compliances) * shape
        square += float(weight[:, j] @ compliances**2) * shape**2
    compliance = float(weight.sum(axis=1) @ compliances)
    return GivingWay(grid, mean, np.sqrt(np.maximum(square - mean**2, 0.0)), compliance)


def _finer(values: Array, weight: Array) -> Array:
    """As many values between the neighbours of those that have weight (n,)."""
    likely = np.flatnonzero(weight > 0.0)
    first, last = max(int(likely[0]) - 1, 0), min(int(likely[-1]) + 1, len(values) - 1)
    return np.linspace(values[first], values[last], len(values))


def _passed(force_N: Array, tau_s: float) -> Array:
    """The force behind a high-pass of the first order; exact where it is linear between the grid's points."""
    from scipy.signal import lfilter  # a second to load, for the few recordings that need it

    keep = np.exp(-GRID_S / tau_s)
    gain = tau_s / GRID_S * (1.0 - keep)
    return np.asarray(lfilter([gain, -gain], [1.0, -keep], force_N - force_N[0]))
