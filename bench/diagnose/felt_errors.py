"""What errors of the positions make of a model's force beyond the pad's stiffness.

Friction that turns round within a micrometre, and a mass that feels the second derivative, make much of what is left
of the encoder's noise, and of what smoothing has bent: no model can say more of the force than the positions do. It is
found by moving the positions within their doubt, and running the model again. What scatters in when a force was felt
(`late_by_chance`), and when within a step it leaps (`within_a_step`), is of the same kind.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import binary_dilation, uniform_filter1d

from bench.felt_motion import REACHES, settled
from bench.identify.motion import holds

from .data import Data, FeltErrors, Prepared
from .late_by_chance import force_rate, late_by_chance_s
from .numbers import Structure
from .refit import Fit, force_at
from .within_a_step import leaps

Array = NDArray[np.float64]

RUNS = 12
BIASED = 1.5  # times the errors drawn: what is drawn about is smooth already, and smoothing bends it less
BENT = 3.0  # times what is left of the noise in rests and planned moves: those may be bent, too
TOGETHER = 7  # entries whose scatter is taken for one
MEDIAN = 0.455  # of a normal variable's square, over its mean
SEEN = 0.3  # of the noise, and of the noise of a mean: less changes nothing


def felt_errors(prepared: Prepared, fit: Fit, errors_mm: Array) -> FeltErrors:
    """What errors of the positions make through the causes of a fit, and chance in when its forces were felt.

    `errors_mm` (runs, p): such errors, as `redrawn` draws them.
    """
    stretch, resting = _rests(prepared.full)
    data = replace(prepared.full, tared=None)
    bare = replace(fit.structure, causes=())
    pad = bare.x(fit.x[: len(bare.pad.coordinates)], [], fit.of_run)
    full, through_pad = _Scatter(data, stretch, fit.structure, fit.x), _Scatter(data, stretch, bare, pad)
    for error in errors_mm:
        position = data.position_mm + np.interp(data.time_s, prepared.position_time_s, error)
        for scatter in (full, through_pad):
            scatter.add(position)
    own_N2 = np.maximum(uniform_filter1d(np.maximum(full.own.variance - through_pad.own.variance, 0.0), TOGETHER), 0.0)
    shared_N2 = np.maximum(full.shared.variance - through_pad.shared.variance, 0.0)
    modelled, late_s = force_at(prepared.full, fit.structure, fit.x), late_by_chance_s(prepared, fit)
    own_N2 += (late_s * force_rate(prepared.full, modelled)) ** 2
    left = prepared.full.force_N - modelled
    common = _common(stretch, data.weight, left)
    if resting.any():  # where a slider is held is chance, and few runs miss much of it in a rest
        counts = data.weight * resting
        held_N2 = np.maximum(shared_N2, float(np.sum(counts * shared_N2)) / max(float(counts.sum()), 1.0))
        # no more than is there: motion that comes to rest as it was planned turns no slider round, errors drawn may
        there_N2 = np.maximum(common**2, float(np.median(common[resting] ** 2)) / MEDIAN)
        shared_N2 = np.where(resting, np.minimum(held_N2, there_N2), shared_N2)
    # nor of each sample's own: what a fit meets well it shall go on meeting
    square = data.weight * (left - common) ** 2
    counted = np.maximum(uniform_filter1d(data.weight, TOGETHER), 1e-12)
    beyond_N2 = uniform_filter1d(square, TOGETHER) / counted - prepared.noise_N(modelled) ** 2
    own_N2 = np.minimum(own_N2, np.maximum(beyond_N2, 0.0))
    at = prepared.at[data.weight[prepared.at] > 0.0]
    leapt_N = leaps(modelled[at], data.force_N[at], prepared.without_felt_N[at])
    own_N2[at] = np.maximum(own_N2[at], leapt_N**2)
    least_N2 = (SEEN * prepared.noise.force_N) ** 2
    alike = np.maximum(np.bincount(stretch, data.weight), 1.0)[stretch]  # the mean of so many tells of less
    own_N = np.sqrt(np.where(own_N2 > least_N2, own_N2, 0.0))
    shared_N = np.sqrt(np.where(shared_N2 > least_N2 / alike, shared_N2, 0.0))
    return FeltErrors(own_N, shared_N, stretch, late_s)


def redrawn(prepared: Prepared, rng: np.random.Generator) -> Array:
    """Errors (`RUNS`, p) of the motion as felt, mm. About motion that is no planner's move the noise of the positions
    is laid on it anew and taken out again, so that neighbours share what they share in the measurement: the parametric
    bootstrap (B. Efron, Bootstrap methods: another look at the jackknife, Ann. Statist. 7, 1979, 1–26). A rest goes
    from the error where it begins to that where it ends; in planner's moves each sample has one of its own.
    """
    time, motion = prepared.position_time_s, prepared.motion
    rest, planned = motion.rest_at(time), motion.planned_at(time)
    std = BENT * np.interp(time, motion.time_s, motion.std_mm)
    position = np.interp(time, prepared.full.time_s, prepared.full.position_mm)
    stretches = _stretches((rest == 0) & ~planned)
    bent = np.zeros(len(rest), dtype=bool)
    for stretch in stretches:
        bent[stretch] = True
    bent &= ~planned
    out = np.empty((RUNS, len(rest)))
    for error in out:
        read = _read_again(prepared, position, rng)
        for stretch in stretches:
            error[stretch] = BIASED * (settled(time[stretch], read[stretch]) - position[stretch])
        of_rests = std * rng.standard_normal(int(rest.max()) + 1)[rest]
        error[~bent] = np.interp(time[~bent], time[bent], error[bent]) if bent.any() else of_rests[~bent]
        error += np.where(planned, std * rng.standard_normal(len(rest)), 0.0)
    return out


def _read_again(prepared: Prepared, position_mm: Array, rng: np.random.Generator) -> Array:
    """Positions (p,) as they might have been read as well, wherever the scale's zero is."""
    step_mm = prepared.position_step_mm
    noise_mm = np.sqrt(max(prepared.motion.noise.of_means_mm**2 - step_mm**2 / 12.0, 0.0))
    read = position_mm + noise_mm * rng.standard_normal(len(position_mm))
    if step_mm == 0.0:
        return np.asarray(read)
    zero = step_mm * rng.uniform()
    return np.asarray(step_mm * np.round((read - zero) / step_mm) + zero)


def _stretches(moving: NDArray[np.bool_]) -> list[slice]:
    """Runs of samples that move, with as many on either side as a window reaches."""
    reach = int(REACHES[-1])
    near = binary_dilation(moving, iterations=reach).astype(np.int8)
    edges = np.flatnonzero(np.diff(np.concatenate([[0], near, [0]]))).reshape(-1, 2)
    return [slice(a, b) for a, b in edges.tolist()]


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
