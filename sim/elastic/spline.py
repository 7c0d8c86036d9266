"""Elastic response through points: a monotone cubic (PCHIP), for pads that no formula fits.

Slopes at the knots are Fritsch and Butland's weighted harmonic means of the neighbouring secants, so the curve has no
overshoot between points that rise (F. N. Fritsch, J. Butland, SIAM J. Sci. Stat. Comput. 5, 1984, 300–304); the ends
use the three-point formula limited to keep the shape (Moler, Numerical Computing with MATLAB, chapter 3).
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Any, ClassVar, Self

import numpy as np
from numpy.typing import NDArray

from sim.elastic.base import Array, ElasticLaw, replaced
from sim.jit import Block, State, block


@block
def spline(dt: float, delta: float, state: State, p: State) -> float:
    """F^e with p = (n, knots …, forces …, slopes …); beyond the last knot a line with its slope."""
    if delta <= 0.0:
        return 0.0
    n = int(p[0])
    if delta >= p[n]:
        return p[2 * n] + p[3 * n] * (delta - p[n])
    low, high = 1, n
    while high - low > 1:
        middle = (low + high) // 2
        if p[middle] <= delta:
            low = middle
        else:
            high = middle
    h = p[low + 1] - p[low]
    t = (delta - p[low]) / h
    left, right = p[n + low], p[n + low + 1]
    d_left, d_right = p[2 * n + low], p[2 * n + low + 1]
    u = 1.0 - t
    return u * u * ((1.0 + 2.0 * t) * left + h * t * d_left) + t * t * ((3.0 - 2.0 * t) * right - h * u * d_right)


def _end_slope(h: Array, secant: Array) -> tuple[float, float, float]:
    """Slope at the first knot, and its derivatives with respect to the first two secants."""
    if secant.size == 1:
        return float(secant[0]), 1.0, 0.0
    share = float((2 * h[0] + h[1]) / (h[0] + h[1]))
    slope = share * secant[0] + (1.0 - share) * secant[1]
    if slope * secant[0] <= 0.0:
        return 0.0, 0.0, 0.0
    if secant[0] * secant[1] <= 0.0 and abs(slope) > 3 * abs(secant[0]):
        return float(3 * secant[0]), 3.0, 0.0
    return float(slope), share, 1.0 - share


def slopes(knots: Array, values: Array) -> tuple[Array, Array]:
    """PCHIP slopes at the knots, shape (n,), and their derivatives with respect to the values, shape (n, n)."""
    n = knots.size
    h = np.diff(knots)
    secant = np.diff(values) / h
    d = np.zeros(n)
    by_secant = np.zeros((n, n - 1))
    for i in range(1, n - 1):
        s1, s2 = secant[i - 1], secant[i]
        if s1 * s2 <= 0.0:
            continue
        w1, w2 = 2 * h[i] + h[i - 1], h[i] + 2 * h[i - 1]
        d[i] = (w1 + w2) / (w1 / s1 + w2 / s2)
        by_secant[i, i - 1] = d[i] ** 2 * w1 / ((w1 + w2) * s1**2)
        by_secant[i, i] = d[i] ** 2 * w2 / ((w1 + w2) * s2**2)
    d[0], by_secant[0, 0], near = _end_slope(h, secant)
    d[-1], by_secant[-1, -1], far = _end_slope(h[::-1], secant[::-1])
    if n > 2:
        by_secant[0, 1], by_secant[-1, -2] = near, far
    secant_by_value = (np.eye(n)[1:] - np.eye(n)[:-1]) / h[:, None]
    return d, by_secant @ secant_by_value


@dataclass(frozen=True)
class Spline(ElasticLaw):
    """F^e through (delta_mm, force_N), from (0, 0) on; a line with the end stiffness beyond the last point.

    The point (0, 0) is there whether listed or not. Parameters are the forces; the depths are fixed.
    Raises ValueError when depths do not rise, forces fall, or there is no point in contact.
    """

    delta_mm: tuple[float, ...]
    force_N: tuple[float, ...]
    name: ClassVar[str] = "spline"
    block: ClassVar[Block] = spline

    def __post_init__(self) -> None:
        if len(self.delta_mm) != len(self.force_N):
            raise ValueError("delta_mm and force_N must have the same number of values")
        if not any(value > 0.0 for value in self.delta_mm):
            raise ValueError("delta_mm needs a depth greater than 0")
        if self.delta_mm[0] < 0.0 or (self.delta_mm[0] == 0.0 and self.force_N[0] != 0.0):
            raise ValueError("the spline starts at depth 0 with force 0")
        if np.any(np.diff(self.delta_mm) <= 0.0):
            raise ValueError("delta_mm must rise from each value to the next")
        if np.any(np.diff((0.0, *self.force_N)) < 0.0):
            raise ValueError("force_N must not fall from one value to the next")

    @property
    def _first(self) -> int:
        """1 where the point (0, 0) is listed (and no parameter), else 0."""
        return 1 if self.delta_mm[0] == 0.0 else 0

    @cached_property
    def _curve(self) -> tuple[Array, Array, Array, Array]:
        knots = np.array((0.0, *self.delta_mm[self._first :]))
        values = np.array((0.0, *self.force_N[self._first :]))
        return (knots, values, *slopes(knots, values))

    @property
    def parameters(self) -> dict[str, float]:
        """`force_1`, `force_2`, …: the forces at the depths greater than 0."""
        return {f"force_{i}": value for i, value in enumerate(self.force_N[self._first :], start=1)}

    @property
    def units(self) -> dict[str, str]:
        """All in N."""
        return dict.fromkeys(self.parameters, "N")

    def with_parameters(self, values: Mapping[str, float]) -> Self:
        """The law with other forces at the same depths."""
        forces = tuple(replaced(self.parameters, values).values())
        return type(self)(self.delta_mm, (0.0,) * self._first + forces)

    def to_dict(self) -> dict[str, Any]:
        """`{law: spline, delta_mm: […], force_N: […]}`."""
        return {"law": self.name, "delta_mm": list(self.delta_mm), "force_N": list(self.force_N)}

    @property
    def kernel_parameters(self) -> tuple[float, ...]:
        """(n, knots, forces, slopes)."""
        knots, values, d, _ = self._curve
        return (float(knots.size), *knots.tolist(), *values.tolist(), *d.tolist())

    def _cells(self, delta: Array) -> tuple[Array, NDArray[np.intp], Array, Array]:
        knots = self._curve[0]
        cell = np.clip(np.searchsorted(knots, delta, side="right") - 1, 0, knots.size - 2)
        h = knots[cell + 1] - knots[cell]
        return knots, cell, h, (delta - knots[cell]) / h

    def _stiffness(self, delta: Array) -> Array:
        _, values, d, _ = self._curve
        _, i, h, t = self._cells(delta)
        inside = (6 * t * (1 - t)) * (values[i + 1] - values[i]) / h
        inside += (1 - t) * (1 - 3 * t) * d[i] + t * (3 * t - 2) * d[i + 1]
        return np.where(t > 1.0, d[-1], inside)

    def _gradient(self, delta: Array) -> Array:
        knots, _, _, by_value = self._curve
        _, i, h, t = self._cells(delta)
        unit = np.eye(knots.size)
        u = 1 - t
        inside = (u**2 * (1 + 2 * t))[:, None] * unit[i] + (h * t * u**2)[:, None] * by_value[i]
        inside += (t**2 * (3 - 2 * t))[:, None] * unit[i + 1] - (h * t**2 * u)[:, None] * by_value[i + 1]
        beyond = unit[-1] + (delta - knots[-1])[:, None] * by_value[-1]
        return np.where((t > 1.0)[:, None], beyond, inside)[:, 1:]

    def _depth(self, force: Array) -> Array:
        knots, values, d, _ = self._curve
        low, high = np.zeros(force.size), np.full(force.size, knots[-1])
        for _ in range(80):  # bisection: the curve rises everywhere
            middle = 0.5 * (low + high)
            above = self.force(middle) >= force
            high = np.where(above, middle, high)
            low = np.where(above, low, middle)
        with np.errstate(divide="ignore", invalid="ignore"):
            beyond = knots[-1] + (force - values[-1]) / d[-1]
        return np.where(force <= values[-1], high, np.where(np.isfinite(beyond), beyond, np.nan))
