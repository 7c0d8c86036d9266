"""What a structure predicts of time blocks that its numbers were not fitted to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .data import FOLDS, Prepared
from .refit import Fit, force_at, refit

SEEN = 0.65  # of the samples, the first ones, from which the last are predicted


def held_out_square(prepared: Prepared, fit: Fit, steps: int = 12) -> float:
    """Mean squared error, N², of every sample as predicted by a fit that did not see its block."""
    total = count = 0.0
    short, full = prepared.short, prepared.full
    for fold in range(FOLDS):
        left = full.only(fold)
        if left.weight.sum() == 0 or short.without(fold).weight.sum() < 30:
            continue
        partial = refit(short.without(fold), fit.structure, fit.x, steps, 1e-6)
        e = full.force_N - force_at(full, fit.structure, partial.x)
        total += float(np.sum(left.weight * e * e))
        count += float(left.weight.sum())
    return total / max(count, 1.0)


def later_square(prepared: Prepared, fit: Fit, steps: int = 12) -> float:
    """Mean squared error, N², of the last samples as predicted by a fit that ended before them.

    Blocks amid the data are told by their neighbours; what comes after all that was seen is not.
    """
    short, full = prepared.short, prepared.full
    seen = np.cumsum(short.weight) <= SEEN * short.weight.sum()
    until = float(short.time_s[seen][-1]) if seen.any() else float(short.time_s[0])
    partial = refit(replace(short, weight=np.where(seen, short.weight, 0.0)), fit.structure, fit.x, steps, 1e-6)
    e = full.force_N - force_at(full, fit.structure, partial.x)
    weight = np.where(full.time_s > until, full.weight, 0.0)
    return float(np.sum(weight * e * e)) / max(float(weight.sum()), 1.0)
