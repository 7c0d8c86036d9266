"""The elastic laws as the estimator sees them: a shape s(u; θ) of the depth u = δ/D, with s(1) = 1.

D is the greatest depth of the data, so that neither the units nor the size of the pad matter, and the gain, which
is F^e(D), is a linear parameter. The names and numbers of (9), (10), (14) come out at the end.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from ._kernel import Array

Named = list[tuple[str, float, str]]


@dataclass(frozen=True)
class Family:
    """One elastic law. θ has shape (k,), within `lower` and `upper` (k,)."""

    name: str
    size: int
    lower: Array
    upper: Array
    starts: Array
    """Starting points, shape (s, k), from softening to strongly stiffening."""
    curve: Callable[[Array, Array], tuple[Array, Array]]
    """(u (n,) in (0, …], θ) -> s (n,), ds/dθ (n, k)."""
    physical_numbers: Callable[[Array, float, float], Named]
    """(θ, gain in N, D in mm) -> [(name, value, unit)]."""
    degree: int = 0

    def shape(self, u: Array, theta: Array) -> tuple[Array, Array]:
        """s (n,) and ds/dθ (n, k) at depths of any sign; both 0 where u ≤ 0."""
        inside = u > 0
        if inside.all():
            return self.curve(u, theta)
        s, d = np.zeros(len(u)), np.zeros((len(u), self.size))
        s[inside], d[inside] = self.curve(u[inside], theta)
        return s, d

    def entry(self, numbers: Named) -> dict[str, Any]:
        """The `elastic` entry of a model file."""
        if self.name == "polynomial":
            return {"law": self.name, "alpha": [0.0] + [value for _, value, _ in numbers]}
        return {"law": self.name} | {name: value for name, value, _ in numbers}

    def rising(self, theta: Array) -> bool:
        """Whether F^e never falls on the way down to D: what a pad's must not."""
        s, _ = self.curve(np.linspace(1e-6, 1.0, 400), theta)
        return bool(np.all(np.diff(s) >= -1e-9) and s[0] >= -1e-9)

    def depth_scale_of(self, name: str) -> float:
        """Below which size of u-based number a parameter's relative error means nothing (b·D, q near 0: a line)."""
        return 0.2 if name in ("b", "q") else 0.0


def exponential() -> Family:
    """(9): F^e = (m/b)(e^{bδ} − 1); θ = bD. Negative b: a pad that softens."""

    def curve(u: Array, theta: Array) -> tuple[Array, Array]:
        beta = float(theta[0])
        if abs(beta) < 1e-4:  # the limit is a line; two terms hold to 1e-12
            s = u * (1 + beta * (u - 1) / 2 + beta**2 * (2 * u * u - 3 * u + 1) / 12)
            return s, (u * ((u - 1) / 2 + beta * (2 * u * u - 3 * u + 1) / 6))[:, None]
        if beta > 0:  # scaled by e^{−β}: no overflow at any bound
            top, whole = np.exp(beta * (u - 1)) - np.exp(-beta), -np.expm1(-beta)
            s = top / whole
            d = (u * np.exp(beta * (u - 1)) - s) / whole
            return s, d[:, None]
        top, whole = np.expm1(beta * u), np.expm1(beta)
        s = top / whole
        d = (u * np.exp(beta * u) - s * np.exp(beta)) / whole
        return s, d[:, None]

    def numbers(theta: Array, gain_N: float, depth_mm: float) -> Named:
        beta = float(theta[0])
        slope = beta / np.expm1(beta) if abs(beta) > 1e-9 else 1.0 - beta / 2
        return [("m", gain_N * slope / depth_mm, "N/mm"), ("b", beta / depth_mm, "1/mm")]

    starts = np.array([[-4.0], [-1.5], [-0.3], [0.5], [1.2], [2.0], [3.0], [4.5], [7.0], [11.0], [18.0]])
    return Family("exponential", 1, np.array([-25.0]), np.array([60.0]), starts, curve, numbers)


def power() -> Family:
    """(10): F^e = p δ^{q+1}/(q+1); θ = q > −1. Negative q: a pad that softens."""

    def curve(u: Array, theta: Array) -> tuple[Array, Array]:
        log_u = np.log(u)
        s = np.exp((float(theta[0]) + 1) * log_u)
        return s, (s * log_u)[:, None]

    def numbers(theta: Array, gain_N: float, depth_mm: float) -> Named:
        q = float(theta[0])
        return [("p", gain_N * (q + 1) / depth_mm ** (q + 1), "N/mm^(q+1)"), ("q", q, "")]

    starts = np.array([[-0.6], [-0.25], [0.0], [0.5], [1.0], [1.7], [2.6], [4.0], [7.0]])
    return Family("power", 1, np.array([-0.95]), np.array([30.0]), starts, curve, numbers)


def polynomial(degree: int) -> Family:
    """(14) with α_0 = 0, as the force does not jump at the surface.

    θ: the shares w_2 … w_n of the powers in s = Σ w_i u^i, w_1 = 1 − Σ θ; any sign.
    """
    powers = np.arange(2, degree + 1)

    def curve(u: Array, theta: Array) -> tuple[Array, Array]:
        d = u[:, None] ** powers - u[:, None]
        return u + d @ theta, d

    def numbers(theta: Array, gain_N: float, depth_mm: float) -> Named:
        w = np.concatenate([[1 - theta.sum()], theta])
        return [(f"alpha_{i}", gain_N * wi / depth_mm**i, f"N/mm^{i}" if i > 1 else "N/mm") for i, wi in enumerate(w, 1)]

    starts = np.zeros((1, 0))
    if degree > 1:  # the exponential's shapes, as near as this degree comes to them
        u, model = np.linspace(0.01, 1.0, 60), exponential()
        basis = curve(u, np.zeros(degree - 1))[1]
        shapes = [model.curve(u, theta)[0] for theta in model.starts[:9]]
        starts = np.array([np.linalg.lstsq(basis, s - u, rcond=None)[0] for s in shapes])
    bound = np.full(degree - 1, 1e3)
    return Family("polynomial", degree - 1, -bound, bound, starts, curve, numbers, degree)
