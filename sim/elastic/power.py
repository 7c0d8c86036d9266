"""Power-law stiffness K^e = p δ^q, F^e = p/(q+1) δ^(q+1): equations (8) and (10)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass
from typing import Any, ClassVar, Self

import numpy as np

from sim.elastic.base import Array, ElasticLaw, replaced
from sim.jit import Block, State, block


@block
def power(dt: float, delta: float, state: State, p: State) -> float:
    """F^e with p = (p, q)."""
    if delta <= 0.0:
        return 0.0
    e = p[1] + 1.0
    return float(p[0] / e * delta**e)


@dataclass(frozen=True)
class Power(ElasticLaw):
    """F^e = p/(q+1) δ^(q+1), with p > 0 in N/mm^(q+1) and q > −1."""

    p: float
    q: float
    name: ClassVar[str] = "power"
    block: ClassVar[Block] = power

    @property
    def parameters(self) -> dict[str, float]:
        """`p`, `q`."""
        return asdict(self)

    @property
    def units(self) -> dict[str, str]:
        """N/mm^(q+1) and 1."""
        return {"p": "N/mm^(q+1)", "q": "1"}

    def with_parameters(self, values: Mapping[str, float]) -> Self:
        """The law with other p, q."""
        return type(self)(**replaced(self.parameters, values))

    def to_dict(self) -> dict[str, Any]:
        """`{law: power, p:, q:}`."""
        return {"law": self.name, "p": self.p, "q": self.q}

    @property
    def kernel_parameters(self) -> tuple[float, ...]:
        """(p, q)."""
        return (self.p, self.q)

    def _stiffness(self, delta: Array) -> Array:
        return np.asarray(self.p * delta**self.q)

    def _gradient(self, delta: Array) -> Array:
        e = self.q + 1.0
        shape = delta**e / e
        return np.stack([shape, self.p * shape * (np.log(delta) - 1.0 / e)], axis=1)

    def _depth(self, force: Array) -> Array:
        e = self.q + 1.0
        return np.asarray((e * force / self.p) ** (1.0 / e))
