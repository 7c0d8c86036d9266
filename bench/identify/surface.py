"""A surface that is not quite where touch-off put it: estimated with the pad, within the doubt that touch-off stated.

A few micrometres matter: at m = 2 N/mm, 7 µm are a step of 14 mN at contact, and another law would be found to make
up for it. Each run with a stated doubt gets one number more, the depth to add to its positions, under a normal prior
with that standard deviation; positions whose surface is certain (CSV) are taken as they are.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ._kernel import Array
from .laws import Family, Named
from .problem import Problem, Run

FARTHEST = 6.0  # standard deviations that a surface may be moved
STEP = 1e-5  # of the greatest depth, for dF^e/dδ


def doubtful(problem: Problem, noise_N: float) -> Problem:
    """The problem with a prior for the surface of every run whose touch-off stated a doubt.

    `noise_N`: RMS noise of the force; it weighs the prior against the samples.
    """
    noise = (max(noise_N, 1e-9 * problem.force_N) / problem.force_N) ** 2
    runs: list[Run] = []
    prior: list[float] = []
    for run, m in zip(problem.runs, problem.measurements, strict=True):
        if m.surface_std_mm > 0:
            runs.append(replace(run, surface=len(prior)))
            prior.append(noise / (m.surface_std_mm / problem.depth_mm) ** 2)
        else:
            runs.append(run)
    return replace(problem, runs=tuple(runs), prior=tuple(prior), noise_square=noise)


def with_surfaces(family: Family, problem: Problem) -> Family:
    """The law with one more θ for each doubtful surface: the depth to add, in units of D."""
    count = len(problem.prior)
    if count == 0:
        return family
    most = FARTHEST * np.sqrt(problem.noise_square / np.array(problem.prior))
    starts = np.hstack([family.starts, np.zeros((len(family.starts), count))])
    return Movable(
        family.name,
        family.size + count,
        np.concatenate([family.lower, -most]),
        np.concatenate([family.upper, most]),
        starts,
        lambda u, theta: family.shape(u, theta[: family.size]),
        lambda theta, gain, depth: family.physical_numbers(theta[: family.size], gain, depth),
        family.degree,
        count,
        family,
    )


@dataclass(frozen=True)
class Movable(Family):
    """A law whose last `surfaces` numbers move the surfaces of runs; `law` is the law itself."""

    surfaces: int = 0
    law: Family | None = None

    def entry(self, numbers: Named) -> dict[str, Any]:
        """The law's own."""
        assert self.law is not None
        return self.law.entry(numbers)

    def of_run(self, u: Array, theta: Array, surface: int | None, slopes: bool = True) -> tuple[Array, Array]:
        """As `Family.of_run`; the derivative by the run's own surface is the stiffness."""
        law = self.law
        assert law is not None
        k = law.size
        ds = np.zeros((len(u), self.size))
        if surface is None:
            s, ds[:, :k] = law.shape(u, theta[:k])
            return s, ds
        moved = u + theta[k + surface]
        s, ds[:, :k] = law.shape(moved, theta[:k])
        if not slopes:
            return s, ds
        ds[:, k + surface] = (law.shape(moved + STEP, theta[:k])[0] - s) / STEP
        return s, ds


def moved_mm(problem: Problem, family: Family, theta: Array) -> list[float]:
    """Of each run, the depth added to its positions, mm."""
    first = family.law.size if isinstance(family, Movable) and family.law is not None else len(theta)
    return [0.0 if r.surface is None else float(theta[first + r.surface]) * problem.depth_mm for r in problem.runs]
