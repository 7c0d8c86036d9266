"""Standard errors that hold under coloured residuals, uneven noise, a doubtful surface and doubtful stamps."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import stdtrit

from . import objective
from ._kernel import Array
from .colour import corrected_colour, plain_colour, spread_through
from .estimate import Estimate
from .objective import Structure
from .problem import Problem

TELLING = 2.0  # standard deviations of its own by which the scores must say more


@dataclass(frozen=True)
class Spread:
    """Covariance of x (P, P), in the scaled units; `samples`: how many independent ones the residual is worth."""

    covariance: Array
    samples: float


def spread_of(problem: Problem, estimate: Estimate) -> Spread:
    """Sandwich H⁻¹ S H⁻¹ (`sandwich`). The prior of a run's doubts adds its own spread, and so does what may be off all
    along a run and was taken as it is: a surface, stamps, what an axis gives way. Variables at a bound have none.
    """
    P = estimate.structure.size
    sensitivity, errors = _per_sample(problem, estimate)
    free = _free(estimate)
    inverse = np.zeros((P, P))
    H = estimate.matrix[np.ix_(free, free)]
    inverse[np.ix_(free, free)] = _inverted(H)
    believed = np.diag(objective.prior_of(problem, estimate.structure)) * problem.noise_square
    spread = sandwich(errors, sensitivity, inverse, believed, int(free.sum()))
    covariance = spread.covariance.copy()
    for off in _taken_as_they_are(problem, estimate):
        moved = inverse @ off
        covariance += np.outer(moved, moved)
    return Spread(covariance, spread.samples)


def sandwich(errors: list[Array], sensitivity: list[Array], inverse: Array, believed: Array, free: int) -> Spread:
    """H⁻¹ S H⁻¹ by two forms of S; of each run, errors (n,) and their derivatives J (n, P) in the same units.

    - S = Σ J_k γ(k−l) J_lᵀ with the noise's autocovariance γ (`colour`): steady, but holds for even noise;
    - S from the scores J e themselves, summed over windows as long as the residual remembers (Bartlett's kernel):
      holds where the noise grows with depth or the model does not fit, but is uncertain itself (H. White, Econometrica
      48, 1980; W. Newey, K. West, Econometrica 55, 1987). Where it says more than the first by more than its own
      doubt, it counts.
    Both are widened by Student's factor for the few samples that the residual may be worth. `inverse` (P, P): H⁻¹, 0
    where nothing is `free`; `believed` (P, P): what priors add to S.
    """
    scores = [J * e[:, None] for J, e in zip(sensitivity, errors, strict=True)]
    colour = corrected_colour(errors, sensitivity, inverse)
    by_colour = inverse @ (spread_through(sensitivity, colour.gamma) + believed) @ inverse
    window = int(min(np.ceil(2 * colour.memory), max(len(e) for e in errors)))
    by_scores = inverse @ (windowed(scores, window) + believed) @ inverse
    independent = sum(len(e) for e in errors) / colour.memory
    freedom = max(independent - free, 1.0)
    even, uneven = np.diag(by_colour), np.diag(by_scores) * independent / freedom
    doubt = np.sqrt(2 / contributions(scores, inverse, window))
    with np.errstate(invalid="ignore", divide="ignore"):
        ratio = np.where(even > 0, uneven / even, 1.0)
    ratio = np.where(ratio > 1 + TELLING * doubt, ratio, 1.0)
    widened = np.sqrt(ratio) * student(freedom)
    return Spread(np.asarray(by_colour * np.outer(widened, widened)), independent)


def student(freedom: float) -> float:
    """What makes ±1.96 standard errors a 95 % interval when the noise itself was estimated."""
    return float(stdtrit(min(max(freedom, 2.0), 1e6), 0.975) / 1.959964)


def independent_samples(problem: Problem, x: Array, structure: Structure) -> float:
    """How many independent samples the residual at x is worth; at least ten."""
    errors = []
    for run, (force, _, _) in zip(problem.runs, objective.forces(problem, structure, x), strict=True):
        errors.append((np.sqrt(run.weight) * (run.y - force))[run.weight > 0])
    return max(sum(len(e) for e in errors) / plain_colour(errors).memory, 10.0)


def contributions(scores: list[Array], inverse: Array, window: int) -> Array:
    """How many independent stretches of the data carry each variable, (P,): (Σ q)²/Σ q² of their squares."""
    first, second = np.zeros(inverse.shape[0]), np.zeros(inverse.shape[0])
    for g in scores:
        if len(g):
            pulls = np.add.reduceat(g, np.arange(0, len(g), max(window, 1)), axis=0) @ inverse
            first += np.sum(pulls**2, axis=0)
            second += np.sum(pulls**4, axis=0)
    with np.errstate(invalid="ignore", divide="ignore"):
        return np.maximum(np.where(second > 0, first**2 / second, 1.0), 1.0)


def _free(estimate: Estimate) -> np.ndarray:
    lower, upper = estimate.bounds.of(estimate.structure)
    x = estimate.x
    k, r = estimate.structure.shape_size, estimate.structure.order
    free = (x > lower) & (x < upper)
    free[k + r] = True  # c_0 at 0 is a share like others: what it might be is part of their doubt
    for i in range(r):  # a mode without a share has no rate
        shared = bool(x[k + r + 1 + i] > 0)
        free[k + i] &= shared
        for j in range(estimate.structure.pasts):
            free[estimate.structure.past(j).start + i] &= shared
    return free


def _inverted(H: Array) -> Array:
    scale = np.sqrt(np.diag(H))
    scale[scale == 0] = 1.0
    values, vectors = np.linalg.eigh(H / np.outer(scale, scale))
    values = np.maximum(values, 1e-10 * max(values.max(initial=0.0), 1e-300))
    return np.asarray((vectors / values) @ vectors.T / np.outer(scale, scale))


def _per_sample(problem: Problem, estimate: Estimate) -> tuple[list[Array], list[Array]]:
    """Of each run, over the samples that count: J, e.

    A block of w samples counts as one: e √w, J √w.
    """
    structure, x = estimate.structure, estimate.x
    sensitivities, errors = [], []
    for run in problem.runs:
        J_parts, e_parts = [], []
        for piece in objective.simulate(run, structure, x, derivatives=True):
            weight = run.weight[piece.at]
            counts = weight > 0
            root = np.sqrt(weight[counts])
            J_parts.append(piece.jacobian[counts] * root[:, None])
            e_parts.append((run.y[piece.at][counts] - piece.force[counts]) * root)
        sensitivities.append(np.concatenate(J_parts))
        errors.append(np.concatenate(e_parts))
    return sensitivities, errors


def _taken_as_they_are(problem: Problem, estimate: Estimate) -> list[Array]:
    """Of each run whose positions may be off all along and were taken as they are: Σ w J δF, (P,), of each way in which
    they may be, δF what one deviation of it makes: a surface for certain, what the axis gives way for known, and stamps
    for right. A model driven by motion that is late by τ is itself late: there δF = −τ dF/dt, with the slope over the
    two steps beside.
    """
    structure, x = estimate.structure, estimate.x
    out = []
    for run, m in zip(problem.runs, problem.measurements, strict=True):
        late = run.stamp_std_s > 0 and run.late is None and run.size >= 3
        off_mm = [np.full(run.size, m.surface_std_mm)] if m.surface_std_mm > 0 and run.surface is None else []
        off_mm += [np.interp(run.time_s, *m.way_doubt)] if m.way_doubt is not None else []
        if not (late or off_mm):
            continue
        pieces = list(objective.simulate(run, structure, x, derivatives=True))
        force = np.concatenate([piece.force for piece in pieces])
        changes = [-run.stamp_std_s * np.gradient(force, run.time_s)] if late else []
        for by_mm in off_mm:
            moved = objective.simulate(replace(run, u=run.u + by_mm / problem.depth_mm), structure, x)
            changes.append(np.concatenate([piece.force for piece in moved]) - force)
        for change in changes:
            weighted = run.weight * change
            out.append(np.asarray(np.sum([p.jacobian.T @ weighted[p.at] for p in pieces], axis=0), dtype=np.float64))
    return out


def windowed(scores: list[Array], width: int) -> Array:
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
