"""Whether something swings in the force at a frequency of its own: a hump in the spectrum of what a model leaves.

Noise of any usual colour has less and less power towards higher frequencies, or the same: its spectrum does not rise. A
floor that sways, a fan or a pump makes it rise to a peak.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LOWEST_HZ = 1.5
SPARED = 24  # ordinates of lowest frequency: there the numbers fitted, and slow drifts, have a say
FEWEST, BANDS_PER_OCTAVE = 12, 10  # ordinates of a band, and how narrow bands are where there are enough
RISE = 3.0  # times the least of the bands below it that a peak is high
LEAST_SHARE = 0.15  # of the power


@dataclass(frozen=True)
class Swing:
    """`frequency_Hz` of the peak, and the `share` of the power that stands above the noise around it."""

    frequency_Hz: float
    share: float


def find(time_s: Array, error_N: Array, sample_s: float) -> Swing | None:
    """The strongest swing in errors (n,) at stamps (n,); None where the spectrum does not rise anywhere."""
    if len(error_N) < 500:
        return None
    slot = np.rint((time_s - time_s[0]) / sample_s).astype(np.intp)
    grid = np.zeros(int(slot[-1]) + 1)
    grid[slot] = error_N - error_N.mean()
    power = np.abs(np.fft.rfft(grid)) ** 2
    frequency = np.fft.rfftfreq(len(grid), sample_s)
    first = max(SPARED, int(np.searchsorted(frequency, LOWEST_HZ)))
    edges = _edges(first, len(power) - 1)
    if len(edges) < 5:
        return None
    count = np.diff(edges)
    level = np.add.reduceat(power, edges[:-1])[: len(count)] / count if len(edges) else power
    level[-1] = power[edges[-2] : edges[-1]].mean()
    above = np.zeros(len(level))
    least, sure = level[0], count[0]
    for k in range(1, len(level)):
        # a mean of n ordinates scatters by 1/√n; of many bands the least lies lower still
        doubt = 1.0 + 5.0 / np.sqrt(count[k]) + 3.0 / np.sqrt(sure)
        if level[k] > max(RISE, doubt) * least:
            above[k] = (level[k] - least) * count[k]
        if level[k] < least:
            least, sure = level[k], count[k]
    share = float(above.sum() / max(power[first:].sum(), 1e-300))
    if share < LEAST_SHARE:
        return None
    k = int(np.argmax(np.where(above > 0, level, 0.0)))
    at = edges[k] + int(np.argmax(power[edges[k] : edges[k + 1]]))
    return Swing(float(frequency[at]), share)


def _edges(first: int, last: int) -> NDArray[np.intp]:
    """Ordinates at which bands begin: of equal ratio, and none of fewer than `FEWEST`."""
    out = [first]
    while out[-1] < last:
        out.append(max(out[-1] + FEWEST, int(round(out[-1] * 2.0 ** (1.0 / BANDS_PER_OCTAVE)))))
    out[-1] = last
    if len(out) > 2 and out[-1] - out[-2] < FEWEST:
        del out[-2]
    return np.array(out, dtype=np.intp)
