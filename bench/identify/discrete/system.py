"""The discrete Hammerstein model (13) as the estimators see it: its numbers as one vector, its force, its cost (16)."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property
from math import comb
from typing import Any

import numpy as np
from numpy.typing import NDArray

from sim.digital import Filter

from .._kernel import Array
from ..laws import Family
from . import _kernel
from .series import Data, Series

SOFTEST = 1e-9  # gain, over the largest force: no stiffness at all
LIMIT = 1e6  # times the largest measured force: beyond, a filter has run away


@dataclass(frozen=True)
class Structure:
    """Law, order r = l, contact. v = [gain, θ (k), α (r), β (r)], gain = F^e(D) over the force scale.

    With the difference q = 1 − z⁻¹, A = q^r + Σ α_j q^j z^(j−r) and B likewise with β, j = 0 … r−1: the same
    polynomials as in a and b with a_0 = b_0 = 1, in numbers that keep their digits where poles crowd near 1. Least
    squares in either are the same, as the one is linear in the other.
    """

    family: Family
    order: int
    unilateral: bool

    @property
    def nonlinear(self) -> int:
        """Numbers of the elastic response, γ: gain and θ."""
        return 1 + self.family.size

    @property
    def size(self) -> int:
        """Length of v."""
        return self.nonlinear + 2 * self.order

    @cached_property
    def origin(self) -> Array:
        """a and b at α = β = 0: those of q^r, (r,)."""
        return np.array([(-1.0) ** i * comb(self.order, i) for i in range(1, self.order + 1)])

    @cached_property
    def M(self) -> Array:
        """a = origin + M α, (r, r): column j holds the coefficients of q^j z^(j−r)."""
        r = self.order
        out = np.zeros((r, r))
        for j in range(r):
            for i in range(j + 1):
                out[r - j + i - 1, j] = (-1.0) ** i * comb(j, i)
        return out

    def coefficients(self, v: Array) -> tuple[Array, Array]:
        """a_1 … a_r and b_1 … b_r."""
        g, r = self.nonlinear, self.order
        return self.origin + self.M @ v[g : g + r], self.origin + self.M @ v[g + r :]

    def filter(self, v: Array) -> Filter:
        """A and B with a_0 = b_0 = 1."""
        a, b = self.coefficients(v)
        return Filter([1.0, *a.tolist()], [1.0, *b.tolist()])

    def vector(self, gain: float, theta: Array, a: Array, b: Array) -> Array:
        """v of a gain, θ (k,) and a_1 …, b_1 … (r,)."""
        ab = [np.linalg.solve(self.M, np.asarray(x) - self.origin) for x in (a, b)] if self.order else []
        return np.concatenate([[gain], theta, *ab])

    def joined(self, gamma: Array, linear: Array) -> Array:
        """v of γ (1+k,) and (α, β) (2r,)."""
        return np.concatenate([gamma, linear])

    def bounds(self) -> tuple[Array, Array]:
        """Of v: the law's own (wide), nothing for the filter, as in the paper."""
        free = np.full(2 * self.order, np.inf)
        family = self.family
        return np.concatenate([[SOFTEST], family.lower, -free]), np.concatenate([[np.inf], family.upper, free])


@dataclass(frozen=True)
class Simulated:
    """The model on one run: `force`, `elastic`, `let_go` (K,), `jacobian` (K, P) or (0, 0); `ok`: not run away."""

    force: Array
    elastic: Array
    jacobian: Array
    let_go: NDArray[np.bool_]
    ok: bool


def simulate(run: Series, structure: Structure, v: Array, derivatives: str = "") -> Simulated:
    """The model from rest; `derivatives`: none, by `gamma` (gain, θ), or by `all`."""
    g = structure.nonlinear
    K = len(run.time_s)
    s, ds = run.elastic(structure.family, v[1:g])
    a, b = structure.coefficients(v)
    P = {"": 0, "gamma": g, "all": structure.size}[derivatives]
    force, elastic, gone = np.zeros(K), np.zeros(K), np.zeros(K, dtype=np.bool_)
    jacobian = np.zeros((K, P)) if P else np.zeros((0, 0))
    workspace = np.zeros((structure.order, P))
    ok = _kernel.run(s, ds, float(v[0]), a, b, structure.M, structure.unilateral, LIMIT, force, elastic, jacobian,
                     workspace, gone)  # fmt: skip
    return Simulated(force, elastic, jacobian, gone, ok)


def cost(data: Data, structure: Structure, v: Array) -> float:
    """N V(θ, Z^N) of (16), force in units of the scale; inf where the filter ran away."""
    total = 0.0
    for run in data.runs:
        out = simulate(run, structure, v)
        if not out.ok:
            return float("inf")
        error = run.y - out.force
        total += float(np.dot(run.weight * error, error))
    return total


def normal_equations(data: Data, structure: Structure, v: Array, derivatives: str) -> tuple[float, Array, Array]:
    """Σ w e², Σ w e ∂F/∂v, Σ w ∂F/∂v ∂F/∂vᵀ; the sums may be infinite where the filter all but runs away."""
    P = structure.size if derivatives == "all" else structure.nonlinear
    total, gradient, matrix = 0.0, np.zeros(P), np.zeros((P, P))
    for run in data.runs:
        out = simulate(run, structure, v, derivatives)
        if not out.ok:
            return float("inf"), gradient, matrix
        error = run.weight * (run.y - out.force)
        total += float(np.dot(error, run.y - out.force))
        with np.errstate(over="ignore", invalid="ignore"):
            gradient += out.jacobian.T @ error
            matrix += out.jacobian.T @ (out.jacobian * run.weight[:, None])
    return total, gradient, matrix


def named(data: Data, structure: Structure, v: Array) -> list[tuple[str, float, str]]:
    """The law's numbers and a_1 … a_r, b_1 … b_r, with units."""
    family = structure.family
    out = family.physical_numbers(v[1 : structure.nonlinear], float(v[0]) * data.force_N, data.depth_mm)
    for letter, values in zip("ab", structure.coefficients(v), strict=True):
        out += [(f"{letter}_{i}", float(value), "1") for i, value in enumerate(values, 1)]
    return [(name, float(value), unit) for name, value, unit in out]


def values(data: Data, structure: Structure, v: Array) -> dict[str, Any]:
    """`named` without units."""
    return {name: value for name, value, _ in named(data, structure, v)}
