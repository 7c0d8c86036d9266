"""What every elastic response F^e(δ) offers."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray

from sim.jit import Block
from sim.kernel import apply, as_vector

Array = NDArray[np.float64]


class ElasticLaw(ABC):
    """An elastic response: force against depth, 0 for δ <= 0 (no contact).

    Methods take depths in mm of any shape and return arrays of that shape.
    """

    name: ClassVar[str]
    block: ClassVar[Block]

    @property
    @abstractmethod
    def parameters(self) -> dict[str, float]:
        """Parameter values by name, in the order of `force_gradient`'s columns."""

    @property
    @abstractmethod
    def units(self) -> dict[str, str]:
        """Unit of each parameter."""

    @abstractmethod
    def with_parameters(self, values: Mapping[str, float]) -> Self:
        """The same law with other numbers; names not given keep theirs. Raises KeyError for an unknown name."""

    @abstractmethod
    def to_dict(self) -> dict[str, Any]:
        """The model file's form: `{law: name, …}`."""

    @property
    @abstractmethod
    def kernel_parameters(self) -> tuple[float, ...]:
        """What the compiled block reads."""

    @abstractmethod
    def _stiffness(self, delta: Array) -> Array:
        """K^e at depths > 0, N/mm."""

    @abstractmethod
    def _gradient(self, delta: Array) -> Array:
        """∂F^e/∂parameter at depths > 0, shape (n, k)."""

    @abstractmethod
    def _depth(self, force: Array) -> Array:
        """Inverse at forces > 0; NaN where the law never reaches the force."""

    @property
    def notes(self) -> tuple[str, ...]:
        """What a person should know about these particular numbers, in plain sentences."""
        return ()

    def force(self, delta_mm: ArrayLike) -> Array:
        """F^e in N: the block that the plant runs, over an array."""
        delta = np.asarray(delta_mm, dtype=np.float64)
        out = np.empty(delta.size)
        parameters = as_vector((*self.kernel_parameters, 0.0))
        apply(self.block.address, parameters, np.zeros(1), as_vector(delta.ravel()), out)
        return out.reshape(delta.shape)

    def stiffness(self, delta_mm: ArrayLike) -> Array:
        """K^e = dF^e/dδ in N/mm; 0 for δ <= 0."""
        delta = np.asarray(delta_mm, dtype=np.float64)
        flat = delta.ravel()
        result = np.zeros(flat.size)
        inside = flat > 0.0
        result[inside] = self._stiffness(flat[inside])
        return result.reshape(delta.shape)

    def force_gradient(self, delta_mm: ArrayLike) -> Array:
        """∂F^e/∂parameter, shape (n, k) for n depths and the k `parameters`; 0 for δ <= 0."""
        flat = np.asarray(delta_mm, dtype=np.float64).ravel()
        result = np.zeros((flat.size, len(self.parameters)))
        inside = flat > 0.0
        result[inside] = self._gradient(flat[inside])
        return result

    def depth_at(self, force_N: ArrayLike) -> Array:
        """The (least) depth in mm at which F^e reaches a force; 0 for forces <= 0, NaN where it never does."""
        force = np.asarray(force_N, dtype=np.float64)
        flat = force.ravel()
        result = np.zeros(flat.size)
        pressed = ~(flat <= 0.0)
        result[pressed] = self._depth(flat[pressed])
        return result.reshape(force.shape)


def replaced(current: Mapping[str, float], values: Mapping[str, float]) -> dict[str, float]:
    """`current` with `values` put in; KeyError for a name that is not there."""
    unknown = [name for name in values if name not in current]
    if unknown:
        raise KeyError(f"no parameter {unknown[0]!r}; there are {', '.join(current) or 'none'}")
    return {**current, **{name: float(value) for name, value in values.items()}}
