"""Searches over the simulated output error (16): the elastic response alone, or everything at once."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np

from .._kernel import Array
from ..solver import Solution, minimise
from . import system
from .series import Data
from .system import Structure, simulate


@dataclass(frozen=True)
class Attempt:
    """Where one start led: V (scaled), v, steps taken, whether it had converged; `history`: (V, v) a step."""

    V: float
    v: Array
    iterations: int
    converged: bool
    history: list[tuple[float, Array]] = field(default_factory=list)


def gamma_step(data: Data, structure: Structure, v: Array, tolerance: float = 1e-12) -> Array | None:
    """(16) minimised over γ with A and B as they are in v; None where that filter runs away."""
    g = structure.nonlinear
    lower, upper = structure.bounds()

    def at(gamma: Array) -> Array:
        return np.concatenate([gamma, v[g:]])

    if not np.isfinite(system.cost(data, structure, v)):
        return None
    solution = minimise(
        lambda x: system.normal_equations(data, structure, at(x), "gamma"),
        lambda x: system.cost(data, structure, at(x)),
        v[:g], lower[:g], upper[:g], 60, tolerance,
    )  # fmt: skip
    return at(solution.x)


def first_gamma(data: Data, structure: Structure, a: Array, b: Array) -> Array | None:
    """v with the best γ for a given filter, from the law's own starting points; None where the filter runs away."""
    best, least = None, np.inf
    for theta in structure.family.starts:
        v = structure.vector(1.0, theta, a, b)
        product, square = 0.0, 0.0
        for run in data.runs:
            out = simulate(run, structure, v)
            if not out.ok:
                return None
            product += float(np.dot(run.weight * out.force, run.y))
            square += float(np.dot(run.weight * out.force, out.force))
        if square <= 0 or not np.isfinite(square):
            continue
        v[0] = max(product / square, 1e-6)
        found = system.cost(data, structure, v)
        if found < least:
            best, least = v, found
    return None if best is None else gamma_step(data, structure, best)


def everything(data: Data, structure: Structure, v: Array, max_steps: int = 200) -> Attempt:
    """(17): (16) minimised over all of θ = [a, b, γ] from v, by Levenberg-Marquardt with exact gradients.

    Nothing holds the filter stable or physical; a step to a filter that runs away within the data is taken back.
    """
    history: list[tuple[float, Array]] = []

    def normal(x: Array) -> tuple[float, Array, Array]:
        value, gradient, matrix = system.normal_equations(data, structure, x, "all")
        history.append((value / data.weight, x.copy()))
        return value, gradient, matrix

    solution = _solved(data, structure, normal, v, max_steps)
    return Attempt(solution.cost / data.weight, solution.x, solution.steps, solution.converged, history)


def _solved(
    data: Data,
    structure: Structure,
    normal: Callable[[Array], tuple[float, Array, Array]],
    v: Array,
    max_steps: int,
) -> Solution:
    lower, upper = structure.bounds()
    return minimise(normal, lambda x: system.cost(data, structure, x), v, lower, upper, max_steps, 1e-10)
