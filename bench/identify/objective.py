"""The cost (16) over all runs, its gradient and Gauss-Newton matrix, in memory bounded by one chunk."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from . import _kernel
from ._kernel import Array
from .laws import Family
from .problem import Problem, Run


@dataclass(frozen=True)
class Structure:
    """What is being fitted: law, order r, contact. x = [θ (k), log ν (r), a (r+1)], ν in 1/s."""

    family: Family
    order: int
    unilateral: bool

    @property
    def size(self) -> int:
        """Length of x."""
        return self.family.size + 2 * self.order + 1

    def split(self, x: Array) -> tuple[Array, Array, Array]:
        """θ (k,), ν (r,), a (r+1,)."""
        k, r = self.family.size, self.order
        return x[:k], np.exp(x[k : k + r]), x[k + r :]


@dataclass(frozen=True)
class Piece:
    """The model over one chunk; arrays (n,), `jacobian` (n, P) or (0, 0)."""

    at: slice
    force: Array
    elastic: Array
    jacobian: Array
    let_go: NDArray[np.bool_]


def simulate(run: Run, structure: Structure, x: Array, derivatives: bool = False) -> Iterator[Piece]:
    """The model on a run from rest, chunk by chunk."""
    theta, rates, weights = structure.split(x)
    r, P = structure.order, structure.size
    state, d_state, coupled = np.zeros(r + 1), np.zeros((r + 1, P)), np.zeros(1, dtype=np.int64)
    for at in run.chunks():
        n = at.stop - at.start
        s, ds = structure.family.of_run(run.u[at], theta, run.surface, derivatives)
        force, elastic, gone = np.empty(n), np.empty(n), np.empty(n, dtype=np.bool_)
        jacobian = np.empty((n, P) if derivatives else (0, 0))
        _kernel.advance(
            run.dt_s[at], s, ds, rates, weights, structure.unilateral,
            state, d_state, coupled, force, elastic, jacobian, gone,
        )  # fmt: skip
        yield Piece(at, force, elastic, jacobian, gone)


def cost(problem: Problem, structure: Structure, x: Array) -> float:
    """Σ w e², force in units of the problem's scale, and what moved surfaces cost."""
    total = float(prior_of(problem, structure) @ x**2)
    for run in problem.runs:
        for piece in simulate(run, structure, x):
            total += _kernel.squared(run.weight[piece.at], run.y[piece.at], piece.force)
    return total


def normal_equations(problem: Problem, structure: Structure, x: Array) -> tuple[float, Array, Array]:
    """Σ w e², Σ w e ∂F/∂x (P,), Σ w ∂F/∂x ∂F/∂xᵀ (P, P), each with the prior of the surfaces."""
    prior = prior_of(problem, structure)
    total, gradient, matrix = float(prior @ x**2), -prior * x, np.diag(prior)
    for run in problem.runs:
        for piece in simulate(run, structure, x, derivatives=True):
            total += _kernel.accumulate(
                run.weight[piece.at], run.y[piece.at], piece.force, piece.jacobian, gradient, matrix
            )
    return total, gradient, matrix + np.tril(matrix, -1).T


def prior_of(problem: Problem, structure: Structure) -> Array:
    """What each x² costs, (P,): nothing but for moved surfaces, which are the last of θ."""
    out = np.zeros(structure.size)
    k, count = structure.family.size, len(problem.prior)
    out[k - count : k] = problem.prior
    return out


def forces(problem: Problem, structure: Structure, x: Array) -> list[tuple[Array, NDArray[np.bool_], Array]]:
    """Of each run, over its union grid: simulated force, let-go, elastic response (after let-go the free surface's)."""
    out = []
    for run in problem.runs:
        pieces = list(simulate(run, structure, x))
        out.append(
            (
                np.concatenate([p.force for p in pieces]),
                np.concatenate([p.let_go for p in pieces]),
                np.concatenate([p.elastic for p in pieces]),
            )
        )
    return out
