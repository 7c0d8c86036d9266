"""Whether the data tell a mode's share and rate, judged not at the estimate alone.

A standard error speaks of the neighbourhood of the estimate. Where two modes can stand in for each other, or one is
hardly needed, the valley of the cost bends, and a small standard error at one place says nothing. So numbers that are
told weakly are moved far off, and everything else may follow. Where that costs next to nothing the pad may as well be
there, and the standard errors of that place count too.
"""

from __future__ import annotations

import math

import numpy as np

from . import objective
from ._kernel import Array
from .condense import condensed
from .estimate import Estimate, polish
from .problem import Problem
from .solver import Solution, minimise

CERTAIN = 0.2  # relative standard error below which a number is moved nowhere
DOUBTFUL = 1.0  # relative standard error at another place that says a number is not told
AS_GOOD = 2.0  # units of χ² that another place may cost
SHARES = (0.5, 1.5, 2.5)  # where a share is tried, of its value
RATES = (0.4, 2.5)
SAMPLES = 1000  # that are enough to see it


def not_told(problem: Problem, estimate: Estimate, relative_std: dict[str, float], independent: float) -> set[str]:
    """Names of c_i and nu_i whose standard error is beyond their value at a place that explains the data as well.

    `relative_std`: of c_i, nu_i by name, nan where there is none; `independent`: how many samples the residual is
    worth. χ² counts those.
    """
    found = doubts(problem, estimate, relative_std, independent, DOUBTFUL)
    return {name for name, doubt in found.items() if doubt > DOUBTFUL}


def doubts(
    problem: Problem, estimate: Estimate, relative_std: dict[str, float], independent: float, enough: float = math.inf
) -> dict[str, float]:
    """Of c_i and nu_i, the largest relative standard error at any place that explains the data as well; none of a fit
    without weak numbers. The search ends where all are above `enough`."""
    weak = [name for name, value in relative_std.items() if not value < CERTAIN]
    out: dict[str, float] = {}
    if not weak:
        return out
    short, _ = condensed(problem, SAMPLES)
    best = polish(short, estimate, tolerance=1e-8)
    unit = estimate.cost / max(independent, 1.0)  # of the cost, for one unit of χ²
    for name in weak:
        i = int(name.partition("_")[2])
        for factor in RATES if name.startswith("nu") else SHARES:
            if sum(doubt > enough for doubt in out.values()) == len(relative_std):
                return out
            for found in _moved(short, best, name, i, factor, unit):
                for other, error in _relative(best, found, unit).items():
                    out[other] = max(out.get(other, 0.0), error)
    return out


def _relative(best: Estimate, found: Solution, unit: float) -> dict[str, float]:
    """Relative standard errors of shares and rates at another place, the modes named by their rates there."""
    k, r = best.structure.shape_size, best.structure.order
    diagonal = np.diag(found.matrix)
    scale = np.sqrt(np.maximum(diagonal, 1e-12 * diagonal.max()))
    values, vectors = np.linalg.eigh(found.matrix / np.outer(scale, scale))
    inverse = (vectors / np.maximum(values, 1e-9)) @ vectors.T / np.outer(scale, scale) * unit
    weights = found.x[k + r :]
    gain = max(float(weights.sum()), 1e-300)
    out = {}
    for rank, i in enumerate(np.argsort(-found.x[k : k + r], kind="stable"), 1):
        share = max(float(weights[i + 1]) / gain, 1e-6)
        gradient = np.full(r + 1, -share / gain)
        gradient[i + 1] += 1 / gain
        out[f"c_{rank}"] = math.sqrt(max(gradient @ inverse[k + r :, k + r :] @ gradient, 0.0)) / share
        out[f"nu_{rank}"] = math.sqrt(max(float(inverse[k + i, k + i]), 0.0))
    return out


def _moved(problem: Problem, best: Estimate, name: str, i: int, factor: float, unit: float) -> list[Solution]:
    """Places with the number at `factor` times its value that cost next to nothing; their matrix is the cost's own."""
    structure, x = best.structure, best.x
    k, r = structure.shape_size, structure.order
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

    tolerance = 0.02 * unit / max(best.cost, 1e-300)
    found = []
    for start in starts:
        s = minimise(normal, cost, start, lower, upper, 15, tolerance)
        if s.cost < best.cost + AS_GOOD * unit:
            found.append(Solution(s.x, s.cost, s.matrix - np.outer(row, row), s.steps, s.converged))
    return found


def _split(best: Estimate, i: int, factor: float) -> list[Array]:
    """The mode's neighbour takes half of it and stands as far on the other side: what two near modes do."""
    k, r = best.structure.shape_size, best.structure.order
    out = []
    for j in range(1, r + 1):
        if j == i:
            continue
        start = best.x.copy()
        middle, share = start[k + i - 1], start[k + r + i]
        side = abs(np.log(min(max(factor, 0.4), 2.5))) * (1 if i < j else -1)
        start[k + i - 1], start[k + j - 1] = middle + side, middle - side
        start[k + r + i], start[k + r + j] = share / 2, share / 2 + start[k + r + j]
        out.append(start)
    return out
