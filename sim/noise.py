"""Random numbers of a simulated bench: one generator a purpose, so that no reader disturbs another's draws."""

from __future__ import annotations

import numpy as np

PURPOSES = ("surface", "position", "force", "faults")
"""Order matters: a purpose's place is its spawn key. New ones are appended."""

_BLOCK = 512


def generator(seed: int, purpose: str, *place: int) -> np.random.Generator:
    """The generator of one purpose of a bench; the same seed, purpose and place give the same numbers always."""
    return np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(PURPOSES.index(purpose), *place)))


class GaussianNoise:
    """Independent normal numbers of mean 0, drawn in blocks (a single draw costs as much as a whole line)."""

    __slots__ = ("_generator", "_values", "std")

    def __init__(self, random: np.random.Generator, std: float) -> None:
        if not std >= 0.0:
            raise ValueError(f"a standard deviation cannot be {std}")
        self.std = std
        self._generator = random
        self._values: list[float] = []

    def draw(self) -> float:
        """The next number; 0.0 where the standard deviation is 0."""
        if self.std == 0.0:
            return 0.0
        if not self._values:
            self._values = self._generator.normal(0.0, self.std, _BLOCK).tolist()
        return self._values.pop()
