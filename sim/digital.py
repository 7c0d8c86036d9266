"""The digital filter B(z⁻¹)/A(z⁻¹) of equation (13), with what follows from its coefficients alone."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Filter:
    """(b_0 + b_1 z⁻¹ + … + b_l z⁻ˡ)/(1 + a_1 z⁻¹ + … + a_r z⁻ʳ), without delay (k = 0 in (13)).

    `a` and `b` are given with a_0 and b_0; both are divided by a_0. Raises ValueError for coefficients that are not
    finite, for no `b`, and for a_0 = 0.
    """

    a: tuple[float, ...]
    b: tuple[float, ...]

    def __init__(self, a: Sequence[float], b: Sequence[float]) -> None:
        if not len(a) or not len(b):
            raise ValueError("a filter needs at least a_0 and b_0")
        if not all(map(math.isfinite, (*a, *b))):
            raise ValueError("a coefficient of the filter is not a finite number")
        if a[0] == 0.0:
            raise ValueError("a_0 of a filter cannot be 0: the output would not depend on the input of its instant")
        object.__setattr__(self, "a", tuple(float(value / a[0]) for value in a))
        object.__setattr__(self, "b", tuple(float(value / a[0]) for value in b))

    @property
    def order(self) -> int:
        """r, the degree of A."""
        return len(self.a) - 1

    @cached_property
    def poles(self) -> Complex:
        """Roots of A in z, shape (r,), the largest in magnitude first; a pair's positive half comes first."""
        return _sorted(roots(self.a))

    @cached_property
    def zeros(self) -> Complex:
        """Roots of B in z, sorted as the poles; fewer than l where b_0 = 0."""
        return _sorted(roots(self.b))

    @property
    def stable(self) -> bool:
        """All poles lie inside the unit circle."""
        return bool(np.all(np.abs(self.poles) < 1.0))

    @property
    def static_gain(self) -> float:
        """B(1)/A(1): what a unit step ends at, if the filter is stable. ±inf with a pole at 1, NaN for 0/0."""
        numerator, denominator = math.fsum(self.b), math.fsum(self.a)
        if denominator == 0.0:
            return math.nan if numerator == 0.0 else math.copysign(math.inf, numerator)
        return numerator / denominator

    def response(self, u: ArrayLike) -> Array:
        """Output (n,) for an input (n,), from rest."""
        from scipy.signal import lfilter  # takes a moment to import

        return np.asarray(lfilter(self.b, self.a, np.asarray(u, dtype=np.float64)))

    def step_response(self, count: int) -> Array:
        """The first `count` outputs for the input 1, 1, 1 …"""
        return self.response(np.ones(count))

    def frequency_response(self, omega_rad_s: ArrayLike, T: float) -> Complex:
        """B/A at z = e^(jωT), for angular frequencies of any shape and the sample time T in s."""
        back = np.exp(-1j * np.asarray(omega_rad_s, dtype=np.float64) * T)
        return np.asarray(np.polyval(self.b[::-1], back) / np.polyval(self.a[::-1], back), dtype=np.complex128)


def roots(coefficients: Sequence[float]) -> NDArray[Any]:
    """Roots of c_0 zⁿ + c_1 zⁿ⁻¹ + … + c_n as long complex numbers, polished in long precision where there is one.

    The eigenvalues of the companion matrix are right to rounding of the largest coefficient; one or two Newton steps
    bring them to what the coefficients themselves say.
    """
    polynomial = np.asarray(coefficients, dtype=np.clongdouble)
    z = np.roots(np.asarray(coefficients, dtype=np.float64)).astype(np.clongdouble)
    slope = np.polyder(polynomial)
    for _ in range(3):
        value, derivative = np.polyval(polynomial, z), np.polyval(slope, z)
        moves = derivative != 0.0
        trial = np.where(moves, z - value / np.where(moves, derivative, 1.0), z)
        z = np.where(np.abs(np.polyval(polynomial, trial)) < np.abs(value), trial, z)
    return np.asarray(z)


def _sorted(z: NDArray[Any]) -> Complex:
    plain = z.astype(np.complex128)
    return plain[np.lexsort((-plain.imag, -plain.real, -np.abs(plain)))]
