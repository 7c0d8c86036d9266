"""What happens within one step of the sampling: a surface is met, a dashpot sets in, a film tears.

When it does is a matter of micrometres of where the pad's surface is, and no model is as exact as that. The one sample
at which the force leaps is anything between those beside it, and a few such samples may weigh more than all others.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

FAR, NEAR = 5.0, 3.0  # deviations: of the one sample at the least, and of those beside it at the most
ALIKE, RARE = 0.5, 0.1  # of a leap, that is as large; and share of those as large that a model misses by chance


def leaps(modelled_N: Array, force_N: Array, sigma_N: Array) -> Array:
    """Doubt about a model's force, N, standard deviations (n,) of samples one after the other: that of a place anywhere
    in its leap, where one sample is off, those beside it are not, and it lies between them as modelled. 0 elsewhere,
    and where a good part of all leaps as large are off: that is no chance, but something late."""
    out = np.zeros(len(modelled_N))
    if len(modelled_N) < 3:
        return out
    beside = np.stack([modelled_N[:-2], modelled_N[1:-1], modelled_N[2:]])
    lowest, highest = beside.min(axis=0), beside.max(axis=0)
    reach, sigma, force = highest - lowest, sigma_N[1:-1], force_N[1:-1]
    off = np.abs(force_N - modelled_N) / sigma_N
    alone = (off[1:-1] > FAR) & (off[:-2] < NEAR) & (off[2:] < NEAR)
    between = (force > lowest - NEAR * sigma) & (force < highest + NEAR * sigma)
    missed = np.flatnonzero(alone & between)
    every, of_these = np.sort(reach), np.sort(reach[missed])
    as_large = len(every) - np.searchsorted(every, ALIKE * reach[missed])
    as_large_missed = len(of_these) - np.searchsorted(of_these, ALIKE * reach[missed])
    rare = missed[as_large_missed <= RARE * as_large]
    out[1 + rare] = reach[rare] / np.sqrt(12.0)
    return out
