"""Elastic laws outside the catalogue, and laws made of others.

Sources: Mooney (1940) and Rivlin (1948) in uniaxial compression; foams with a plateau and densification (Gibson and
Ashby 1997); a probe that meets the surface over a range of heights as the mean over that range.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..laws import Law, _Tabulated


def stretched(depth_mm: np.ndarray, thickness_mm: float) -> np.ndarray:
    """Stretch λ = 1 − δ/H of a block of thickness H; never below 0.05."""
    return np.maximum(1 - depth_mm / thickness_mm, 0.05)


@dataclass(frozen=True)
class MooneyRivlin(_Tabulated):
    """Nominal stress of a block of thickness H: F = A (λ^{−2} − λ) + B (λ^{−3} − 1), λ = 1 − δ/H."""

    name: ClassVar[str] = "mooney_rivlin"
    first: float
    second: float
    thickness: float

    def curve(self, depth_mm: np.ndarray) -> np.ndarray:
        stretch = stretched(depth_mm, self.thickness)
        return self.first * (stretch**-2 - stretch) + self.second * (stretch**-3 - 1)


@dataclass(frozen=True)
class TwoSlope(_Tabulated):
    """k_1 δ, and k_2 more beyond δ_k, rounded over w: k_1 δ + k_2 w [ln(1 + e^{(δ−δ_k)/w}) − ln(1 + e^{−δ_k/w})]."""

    name: ClassVar[str] = "two_slope"
    first: float
    more: float
    knee: float
    width: float

    def curve(self, depth_mm: np.ndarray) -> np.ndarray:
        bend = np.logaddexp(0, (depth_mm - self.knee) / self.width) - np.logaddexp(0, -self.knee / self.width)
        return self.first * depth_mm + self.more * self.width * bend


@dataclass(frozen=True)
class Foam(_Tabulated):
    """Linear, plateau, densification: F = A tanh(δ/d) + B (δ/D)^4."""

    name: ClassVar[str] = "foam"
    plateau: float
    scale: float
    dense: float
    depth: float

    def curve(self, depth_mm: np.ndarray) -> np.ndarray:
        return self.plateau * np.tanh(depth_mm / self.scale) + self.dense * (depth_mm / self.depth) ** 4


@dataclass(frozen=True)
class Blend(_Tabulated):
    """base + share (other − base)."""

    name: ClassVar[str] = "blend"
    base: Law
    other: Law
    share: float

    def curve(self, depth_mm: np.ndarray) -> np.ndarray:
        base = self.base.curve(depth_mm)
        return base + self.share * (self.other.curve(depth_mm) - base)

    def parameters(self) -> dict[str, float]:
        return {"share": self.share}


@dataclass(frozen=True)
class Rounded(_Tabulated):
    """The mean of a law over surfaces that begin from 0 to 2 half mm deep."""

    name: ClassVar[str] = "rounded"
    law: Law
    half: float

    def force(self, depth_mm: np.ndarray | float) -> np.ndarray:
        depth = np.asarray(depth_mm, dtype=float)
        nodes, weights = np.polynomial.legendre.leggauss(8)
        parts = [w / 2 * self.law.force(depth - self.half * (1 - x)) for x, w in zip(nodes, weights, strict=True)]
        return np.sum(parts, axis=0)

    def parameters(self) -> dict[str, float]:
        return self.law.parameters() | {"half": self.half}

    def model(self, depth_mm: float) -> dict[str, Any]:
        return self.law.model(depth_mm)
