"""Conversions between the reduced relaxation g(t) (6), its transfer function G_L(s) (12), and digital filters (13).

A relaxation is given by the shares c_1 … c_r and the rates ν_1 … ν_r (1/s); c_0 = 1 − Σ c_i. With p_i = e^(−ν_i T),

    zero-order hold   G_L(z⁻¹) = c_0 + Σ c_i (1 − z⁻¹)/(1 − p_i z⁻¹)
    ramp-invariant    G_L(z⁻¹) = c_0 + Σ c_i φ_i (1 − z⁻¹)/(1 − p_i z⁻¹),   φ_i = (1 − p_i)/(ν_i T)

The first is exact for an elastic force that stands still between samples: the paper's form, with b_0 = Σ c_i = 1. The
second is exact for one that is linear between samples, as a moving axis makes it, and is the filter of
`sim.relaxation` on a uniform grid. The way back is in `sim.inverse`.

Direct-form coefficients lose digits where ν T is small: r poles crowd at 1, and what tells them apart is in the last
places of a. To *run* a filter use the state space, whose modes stand side by side.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from sim.digital import Array, Complex, Filter
from sim.inverse import Hold, NotARelaxation, is_relaxation, relaxation_of
from sim.kernel import ramp_gain

__all__ = [
    "Filter",
    "Hold",
    "NotARelaxation",
    "StateSpace",
    "frequency_response",
    "is_relaxation",
    "ramp_invariant",
    "relaxation_of",
    "state_space",
    "transfer_function",
    "zero_order_hold",
]


def transfer_function(shares: Sequence[float], rates: Sequence[float]) -> tuple[Array, Array]:
    """Numerator and denominator of G_L(s), (12), each of shape (r + 1,), descending powers of s, s^r of both with 1.

    The last coefficient of the numerator is c_0 Π ν_i over i = 1 … r: the paper's product begins at i = 0, where
    ν_0 = 0 would make it vanish.
    """
    c, nu = _checked(shares, rates)
    factors = [np.array([1.0, rate]) for rate in nu]
    numerator = _c_0(c) * _product(factors)
    for i, share in enumerate(c):
        rest = _product(factors[:i] + factors[i + 1 :])
        numerator[:-1] += share * rest
    return numerator, _product(factors)


def zero_order_hold(shares: Sequence[float], rates: Sequence[float], T: float) -> Filter:
    """The paper's filter (13), b_0 = 1 and l = r, for an elastic force that stands still for each T seconds."""
    return _filter(shares, rates, T, "zero_order")


def ramp_invariant(shares: Sequence[float], rates: Sequence[float], T: float) -> Filter:
    """The filter for an elastic force that is linear between samples T seconds apart; l = r, b_0 < 1."""
    return _filter(shares, rates, T, "ramp")


def frequency_response(shares: Sequence[float], rates: Sequence[float], omega_rad_s: ArrayLike) -> Complex:
    """G_L(jω) = c_0 + Σ c_i jω/(jω + ν_i) for angular frequencies of any shape."""
    c, nu = _checked(shares, rates)
    s = 1j * np.asarray(omega_rad_s, dtype=np.float64)
    result = np.full(s.shape, _c_0(c), dtype=np.complex128)
    for share, rate in zip(c, nu, strict=True):
        result += share * s / (s + rate)
    return result


@dataclass(frozen=True)
class StateSpace:
    """F^e → F as v' = A v + B F^e (or v(k+1), with `sample_time_s`), F = C v + D F^e; r states, from rest at 0.

    A (r, r), B (r,), C (r,), D a number. Each state is one mode's share of what has relaxed away: A is diagonal.
    """

    A: Array
    B: Array
    C: Array
    D: float
    sample_time_s: float | None

    def frequency_response(self, omega_rad_s: ArrayLike) -> Complex:
        """F/F^e at angular frequencies of any shape."""
        omega = np.asarray(omega_rad_s, dtype=np.float64)
        T = self.sample_time_s
        where = 1j * omega if T is None else np.exp(1j * omega * T)
        result = np.full(where.shape, self.D, dtype=np.complex128)
        for pole, gain in zip(np.diag(self.A), self.B * self.C, strict=True):
            result += gain / (where - pole)
        return result


def state_space(
    shares: Sequence[float], rates: Sequence[float], T: float | None = None, hold: Hold = "ramp"
) -> StateSpace:
    """State space of G_L, from elastic force to force: continuous, or sampled every T seconds.

    Continuous, v_i' = ν_i (F^e − v_i) and F = F^e − Σ c_i v_i. Sampled, with `hold` for what F^e does between samples:
    v_i(k+1) = p_i v_i + φ_i (1 − p_i) F^e and F = (1 − Σ c_i (1 − φ_i)) F^e − Σ c_i v_i, φ_i = 1 for the zero-order
    hold. (The ramp's v is the mode less what the present sample adds to it.)
    """
    c, nu = _checked(shares, rates)
    if T is None:
        return StateSpace(np.diag(-np.array(nu)), np.array(nu), -np.array(c), 1.0, None)
    _check_time(T)
    gain = np.array(_gains(nu, T, hold))
    lost = np.array([-math.expm1(-rate * T) for rate in nu])
    D = _c_0(c) + math.fsum(np.array(c) * gain)
    return StateSpace(np.diag([math.exp(-rate * T) for rate in nu]), gain * lost, -np.array(c), D, T)


def _filter(shares: Sequence[float], rates: Sequence[float], T: float, hold: Hold) -> Filter:
    c, nu = _checked(shares, rates)
    _check_time(T)
    factors = [np.array([1.0, -math.exp(-rate * T)]) for rate in nu]
    b = _c_0(c) * _product(factors)
    for i, (share, gain) in enumerate(zip(c, _gains(nu, T, hold), strict=True)):
        rest = _product(factors[:i] + factors[i + 1 :])
        b += share * gain * np.convolve([1.0, -1.0], rest)
    if hold == "zero_order":
        b[0] = 1.0  # Σ c_i, but for rounding
    return Filter(_product(factors).tolist(), b.tolist())


def _gains(nu: Sequence[float], T: float, hold: Hold) -> list[float]:
    if hold == "zero_order":
        return [1.0] * len(nu)
    if hold == "ramp":
        return [ramp_gain.python(rate * T) for rate in nu]
    raise ValueError(f"no hold {hold!r}; there are 'zero_order' and 'ramp'")


def _product(factors: Iterable[Array]) -> Array:
    result = np.ones(1)
    for factor in factors:
        result = np.convolve(result, factor)
    return result


def _c_0(shares: Sequence[float]) -> float:
    return math.fsum((1.0, *(-share for share in shares)))


def _checked(shares: Sequence[float], rates: Sequence[float]) -> tuple[list[float], list[float]]:
    c, nu = [float(value) for value in shares], [float(value) for value in rates]
    if len(c) != len(nu):
        raise ValueError(f"{len(c)} shares but {len(nu)} rates: one of each a mode")
    if not all(map(math.isfinite, c)):
        raise ValueError("a share is not a finite number")
    if not all(math.isfinite(rate) and rate > 0.0 for rate in nu):
        raise ValueError("a rate must be a finite number above 0, in 1/s")
    return c, nu


def _check_time(T: float) -> None:
    if not (math.isfinite(T) and T > 0.0):
        raise ValueError(f"the sample time must be a finite number of seconds above 0, not {T:g}")
