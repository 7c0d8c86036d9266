"""Starting points from the data.

With the law's shape and a grid of rates given, the model is linear in the shares: one pass gives the Gram matrix of
all modes on the grid, and every choice of r rates among them is a small positive least-squares problem.
"""

from __future__ import annotations

from dataclasses import dataclass
from itertools import combinations

import numpy as np

from . import _kernel, objective
from ._kernel import Array
from .laws import Family
from .objective import Structure
from .problem import Problem

GRID = 13  # rates on the grid
PAST = 4.0  # of F^e at the greatest depth: more than that no mode has left from before


@dataclass(frozen=True)
class Bounds:
    """Rates the data can speak of, 1/s."""

    slowest: float
    fastest: float

    def grid(self) -> Array:
        """Log-spaced, fast to slow, half a step inside the bounds."""
        edges = np.linspace(np.log(self.fastest), np.log(self.slowest), GRID + 1)
        return np.exp((edges[1:] + edges[:-1]) / 2)

    def of(self, structure: Structure) -> tuple[Array, Array]:
        """Lower and upper bounds of x."""
        family, r = structure.family, structure.order
        past = np.full(structure.pasts * r, PAST)
        lower = np.concatenate([family.lower, -past, np.full(r, np.log(self.slowest)), np.zeros(r + 1)])
        upper = np.concatenate([family.upper, past, np.full(r, np.log(self.fastest)), np.full(r + 1, np.inf)])
        return lower, upper


def bounds_of(problem: Problem) -> Bounds:
    """From a third of a time constant in the longest run to one time constant a sample."""
    step, span = problem.times()
    return Bounds(slowest=0.3 / span, fastest=max(1.0 / step, 10.0 / span))


@dataclass(frozen=True)
class Gram:
    """Products of the modes on a grid of rates (M,), θ given: `matrix` (M+1, M+1), `right` (M+1,), `square` Σ w y²."""

    theta: Array
    rates: Array
    matrix: Array
    right: Array
    square: float

    def best(self, order: int, must: tuple[int, ...] = (), count: int = 1) -> list[tuple[float, list[int], Array]]:
        """The `count` best choices of `order` rates (columns `must` among them): (Σ w e², columns, a ≥ 0).

        c_0 may be left out; a choice with a negative share is no candidate (a smaller one covers it).
        """
        others = [i for i in range(1, len(self.rates) + 1) if i not in must]
        picks = [sorted(must + pick) for pick in combinations(others, order - len(must))]
        found = []
        for lead in ([0], []):
            index = np.array([lead + pick for pick in picks], dtype=np.intp)
            A = self.matrix[index[:, :, None], index[:, None, :]].copy()
            diagonal = np.einsum("kii->ki", A)
            diagonal *= 1 + 1e-12
            diagonal += 1e-12 * self.square + 1e-30
            b = self.right[index]
            a = np.linalg.solve(A, b[..., None])[..., 0]
            left = self.square - np.einsum("ki,ki->k", a, b)
            left[np.any(a < 0, axis=1)] = np.inf
            for k in np.argsort(left)[:count]:
                if np.isfinite(left[k]):
                    weights = a[k] if lead else np.concatenate([[0.0], a[k]])
                    found.append((float(left[k]), list(picks[k]), weights))
        return sorted(found, key=lambda item: item[0])[:count]


def gram(problem: Problem, family: Family, theta: Array, rates: Array, elastic: list[Array] | None = None,
         keep: list[Array] | None = None) -> Gram:  # fmt: skip
    """One pass. `elastic`: of each run, the response to use in place of F^e(δ) (a surface that had let go);
    `keep`: of each run, weights in place of the run's own (out of contact a linear model says nothing)."""
    M = len(rates)
    matrix, right, square = np.zeros((M + 1, M + 1)), np.zeros(M + 1), 0.0
    for j, run in enumerate(problem.runs):
        s = elastic[j] if elastic is not None else family.of_run(run, run.dt_s, run.u, theta, False)[0]
        weight = keep[j] if keep is not None else run.weight
        H = _kernel.modes(run.dt_s, s, rates)
        weighted = H * weight[:, None]
        products, ends, own = H.T @ weighted, weighted.T @ run.y, float(np.dot(weight * run.y, run.y))
        if run.past is not None:
            # Whatever the rates turn out to be, the past fades within what the whole grid of rates can follow.
            E = np.exp(-rates * (run.time_s - run.time_s[0])[:, None])
            half = (E * weight[:, None]).T
            inverse, shared, seen = np.linalg.pinv(half @ E, rcond=1e-7, hermitian=True), half @ H, half @ run.y
            products, ends = products - shared.T @ inverse @ shared, ends - shared.T @ inverse @ seen
            own -= float(seen @ inverse @ seen)
        matrix += products
        right += ends
        square += own
    return Gram(theta, rates, matrix, right, square)


