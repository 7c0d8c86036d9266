"""Elastic laws F^e(δ), N over mm; F^e = 0 for δ ≤ 0.

Those a model file can name are (9), (10) and (14) of the paper. Two more stand for pads that follow no textbook
law: a sphere on a half-space, and a law that stiffens first and then flattens.
"""

from __future__ import annotations

from dataclasses import asdict, dataclass, replace
from typing import Any, ClassVar

import numpy as np


@dataclass(frozen=True)
class Law:
    """An elastic law: its numbers are the fields, `curve` is its shape for δ > 0."""

    name: ClassVar[str] = ""

    def curve(self, depth_mm: np.ndarray) -> np.ndarray:
        """F^e at depths that are all positive, N."""
        raise NotImplementedError

    def force(self, depth_mm: np.ndarray | float) -> np.ndarray:
        """F^e(δ) in N, same shape as the depth."""
        depth = np.asarray(depth_mm, dtype=float)
        inside = depth > 0
        return np.where(inside, self.curve(np.where(inside, depth, 1.0)), 0.0)

    def parameters(self) -> dict[str, float]:
        """Names and values of the law's numbers."""
        return asdict(self)

    def with_parameters(self, values: dict[str, float]) -> Law:
        """The same law with some numbers changed."""
        return replace(self, **values)

    def model(self, depth_mm: float) -> dict[str, Any]:
        """The `elastic` entry of a model file, valid to the depth given."""
        return {"law": self.name, **self.parameters()}


@dataclass(frozen=True)
class Exponential(Law):
    """(9): F^e = (m/b)(e^{bδ} − 1); m in N/mm, b in 1/mm."""

    name: ClassVar[str] = "exponential"
    m: float
    b: float

    def curve(self, depth_mm: np.ndarray) -> np.ndarray:
        return self.m / self.b * np.expm1(self.b * depth_mm)


@dataclass(frozen=True)
class Power(Law):
    """(10): F^e = p δ^{q+1}/(q+1); p in N/mm^{q+1}. q = 0 is a linear spring of stiffness p."""

    name: ClassVar[str] = "power"
    p: float
    q: float

    def curve(self, depth_mm: np.ndarray) -> np.ndarray:
        return self.p * depth_mm ** (self.q + 1) / (self.q + 1)


@dataclass(frozen=True)
class Polynomial(Law):
    """(14): F^e = Σ α_i δ^i for δ > 0; α_i in N/mm^i. α_0 = 0 unless the force jumps at the surface."""

    name: ClassVar[str] = "polynomial"
    alpha: tuple[float, ...]

    def curve(self, depth_mm: np.ndarray) -> np.ndarray:
        return np.polynomial.polynomial.polyval(depth_mm, self.alpha)

    def parameters(self) -> dict[str, float]:
        """alpha_1, alpha_2, …; alpha_0 too where it is not zero."""
        return {f"alpha_{i}": a for i, a in enumerate(self.alpha) if i or a}

    def with_parameters(self, values: dict[str, float]) -> Polynomial:
        return Polynomial(tuple(values.get(f"alpha_{i}", a) for i, a in enumerate(self.alpha)))

    def model(self, depth_mm: float) -> dict[str, Any]:
        return {"law": self.name, "alpha": list(self.alpha)}


class _Tabulated(Law):
    """A law a model file has no name for: it is written as points of a spline."""

    def model(self, depth_mm: float) -> dict[str, Any]:
        knots = np.linspace(0.0, depth_mm, 25)
        return {"law": "spline", "delta_mm": knots.tolist(), "force_N": self.force(knots).tolist()}


@dataclass(frozen=True)
class Hertz(_Tabulated):
    """Rigid sphere on a half-space: F^e = (4/3) E* √R δ^{3/2}; E* in N/mm² (MPa), R in mm."""

    name: ClassVar[str] = "hertz"
    modulus: float
    radius: float

    def curve(self, depth_mm: np.ndarray) -> np.ndarray:
        return 4.0 / 3.0 * self.modulus * np.sqrt(self.radius) * depth_mm**1.5

    def model(self, depth_mm: float) -> dict[str, Any]:
        """The power law that is the same: p = 2 E* √R, q = 1/2."""
        return {"law": "power", "p": 2.0 * self.modulus * self.radius**0.5, "q": 0.5}


@dataclass(frozen=True)
class Tanh(_Tabulated):
    """A pad that gives way: F^e = A tanh(δ/d) + k δ; A in N, d in mm, k in N/mm."""

    name: ClassVar[str] = "tanh"
    amplitude: float
    scale: float
    slope: float

    def curve(self, depth_mm: np.ndarray) -> np.ndarray:
        return self.amplitude * np.tanh(depth_mm / self.scale) + self.slope * depth_mm
