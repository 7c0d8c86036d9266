"""Which path between the samples the forces were made on: straight lines, or the motion rebuilt from the samples.

A force from a real pad is that of the true motion, and rebuilding it removes a bias of many standard errors at a
hundred samples a second. A force that was computed from straight lines between the same stamps is told by its cost.
"""

from __future__ import annotations

from dataclasses import replace

from .estimate import polish
from .problem import Problem
from .select import Choice

STEPS = 12
CLEARLY = 1.0  # units of χ² that the rebuilt path must gain to be taken
OTHER = 25.0  # units of χ² by which another path would have made another choice


def straightened(plain: Problem, choice: Choice) -> Choice | bool:
    """Whether straight lines explain as much as the rebuilt path that the choice was made on.

    `plain`: the same data without nodes. False: they do not. A choice: the same one with its best taken there, as the
    two paths hardly differ. True: they explain so much more that the choice must be made again.
    """
    best = choice.best
    on_lines = polish(plain, best.estimate, max_steps=STEPS)
    unit = best.estimate.cost / max(choice.independent, 1.0)
    if on_lines.cost >= best.estimate.cost + CLEARLY * unit:
        return False
    if on_lines.cost < best.estimate.cost - OTHER * unit or not on_lines.converged:
        return True
    moved = replace(best, estimate=on_lines, V=on_lines.cost / plain.weight)
    return replace(choice, best=moved, candidates=[moved if c is best else c for c in choice.candidates])
