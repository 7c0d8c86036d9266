"""Whether a hidden effect can be seen at all: the misfit that stays when the believed structure is refitted.

The data are free of noise; what is left of them after the refit is counted in units of the noise,

    χ² = Σ (residual/σ)²,    σ² = σ_F² + (K(δ) σ_x)²,

whitened where the noise is coloured, and by the information of a location where its tails are heavy. An effect is
called detectable from χ² ≥ 60. The refit has its own simulator: the plain quasi-linear pad on the reported motion,
F^e linear between nodes. Stuck samples are counted by how unlikely their repeats are.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numba import njit
from scipy.interpolate import CubicSpline
from scipy.optimize import least_squares

from .cases import Case, Truth
from .laws import Exponential, Law, Polynomial, Power
from .noise import Coloured, Quantised, White
from .pad import Pad

ENOUGH = 60.0
LAW_POINTS = 15
"""Of a law of which nothing is known."""


@dataclass(frozen=True)
class Misfit:
    """chi2: of the structure refitted; faults: of outliers and stuck samples; rmse_N: of the clean residual."""

    chi2: float
    faults: float
    rmse_N: float
    refitted: Pad
    residual_N: np.ndarray

    @property
    def detectable(self) -> bool:
        """Whether anything can be seen."""
        return self.chi2 + self.faults >= ENOUGH


@njit(cache=True)
def _run(u, h, c, nu, unilateral):
    """Force at nodes (n,) of the plain pad; u (n,) elastic force, h (n−1,) steps in s."""
    n, r = u.shape[0], c.shape[0]
    force, z = np.zeros(n), np.zeros(r)
    e, k = np.zeros(r), np.zeros(r)
    force[0] = u[0]
    before, last_h = 0.0, -1.0
    for j in range(1, n):
        if h[j - 1] != last_h:
            last_h = h[j - 1]
            for i in range(r):
                e[i] = np.exp(-nu[i] * last_h)
                k[i] = (1 - e[i]) / (nu[i] * last_h)
        held, remembered = 1.0, 0.0
        for i in range(r):
            held -= c[i] * (1 - k[i])
            remembered += c[i] * (before * k[i] + (z[i] - before) * e[i])
        now = u[j]
        if unilateral and held * now < remembered:
            now = max(remembered / held, 0.0)
        for i in range(r):
            z[i] = now - (now - before) * k[i] + (z[i] - before) * e[i]
        force[j] = held * now - remembered
        before = now
    return force


class Lab:
    """The plain pad on the reported motion of a case, as the lab would simulate it had it no noise."""

    def __init__(self, truth: Truth, chosen: np.ndarray | None = None, step_mm: float = 0.01) -> None:
        """Nodes after each `step_mm` of way or 20 ms, and at the force samples (those of the indices `chosen`)."""
        fine, label = truth.fine, truth.label_time_s
        label = label if chosen is None else label[chosen]
        way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(fine.reported_mm)))])
        count = np.floor(way / step_mm + 1e-9) + np.floor(fine.time_s / 0.02 + 1e-9)
        often = np.flatnonzero(np.diff(count) > 0) + 1
        moves = np.diff(way) > 1e-12
        edges = np.flatnonzero(np.diff(moves.astype(int))) + 1
        self.nodes = np.unique(np.concatenate([[0.0], fine.time_s[often], fine.time_s[edges], label]))
        # Nodes a rounding apart are one; equal steps come in runs, and share their exponentials.
        self.nodes = self.nodes[np.concatenate([[True], np.diff(self.nodes) > 1e-9])]
        self.h = np.round(np.diff(self.nodes), 12)
        self.depth_mm = np.interp(self.nodes, fine.time_s, fine.reported_mm)
        self.at = np.minimum(np.searchsorted(self.nodes, label - 1e-9), len(self.nodes) - 1)
        # How far the motion went in the last 60 ms.
        recent = np.interp(label + 1e-3, fine.time_s, way) - np.interp(label - 0.06, fine.time_s, way)
        self.lively = recent > 1e-9

    def along(self, pad: Pad) -> np.ndarray:
        """Force in N at the nodes."""
        u = pad.law.force(self.depth_mm)
        return _run(u, self.h, np.array(pad.shares), np.array(pad.rates), pad.contact == "unilateral")

    def force(self, pad: Pad) -> np.ndarray:
        """Force in N at the force samples."""
        return self.along(pad)[self.at]


ForceOf = Callable[[Lab, np.ndarray], np.ndarray]


def _coordinates(pad: Pad) -> np.ndarray:
    """Numbers without bounds: shares as logits against c_0, rates and stiffnesses as logarithms."""
    rest = np.log(max(1 - sum(pad.shares), 1e-6))
    shares = [np.log(c) - rest for c in pad.shares]
    return np.array([*_law_coordinates(pad.law), *shares, *np.log(pad.rates)])


def _law_coordinates(law: Law) -> list[float]:
    if isinstance(law, Exponential):
        return [np.log(law.m), law.b]
    if isinstance(law, Power):
        return [np.log(law.p), np.log(law.q + 1)]
    if isinstance(law, Polynomial):
        return list(law.alpha[1:])
    raise ValueError(f"no coordinates for {law}")


def _pad(like: Pad, x: np.ndarray) -> Pad:
    n, r = len(x) - 2 * len(like.rates), len(like.rates)
    law: Law
    if isinstance(like.law, Exponential):
        b = x[1] if abs(x[1]) > 1e-6 else 1e-6
        law = Exponential(float(np.exp(x[0])), float(b))
    elif isinstance(like.law, Power):
        law = Power(float(np.exp(x[0])), float(np.expm1(x[1])))
    else:
        law = Polynomial((0.0, *x[:n].tolist()))
    odds = np.exp(np.clip(x[n : n + r], -25, 25))
    shares = odds / (1 + odds.sum())
    rates = np.exp(np.clip(x[n + r :], -12, 9))
    return Pad(law, tuple(shares.tolist()), tuple(rates.tolist()), like.contact)


def _thinned(lab: Lab, most: int = 2500) -> tuple[np.ndarray, np.ndarray]:
    """Samples to fit, and their weights: lively and quiet ones thinned apart."""
    index, weight = [], []
    for kind in (lab.lively, ~lab.lively):
        where = np.flatnonzero(kind)
        every = max(1, -(-len(where) // most))
        index.append(where[every // 2 :: every])
        weight.append(np.full(len(index[-1]), np.sqrt(every)))
    order = np.argsort(np.concatenate(index), kind="stable")
    return np.concatenate(index)[order], np.concatenate(weight)[order]


def _sigma(truth: Truth, lab: Lab) -> np.ndarray:
    """Deviation of the noise at each force sample, N."""
    depth, h = lab.depth_mm[lab.at], 1e-4
    stiffness = (truth.pad.law.force(depth + h) - truth.pad.law.force(depth - h)) / (2 * h)
    return np.sqrt(truth.noise.std**2 + (stiffness * truth.position_std_mm) ** 2)


def _whitened(noise: White | Quantised, time_s: np.ndarray, left: np.ndarray) -> np.ndarray:
    return noise.whiten(time_s, left[:, None])[:, 0]


def of_the_pad(truth: Truth, lab: Lab, weighed: Callable[[np.ndarray], np.ndarray]) -> list[np.ndarray]:
    """How the plain pad's weighed force goes with each of its numbers, up to a factor."""
    x = _coordinates(truth.structure)
    steps = [1e-4 * max(abs(x[k]), 0.1) * (np.arange(len(x)) == k) for k in range(len(x))]
    pads = [(_pad(truth.structure, x + h), _pad(truth.structure, x - h)) for h in steps]
    return [weighed(lab.force(above) - lab.force(below)) for above, below in pads]


