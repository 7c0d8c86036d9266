"""Which path between the samples the forces were made on: straight lines, or the motion rebuilt from the samples.

A force from a real pad is that of the true motion, and rebuilding it removes a bias of many standard errors at a
hundred samples a second. A force that was computed from straight lines between the same stamps is told by its cost.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from . import objective
from .estimate import Estimate, polish
from .problem import Problem
from .select import Choice

STEPS = 12
HOPED = 3.0  # times what a full step promises, that a search could gain at the very most
OTHER = 25.0  # units of χ² by which another path would have made another choice


def straightened(plain: Problem, choice: Choice) -> Choice | bool:
    """Whether straight lines explain more than the rebuilt path that the choice was made on.

    `plain`: the same data without nodes. False: they do not. A choice: the same one with its best taken there, as the
    two paths hardly differ. True: they explain so much more that the choice must be made again. The lower cost decides,
    by however little: so V is no higher than that of the true numbers on whichever path is the true one.
    """
    best = choice.best
    if not _may_gain(plain, best.estimate):
        return False
    on_lines = polish(plain, best.estimate, max_steps=STEPS)
    if on_lines.cost >= best.estimate.cost:
        return False
    unit = best.estimate.cost / max(choice.independent, 1.0)
    if on_lines.cost < best.estimate.cost - OTHER * unit or not on_lines.converged:
        return True
    moved = replace(best, estimate=on_lines, V=on_lines.cost / plain.weight)
    return replace(choice, best=moved, candidates=[moved if c is best else c for c in choice.candidates])


def _may_gain(plain: Problem, estimate: Estimate) -> bool:
    """Whether a search on straight lines could end below the cost on the rebuilt path: one pass tells mostly not."""
    cost, gradient, matrix = objective.normal_equations(plain, estimate.structure, estimate.x)
    scale = np.sqrt(np.maximum(np.diag(matrix), 1e-300))
    step = np.linalg.lstsq(matrix / np.outer(scale, scale), gradient / scale, rcond=1e-10)[0]
    return bool(cost - HOPED * float(step @ (gradient / scale)) < estimate.cost)
