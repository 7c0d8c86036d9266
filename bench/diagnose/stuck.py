"""Samples at which a force channel says again what it said before."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.stats import norm, poisson

from bench.readings import resolution, runs, spacing

from .coarse import noise_steps

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

AGAIN = 0.01  # of the samples that repeat the one before, at the least, where digits are not so many
FEW_REPEATS = 4  # equal pairs that are no accident where digits are many
CHANCE = 1e-7  # of a run of equal values that long, anywhere in the data
SOME, LATER = 3, 6  # samples of runs that may be accidents
ACCIDENTS = 0.05  # of the runs flagged, where a channel sticks
FINE = 3.0  # steps: with more noise a channel has many digits
HARDLY = 0.8  # steps: less noise hardly leaves one where the force is at rest
STANDS = 0.5  # share of equal pairs beyond which noise is less than half a step
LEAPS = 3  # steps by which what has stuck in such a channel catches up, at the least
DIGITS, WHOLE = 12, 1e-3  # decimal places that are looked for; and how far off a whole number of them is one
SLOWED = (2, 3, 4)  # samples that a channel says one value for, when it is for a while that much slower


def slowed(force: Array, but: Mask) -> Mask:
    """Samples that say again what the channel said before, for a while every other one or all but every so many."""
    mask, same = np.zeros(len(force), dtype=bool), np.concatenate([[False], force[1:] == force[:-1]])
    # where it repeats itself the most anyway: in holds
    window = min(max(len(force) // 40, 20), len(force))
    shares = np.convolve(same & ~but, np.ones(window) / window, mode="valid")
    chance = min(max(float(np.quantile(shares, 0.9)), 0.05), 0.97)
    for every in SLOWED:
        least = int(np.ceil(np.log(CHANCE / len(force)) / np.log(chance) / (every - 1))) + 1
        for phase in range(every):
            count = (len(force) - phase) // every
            group = np.arange(phase, phase + count * every).reshape(count, every)
            again = np.all(same[group[:, 1:]] & ~but[group[:, 1:]], axis=1).astype(np.int8)
            edges = np.flatnonzero(np.diff(np.concatenate([[0], again, [0]]))).reshape(-1, 2)
            for first, last in edges[np.diff(edges, axis=1)[:, 0] >= least].tolist():
                if np.mean(same[group[first:last, 0]]) < 0.5 * (1.0 + chance):  # else it is one long run
                    mask[group[first:last, 1:].ravel()] = True
    return mask


def repeated(force: Array, but: Mask) -> Mask:
    """Samples that repeat the one before in runs longer than resolution and noise make them."""
    mask = np.zeros(len(force), dtype=bool)
    first, length = runs(force)
    if np.count_nonzero(~but[first]) < 2:
        return mask
    # how often a sample equals the one before when nothing sticks: judged where values change most
    same = np.concatenate([[0.0], (np.diff(force) == 0).astype(float)])
    step, counted = _step(force), ~but[first]
    if step > 0.0:
        window = max(len(force) // 40, 20)
        shares = np.convolve(same, np.ones(window) / window, mode="same")
        p = max(float(np.median(shares[window:-window] if len(force) > 3 * window else shares)), 0.05)
        # neighbours are apart as often as noise crosses a step's edge, of which there is one wherever the force is
        noise = noise_steps(force, step)
        if p > STANDS:
            noise = np.fmin(noise, 0.5 * np.sqrt(np.pi) * (1.0 - p))
        middle = 2.0 * float(norm.cdf(0.5 / max(noise, 1e-3))) - 1.0 if np.isfinite(noise) else p
        in_the_middle = min(max(middle, p), 1.0 - 1e-12)
        if noise < HARDLY:  # it hardly leaves a step: in its middle a force stands long, but nothing leaps in the end
            long = (length >= _least(min(p, 0.97), len(force))) & _catches_up(force, first, length, step)
            long |= length >= _least(in_the_middle, len(force))
        else:
            long = length >= _least(p, len(force))
        long |= length >= _least_of_many(length[counted], in_the_middle, bool(np.any(long & counted)))
    else:
        chance = equal_by_chance(force)
        p = 0.0 if no_accident(int(same[~but].sum()), chance) else min(max(chance / len(force), AGAIN), 0.97)
        long = length >= _least(p, len(force))
    long &= counted
    for start, count in zip(first[long].tolist(), length[long].tolist(), strict=True):
        mask[start + 1 : start + count] = True
    return mask


def _step(force: Array) -> float:
    """The step of a channel's values, where noise is of its size; 0: the channel has many digits."""
    if (known := resolution(force)) > 0.0:
        return known
    step = spacing(force)
    if step == 0.0:
        return 0.0
    noise = noise_steps(force, step)
    size = noise if np.isfinite(noise) else float(np.median(np.abs(np.diff(force)))) / step
    return step if size < FINE else 0.0


