"""Samples that repeat the one before in a coarse channel, which repeats itself anyway."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import binom, poisson

from bench.readings import resolution

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BELOW = 0.7  # of the greatest force
MORE, SURELY = 0.05, 4.0  # of the equal pairs that chance makes, and of their deviations
WIDEST, WIDE = 0.67, 1.5  # logarithm of changes by one step over those by two: noise of some steps; of nearly one
ENOUGH = 50  # changes of a size, either way, that tell how likely it is
RARE = 1e-3  # chance of so many equal pairs in motion
FASTEST, RARER = 0.01, 1e-4  # chance of one equal pair in fast motion, at the most; and of so many
AMID = 0.01  # chance of so many equal pairs amid those that differ by a step or two
WINDOW, FEWEST = 50, 8  # samples looked at together, and the fewest such windows that tell of the noise
PASSED = 1.5  # steps that the force moves there at the least
HIDDEN = 0.4  # steps: less noise does not show at rest
MANY = 4.0  # steps that changes scatter by, from which the median tells it well
FINEST = 0.6  # steps that a change scatters by at the least: of rounding alone


@dataclass(frozen=True)
class _Excess:
    """Equal pairs beyond those that chance makes: share of all and its standard deviation; steps that a change scatters
    by; whether they are beyond doubt."""

    share: float
    std: float
    scatter: float
    sure: bool


def noise_steps(force: Array, step_N: float) -> float:
    """Standard deviation of a coarse channel's noise before rounding, in steps; nan where nothing tells of it.

    Told where the force moves, so that each place within a step is met alike: between two samples it crosses as many
    edges as steps, on the average |δ + √2 σ z| with δ its own way and z standard normal, nearly √(δ² + 4σ²/π). At rest
    a force stands in the middle of a step, or at an edge.
    """
    change = np.diff(force) / step_N
    windows = change[: len(change) // WINDOW * WINDOW].reshape(-1, WINDOW)
    way, crossed = np.abs(windows.mean(axis=1)), np.abs(windows).mean(axis=1)
    moving = np.flatnonzero(way * WINDOW > PASSED)
    count = max(len(moving) // 4, FEWEST)
    slow = moving[np.argsort(way[moving], kind="stable")][:count]  # where noise counts the most
    if len(slow) < FEWEST:
        return float("nan")
    middle = float(np.median(crossed[slow] ** 2 - way[slow] ** 2))  # whatever a stray reading makes of some windows
    return float(0.5 * np.sqrt(np.pi * max(middle, 0.0)))


def rounded(force: Array, step_N: float) -> float:
    """What rounding makes of a force (m,) at the least, standard deviation, N; with the noise before it where that
    hardly leaves a step, so that at rest it does not show."""
    steps = noise_steps(force, step_N) if step_N > 0.0 else 0.0
    return step_N * float(np.sqrt(1.0 / 12.0 + (steps**2 if steps < HIDDEN else 0.0)))


def coarse_repeats(force: Array, but: Mask) -> tuple[Mask, float | None]:
    """Samples (m,) that more likely stick than repeat the one before by chance, which shows in motion; and the share of
    all samples that stick (None: none that is sure). `but`: samples that are something else.
    """
    mask, step = np.zeros(len(force), dtype=bool), resolution(force)
    if step == 0.0:
        return mask, None
    change = np.rint(np.diff(force) / step)
    bad = but[1:] | but[:-1]
    high = np.abs(force) > BELOW * float(np.abs(force).max())  # where an amplifier that ends narrows the noise
    excess = _in_excess(np.abs(change[~(bad | high[1:] | high[:-1])]))
    if excess is None:
        return mask, None
    # what repeats counts with the change that is foretold beside it, whether it repeats or not
    same = np.diff(force) == 0.0
    begins = np.flatnonzero(~(same & np.concatenate([[False], same[:-1]])))
    first, length = begins[1:-1], np.diff(begins[1:])
    before, after = change[first - 1], change[first + length]
    others = np.concatenate([[0], np.cumsum(bad)])
    one_way = (before * after > 0) & (others[first + length + 1] == others[first - 1])
    if excess.sure:
        along, within = before + change[first] + after, excess.share
        chance = _of_none(along / (length + 2.0), excess.scatter)
    else:  # where a move begins or ends the change is between those beside it; what has stuck catches up
        least = np.minimum(np.abs(before), np.abs(after) / (length + 1.0))
        chance, within = _of_none(least, np.sqrt(3.0) * excess.scatter), FASTEST
    telling = one_way & (chance < within)
    sticks = telling & same[first]
    if excess.sure:
        found, share = poisson.sf(int(sticks.sum()) - 1, float(chance[telling].sum())) < RARE, excess.share
    else:
        slow = telling & (np.abs(change[first]) <= 2)
        found = _amid_none(int(sticks.sum()), int(slow.sum()), float(chance[telling].sum()))
        share = _share(int(length[sticks].sum()), int(length[telling].sum()), excess)
    if not found:
        return mask, None
    for begin, count in zip(first[sticks].tolist(), length[sticks].tolist(), strict=True):
        mask[begin + 1 : begin + 1 + count] = True
    return mask, share


def _in_excess(change: Array) -> _Excess | None:
    """Of changes (k,), in steps and without their signs; None where too few are of one step or two.

    Chance makes as many of 0 steps as those of 1 to 4 steps foretell, whose logarithms go down with the square; that
    holds for noise of any colour, which only makes it narrower.
    """
    counts = np.array([np.count_nonzero(change == k) / 2.0 for k in range(1, 5)])
    told = int(np.argmin(np.append(counts >= ENOUGH, False)))
    if told < 2:
        return None
    counts, fall = counts[:told], float(np.log(counts[0] / counts[1]))
    # counts weigh as much as they are sure of
    A = np.stack([np.ones(told), np.arange(1.0, told + 1.0) ** 2], axis=1)
    inverse = np.linalg.inv((A * (2.0 * counts)[:, None]).T @ A)
    level, slope = (inverse @ (A * (2.0 * counts)[:, None]).T @ np.log(counts)).tolist()
    foretold = float(np.exp(level))
    more = float(np.count_nonzero(change == 0)) - foretold
    std = float(np.sqrt(foretold + foretold**2 * inverse[0, 0]))
    sure = told == 4 and fall <= WIDEST and more >= max(MORE * foretold, SURELY * std)
    scatter, usual = float(np.sqrt(0.5 / max(-slope, 1e-6))), 1.4826 * float(np.median(change))
    # where they scatter by many steps their numbers hardly go down within four, and tell of it by chance
    scatter = max(min(scatter, usual) if usual > MANY else scatter, FINEST)
    return _Excess(more / len(change), std / len(change) if fall < WIDE else np.inf, scatter, sure)


def _of_none(usual: Array, scatter: float) -> Array:
    """How likely changes (n,) are none, in steps."""
    return np.asarray(np.exp(-0.5 * (usual / scatter) ** 2) / (np.sqrt(2.0 * np.pi) * scatter))


def _share(stuck: int, telling: int, excess: _Excess) -> float:
    """Share of all samples that stick, from that of all which chance does not make, and from that in motion: some links
    lose more then, so it tells of the other to within half of it."""
    in_motion = stuck / max(telling, 1)
    std = np.hypot(np.sqrt(max(stuck, 1)) / max(telling, 1), 0.5 * in_motion)
    weights = np.array([std**-2, excess.std**-2])
    return float(np.clip(weights @ [in_motion, excess.share] / weights.sum(), 0.0, in_motion))


def _amid_none(sticks: int, slow: int, chance: float) -> bool:
    """Whether repeats in motion are more than chance makes, and not the least of small changes (`slow`: up to two
    steps), as there are where a move begins and ends."""
    return bool(poisson.sf(sticks - 1, chance) < RARER and binom.sf(sticks - 1, slow, 0.2) < AMID)
