"""Standard errors of the discrete estimates, for residuals of any colour."""

from __future__ import annotations

from typing import Any

import numpy as np

from sim.transfer import zero_order_hold

from .._kernel import Array
from ..uncertainty import windowed
from .estimator import Estimator, Found
from .series import Data
from .system import Structure, simulate


def covariance(data: Data, structure: Structure, estimator: Estimator, found: Found) -> Array:
    """Of v (P, P): M⁻¹ S M⁻ᵀ, M the slope of the sums that the scheme sets to zero, S their variance.

    S is summed over windows as long as the simulated residual remembers (Bartlett's kernel). What a scheme gets wrong
    by construction (ARX under output noise) is in no standard error. γ from data of its own (`fast`) is carried on.

    A surface that touch-off left in doubt adds (dv/ds)(dv/ds)ᵀ of its own variance: the schemes take it as certain,
    and their numbers move with it. Of a filter that all but runs away, whose sensitivities overflow: NaN throughout.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        scores = estimator.scores(data, structure, found.v)
        S = windowed(scores, memory(data, structure, found.v))
    if not np.isfinite(S).all():
        return np.full_like(S, np.nan)
    M = _slope(data, structure, estimator, found.v)
    g = structure.nonlinear
    if found.gamma_covariance is None:
        inverse = _inverse(M)
        return inverse @ S @ inverse.T + _by_surface(data, structure, estimator, found, inverse)
    inverse = _inverse(M[g:, g:])
    by_gamma = -inverse @ M[g:, :g]
    out = np.zeros_like(S)
    out[:g, :g] = found.gamma_covariance
    out[g:, :g] = by_gamma @ found.gamma_covariance
    out[:g, g:] = out[g:, :g].T
    out[g:, g:] = inverse @ S[g:, g:] @ inverse.T + by_gamma @ found.gamma_covariance @ by_gamma.T
    return out + _by_surface(data, structure, estimator, found, None)


def _by_surface(data: Data, structure: Structure, estimator: Estimator, found: Found, inverse: Array | None) -> Array:
    """What the doubtful surfaces add to the covariance of v.

    `inverse`: of the slope M, as the numbers then move by −M⁻¹ ∂(sums)/∂s; None: the scheme is run again, for one whose
    numbers are no zero of its sums (`fast`).
    """
    out = np.zeros((structure.size,) * 2)
    for j, m in enumerate(data.measurements):
        h = m.surface_std_mm
        if not h > 0:
            continue
        ends = [_moved(data.moved(j, sign * h), structure, estimator, found, inverse) for sign in (1, -1)]
        shift = (ends[0] - ends[1]) / 2  # of one standard deviation
        out += np.outer(shift, shift)
    return out


def _moved(data: Data, structure: Structure, estimator: Estimator, found: Found, inverse: Array | None) -> Array:
    if inverse is None:
        return estimator.estimate(data, structure, quick=True, start=found.v).v
    return -inverse @ _sums(data, structure, estimator, found.v)


def _sums(data: Data, structure: Structure, estimator: Estimator, v: Array) -> Array:
    return sum((s.sum(axis=0) for s in estimator.scores(data, structure, v)), np.zeros(structure.size))


def memory(data: Data, structure: Structure, v: Array) -> int:
    """Samples after which the residual's autocorrelation has fallen below a tenth, times two; at least 1."""
    longest = 1
    for run in data.runs:
        e = run.weight * (run.y - simulate(run, structure, v).force)
        n = len(e)
        size = 1 << int(np.ceil(np.log2(2 * n)))
        gamma = np.fft.irfft(np.abs(np.fft.rfft(e, size)) ** 2, size)[: max(n // 4, 1)]
        if gamma[0] <= 0:
            continue
        small = np.flatnonzero(gamma < 0.1 * gamma[0])
        longest = max(longest, 2 * int(small[0]) - 1 if len(small) else n // 4)
    return longest


def independent(data: Data, structure: Structure, v: Array) -> float:
    """How many independent samples the residual is worth; at least ten."""
    return max(2 * data.weight / (memory(data, structure, v) + 1), 10.0)


def relaxation_jacobian(shares: list[float], rates: list[float], T: float) -> Array:
    """∂(a_1 … a_r, b_1 … b_r)/∂(c_1 … c_r, ν_1 … ν_r) of the zero-order hold, (2r, 2r)."""
    x = np.array([*shares, *rates])
    r = len(shares)
    out = np.empty((2 * r, 2 * r))
    for j in range(2 * r):
        h = 1e-5 * x[j] if j >= r else 1e-5
        sides = []
        for sign in (1, -1):
            y = x.copy()
            y[j] += sign * h
            filter = zero_order_hold(y[:r].tolist(), y[r:].tolist(), T)
            sides.append(np.array([*filter.a[1:], *filter.b[1:]]))
        out[:, j] = (sides[0] - sides[1]) / (2 * h)
    return out


def _slope(data: Data, structure: Structure, estimator: Estimator, v: Array) -> Array:
    P = structure.size
    out = np.empty((P, P))
    for j in range(P):
        h = 1e-6 * max(abs(v[j]), 1e-4)
        sums = []
        for sign in (1, -1):
            near = v.copy()
            near[j] += sign * h
            sums.append(_sums(data, structure, estimator, near))
        out[:, j] = (sums[0] - sums[1]) / (2 * h)
    return out


def _inverse(M: Array) -> Array:
    rows = np.linalg.norm(M, axis=1)
    rows[rows == 0] = 1.0
    columns = np.linalg.norm(M / rows[:, None], axis=0)
    columns[columns == 0] = 1.0
    scaled: Any = np.linalg.pinv(M / rows[:, None] / columns, rcond=1e-14)
    return np.asarray(scaled / columns[:, None] / rows)
