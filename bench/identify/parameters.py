"""From the estimator's scaled variables to the paper's names, with their standard errors."""

from __future__ import annotations

from typing import Any

import numpy as np

from ._kernel import Array
from .estimate import NOTHING, Estimate
from .problem import Problem
from .result import Parameter
from .uncertainty import Spread

DOUBTFUL = 0.6  # a standard error beyond this share of the value: the data do not tell it


def named(problem: Problem, estimate: Estimate, x: Array) -> list[tuple[str, float, str]]:
    """The law's numbers, c_1 … c_r, ν_1 … ν_r (1/s), with units."""
    theta, rates, weights = estimate.structure.split(x)
    gain = float(weights.sum()) or 1.0  # no stiffness at all: every share is 0
    family = estimate.structure.family
    out = family.physical_numbers(theta, float(weights.sum()) * problem.force_N, problem.depth_mm)
    out += [(f"c_{i}", float(a / gain), "1") for i, a in enumerate(weights[1:], 1)]
    out += [(f"nu_{i}", float(nu), "1/s") for i, nu in enumerate(rates, 1)]
    return [(name, float(value), unit) for name, value, unit in out]


def parameters(problem: Problem, estimate: Estimate, spread: Spread) -> tuple[dict[str, Parameter], Array, list[str]]:
    """The named numbers with standard errors, their covariance (n, n), and the names of those the data cannot tell."""
    x = estimate.x
    entries = named(problem, estimate, x)
    gradient = np.empty((len(entries), len(x)))
    for j in range(len(x)):
        h = 1e-6 * max(abs(x[j]), 1e-2)
        step = np.zeros(len(x))
        step[j] = h
        up, down = named(problem, estimate, x + step), named(problem, estimate, x - step)
        gradient[:, j] = [(a[1] - b[1]) / (2 * h) for a, b in zip(up, down, strict=True)]
    covariance = gradient @ spread.covariance @ gradient.T
    variance = np.diag(covariance)  # below 0: rounding, where nothing is told
    std = np.sqrt(np.where(variance < 0, np.nan, variance))
    lost = _lost(estimate)
    result, undetermined = {}, []
    for (name, value, unit), error in zip(entries, std, strict=True):
        # b or q near 0 is a line: told when it is told to be one within the depth measured.
        floor = {"b": 0.2 / problem.depth_mm, "q": 0.2}.get(name, 0.0)
        known = name not in lost and np.isfinite(error)
        result[name] = Parameter(value, unit, float(error) if known else float("nan"))
        if not known or error > DOUBTFUL * max(abs(value), floor):
            undetermined.append(name)
    return result, covariance, undetermined


def _lost(estimate: Estimate) -> set[str]:
    """Numbers that ended at a bound: the data pull them out of what they can tell."""
    structure, x = estimate.structure, estimate.x
    lower, upper = estimate.bounds.of(structure)
    k, r = structure.shape_size, structure.order
    out: set[str] = set()
    if x[k + r :].sum() <= NOTHING:
        return {name for name, _, _ in structure.family.physical_numbers(x[: structure.family.size], 1.0, 1.0)} | {
            f"{letter}_{i}" for letter in ("c", "nu") for i in range(1, r + 1)
        }
    for i in range(1, r + 1):
        # At the edge of what the data see a share and its rate stand for each other.
        if x[k + r + i] <= 0 or not lower[k + i - 1] < x[k + i - 1] < upper[k + i - 1]:
            out |= {f"c_{i}", f"nu_{i}"}
    k = structure.family.size
    if k and not np.all((lower[:k] < x[:k]) & (x[:k] < upper[:k])):
        out |= {"exponential": {"m", "b"}, "power": {"p", "q"}}.get(structure.family.name, set())
    return out


def model_dict(problem: Problem, estimate: Estimate, found: dict[str, Parameter]) -> dict[str, Any]:
    """The content of a model file."""
    structure = estimate.structure
    theta, rates, weights = structure.split(estimate.x)
    gain = float(weights.sum()) or 1.0
    law = structure.family.physical_numbers(theta, float(weights.sum()) * problem.force_N, problem.depth_mm)
    pad: dict[str, Any] = {
        "elastic": structure.family.entry([(n, float(v), u) for n, v, u in law]),
        "relaxation": {"shares": [float(a / gain) for a in weights[1:]], "rates": _descending(rates)},
        "contact": "unilateral" if structure.unilateral else "bonded",
        "std": {name: p.std for name, p in found.items() if np.isfinite(p.std)},
    }
    return {"pad": pad}


def _descending(rates: Array) -> list[float]:
    """As a model file wants them: two that ended on one value (a mode too many) are set apart by a part in 10⁹."""
    out: list[float] = []
    for nu in rates:
        out.append(float(nu) if not out or nu < out[-1] else out[-1] * (1 - 1e-9))
    return out
