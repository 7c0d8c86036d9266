"""What a structure predicts of time blocks that its numbers were not fitted to."""

from __future__ import annotations

import numpy as np

from .data import FOLDS, Prepared
from .refit import Fit, force_at, refit


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
