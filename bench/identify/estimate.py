"""The fit of one structure: from several starts on short data, then to the end on all of them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import objective
from ._kernel import Array
from .objective import Structure
from .problem import Problem
from .solver import Solution, minimise
from .starts import Bounds

MERGED = 1.25  # rates nearer than this are one mode
NOTHING = 1e-6  # of the largest force: a gain below it is no stiffness at all


@dataclass(frozen=True)
class Estimate:
    """x (P,) with rates descending, Σ w e² there (scaled), Gauss-Newton matrix (P, P), whether the search ended."""

    structure: Structure
    x: Array
    cost: float
    matrix: Array
    converged: bool
    bounds: Bounds

    @property
    def distinct(self) -> bool:
        """Whether every mode is there: no share at zero, no two rates the same, none at the edge of what the data see
        (a mode faster than the samples stands for something else: a late force, a viscous part)."""
        _, rates, _ = self.structure.split(self.x)
        return self.distinct_but_slow and bool(np.all(rates > 1.001 * self.bounds.slowest))

    @property
    def distinct_but_slow(self) -> bool:
        """Whether every mode is there, but for one so slow that the data show only that the force goes on falling."""
        _, rates, weights = self.structure.split(self.x)
        apart = bool(np.all(rates[:-1] >= MERGED * rates[1:]))
        seen = bool(np.all(rates < 0.999 * self.bounds.fastest))
        return apart and seen and bool(np.all(weights[1:] > 1e-6 * weights.sum()))

    @property
    def physical(self) -> bool:
        """Shares ≥ 0 and rates > 0 by construction; a positive gain and an elastic response that never falls."""
        theta, _, weights = self.structure.split(self.x)
        return bool(weights.sum() > NOTHING) and self.structure.family.rising(theta)


def search(problem: Problem, structure: Structure, starts: list[Array], bounds: Bounds) -> Estimate:
    """The best minimum reached from the starts: each a few steps, the best two to the end."""
    rough = [_solve(problem, structure, x, bounds, max_steps=12, tolerance=1e-4) for x in starts]
    rough.sort(key=lambda s: s.cost)
    near = [s for s in _different(rough)[:2] if s.cost <= 1.3 * rough[0].cost]
    ended = [_solve(problem, structure, s.x, bounds, max_steps=60, tolerance=1e-8) for s in near]
    return _ordered(structure, min(ended, key=lambda s: s.cost), bounds)


def polish(problem: Problem, estimate: Estimate, max_steps: int = 60, tolerance: float = 1e-12) -> Estimate:
    """The same structure from where another fit ended, to convergence."""
    solution = _solve(problem, estimate.structure, estimate.x, estimate.bounds, max_steps, tolerance)
    return _ordered(estimate.structure, solution, estimate.bounds)


def _solve(
    problem: Problem, structure: Structure, x: Array, bounds: Bounds, max_steps: int, tolerance: float
) -> Solution:
    lower, upper = bounds.of(structure)
    return minimise(
        lambda v: objective.normal_equations(problem, structure, v),
        lambda v: objective.cost(problem, structure, v),
        x, lower, upper, max_steps, tolerance,
    )  # fmt: skip


def _different(solutions: list[Solution]) -> list[Solution]:
    kept: list[Solution] = []
    for s in solutions:
        if all(abs(s.cost - other.cost) > 1e-3 * other.cost for other in kept):
            kept.append(s)
    return kept


def _ordered(structure: Structure, s: Solution, bounds: Bounds) -> Estimate:
    k, r = structure.shape_size, structure.order
    by_rate = np.argsort(-s.x[k : k + r], kind="stable")
    pasts = [structure.past(j).start + by_rate for j in range(structure.pasts)]
    order = np.concatenate(
        [np.arange(structure.family.size), *pasts, k + by_rate, [k + r], k + r + 1 + by_rate]
    ).astype(np.intp)
    return Estimate(structure, s.x[order], s.cost, s.matrix[np.ix_(order, order)], s.converged, bounds)
