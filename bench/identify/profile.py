"""Whether the data tell a mode's share and rate: the cost with the number held elsewhere, the rest refitted.

A standard error speaks of the neighbourhood of the estimate. Where two modes can stand in for each other the valley
of the cost bends, and a small standard error at one place says nothing: so the number is moved by half its value,
and everything else may follow.
"""

from __future__ import annotations

import numpy as np

from . import objective
from ._kernel import Array
from .condense import condensed
from .estimate import Estimate, polish
from .problem import Problem
from .solver import minimise

CERTAIN = 0.08  # relative standard error below which, for every mode, nothing bends
FURTHER = (0.5, 1.5)  # of the value
LOST = 0.5  # relative standard error that says so by itself


def not_told(problem: Problem, estimate: Estimate, relative_std: dict[str, float], independent: float) -> set[str]:
    """Names of c_i and nu_i that can be half as large again, or half as large, for less than one unit of χ².

    `relative_std`: of c_i, nu_i by name; `independent`: how many samples the residual is worth. χ² counts those.
    """
    if all(value < CERTAIN for value in relative_std.values()):
        return set()
    short, _ = condensed(problem)
    best = polish(short, estimate, tolerance=1e-9)
    unit = estimate.cost / max(independent, 1.0)  # of the cost, for one unit of χ²
    out = set()
    for i in range(1, estimate.structure.order + 1):
        for name in (f"c_{i}", f"nu_{i}"):
            if relative_std.get(name, np.inf) > LOST:
                continue  # known to be lost already
            if any(_cost_at(short, best, name, i, factor) - best.cost < unit for factor in FURTHER):
                out.add(name)
    return out


def _cost_at(problem: Problem, best: Estimate, name: str, i: int, factor: float) -> float:
    """The least cost with the number held at `factor` times its value."""
    structure, x = best.structure, best.x
    k, r = structure.family.size, structure.order
    lower, upper = best.bounds.of(structure)
    row = np.zeros(len(x))
    starts = [x.copy(), *_split(best, i, factor)]
    if name.startswith("nu"):
        at = k + i - 1
        lower[at] = upper[at] = float(np.clip(x[at] + np.log(factor), lower[at], upper[at]))
    else:  # a_i = κ Σ a, kept by a stiff spring
        weights = x[k + r :]
        kappa = min(factor * weights[i] / weights.sum(), 0.98)
        row[k + r :] = -kappa
        row[k + r + i] += 1.0
        row *= np.sqrt(1e6 * best.cost)
        for start in starts:
            others = start[k + r :].sum() - start[k + r + i]
            start[k + r + i] = kappa / (1 - kappa) * others

    def normal(v: Array) -> tuple[float, Array, Array]:
        cost, gradient, matrix = objective.normal_equations(problem, structure, v)
        pull = float(row @ v)
        return cost + pull**2, gradient - pull * row, matrix + np.outer(row, row)

    def cost(v: Array) -> float:
        return objective.cost(problem, structure, v) + float(row @ v) ** 2

    tolerance = 1e-4 / max(problem.weight, 1.0)
    return min(minimise(normal, cost, start, lower, upper, 40, tolerance).cost for start in starts)


def _split(best: Estimate, i: int, factor: float) -> list[Array]:
    """The mode's neighbour takes half of it and stands as far on the other side: what two near modes do."""
    k, r = best.structure.family.size, best.structure.order
    out = []
    for j in range(1, r + 1):
        if j == i:
            continue
        start = best.x.copy()
        middle, share = start[k + i - 1], start[k + r + i]
        for side in (np.log(factor), -np.log(factor)):
            other = start.copy()
            other[k + i - 1], other[k + j - 1] = middle + side, middle - side
            other[k + r + i], other[k + r + j] = share / 2, share / 2 + start[k + r + j]
            out.append(other)
    return out
