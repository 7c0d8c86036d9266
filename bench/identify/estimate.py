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
ASIDE = (0.9, 1.1)  # times a rate
LOWER = 1e-5  # of the cost, by which another minimum is one
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
    limits = bounds.of(structure)
    rough = [_solve(problem, structure, x, limits, max_steps=12, tolerance=1e-4) for x in starts]
    rough.sort(key=lambda s: s.cost)
    near = [s for s in _different(rough)[:2] if s.cost <= 1.3 * rough[0].cost]
    ended = [_solve(problem, structure, s.x, limits, max_steps=60, tolerance=1e-8) for s in near]
    return _ordered(structure, min(ended, key=lambda s: s.cost), bounds)


def polish(problem: Problem, estimate: Estimate, max_steps: int = 60, tolerance: float = 1e-12) -> Estimate:
    """The same structure from where another fit ended, to convergence."""
    limits = estimate.bounds.of(estimate.structure)
    solution = _solve(problem, estimate.structure, estimate.x, limits, max_steps, tolerance)
    return _ordered(estimate.structure, solution, estimate.bounds)


def over_the_edge(problem: Problem, estimate: Estimate) -> Estimate:
    """The same structure, at another minimum if there is a lower one beside this one on the far side of an event.

    Whether a pad that let go comes back before the next move decides which samples have a force at all. So the cost
    has a ridge where such a return appears or goes, with a minimum on either side, and a search does not cross it. The
    return hangs on the slow modes: each of the two slowest rates is held a little off, all else follows, and from there
    the search is free again.
    """
    structure = estimate.structure
    if not structure.unilateral or not _lets_go_inside(problem, estimate):
        return estimate
    k, r = structure.shape_size, structure.order
    best = estimate
    for at in range(max(k + r - 2, k), k + r):
        for factor in ASIDE:
            lower, upper = estimate.bounds.of(structure)
            x = estimate.x.copy()
            x[at] = lower[at] = upper[at] = float(np.clip(x[at] + np.log(factor), lower[at], upper[at]))
            held = _solve(problem, structure, x, (lower, upper), max_steps=8, tolerance=1e-4)
            freed = _solve(problem, structure, held.x, estimate.bounds.of(structure), max_steps=12, tolerance=1e-5)
            if freed.cost < (1 - LOWER) * best.cost:
                best = _ordered(structure, freed, estimate.bounds)
    return best


def _lets_go_inside(problem: Problem, estimate: Estimate) -> bool:
    """Whether there is no contact in the simulation at some sample at which the probe is below the surface."""
    simulated = objective.forces(problem, estimate.structure, estimate.x)
    return any(bool(np.any(gone & (run.u > 0))) for run, (_, gone, _) in zip(problem.runs, simulated, strict=True))


def _solve(
    problem: Problem, structure: Structure, x: Array, limits: tuple[Array, Array], max_steps: int, tolerance: float
) -> Solution:
    lower, upper = limits
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
