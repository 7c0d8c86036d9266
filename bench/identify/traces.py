"""Measurements beside their simulation, and the figures of merit over them."""

from __future__ import annotations

import math

import numpy as np

from bench.recording.types import Measurement

from . import objective
from ._kernel import Array
from .estimate import Estimate
from .long import stretches
from .objective import Simulation, Structure
from .problem import PIECE, Problem
from .result import Trace
from .runs import Run


def traces_of(problem: Problem, best: Estimate) -> list[Trace]:
    """Of each measurement, at its force stamps."""
    out = []
    structure, x = best.structure, best.x
    for m, run, at in zip(problem.measurements, problem.runs, problem.where, strict=True):
        if not len(at):
            out.append(_traced(m, structure, x, run, problem.depth_mm, problem.force_N))
            continue
        model = np.concatenate([piece.force for piece in objective.simulate(run, structure, x)])[at]
        position = run.u[at] * problem.depth_mm
        out.append(Trace(m.name, m.force_time_s, position, m.force_N, model * problem.force_N, run.weight[at] > 0))
    return out


def figures_of(traces: list[Trace]) -> tuple[int, float, float]:
    """Samples that count, V in N², and the fit in per cent; in pieces, so that long data need no copies."""
    count, level = 0, 0.0
    pieces = [(t, slice(k, k + PIECE)) for t in traces for k in range(0, len(t.time_s), PIECE)]
    for t, s in pieces:
        count += int(np.count_nonzero(t.counted[s]))
        level += float(np.sum(t.force_N[s], where=t.counted[s]))
    level /= max(count, 1)
    squares, variation = 0.0, 0.0
    for t, s in pieces:
        squares += float(np.sum((t.force_N[s] - t.simulated_N[s]) ** 2, where=t.counted[s]))
        variation += float(np.sum((t.force_N[s] - level) ** 2, where=t.counted[s]))
    percent = 100 * (1 - math.sqrt(squares / variation)) if variation > 0 else 0.0
    return count, squares / max(count, 1), percent


def _traced(m: Measurement, structure: Structure, x: Array, run: Run, depth_mm: float, force_N: float) -> Trace:
    """The measurement beside its simulation, sample by sample; `run`: which surface it presses, how it began."""
    simulation = Simulation(structure, x, run)
    simulated = np.empty(len(m.force_time_s))
    same = m.position_time_s is m.force_time_s or np.array_equal(m.position_time_s, m.force_time_s)
    position = m.position_mm if same else np.empty(len(m.force_time_s))
    last: float | None = None
    for s in stretches(m):
        if not len(s.time_s):
            continue
        dt = np.diff(s.time_s, prepend=s.time_s[0] if last is None else last)
        last = float(s.time_s[-1])
        piece = simulation.over(dt, s.position_mm / depth_mm)
        simulated[s.forces] = piece.force[s.at] * force_N
        if not same:
            position[s.forces] = s.position_mm[s.at]
    return Trace(m.name, m.force_time_s, position, m.force_N, simulated, m.counted())
