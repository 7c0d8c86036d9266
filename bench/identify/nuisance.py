"""What a run itself leaves in doubt: estimated with the pad, within the doubt that was stated for it.

- The surface: a few micrometres matter. At m = 2 N/mm, 7 µm are a step of 14 mN at contact, and another law would be
  found to make up for it.
- The stamps of a polled motor's positions, which may all be late together: half a millisecond of a move is a force that
  a mode of some milliseconds would be found to make up for, and with it a greater stiffness.

Each doubt is one number more, under a normal prior with its standard deviation: the depth to add to the positions, and
the time by which they were measured later than stamped. What is certain (CSV) is taken as it is.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from ._kernel import Array
from .laws import Family, Named
from .problem import Problem, Run

FARTHEST = 6.0  # standard deviations that a number may be from what was stated
STEP = 1e-5  # of the greatest depth, for dF^e/dδ


def doubtful(problem: Problem, noise_N: float) -> Problem:
    """The problem with a prior for the surface of every run whose touch-off stated a doubt, and for doubtful stamps.

    `noise_N`: RMS noise of the force; it weighs the prior against the samples.
    """
    noise = (max(noise_N, 1e-9 * problem.force_N) / problem.force_N) ** 2
    runs: list[Run] = []
    surfaces: list[float] = []
    lates = 0
    for run, m in zip(problem.runs, problem.measurements, strict=True):
        if m.surface_std_mm > 0:
            run = replace(run, surface=len(surfaces))
            surfaces.append(noise / (m.surface_std_mm / problem.depth_mm) ** 2)
        if m.stamp_std_s > 0:
            run = replace(run, late=lates)
            lates += 1
        runs.append(run)
    return replace(problem, runs=tuple(runs), prior=(*surfaces, *[noise] * lates), noise_square=noise)


def with_doubts(family: Family, problem: Problem) -> Family:
    """The law with one more θ for each doubtful surface, the depth to add, in units of D; then one for each run of
    doubtful stamps, by how much positions are late, in standard deviations."""
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
        sum(run.surface is not None for run in problem.runs),
        family,
    )


@dataclass(frozen=True)
class Movable(Family):
    """A law whose last numbers move the surfaces of runs, of which there are `surfaces`, and then the times of runs;
    `law` is the law itself."""

    surfaces: int = 0
    law: Family | None = None

    def entry(self, numbers: Named) -> dict[str, Any]:
        """The law's own."""
        assert self.law is not None
        return self.law.entry(numbers)

    def of_run(self, run: Run, dt_s: Array, u: Array, theta: Array, slopes: bool = True) -> tuple[Array, Array]:
        """As `Family.of_run`; the derivatives by the run's own doubts are the stiffness, and that times the speed."""
        law = self.law
        assert law is not None
        k = law.size
        moves: list[tuple[int, Array | float]] = []
        if run.surface is not None:
            moves.append((k + run.surface, 1.0))
        if run.late is not None and len(u) > 1:
            moves.append((k + self.surfaces + run.late, -run.stamp_std_s * _speed(dt_s, u)))
        moved = u + sum(theta[at] * by for at, by in moves) if moves else u
        ds = np.zeros((len(u), self.size))
        s, ds[:, :k] = law.shape(moved, theta[:k])
        if moves and slopes:
            stiffness = (law.shape(moved + STEP, theta[:k])[0] - s) / STEP
            for at, by in moves:
                ds[:, at] = by * stiffness
        return s, ds


def _speed(dt_s: Array, u: Array) -> Array:
    """du/dt (n,), 1/s, over the two steps beside each sample."""
    return np.asarray(np.gradient(u, np.cumsum(dt_s)))


def moved_mm(problem: Problem, theta: Array) -> list[float]:
    """Of each run, the depth added to its positions, mm."""
    first = len(theta) - len(problem.prior)
    return [0.0 if r.surface is None else float(theta[first + r.surface]) * problem.depth_mm for r in problem.runs]


def late_s(problem: Problem, theta: Array) -> list[float]:
    """Of each run, by how much its positions were measured later than their stamps say, s."""
    first = len(theta) - sum(r.late is not None for r in problem.runs)
    return [0.0 if r.late is None else float(theta[first + r.late]) * r.stamp_std_s for r in problem.runs]