class Starter:
    """Starting points for one law and contact; learns from the fits already made."""

    def __init__(self, problem: Problem, family: Family, unilateral: bool, bounds: Bounds) -> None:
        self.problem, self.family, self.unilateral, self.bounds = problem, family, unilateral, bounds
        self._keep = self._in_contact() if unilateral else None
        self._grams: list[Gram] | None = None

    def _in_contact(self) -> list[Array]:
        # A pad that lets go shows no force: such samples would press a linear model into a false shape.
        kept = [np.where(run.y > 0.02, run.weight, 0.0) for run in self.problem.runs]
        few = sum(float(w.sum()) for w in kept) < 0.02 * self.problem.weight
        return [run.weight for run in self.problem.runs] if few else kept

    def first(self, order: int, count: int = 3) -> list[Array]:
        """The best few by grid search over law shape and rates."""
        if self._grams is None:
            rates = self.bounds.grid()
            self._grams = [gram(self.problem, self.family, th, rates, keep=self._keep) for th in self.family.starts]
        found = []
        for g in self._grams:
            found += [(left, g, columns, a) for left, columns, a in g.best(order, count=2)]
        found.sort(key=lambda item: item[0])
        return [self._x(g, columns, a) for _, g, columns, a in found[:count]] or [self._plain(order)]

    def _plain(self, order: int) -> Array:
        """A start where no choice of rates has positive shares alone: nearly elastic, the rates spread out."""
        grams = self._grams or []
        gains = [g.right[0] / max(g.matrix[0, 0], 1e-300) for g in grams]
        left = [g.square - gain * g.right[0] for g, gain in zip(grams, gains, strict=True)]
        k = int(np.argmin(left))
        columns = np.linspace(1, GRID, order + 2)[1:-1].astype(int).tolist()
        return self._x(grams[k], columns, np.concatenate([[max(gains[k], 1e-3)], np.zeros(order)]))

    def next(self, structure: Structure, x: Array) -> list[Array]:
        """One more mode beside those of a fit of the order below: at least as good as that fit."""
        theta, rates, _ = structure.split(x)
        new = self.bounds.grid()
        apart = np.all(np.abs(np.log(new[:, None] / rates)) > 0.3, axis=1)
        apart[np.argmax(np.min(np.abs(np.log(new[:, None] / rates)), axis=1))] = True
        both = np.concatenate([rates, new[apart]])
        elastic = [e for _, _, e in objective.forces(self.problem, structure, x)] if self.unilateral else None
        keep = None
        if self.unilateral:
            gone = [g for _, g, _ in objective.forces(self.problem, structure, x)]
            keep = [np.where(g, 0.0, run.weight) for g, run in zip(gone, self.problem.runs, strict=True)]
        g = gram(self.problem, self.family, theta, both, elastic, keep)
        best = g.best(structure.order + 1, tuple(range(1, structure.order + 1)), count=1)
        best += g.best(structure.order + 1, count=1)
        if not best:  # a mode that the data give no share: in the widest gap
            gaps = np.min(np.abs(np.log(new[:, None] / rates)), axis=1)
            spare = np.concatenate([[np.log(new[np.argmax(gaps)])], [1e-3 * x[-structure.order - 1 :].sum()]])
            more = np.concatenate([theta, np.log(rates), spare[:1], x[-structure.order - 1 :], spare[1:]])
            return [self._with_past(more, structure.order + 1)]
        return [self._x(g, columns, a) for _, columns, a in best]

    def _x(self, g: Gram, columns: list[int], a: Array) -> Array:
        rates = g.rates[np.array(columns) - 1]
        weights = np.maximum(a, 1e-3 * np.sum(a))  # off the bound, where a rate would have no gradient
        return self._with_past(np.concatenate([g.theta, np.log(rates), weights]), len(rates))

    def _with_past(self, x: Array, order: int) -> Array:
        """The start with the pasts that suit it best: they are linear, so one step finds them."""
        if not self.problem.pasts:
            return x
        structure = Structure(self.family, order, self.unilateral, self.problem.pasts)
        k = self.family.size
        out = np.concatenate([x[:k], np.zeros(structure.shape_size - k), x[k:]])
        _, gradient, matrix = objective.normal_equations(self.problem, structure, out)
        inside = slice(k, structure.shape_size)
        H = matrix[inside, inside]
        H = H + 1e-9 * max(float(np.trace(H)), 1e-30) * np.eye(len(H))
        out[inside] = np.clip(np.linalg.solve(H, gradient[inside]), -PAST / 2, PAST / 2)
        return out