def of_any_law(truth: Truth, lab: Lab, weighed: Callable[[np.ndarray], np.ndarray]) -> list[np.ndarray]:
    """How the plain pad's weighed force goes with its law at each of some depths, a cubic curve between; up to a
    factor."""
    pad, depth = truth.structure, np.maximum(lab.depth_mm, 0.0)
    shares, rates, lets_go = np.array(pad.shares), np.array(pad.rates), pad.contact == "unilateral"
    u = pad.law.force(lab.depth_mm)
    h = 1e-4 * float(np.abs(u).max())
    points = np.linspace(0.0, float(depth.max()), LAW_POINTS + 1)
    out = []
    for own in np.eye(LAW_POINTS + 1)[1:]:
        curve = h * CubicSpline(points, own, bc_type="natural")(depth)
        above, below = (_run(u + way * curve, lab.h, shares, rates, lets_go) for way in (1.0, -1.0))
        out.append(weighed((above - below)[lab.at]))
    return out


def freed(own: np.ndarray, columns: list[np.ndarray]) -> np.ndarray:
    """What of a signature no sum of the columns makes."""
    J = np.stack(columns, axis=1)
    J = J / np.maximum(np.linalg.norm(J, axis=0), 1e-300)
    return own - J @ np.linalg.lstsq(J, own, rcond=None)[0]


