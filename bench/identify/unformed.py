"""When a choice among formulas gives way to a curve through points: only where all of them fail clearly."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np

from .condense import condensed
from .estimate import polish, search
from .nuisance import with_doubts
from .points import Points, points
from .problem import Problem
from .select import CLEAR, Choice, choose, finer, judged
from .starts import Starter

TINY = 1e-300
CLEARLY = 20.0  # of the criterion, and units of χ² that a trial must gain


def with_points(problem: Problem, choice: Choice, orders: Sequence[int], progress: Callable[[str], None]) -> Choice:
    """The choice with curves through points among the candidates, where a trial of one gains clearly on the formulas.

    One is chosen only if its criterion is lower by `CLEARLY`, and if it predicts left-out blocks better by more than
    chance would.
    """
    structure = choice.best.estimate.structure
    through = points(problem, structure.unilateral)
    if not _gains(problem, choice, through[1]):
        return choice
    near = [r for r in orders if abs(r - structure.order) <= 1]
    progress("curves through points")
    families = [with_doubts(family, problem) for family in through]
    other = choose(problem, families, near, (structure.unilateral,), progress)
    lower = other if other.best.V < choice.best.V else choice
    rivals = [judged(c, lower.independent) for c in other.candidates]
    formulas = [judged(c, lower.independent) for c in choice.candidates]
    rival = rivals[_place(other)]
    formula = formulas[_place(choice)]
    predicts = lower.independent * float(np.log(max(formula.held_out_square, TINY) / max(rival.held_out_square, TINY)))
    wins = rival.eligible and rival.criterion < formula.criterion - CLEARLY and predicts > CLEAR
    return Choice(rival if wins else formula, [*formulas, *rivals], lower.independent)


def _place(choice: Choice) -> int:
    return next(k for k, c in enumerate(choice.candidates) if c is choice.best)


def _gains(problem: Problem, choice: Choice, family: Points) -> bool:
    """Whether a curve through points gains on the best formula at all: on a shortened stand-in, then on a finer one."""
    best = choice.best.estimate
    short, _ = condensed(problem)
    structure = replace(best.structure, family=with_doubts(family, problem))
    starts = Starter(short, structure.family, structure.unilateral, best.bounds).first(structure.order, 2)
    trial, formula = search(short, structure, starts, best.bounds), best
    for on in (short, finer(problem)):
        formula, trial = (polish(on, e, max_steps=8, tolerance=1e-6) for e in (formula, trial))
        # The scatter within a stand-in's blocks is noise too: a gain is judged by the cost of all the samples.
        if choice.independent * (formula.cost - trial.cost) <= CLEARLY * max(best.cost, TINY):
            return False
    return True
