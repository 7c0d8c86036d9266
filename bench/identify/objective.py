"""The cost (16) over all runs, its gradient and Gauss-Newton matrix, in memory bounded by one chunk."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from . import _kernel
from ._kernel import Array
from .laws import Family
from .runs import Run

if TYPE_CHECKING:
    from .problem import Problem


@dataclass(frozen=True)
class Structure:
    """What is being fitted: law, order r, contact. x = [θ (k), η (pasts·r), log ν (r), a (r+1)], ν in 1/s."""

    family: Family
    order: int
    unilateral: bool
    pasts: int = 0
    """Runs that begin loaded: each has r numbers η, its state beyond that of a pad just pressed (`past`)."""

    @property
    def size(self) -> int:
        """Length of x."""
        return self.shape_size + 2 * self.order + 1

    @property
    def shape_size(self) -> int:
        """Length of x before the rates."""
        return self.family.size + self.pasts * self.order

    def past(self, which: int) -> slice:
        """Where one run's η are in x."""
        first = self.family.size + which * self.order
        return slice(first, first + self.order)

    def split(self, x: Array) -> tuple[Array, Array, Array]:
        """θ (k,), ν (r,), a (r+1,)."""
        k, r = self.shape_size, self.order
        return x[: self.family.size], np.exp(x[k : k + r]), x[k + r :]


@dataclass(frozen=True)
class Piece:
    """The model over one chunk; arrays (n,), `jacobian` (n, P) or (0, 0)."""

    at: slice
    force: Array
    elastic: Array
    jacobian: Array
    let_go: NDArray[np.bool_]


class Simulation:
    """The model on one run from its beginning, carried on from piece to piece."""

    def __init__(self, structure: Structure, x: Array, run: Run) -> None:
        self.structure, self.run = structure, run
        self._theta, self._rates, self._weights = structure.split(x)
        r, P = structure.order, structure.size
        self._state, self._d_state = np.zeros(r + 1), np.zeros((r + 1, P))
        self._coupled = np.zeros(1, dtype=np.int64)
        self._at = 0
        if run.past is not None:
            mine = structure.past(run.past)
            self._state[1:] = x[mine]
            self._d_state[np.arange(1, r + 1), np.arange(mine.start, mine.stop)] = 1.0

    def over(self, dt_s: Array, u: Array, derivatives: bool = False) -> Piece:
        """The next n samples: time since the one before each, and depth over D."""
        structure, n = self.structure, len(u)
        s, ds = structure.family.of_run(self.run, dt_s, u, self._theta, derivatives)
        if structure.pasts:
            ds = np.hstack([ds, np.zeros((n, structure.pasts * structure.order))])
        force, elastic, gone = np.empty(n), np.empty(n), np.empty(n, dtype=np.bool_)
        jacobian = np.empty((n, structure.size) if derivatives else (0, 0))
        _kernel.advance(
            dt_s, s, ds, self._rates, self._weights, structure.unilateral,
            self._state, self._d_state, self._coupled, force, elastic, jacobian, gone,
        )  # fmt: skip
        at = slice(self._at, self._at + n)
        self._at += n
        return Piece(at, force, elastic, jacobian, gone)


def simulate(run: Run, structure: Structure, x: Array, derivatives: bool = False) -> Iterator[Piece]:
    """The model on a run from rest, chunk by chunk."""
    simulation = Simulation(structure, x, run)
    for at in run.chunks():
        yield simulation.over(run.dt_s[at], run.u[at], derivatives)


def cost(problem: Problem, structure: Structure, x: Array) -> float:
    """Σ w e², force in units of the problem's scale, and what the runs' own doubts cost."""
    total = float(prior_of(problem, structure) @ x**2)
    for run in problem.runs:
        for piece in simulate(run, structure, x):
            total += _kernel.squared(run.weight[piece.at], run.y[piece.at], piece.force)
    return total


def normal_equations(problem: Problem, structure: Structure, x: Array) -> tuple[float, Array, Array]:
    """Σ w e², Σ w e ∂F/∂x (P,), Σ w ∂F/∂x ∂F/∂xᵀ (P, P), each with the prior of the runs' own doubts."""
    prior = prior_of(problem, structure)
    total, gradient, matrix = float(prior @ x**2), -prior * x, np.diag(prior)
    for run in problem.runs:
        for piece in simulate(run, structure, x, derivatives=True):
            total += _kernel.accumulate(
                run.weight[piece.at], run.y[piece.at], piece.force, piece.jacobian, gradient, matrix
            )
    return total, gradient, matrix + np.tril(matrix, -1).T


def prior_of(problem: Problem, structure: Structure) -> Array:
    """What each x² costs, (P,): nothing but for the runs' own doubts, which are the last of θ, and for what a past has
    left: of the order of F^e(D), which no data feel that tell it; where nothing moves it and the shares are one."""
    out = np.zeros(structure.size)
    out[structure.family.size : structure.shape_size] = problem.noise_square
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