def fitted(truth: Truth, x: np.ndarray, force_of: ForceOf, most: int = 400) -> tuple[np.ndarray, float, np.ndarray]:
    """(numbers, χ², residual in N) of a structure fitted to the case without noise, from `x`.

    force_of: (lab, numbers) → force at the lab's samples, N. most: evaluations of the first of the two fits.
    """
    lab = Lab(truth)
    sigma = _sigma(truth, lab)
    index, weight = _thinned(lab)
    scale, wanted, few = weight / sigma[index], truth.clean_N[index], Lab(truth, index)

    def left(x: np.ndarray) -> np.ndarray:
        return np.clip((force_of(few, x) - wanted) * scale, -1e8, 1e8)

    x = least_squares(left, x, method="lm", x_scale="jac", max_nfev=most, ftol=1e-8, xtol=1e-8).x
    if isinstance(truth.noise, Coloured):
        # What is far in the sum of squares may be near in the whitened one: a few steps more over all samples.
        def whole(x: np.ndarray) -> np.ndarray:
            off = (force_of(lab, x) - truth.clean_N) * truth.noise.std / sigma
            return np.clip(_whitened(truth.noise, truth.label_time_s, off), -1e8, 1e8)

        x = least_squares(whole, x, method="lm", x_scale="jac", max_nfev=150, ftol=1e-4).x
    residual = truth.clean_N - force_of(lab, x)
    in_units = _whitened(truth.noise, truth.label_time_s, residual * truth.noise.std / sigma)
    return x, float(np.sum(in_units**2)), residual


def misfit(case: Case) -> Misfit:
    """Refit the believed structure to the case without noise, and weigh what is left."""
    truth = case.truth
    start = _coordinates(truth.structure)
    x, chi2, residual = fitted(truth, start, lambda lab, x: lab.force(_pad(truth.structure, x)))
    faults = _faults(truth, _sigma(truth, Lab(truth)))
    rmse_N = float(np.sqrt(np.mean(residual**2)))
    return Misfit(chi2, faults, rmse_N, _pad(truth.structure, x), residual)


def sampling(case: Case) -> float:
    """χ² that coarse sampling alone makes: the plain pad on the motion at the rows, linear between, against the motion.

    Where this is not small against 60 the rows do not tell enough of the motion, and a finding may be due to that.
    """
    truth = case.truth
    lab, rows = Lab(truth), truth.row_time_s
    u = truth.structure.law.force(truth.reported_mm)
    c, nu = np.array(truth.structure.shares), np.array(truth.structure.rates)
    coarse = _run(u, np.diff(rows), c, nu, truth.structure.contact == "unilateral")
    left = np.interp(truth.label_time_s, rows, coarse) - lab.force(truth.structure)
    return float(np.sum((left / _sigma(truth, lab)) ** 2))


def _faults(truth: Truth, sigma: np.ndarray) -> float:
    """Outliers by their size; stuck samples by minus twice the logarithm of the odds of as many repeats."""
    total = 0.0
    if "outlier" in truth.flags:
        total += float(np.sum((truth.fault_N / sigma)[truth.flags["outlier"]] ** 2))
    if "stuck" in truth.flags:
        step = truth.noise.step if isinstance(truth.noise, Quantised) else 1e-9 * truth.noise.std
        repeat = min(step / (2 * np.sqrt(np.pi) * truth.noise.std), 0.5)
        total += float(-2 * np.log(repeat) * truth.flags["stuck"].sum())
    return total
