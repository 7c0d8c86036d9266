"""How noisy a channel of positions is, and what it is rounded to; found in the data alone."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from bench.amounts import amounts
from bench.identify.motion import holds, jitter
from bench.readings import resolution

Array = NDArray[np.float64]

LAGS = np.array([1, 2, 3, 4, 6, 8, 12, 16, 24, 32])  # samples, over which a noise with memory is seen to grow
EDGE = 4  # samples at the ends of a hold that may still move
LONG_ENOUGH = 3 * int(LAGS[-1])  # samples of a hold that tell of a memory
AS_LOUD = 2.0  # times the growth of a usual hold: more is motion
GROWS, SURE = 1.1, 5.0  # growth from a lag of one sample to longer ones that is a memory; standard deviations
AS_IT_FADES = 0.2  # of how the growths differ, that a memory which fades leaves at the most: more is motion
KEPT = np.array([0.3, 0.4, 0.5, 0.55, 0.6, 0.65, 0.7, 0.75, 0.8, 0.85, 0.9, 0.95])  # of a value, one sample on
AVERAGED = np.array([2, 3, 4, 5, 6, 8, 10, 12, 16])  # samples that a moving mean is of


@dataclass(frozen=True)
class PositionNoise:
    """Standard deviations of reported positions, rounding included, mm: of each sample, and of noise without memory
    whose means over many samples scatter as much."""

    each_mm: float
    of_means_mm: float

    @property
    def memory(self) -> float:
        """Samples that say the same as one."""
        return (self.of_means_mm / self.each_mm) ** 2 if self.each_mm > 0.0 else 1.0


def position_noise(position_mm: Array) -> PositionNoise:
    """How noisy positions (n,) are, as short lines tell, rounding and holds.

    A filtered encoder's or a servo's errors last for some samples: neighbours agree, and `jitter`, which goes by short
    lines, sees half of them. Over the holds half the mean square of differences grows with the lag k as σ_w² +
    σ_c² (1 − ρ^k) (a variogram: N. Cressie, Statistics for Spatial Data, Wiley 1993, ch. 2); means over many samples
    scatter as those of noise without memory of σ² = σ_w² + σ_c² (1 + ρ)/(1 − ρ) do.
    """
    short = jitter(position_mm)
    step = resolution(position_mm)
    if 0.0 < step <= 0.01 * np.ptp(position_mm):
        short = max(short, _hopping(position_mm, step), step / np.sqrt(12.0))
    seen = _memory(position_mm, short)
    if seen is None:
        return PositionNoise(float(short), float(short))
    # holds were cut where louder noise than was known of ran out of them
    white, coloured, alike = _memory(position_mm, float(np.sqrt(seen[0] + seen[1]))) or seen
    return PositionNoise(float(np.sqrt(white + coloured)), float(np.sqrt(white + alike * coloured)))


def _memory(position_mm: Array, noise_mm: float) -> tuple[float, float, float] | None:
    """(σ_w², mm²; σ_c², mm²; samples of the latter that say the same) of holds with some noise; None: no memory."""
    grown, count = _growth(position_mm, noise_mm)
    if count == 0 or grown[0] == 0.0 or not np.isfinite(grown).all():  # numbers of no bench are refused later
        return None
    longer = float(np.mean(grown[len(LAGS) // 2 :]))
    if longer < (GROWS + SURE * np.sqrt(len(LAGS) / (4.0 * count))) * grown[0]:
        return None
    fading = [(1.0 - kept**LAGS, (1.0 + kept) / (1.0 - kept)) for kept in KEPT]
    averages = [(np.minimum(LAGS / many, 1.0), float(many)) for many in AVERAGED]
    fits = [
        (alike, *amounts(np.stack([np.ones(len(LAGS)), growth], axis=1), grown)) for growth, alike in fading + averages
    ]
    alike, (white, coloured), left = min(fits, key=lambda fit: float(fit[2]))
    by_chance = float(np.sqrt(alike / count))  # few samples scatter about any curve
    if left > (AS_IT_FADES + by_chance) * float(np.linalg.norm(grown - grown.mean())):
        return None
    return float(white), float(coloured), float(alike)


def _growth(position_mm: Array, noise_mm: float) -> tuple[Array, int]:
    """Half the mean squares of differences over `LAGS` within holds with some noise (lags,), mm², and of how many
    samples they are."""
    squares, counts = [], []
    for hold in holds(np.arange(len(position_mm), dtype=np.float64), position_mm, noise_mm):
        x = position_mm[hold.start + EDGE : hold.stop - EDGE]
        if len(x) >= LONG_ENOUGH:
            with np.errstate(over="ignore"):
                squares.append([0.5 * np.mean((x[lag:] - x[:-lag]) ** 2) for lag in LAGS.tolist()])
            counts.append(len(x))
    if not counts:
        return np.zeros(len(LAGS)), 0
    all_squares, all_counts = np.array(squares), np.array(counts)
    by_size = np.argsort(all_squares[:, -1])
    half = np.searchsorted(np.cumsum(all_counts[by_size]), 0.5 * all_counts.sum())
    usual = all_squares[:, -1] <= AS_LOUD * all_squares[by_size[half], -1]
    return all_counts[usual] @ all_squares[usual] / all_counts[usual].sum(), int(all_counts[usual].sum())


def _hopping(position_mm: Array, step_mm: float) -> float:
    """Scatter about short lines, mm, where the motion passes no more than a step of the scale: where readings stay the
    same for a while the quietest stretches, which `jitter` goes by, have none."""
    n = len(position_mm) // 6
    if n < 4:
        return 0.0
    windows = position_mm[: 6 * n].reshape(n, 6)
    t = np.arange(6) - 2.5
    slope = windows @ t / (t @ t)
    slow = np.abs(slope) * 5.0 <= step_mm
    if np.count_nonzero(slow) < 4:
        return 0.0
    off = windows[slow] - windows[slow].mean(axis=1, keepdims=True) - slope[slow][:, None] * t
    return float(np.sqrt(np.sum(off**2) / (4.0 * np.count_nonzero(slow))))
