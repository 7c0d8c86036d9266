"""Noise of the force that is louder the more it is pressed, as where a motor that does not come to rest shakes the pad,
or a bridge's supply is noisy: σ² = σ_air² + (share · F)².

Told by how loud the holds are beside each other. Noise that is louder at times, and at the same force is not, is none
of this: something comes and goes.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from bench.amounts import amounts as nearest

Array = NDArray[np.float64]

FEWEST = 5  # holds that tell of it
APART = 3.0  # squares of second differences that say as much as one of noise whose tails may be heavy
PAYS = 30.0  # twice the log-likelihood that it must gain over noise that is the same at all forces …
MOST = 0.7  # … and the share of what holds of one loudness leave of that


def share_of_force(errors_N: Sequence[Array], forces_N: Sequence[float]) -> float:
    """Of what holds leave about smooth curves (each n_k, N) at forces (RMS, N): how much of the force is noise, beside
    what there is in air; as the variances of second differences tell, relative to that in air. 0: the same everywhere.

    The share is that of a noise of 1 N in air.
    """
    long = [k for k, e in enumerate(errors_N) if len(e) > 2]
    squares = np.array([float(np.mean(np.diff(errors_N[k], 2) ** 2)) for k in long])
    if len(long) < FEWEST or not squares.all():  # a channel that stands still in air is coarse, and no more
        return 0.0
    counts = np.array([len(errors_N[k]) - 2 for k in long]) / APART
    grown = np.array([forces_N[k] for k in long]) ** 2
    if not grown.any():
        return 0.0
    scale = float(grown.max())
    even = likeliest(np.ones((len(long), 1)), squares, counts)[1]
    (air, more), uneven = likeliest(np.stack([np.ones(len(long)), grown / scale], axis=1), squares, counts)
    if even - uneven < max(PAYS, MOST * even) or air <= 0.0:
        return 0.0
    return float(np.sqrt(more / air / scale))


def likeliest(columns: Array, found: Array, weight: Array) -> tuple[Array, float]:
    """(amounts ≥ 0 of columns (k, p) for mean squares `found` (k,) that scatter by √(2/weight), deviance)."""
    expected, amounts = found, np.zeros(columns.shape[1])
    for _ in range(6):
        scale = np.sqrt(weight) / expected
        amounts, _ = nearest(columns * scale[:, None], found * scale)
        expected = np.maximum(columns @ amounts, 1e-6 * found)
    return amounts, float(np.sum(weight * (np.log(expected / found) + found / expected - 1.0)))
