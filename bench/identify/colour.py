"""The colour of a residual: its autocovariance as that of an autoregression, with what the fit took out put back.

A fit follows part of the noise, most of all its slow part, so the residual's own autocovariance falls short of the
noise's. With M = J H⁻¹ Jᵀ the residual is (1 − M) n, hence for each lag k

    E Σ_t e_t e_{t+k} = Σ_t [Γ − MΓ − ΓM + MΓM]_{t, t+k},

and Γ is corrected by what those three terms amount to. An autoregression (Yule-Walker, its order by the Bayesian
criterion) then stands for Γ: raw autocovariances at long lags are mostly their own error.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.fft import irfft, next_fast_len, rfft
from scipy.linalg import solve_toeplitz

from ._kernel import Array

ORDERS = 30
FORGOTTEN = 1e-3  # of γ(0): where the autoregression's memory is cut
ROUNDS = 3
SIZES = 8  # lags of a raw autocovariance that the order search wants beyond the order


@dataclass(frozen=True)
class Colour:
    """`gamma`: autocovariance at lags 0 … L−1 (L,); `memory`: 1 + 2 Σ ρ, how many samples in a row say the same."""

    gamma: Array
    memory: float


def plain_colour(errors: list[Array]) -> Colour:
    """Of residuals as they are, one array a run."""
    count = sum(len(e) for e in errors)
    lags = _lags(errors)
    raw = np.sum([_raw(e, lags) for e in errors], axis=0)
    return _regressed(np.asarray(raw / max(count, 1)), count)


def corrected_colour(errors: list[Array], sensitivity: list[Array], inverse: Array) -> Colour:
    """Of the noise behind residuals of a fit: `sensitivity` J (n, P) of each run, `inverse` H⁻¹ (P, P)."""
    count = sum(len(e) for e in errors)
    lags = _lags(errors)
    raw = np.asarray(np.sum([_raw(e, lags) for e in errors], axis=0))
    colour = _regressed(raw / count, count)
    if colour.gamma[0] <= 0:
        return colour
    sizes = [next_fast_len(len(e) + max(lags, 1), real=True) for e in errors]
    transforms = [rfft(J, size, axis=0) for J, size in zip(sensitivity, sizes, strict=True)]
    for _ in range(ROUNDS):
        taken = np.zeros(lags)
        inner = np.zeros_like(inverse)
        parts = []
        for J, size, spectrum in zip(sensitivity, sizes, transforms, strict=True):
            gammaJ = _filtered(J, colour.gamma)
            inner += J.T @ gammaJ
            parts.append((size, spectrum, rfft(gammaJ, size, axis=0)))
        middle = inverse @ inner @ inverse
        for size, spectrum, gamma_spectrum in parts:
            # Σ_t (MΓ)_{t,t+k} and its mirror, Σ_t (MΓM)_{t,t+k}: correlations of columns.
            cross = np.sum((spectrum @ inverse).conj() * gamma_spectrum, axis=1)
            both = np.sum((spectrum @ middle).conj() * spectrum, axis=1)
            taken += irfft(both - 2 * cross.real, size)[:lags]
        pairs = sum(np.maximum(len(e) - np.arange(lags), 0) for e in errors)
        fitted = np.zeros(lags)
        fitted[: min(len(colour.gamma), lags)] = colour.gamma[:lags]
        # The correction may not take over: a residual without freedom left says nothing about the noise.
        if (pairs * fitted + taken)[0] < 0.2 * raw[0]:
            break
        colour = _regressed((raw - taken) / count, count)
    return colour


def _lags(errors: list[Array]) -> int:
    longest = max((len(e) for e in errors), default=1)
    return int(max(1, min(ORDERS + SIZES, longest // 4)))


def _raw(e: Array, lags: int) -> Array:
    out = np.zeros(lags)
    for k in range(min(lags, len(e))):
        out[k] = float(np.dot(e[: len(e) - k], e[k:]))
    return out


def _regressed(gamma: Array, count: int) -> Colour:
    """An autoregression's autocovariance: order by n ln σ² + p ln n (Levinson's recursion)."""
    if gamma[0] <= 0 or len(gamma) < 2:
        return Colour(gamma[:1].copy(), 1.0)
    best, chosen = 0.0, 0
    error, a = float(gamma[0]), np.zeros(0)
    for p in range(1, min(ORDERS, len(gamma) - 1) + 1):
        reflection = float(gamma[p] - a @ gamma[1:p][::-1]) / error
        if not abs(reflection) < 1:
            break
        a = np.concatenate([a - reflection * a[::-1], [reflection]])
        error *= 1 - reflection**2
        score = count * np.log(error / gamma[0]) + p * np.log(max(count, 2))
        if score < best:
            best, chosen = float(score), p
    if chosen == 0:
        return Colour(gamma[:1].copy(), 1.0)
    a = np.asarray(solve_toeplitz(gamma[:chosen], gamma[1 : chosen + 1]))
    whole = list(gamma[: chosen + 1])
    most = max(count // 4, chosen + 2)
    quiet = 0
    while len(whole) < most and quiet < chosen + 5:
        whole.append(float(a @ np.array(whole[-1 : -chosen - 1 : -1])))
        quiet = quiet + 1 if abs(whole[-1]) < FORGOTTEN * gamma[0] else 0
    out = np.array(whole)
    return Colour(out, max(1 + 2 * float(np.sum(out[1:] / out[0])), 1.0))


def _filtered(J: Array, gamma: Array) -> Array:
    """Γ J, Γ the Toeplitz matrix of γ; (n, P)."""
    if len(gamma) == 1:
        return np.asarray(gamma[0] * J)
    n, L = len(J), len(gamma)
    size = next_fast_len(n + L, real=True)
    kernel = np.zeros(size)
    kernel[:L] = gamma
    kernel[-(L - 1) :] = gamma[:0:-1]
    return np.asarray(irfft(rfft(J, size, axis=0) * rfft(kernel).real[:, None], size, axis=0)[:n])


def spread_through(sensitivity: list[Array], gamma: Array) -> Array:
    """Σ_kl γ(k−l) J_k J_lᵀ over all runs, (P, P)."""
    return np.asarray(np.sum([J.T @ _filtered(J, gamma) for J in sensitivity], axis=0))
