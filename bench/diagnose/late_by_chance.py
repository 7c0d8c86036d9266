"""How far the time at which a force was felt scatters from sample to sample: what is queued or polled waits by chance.

Each sample is off by the rate of the force times its own lateness. No model can know that; it is noise, large in fast
moves and nothing in holds. It is told from what a model misses by third differences of what is left: errors of a model
go on from sample to sample, and chance does not.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from .data import Data, Prepared
from .late import LATE
from .louder import THIRD
from .refit import Fit, force_at

Array = NDArray[np.float64]

EVEN = 1.5  # times that the force's rate may change within a difference: beside corners a model's errors do not go on
SHOWN, FEWEST = 0.1, 40  # of a step between samples, that must show where it is looked at; differences there
CLEAR = 2.0  # times what noise alone makes of their square: less is none
SHARE = 0.02  # of a step between samples: less changes nothing
NORMAL = 1.4826


def late_by_chance_s(prepared: Prepared, fit: Fit) -> float:
    """Standard deviation of when forces were felt, s, from what a fit that makes the force late leaves of it; 0 where
    it shows none, or makes nothing late."""
    if not any(cause.id in LATE for cause in fit.structure.causes):
        return 0.0
    full, at = prepared.full, prepared.at[prepared.full.weight[prepared.at] > 0.0]
    if len(at) < len(THIRD):
        return 0.0
    modelled = force_at(full, fit.structure, fit.x)
    left, rate = (full.force_N - modelled)[at], np.abs(force_rate(full, modelled))[at]
    known_N = prepared.without_felt_N[at]
    lefts, rates, times, knowns = (
        np.lib.stride_tricks.sliding_window_view(values, len(THIRD))
        for values in (left, rate, full.time_s[at], known_N)
    )
    step = np.diff(times, axis=1)
    steady = (rates.max(axis=1) < EVEN * rates.min(axis=1)) & (step.max(axis=1) < EVEN * step.min(axis=1))
    across, noise = (np.sum((THIRD * values) ** 2, axis=1) for values in (rates, knowns))
    steep = steady & (across * (SHOWN * prepared.sample_s) ** 2 > noise)
    if np.count_nonzero(steep) < FEWEST:
        return 0.0
    difference, across, noise = (lefts @ THIRD)[steep], across[steep], noise[steep]
    square = (NORMAL * float(np.median(np.abs(difference) / np.sqrt(across)))) ** 2
    by_noise = float(np.median(noise / across))
    scatter = float(np.sqrt(max(square - by_noise, 0.0)))
    return scatter if square > CLEAR * by_noise and scatter > SHARE * prepared.sample_s else 0.0


def force_rate(data: Data, force_N: Array) -> Array:
    """Rate of a force on the grid (n,), N/s."""
    return np.asarray(np.gradient(force_N, data.time_s))
