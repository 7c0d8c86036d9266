"""Whether something swings in the force at a frequency of its own: a hump in the spectrum of what a model leaves.

Noise of any usual colour has less and less power towards higher frequencies, or the same: its spectrum does not rise. A
floor that sways, a fan or a pump makes it rise to a peak.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2 as chi2_law

Array = NDArray[np.float64]

FEWEST_SAMPLES = 500
LOWEST_HZ = 1.5
SPARED = 24  # ordinates of lowest frequency: there the numbers fitted, and slow drifts, have a say
FEWEST, BANDS_PER_OCTAVE = 12, 10  # ordinates of a band, and how narrow bands are where there are enough
GROUND = 3  # neighbouring bands whose mean is the noise around a peak, where it is least below the peak
RISE, CHANCE = 3.0, 1e-4  # times that, at the least, that a peak is high; and of a band so high, of a ground so low
LEAST_SHARE = 0.15  # of the power


@dataclass(frozen=True)
class Swing:
    """`frequency_Hz` of the peak; the `share` of the power that stands above the noise around it; and the mean square
    `beside_N2` of what does not: of all that is as quick as swings can be."""

    frequency_Hz: float
    share: float
    beside_N2: float


def find(time_s: Array, error_N: Array, sample_s: float) -> Swing | None:
    """The strongest swing in errors (n,) at stamps (n,); None where the spectrum does not rise anywhere."""
    if len(error_N) < FEWEST_SAMPLES:
        return None
    slot = np.rint((time_s - time_s[0]) / sample_s).astype(np.intp)
    # a stretch that was sampled more coarsely would show what is slow in it at the grid's high frequencies again
    apart = np.concatenate([[True], np.diff(slot) > 1, [True]])
    close = ~(apart[1:] & apart[:-1])
    if close.sum() < FEWEST_SAMPLES:
        return None
    slot, error_N = slot[close], error_N[close]
    grid = np.zeros(int(slot[-1]) + 1)
    grid[slot] = error_N - error_N.mean()
    power = np.abs(np.fft.rfft(grid)) ** 2
    frequency = np.fft.rfftfreq(len(grid), sample_s)
    filled = len(error_N) / len(grid)  # where holds are short and far apart, neighbouring ordinates say the same
    first = max(SPARED, int(np.searchsorted(frequency, LOWEST_HZ)))
    edges = _edges(first, len(power))
    if len(edges) < 5:
        return None
    count = np.diff(edges)
    level = np.add.reduceat(power, edges[:-1]) / count
    above = np.zeros(len(level))
    # the least of three neighbouring bands together: of many single ones some lie low by chance
    kernel = np.ones(GROUND)
    together = np.convolve(count, kernel, "valid")
    ground = np.convolve(level * count, kernel, "valid") / together
    for k in range(GROUND, len(level)):
        low = int(np.argmin(ground[: k - GROUND + 1]))
        own, others = 2 * filled * count[k], 2 * filled * together[low]
        chance = float(chi2_law.isf(CHANCE, own)) / own / (float(chi2_law.ppf(CHANCE, others)) / others)
        if level[k] > max(RISE, chance) * ground[low]:
            above[k] = (level[k] - ground[low]) * count[k]
    share = float(above.sum() / max(power[first:].sum(), 1e-300))
    if share < LEAST_SHARE:
        return None
    k = int(np.argmax(np.where(above > 0, level, 0.0)))
    at = edges[k] + int(np.argmax(power[edges[k] : edges[k + 1]]))
    beside = (1.0 - share) * 2.0 * float(power[first:].sum()) / len(grid) / len(error_N)
    return Swing(float(frequency[at]), share, beside * len(power) / (len(power) - first))


def _edges(first: int, last: int) -> NDArray[np.intp]:
    """Ordinates at which bands begin: of equal ratio, and none of fewer than `FEWEST`."""
    out = [first]
    while out[-1] < last:
        out.append(max(out[-1] + FEWEST, int(round(out[-1] * 2.0 ** (1.0 / BANDS_PER_OCTAVE)))))
    out[-1] = last
    if len(out) > 2 and out[-1] - out[-2] < FEWEST:
        del out[-2]
    return np.array(out, dtype=np.intp)
