"""The elastic laws as the estimator sees them: a shape s(u; θ) of the depth u = δ/D, with s(1) = 1.

D is the greatest depth of the data, so that neither the units nor the size of the pad matter, and the gain, which
is F^e(D), is a linear parameter. The curves and their derivatives are those of sim.elastic; the names and numbers of
(9), (10), (14) come out at the end.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from sim.elastic import Exponential, Polynomial, Power

from ._kernel import Array
from .runs import Run

Named = list[tuple[str, float, str]]

LEAST_GAIN = 1e-12  # N/mm: a model file holds no pad without a stiffness, and one that bears nothing is to simulate too


@dataclass(frozen=True)
class Family:
    """One elastic law. θ has shape (k,), within `lower` and `upper` (k,)."""

    name: str
    size: int
    lower: Array
    upper: Array
    starts: Array
    """Starting points, shape (s, k), from softening to strongly stiffening."""
    shape: Callable[[Array, Array], tuple[Array, Array]]
    """(u (n,) of any sign, θ) -> s (n,), ds/dθ (n, k); 0 where u ≤ 0."""
    physical_numbers: Callable[[Array, float, float], Named]
    """(θ, gain in N, D in mm) -> [(name, value, unit)]."""
    degree: int = 0

    def entry(self, numbers: Named) -> dict[str, Any]:
        """The `elastic` entry of a model file."""
        if self.name == "polynomial":
            return {"law": self.name, "alpha": [0.0] + [value for _, value, _ in numbers]}
        entry = {name: value for name, value, _ in numbers}
        gain = next(iter(entry))
        return {"law": self.name} | entry | {gain: max(entry[gain], LEAST_GAIN)}

    def of_run(self, run: Run, dt_s: Array, u: Array, theta: Array, slopes: bool = True) -> tuple[Array, Array]:
        """`shape` over samples of one run, which may be in doubt itself (`nuisance.Movable`).

        Without `slopes` the derivatives may be left out.
        """
        return self.shape(u, theta)

    def rising(self, theta: Array) -> bool:
        """Whether F^e never falls on the way down to D: what a pad's must not."""
        s, _ = self.shape(np.linspace(0.0, 1.0, 401), theta)
        return bool(np.all(np.diff(s) >= -1e-9))


def _of(name: str, law: Callable[[float], Exponential | Power], lower: float, upper: float, starts: list[float],
        numbers: Callable[[Array, float, float], Named]) -> Family:  # fmt: skip
    """A family of two parameters, the first of them a gain: `law(θ)` has gain 1."""

    def shape(u: Array, theta: Array) -> tuple[Array, Array]:
        form = law(float(theta[0]))
        (whole, whole_slope), G = form.force_gradient(1.0)[0], form.force_gradient(u)
        s = G[:, 0] / whole
        return s, ((G[:, 1] - s * whole_slope) / whole)[:, None]

    return Family(name, 1, np.array([lower]), np.array([upper]), np.array(starts)[:, None], shape, numbers)


def exponential() -> Family:
    """(9): F^e = (m/b)(e^{bδ} − 1); θ = bD. Negative b: a pad that softens."""

    def numbers(theta: Array, gain_N: float, depth_mm: float) -> Named:
        whole = float(Exponential(1.0, float(theta[0])).force_gradient(1.0)[0, 0])
        return [("m", gain_N / whole / depth_mm, "N/mm"), ("b", float(theta[0]) / depth_mm, "1/mm")]

    starts = [-4.0, -1.5, -0.3, 0.5, 1.2, 2.0, 3.0, 4.5, 7.0, 11.0, 18.0]
    return _of("exponential", lambda b: Exponential(1.0, b), -25.0, 60.0, starts, numbers)


def power() -> Family:
    """(10): F^e = p δ^{q+1}/(q+1); θ = q > −1. Negative q: a pad that softens."""

    def numbers(theta: Array, gain_N: float, depth_mm: float) -> Named:
        q = float(theta[0])
        return [("p", gain_N * (q + 1) / depth_mm ** (q + 1), "N/mm^(q+1)"), ("q", q, "1")]

    starts = [-0.6, -0.25, 0.0, 0.5, 1.0, 1.7, 2.6, 4.0, 7.0]
    return _of("power", lambda q: Power(1.0, q), -0.95, 30.0, starts, numbers)


def polynomial(degree: int) -> Family:
    """(14) with α_0 = 0, as the force does not jump at the surface.

    θ: the shares w_2 … w_n of the powers in s = Σ w_i u^i, w_1 = 1 − Σ θ; any sign.
    """
    law = Polynomial((0.0,) + (1.0,) * degree)

    def shape(u: Array, theta: Array) -> tuple[Array, Array]:
        powers = law.force_gradient(u)[:, 1:]
        d = np.ascontiguousarray(powers[:, 1:] - powers[:, :1])
        return powers[:, 0] + d @ theta, d

    def numbers(theta: Array, gain_N: float, depth_mm: float) -> Named:
        w = np.concatenate([[1 - theta.sum()], theta])
        units = law.units
        return [(f"alpha_{i}", gain_N * wi / depth_mm**i, units[f"alpha_{i}"]) for i, wi in enumerate(w, 1)]

    starts = np.zeros((1, 0))
    if degree > 1:  # the exponential's shapes, as near as this degree comes to them
        u, model = np.linspace(0.01, 1.0, 60), exponential()
        line, basis = shape(u, np.zeros(degree - 1))
        starts = np.array(
            [np.linalg.lstsq(basis, model.shape(u, t)[0] - line, rcond=None)[0] for t in model.starts[:9]]
        )
    bound = np.full(degree - 1, 1e3)
    return Family("polynomial", degree - 1, -bound, bound, starts, shape, numbers, degree)
