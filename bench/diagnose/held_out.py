"""What a structure predicts of time blocks that its numbers were not fitted to."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .data import FOLDS, Prepared
from .numbers import Structure
from .refit import Fit, force_at, refit

Array = NDArray[np.float64]

SEEN = 0.65  # of the samples, the first ones, from which the last are predicted
BY_ITSELF = {"saturation": None, "adhesion": ("range",), "separation": ("impulse",)}
"""By id the numbers that one moment tells and no other: None: all."""


def held_out_square(prepared: Prepared, fit: Fit, steps: int = 12) -> float:
    """Mean squared error, N², of every sample as predicted by a fit that did not see its block."""
    total = count = 0.0
    short, full = prepared.short, prepared.full
    structure, x = _with_its_moment(fit)
    for fold in range(FOLDS):
        left = full.only(fold)
        if left.weight.sum() == 0 or short.without(fold).weight.sum() < 30:
            continue
        partial = refit(short.without(fold), structure, x, steps, 1e-6)
        e = full.force_N - force_at(full, structure, partial.x)
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
    structure, x = _with_its_moment(fit)
    partial = refit(replace(short, weight=np.where(seen, short.weight, 0.0)), structure, x, steps, 1e-6)
    e = full.force_N - force_at(full, structure, partial.x)
    weight = np.where(full.time_s > until, full.weight, 0.0)
    return float(np.sum(weight * e * e)) / max(float(weight.sum()), 1.0)


def _with_its_moment(fit: Fit) -> tuple[Structure, Array]:
    """Structure and x of a fit, with what one moment tells taken as known.

    Nothing tells of the limit of a channel but the greatest forces: a block that has them leaves none to the others,
    which would put it right above what they reach. Nothing tells where a bond snaps but the moment when it does: the
    others would leave it to hold for all of a rest at which it has gone.
    """
    causes, values = list(fit.structure.causes), fit.structure.values(fit.x)
    for k, cause in enumerate(causes):
        if cause.id in BY_ITSELF:
            names = BY_ITSELF[cause.id]
            known = tuple(replace(p, fixed=p.fixed or names is None or p.name in names) for p in cause.form.parameters)
            causes[k] = replace(cause, form=replace(cause.form, parameters=known), start=values[k])
    structure = replace(fit.structure, causes=tuple(causes))
    return structure, structure.x(fit.x[: len(structure.pad.coordinates)], values, fit.of_run)
