"""Polynomial response F^e = Σ α_i δ^i: equation (14)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from sim.elastic.base import Array, ElasticLaw, replaced
from sim.jit import Block, State, block


@block
def polynomial(dt: float, delta: float, state: State, p: State) -> float:
    """F^e with p = (count, α_0, α_1, …), by Horner's rule."""
    if delta <= 0.0:
        return 0.0
    result = 0.0
    for i in range(int(p[0]), 0, -1):
        result = result * delta + p[i]
    return result


@dataclass(frozen=True)
class Polynomial(ElasticLaw):
    """F^e = Σ α_i δ^i for δ > 0, with α_i in N/mm^i.

    The law holds in contact only, so an α_0 other than 0 is a jump of the force by α_0 at first touch. The paper
    fits one all the same (it lists γ_1 = α_0), which is why it is taken; `notes` says so.
    """

    alpha: tuple[float, ...]
    name: ClassVar[str] = "polynomial"
    block: ClassVar[Block] = polynomial

    @property
    def parameters(self) -> dict[str, float]:
        """`alpha_0`, `alpha_1`, …"""
        return {f"alpha_{i}": value for i, value in enumerate(self.alpha)}

    @property
    def units(self) -> dict[str, str]:
        """N, N/mm, N/mm^2, …"""
        names = ("N", "N/mm")
        return {f"alpha_{i}": names[i] if i < 2 else f"N/mm^{i}" for i in range(len(self.alpha))}

    @property
    def notes(self) -> tuple[str, ...]:
        """The jump at first touch, if there is one."""
        if self.alpha[0] == 0.0:
            return ()
        return (f"alpha_0 is not 0: the elastic force jumps by {self.alpha[0]:g} N at first touch",)

    def with_parameters(self, values: Mapping[str, float]) -> Self:
        """The law with other coefficients."""
        return type(self)(tuple(replaced(self.parameters, values).values()))

    def to_dict(self) -> dict[str, Any]:
        """`{law: polynomial, alpha: […]}`."""
        return {"law": self.name, "alpha": list(self.alpha)}

    @property
    def kernel_parameters(self) -> tuple[float, ...]:
        """(count, α_0, …)."""
        return (float(len(self.alpha)), *self.alpha)

    def _stiffness(self, delta: Array) -> Array:
        return np.asarray(np.polynomial.Polynomial(self.alpha).deriv()(delta))

    def _gradient(self, delta: Array) -> Array:
        return np.vander(delta, len(self.alpha), increasing=True)

    def _depth(self, force: Array) -> Array:
        result = np.full(force.size, np.nan)
        for n, value in enumerate(force):
            if value <= self.alpha[0]:  # reached by the jump at first touch
                result[n] = 0.0
                continue
            roots = np.polynomial.Polynomial((self.alpha[0] - value, *self.alpha[1:])).roots()
            real = roots.real[(np.abs(roots.imag) <= 1e-9 * (1.0 + np.abs(roots.real))) & (roots.real > 0.0)]
            if real.size:
                result[n] = real.min()
        return result
