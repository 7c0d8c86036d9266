"""What errors of the positions make of a model's force beyond the pad's stiffness.

Friction that turns round within a micrometre, and a mass that feels the second derivative, make much of what is left
of the encoder's noise, and of what smoothing has bent: no model can say more of the force than the positions do. It is
found by moving the positions within their doubt, and running the model again. What scatters in when a force was felt
(`late_by_chance`) is of the same kind.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import uniform_filter1d

from bench.identify.motion import holds

from .data import Data, FeltErrors, Prepared
from .late_by_chance import force_rate, late_by_chance_s
from .numbers import Structure
from .refit import Fit, force_at

Array = NDArray[np.float64]

RUNS = 12
BENT = 3.0  # times what is left of the noise: smoothing takes as much away as it leaves doubt
TOGETHER = 7  # entries whose scatter is taken for one
SEEN = 0.3  # of the noise: less changes nothing


def felt_errors(prepared: Prepared, fit: Fit, rng: np.random.Generator) -> FeltErrors:
    """What errors of the positions make through the causes of a fit, and chance in when its forces were felt."""
    stretch, resting = _rests(prepared.full)
    data = replace(prepared.full, tared=None)
    bare = replace(fit.structure, causes=())
    pad = bare.x(fit.x[: len(bare.pad.coordinates)], [], fit.of_run)
    full, through_pad = _Scatter(data, stretch, fit.structure, fit.x), _Scatter(data, stretch, bare, pad)
    for _ in range(RUNS):
        error = BENT * prepared.position_std_mm * _drawn(prepared.position_rest, rng)
        position = data.position_mm + np.interp(data.time_s, prepared.position_time_s, error)
        for scatter in (full, through_pad):
            scatter.add(position)
    own_N2 = np.maximum(uniform_filter1d(np.maximum(full.own.variance - through_pad.own.variance, 0.0), TOGETHER), 0.0)
    shared_N2 = np.maximum(full.shared.variance - through_pad.shared.variance, 0.0)
    if resting.any():  # where a slider is held is chance, and few runs miss much of it in a rest
        counts = data.weight * resting
        pooled = float(np.sum(counts * shared_N2) / max(counts.sum(), 1.0))
        shared_N2 = np.where(resting, np.maximum(shared_N2, pooled), shared_N2)
    modelled, late_s = force_at(prepared.full, fit.structure, fit.x), late_by_chance_s(prepared, fit)
    own_N2 += (late_s * force_rate(prepared.full, modelled)) ** 2
    # no more than is there: what a fit meets well it shall go on meeting
    left = prepared.full.force_N - modelled
    square = data.weight * (left - _common(stretch, data.weight, left)) ** 2
    counted = np.maximum(uniform_filter1d(data.weight, TOGETHER), 1e-12)
    own_N2 = np.minimum(own_N2, np.maximum(uniform_filter1d(square, TOGETHER), 0.0) / counted)
    least = (SEEN * prepared.noise.force_N) ** 2
    own_N, shared_N = (np.sqrt(np.where(square > least, square, 0.0)) for square in (own_N2, shared_N2))
    return FeltErrors(own_N, shared_N, stretch, late_s)


class _Moments:
    """Running sums of arrays (n,) and of their squares."""

    def __init__(self, size: int) -> None:
        self.count, self.sum, self.square = 0, np.zeros(size), np.zeros(size)

    def add(self, values: Array) -> None:
        self.count += 1
        self.sum += values
        self.square += values**2

    @property
    def variance(self) -> Array:
        """About the mean: that the runs shake friction loose is no error of the positions."""
        return np.maximum(self.square - self.sum**2 / self.count, 0.0) / (self.count - 1)


class _Scatter:
    """Of a model's force, from run to run: `shared` by all of a stretch, and each sample's `own`."""

    def __init__(self, data: Data, stretch: NDArray[np.intp], structure: Structure, x: Array) -> None:
        self.data, self.stretch, self.structure, self.x = data, stretch, structure, x
        self.before = force_at(data, structure, x)
        self.own, self.shared = _Moments(data.size), _Moments(data.size)

    def add(self, position_mm: Array) -> None:
        """One more run, over other positions (n,)."""
        change = force_at(replace(self.data, position_mm=position_mm), self.structure, self.x) - self.before
        change = np.where(np.isfinite(change), change, 0.0)
        common = _common(self.stretch, self.data.weight, change)
        self.shared.add(common)
        self.own.add(change - common)


def _drawn(rest: NDArray[np.intp], rng: np.random.Generator) -> Array:
    """Errors (p,) of scatter 1: one for each rest, and of each position in motion by itself."""
    of_rests = rng.standard_normal(int(rest.max()) + 1)[rest]
    return np.where(rest > 0, of_rests, rng.standard_normal(len(rest)))


def _rests(data: Data) -> tuple[NDArray[np.intp], NDArray[np.bool_]]:
    """The stretches (n,), a whole rest one of them: what holds a slider does so until the next move; and what rests."""
    stretch = np.zeros(data.size, dtype=np.intp) if data.stretch is None else data.stretch.copy()
    resting = np.zeros(data.size, dtype=bool)
    for s in holds(data.time_s, data.position_mm):
        stretch[s], resting[s] = stretch[s.start], True
    return np.asarray(np.unique(stretch, return_inverse=True)[1], dtype=np.intp), resting


def _common(stretch: NDArray[np.intp], weight: Array, change_N: Array) -> Array:
    """Mean of a change (n,) over the forces of each stretch."""
    counts = np.bincount(stretch, weight)
    means = np.bincount(stretch, weight * change_N) / np.maximum(counts, 1e-300)
    return np.asarray(means[stretch])
