"""No pad: the bench in free air."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from sim.elastic.base import Array, ElasticLaw, replaced
from sim.jit import Block, State, block


@block
def nothing(dt: float, delta: float, state: State, p: State) -> float:
    """No force at any depth."""
    return 0.0


@dataclass(frozen=True)
class NoPad(ElasticLaw):
    """No force at any depth."""

    name: ClassVar[str] = "none"
    block: ClassVar[Block] = nothing

    @property
    def parameters(self) -> dict[str, float]:
        """None."""
        return {}

    @property
    def units(self) -> dict[str, str]:
        """None."""
        return {}

    def with_parameters(self, values: Mapping[str, float]) -> Self:
        """Raises KeyError for any name."""
        replaced({}, values)
        return self

    def to_dict(self) -> dict[str, Any]:
        """`{law: none}`."""
        return {"law": self.name}

    @property
    def kernel_parameters(self) -> tuple[float, ...]:
        """None."""
        return ()

    def _stiffness(self, delta: Array) -> Array:
        return np.zeros(delta.size)

    def _gradient(self, delta: Array) -> Array:
        return np.zeros((delta.size, 0))

    def _depth(self, force: Array) -> Array:
        return np.full(force.size, np.nan)