def _least(p: float, samples: int) -> float:
    """The shortest run that is no accident anywhere in the data, where a sample equals the one before by chance `p`."""
    return float(np.ceil(np.log(CHANCE / samples) / np.log(p))) + 1.0 if p > 0.0 else 2.0


def _least_of_many(length: NDArray[np.intp], p: float, sticks: bool) -> float:
    """The shortest run of which hardly one in so many is an accident, in a channel that is known to stick, or does so
    by how many runs are long together. `length`: of all runs (r,); of those of some samples, that are accidents, no
    more go on than would at `p`; or, in doubt, than go on a little later."""
    at_least = np.cumsum(np.bincount(length, minlength=LATER + 2)[::-1])[::-1]
    if not sticks:
        p = max(p, float(at_least[LATER + 1] / max(at_least[LATER], 1)))
    count = np.arange(LATER, len(at_least))
    expected, found = at_least[SOME] * p ** (count - SOME), at_least[LATER:]
    if not sticks and not np.any(poisson.sf(found - 1, expected) < CHANCE):
        return np.inf
    return float(np.append(count[expected <= ACCIDENTS * found], np.inf)[0])


def _catches_up(force: Array, first: NDArray[np.intp], length: NDArray[np.intp], step: float) -> Mask:
    """Of runs (r,), whether the force leaps by some steps at the end, and goes on much slower: no move does so."""
    end = np.minimum(first + length, len(force) - 2)
    leap, then = np.abs(force[end] - force[end - 1]), np.abs(force[end + 1] - force[end])
    return np.asarray((first + length < len(force) - 1) & (leap > (LEAPS - 0.5) * step) & (then < leap / 3.0))


def no_accident(repeats: int, chance: float) -> bool:
    """Whether equal samples are far more than the `chance` ones."""
    return repeats >= FEW_REPEATS and repeats > 8.0 * chance


def equal_by_chance(force: Array) -> float:
    """How many samples agree with the one before by chance, in a channel of many digits."""
    change = np.abs(np.diff(force))
    least = 1e-9 * float(np.ptp(force))
    sizes, counts = np.unique(np.rint(change[change > least] / max(least, 1e-300)), return_counts=True)
    if counts.max(initial=0) >= FEW_REPEATS:  # changes come in steps: those of 0 are as many as of one step either way
        return 0.5 * float(counts.max())
    # of any samples two are as close as that one expects one equal pair: what they are written with is finer
    finest = max(min(least * float(sizes[0]), _last_digit(force)), spacing(force)) if len(sizes) else 0.0
    scatter = 1.4826 * float(np.median(change))
    return len(force) * finest / max(float(np.sqrt(2.0 * np.pi)) * scatter, 1e-300)


def _last_digit(force: Array) -> float:
    """The decimal place with which most values (m,) end; 0 where they have all that a number of the machine has."""
    for place in range(DIGITS):
        scaled = force * 10.0**place
        if np.mean(np.abs(scaled - np.rint(scaled)) < WHOLE) > 0.5:
            return 10.0**-place
    return 0.0
