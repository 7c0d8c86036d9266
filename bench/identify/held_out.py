"""Prediction of time blocks that were left out of the fit."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from . import objective
from .estimate import Estimate, polish
from .problem import Problem

BLOCKS, FOLDS = 20, 5
JITTER = 2e-3  # of the greatest depth: a shorter way from sample to sample is no travel


def folds_of(problem: Problem) -> list[NDArray[np.intp]]:
    """Of each run, the fold of every sample: contiguous blocks dealt out in turn.

    A block is a twentieth of the data, half by samples and half by travel: else one block would hold a whole fast
    ramp, and with it all that is known of the elastic response. Travel is that from one sample that counts to the
    next, however many nodes without force lie between them.
    """
    steps = []
    for run in problem.runs:
        travel, counted = np.zeros(run.size), np.flatnonzero(run.weight > 0)
        way_of_each = np.abs(np.diff(run.u[counted], prepend=run.u[counted[:1]]))
        travel[counted] = np.where(way_of_each < JITTER, 0.0, way_of_each)
        steps.append((run.weight, travel))
    weight = sum(float(w.sum()) for w, _ in steps)
    way = sum(float(t.sum()) for _, t in steps) or 1.0
    progress, out = 0.0, []
    for w, t in steps:
        along = progress + np.cumsum(w / weight / 2 + t / way / 2)
        progress = float(along[-1])
        out.append(np.minimum((along * BLOCKS).astype(np.intp), BLOCKS - 1) % FOLDS)
    return out


def held_out_square(
    short: Problem, full: Problem, owners: list[NDArray[np.intp]], estimate: Estimate, max_steps: int = 25
) -> float:
    """Mean squared error, in scaled force, of every sample as predicted by a fit that did not see its block.

    Refits are made on `short`, errors taken on `full`; `owners`: of each run, the short sample of every full one.
    """
    folds = folds_of(short)
    total = 0.0
    for k in range(FOLDS):
        kept = [np.where(f == k, 0.0, run.weight) for f, run in zip(folds, short.runs, strict=True)]
        left = [np.where(f[o] == k, run.weight, 0.0) for f, o, run in zip(folds, owners, full.runs, strict=True)]
        if sum(float(w.sum()) for w in left) == 0 or sum(float(w.sum()) for w in kept) == 0:
            continue
        refit = polish(short.weighted(kept), estimate, max_steps, tolerance=1e-6)
        total += objective.cost(full.weighted(left), estimate.structure, refit.x)
    return total / full.weight
