"""A shorter stand-in for long data, on which models are searched and compared before the last polish."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from .motion import holds
from .problem import Problem, Run

TARGET = 6000  # samples left, at most about
SHORT = 1500  # samples that need no stand-in
GROWTH = 0.06  # length of a block in a hold, of the time since the hold began
BLOCKS = 6.0  # times 1/GROWTH, blocks in a hold, about


def condensed(problem: Problem, target: int = TARGET, growth: float = GROWTH) -> tuple[Problem, list[NDArray[np.intp]]]:
    """Block means that keep what the model feels: (the shorter problem, of each run the block of every sample).

    In a hold the blocks grow with the time since its start, as relaxation slows down; in motion they are of equal
    length. A block weighs as many samples as it stands for. Data that are short already come back as they are.
    `growth`: length of a block in a hold, of the time since it began (more where there are too many holds).
    """
    moving, blocks_of_holds = 0, 0
    still = [holds(run.time_s, run.u) for run in problem.runs]
    for run, stretches in zip(problem.runs, still, strict=True):
        held = sum(s.stop - s.start for s in stretches)
        moving += run.size - held
        blocks_of_holds += sum(min(int(BLOCKS / growth), s.stop - s.start) for s in stretches)
    if problem.size <= SHORT:
        return problem, [np.arange(run.size) for run in problem.runs]
    length = max(1, int(np.ceil(moving / max(target - blocks_of_holds, target // 3))))
    growth *= max(1.0, blocks_of_holds / target)
    runs: list[Run] = []
    owners: list[NDArray[np.intp]] = []
    for run, stretches in zip(problem.runs, still, strict=True):
        owner = _blocks(run, stretches, length, growth)
        runs.append(_averaged(run, owner))
        owners.append(owner)
    short = replace(problem, runs=tuple(runs))
    return short, owners


def _blocks(run: Run, stretches: list[slice], length: int, growth: float) -> NDArray[np.intp]:
    starts = []
    at = 0
    for s in [*stretches, slice(run.size, run.size)]:
        starts.append(np.arange(at, s.start, length))
        n = s.stop - s.start
        if n:
            # Without force the pad may have let go: there the surface comes back in its own time.
            rate = growth if float(np.median(np.abs(run.y[s]))) > 0.02 else growth / 5
            grid = [0.0]
            while grid[-1] < n:
                grid.append(grid[-1] + max(1.0, rate * grid[-1]))
            starts.append(s.start + np.unique(np.array(grid[:-1]).astype(np.intp)))
        at = s.stop
    first = np.zeros(run.size, dtype=np.intp)
    first[np.unique(np.concatenate(starts)).astype(np.intp)] = 1
    first[0] = 0
    # A run's first sample stays alone: the jump from rest to it is part of the motion.
    if run.size > 1:
        first[1] = 1
    return np.cumsum(first)


def _averaged(run: Run, owner: NDArray[np.intp]) -> Run:
    count = np.bincount(owner).astype(float)
    weight = np.asarray(np.bincount(owner, run.weight), dtype=np.float64)
    # Where a block has forces, its time and depth are theirs: nodes without force must not pull them away.
    share = np.where(weight[owner] > 0, run.weight, 1.0)
    count = np.where(weight > 0, weight, count)
    time = np.bincount(owner, share * run.time_s) / count
    u = np.bincount(owner, share * run.u) / count
    with np.errstate(invalid="ignore"):
        y = np.where(weight > 0, np.bincount(owner, run.weight * run.y) / weight, 0.0)
    return Run(time, np.diff(time, prepend=time[0]), u, y, weight, run.surface, run.past, run.stamp_std_s, run.late)
