"""Exponential stiffness K^e = m e^(bδ), F^e = (m/b)(e^(bδ) − 1): equations (7) and (9)."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, ClassVar, Self

import numpy as np

from sim.elastic.base import Array, ElasticLaw, replaced
from sim.jit import Block, State, block


@block
def exponential(dt: float, delta: float, state: State, p: State) -> float:
    """F^e with p = (m, b); b = 0 is the linear spring m δ."""
    if delta <= 0.0:
        return 0.0
    x = p[1] * delta
    if x == 0.0:
        return p[0] * delta
    return p[0] * delta * (math.expm1(x) / x)


@dataclass(frozen=True)
class Exponential(ElasticLaw):
    """F^e = (m/b)(e^(bδ) − 1), with m in N/mm > 0 and b in 1/mm."""

    m: float
    b: float
    name: ClassVar[str] = "exponential"
    block: ClassVar[Block] = exponential

    @property
    def parameters(self) -> dict[str, float]:
        """`m`, `b`."""
        return asdict(self)

    @property
    def units(self) -> dict[str, str]:
        """N/mm and 1/mm."""
        return {"m": "N/mm", "b": "1/mm"}

    def with_parameters(self, values: Mapping[str, float]) -> Self:
        """The law with other m, b."""
        return type(self)(**replaced(self.parameters, values))

    def to_dict(self) -> dict[str, Any]:
        """`{law: exponential, m:, b:}`."""
        return {"law": self.name, "m": self.m, "b": self.b}

    @property
    def kernel_parameters(self) -> tuple[float, ...]:
        """(m, b)."""
        return (self.m, self.b)

    def _stiffness(self, delta: Array) -> Array:
        return self.m * np.exp(self.b * delta)

    def _gradient(self, delta: Array) -> Array:
        x = self.b * delta
        small = np.abs(x) < 1e-3
        safe = np.where(small, 1.0, x)
        by_m = delta * np.where(small, 1 + x / 2 + x**2 / 6 + x**3 / 24 + x**4 / 120, np.expm1(safe) / safe)
        curve = np.where(
            small,
            1 / 2 + x / 3 + x**2 / 8 + x**3 / 30 + x**4 / 144,
            (safe * np.exp(safe) - np.expm1(safe)) / safe**2,
        )
        return np.stack([by_m, self.m * delta**2 * curve], axis=1)

    def _depth(self, force: Array) -> Array:
        x = self.b * force / self.m  # with b < 0 the force saturates at -m/b
        reached = np.where(x > -1.0, x, np.nan)
        small = np.abs(x) < 1e-300
        return np.where(small, force / self.m, np.log1p(reached) / np.where(self.b == 0.0, 1.0, self.b))
