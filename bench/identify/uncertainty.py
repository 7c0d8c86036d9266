"""Standard errors that hold under coloured residuals, uneven noise, and a doubtful surface."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from . import objective
from ._kernel import Array
from .estimate import Estimate
from .objective import Structure
from .problem import Problem

MOST = 400_000  # samples kept one by one; beyond, neighbours are summed


@dataclass(frozen=True)
class Spread:
    """Covariance of x (P, P), in the scaled units; `samples`: how many independent ones the residual is worth."""

    covariance: Array
    samples: float


def spread_of(problem: Problem, estimate: Estimate) -> Spread:
    """Sandwich H⁻¹ S H⁻¹, H = Σ J Jᵀ, in two forms; of each variable the larger variance counts.

    - S from the scores J e themselves, summed over windows as long as the residual remembers (Bartlett's kernel):
      holds where the noise grows with depth or the model does not fit, poor where few samples carry a parameter;
    - S = Σ J_k γ(k−l) J_lᵀ with the residual's autocovariance γ over all the data: steady, but holds for even noise.
    The prior of a doubtful surface adds its own spread. Variables at a bound have none.
    """
    P = estimate.structure.size
    scores, sensitivity, errors = _per_sample(problem, estimate)
    total = sum(len(e) for e in errors)
    gamma, lags = _autocovariance(errors)
    free = _free(estimate)
    inverse = np.zeros((P, P))
    H = estimate.matrix[np.ix_(free, free)]
    inverse[np.ix_(free, free)] = _inverted(H)
    believed = np.diag(objective.prior_of(problem, estimate.structure)) * problem.noise_square
    by_scores = inverse @ (_windowed(scores, 2 * lags) + believed) @ inverse
    by_colour = inverse @ (_coloured(sensitivity, gamma) + believed) @ inverse
    independent = total / _memory(gamma)
    freedom = min(independent / max(independent - free.sum(), 1.0), 3.0)  # what the fit itself took out of the residual
    widest = np.sqrt(np.maximum(np.maximum(np.diag(by_scores), np.diag(by_colour)), 0.0) * freedom)
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.where(np.diag(by_colour) > 0, widest / np.sqrt(np.abs(np.diag(by_colour))), 1.0)
    covariance = by_colour * np.outer(ratio, ratio)
    return Spread(covariance, problem.weight / _memory(gamma))


def independent_samples(problem: Problem, x: Array, structure: Structure) -> float:
    """How many independent samples the residual at x is worth; at least ten."""
    errors = []
    for run, (force, _, _) in zip(problem.runs, objective.forces(problem, structure, x), strict=True):
        errors.append((run.y - force)[run.weight > 0])
    gamma, _ = _autocovariance(errors)
    return max(sum(len(e) for e in errors) / _memory(gamma), 10.0)


def _memory(gamma: Array) -> float:
    """1 + 2 Σ ρ: how many samples in a row say the same."""
    return max(1 + 2 * float(np.sum(gamma[1:] / gamma[0])), 1.0) if gamma[0] > 0 else 1.0


def _free(estimate: Estimate) -> np.ndarray:
    lower, upper = estimate.bounds.of(estimate.structure)
    x = estimate.x
    k, r = estimate.structure.family.size, estimate.structure.order
    free = (x > lower) & (x < upper)
    for i in range(r):  # a mode without a share has no rate
        free[k + i] &= bool(x[k + r + 1 + i] > 0)
    return free


def _inverted(H: Array) -> Array:
    scale = np.sqrt(np.diag(H))
    scale[scale == 0] = 1.0
    values, vectors = np.linalg.eigh(H / np.outer(scale, scale))
    values = np.maximum(values, 1e-13 * max(values.max(initial=0.0), 1e-300))
    return np.asarray((vectors / values) @ vectors.T / np.outer(scale, scale))


def _per_sample(problem: Problem, estimate: Estimate) -> tuple[list[Array], list[Array], list[Array]]:
    """Of each run, over the samples that count: scores e J, J, e.

    In long data each row stands for m neighbours: Σ e J, Σ J/√m, Σ e/√m.
    """
    structure, x = estimate.structure, estimate.x
    m = max(1, int(np.ceil(problem.weight / MOST)))
    scores, sensitivities, errors = [], [], []
    for run in problem.runs:
        score_parts, J_parts, e_parts = [], [], []
        for piece in objective.simulate(run, structure, x, derivatives=True):
            counts = run.weight[piece.at] > 0
            J = piece.jacobian[counts]
            e = run.y[piece.at][counts] - piece.force[counts]
            score_parts.append(_summed(J * e[:, None], m))
            J_parts.append(_summed(J, m) / np.sqrt(m))
            e_parts.append(_summed(e[:, None], m)[:, 0] / np.sqrt(m))
        scores.append(np.concatenate(score_parts))
        sensitivities.append(np.concatenate(J_parts))
        errors.append(np.concatenate(e_parts))
    return scores, sensitivities, errors


def _summed(rows: Array, m: int) -> Array:
    return rows if m == 1 or len(rows) == 0 else np.add.reduceat(rows, np.arange(0, len(rows), m), axis=0)


def _autocovariance(errors: list[Array]) -> tuple[Array, int]:
    """γ(0) … γ(L) of the residual, up to where it has died away (2 %, or its own error), L+1."""
    longest = max(len(e) for e in errors)
    total = sum(len(e) for e in errors)
    most = max(longest // 4, 1)
    gamma = np.zeros(most)
    for e in errors:
        size = 1 << int(np.ceil(np.log2(2 * len(e))))
        power = np.abs(np.fft.rfft(e, size)) ** 2
        raw = np.fft.irfft(power, size)[: min(most, len(e))]
        gamma[: len(raw)] += raw
    gamma /= total
    if gamma[0] <= 0:
        return gamma[:1], 1
    small = np.flatnonzero(gamma / gamma[0] < max(0.02, 1.5 / np.sqrt(total)))
    last = int(small[0]) if len(small) else most
    return gamma[: max(last, 1)], max(last, 1)


def _windowed(scores: list[Array], width: int) -> Array:
    """Σ_kl w(k−l) g_k g_lᵀ with Bartlett's w, by sums over all windows of `width` samples."""
    P = scores[0].shape[1]
    out = np.zeros((P, P))
    for g in scores:
        if width <= 1:
            out += g.T @ g
            continue
        padded = np.concatenate([np.zeros((1, P)), np.cumsum(g, axis=0)])
        n = len(g)
        ends = np.minimum(np.arange(1, n + width), n)
        begins = np.maximum(np.arange(1 - width, n), 0)
        windows = padded[ends] - padded[begins]
        out += windows.T @ windows / width
    return out


def _coloured(sensitivity: list[Array], gamma: Array) -> Array:
    """Σ_kl γ(k−l) J_k J_lᵀ, by Fourier transform (the kernel tapered to stay non-negative)."""
    P = sensitivity[0].shape[1]
    out = np.zeros((P, P))
    L = len(gamma)
    for J in sensitivity:
        if L == 1:
            out += gamma[0] * (J.T @ J)
            continue
        n = len(J)
        size = 1 << int(np.ceil(np.log2(n + L)))
        kernel = np.zeros(size)
        kernel[:L] = gamma
        kernel[-(L - 1) :] = gamma[:0:-1]
        spectrum = np.maximum(np.fft.rfft(kernel).real, 0.0)
        fold = np.full(len(spectrum), 2.0)
        fold[0] = fold[-1] = 1.0
        transformed = np.fft.rfft(J, size, axis=0)
        out += np.real((transformed.conj() * (fold * spectrum)[:, None]).T @ transformed) / size
    return out
