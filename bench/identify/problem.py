"""What a fit works on: every run on the union of its position and force stamps, scaled to order one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from bench.errors import InputError
from bench.recording.types import Measurement
from sim.pad import union

from ._kernel import Array

CHUNK = 32768  # samples whose derivatives are in memory at once


@dataclass(frozen=True)
class Run:
    """One measurement on its union grid; all arrays (n,).

    `dt_s`: time since the sample before, 0 for the first; `u`: depth over D; `y`: force over the force scale, 0
    where `weight` is 0; `weight`: what a sample counts in the cost (0: no force there, or history).
    """

    time_s: Array
    dt_s: Array
    u: Array
    y: Array
    weight: Array
    surface: int | None = None
    """Which of the problem's doubtful surfaces this run presses; None: its surface is certain."""

    @property
    def size(self) -> int:
        """Samples of the union grid."""
        return len(self.dt_s)

    def chunks(self) -> Iterator[slice]:
        """Pieces small enough to hold their derivatives."""
        for start in range(0, self.size, CHUNK):
            yield slice(start, min(start + CHUNK, self.size))


@dataclass(frozen=True)
class Problem:
    """Runs that share one pad. `depth_mm` = D and `force_N` are the units of `Run.u` and `Run.y`."""

    runs: tuple[Run, ...]
    depth_mm: float
    force_N: float
    measurements: tuple[Measurement, ...] = ()
    where: tuple[NDArray[np.intp], ...] = ()
    """Of each run: where its force samples stand in the union grid."""
    notes: tuple[str, ...] = field(default=())
    prior: tuple[float, ...] = ()
    """Of each doubtful surface: what its shift squared (units of D) costs, in the units of Σ w e²."""
    noise_square: float = 0.0
    """Variance of the force's noise, scaled; the prior was weighed by it."""

    @property
    def weight(self) -> float:
        """Samples that count."""
        return float(sum(run.weight.sum() for run in self.runs))

    @property
    def size(self) -> int:
        """Samples of all union grids."""
        return sum(run.size for run in self.runs)

    def weighted(self, weights: Sequence[Array]) -> Problem:
        """The same runs, other weights."""
        return replace(self, runs=tuple(replace(r, weight=w) for r, w in zip(self.runs, weights, strict=True)))

    def times(self) -> tuple[float, float]:
        """Shortest useful and longest time in the data, s: the force step that a tenth of the steps fall below (where
        stamps are dense after a move and sparse later, the dense ones), and the longest run's span."""
        steps, spans = [], []
        for run in self.runs:
            t = run.time_s[run.weight > 0]
            if len(t) > 1:
                steps.append(np.diff(t))
                spans.append(t[-1] - t[0])
        return float(np.quantile(np.concatenate(steps), 0.1)), float(max(spans))


def build(measurements: Sequence[Measurement]) -> Problem:
    """Union grids and scales of the measurements.

    Raises InputError, naming the measurement, where there is nothing to fit: fewer than 20 force samples that count,
    no sample deeper than the surface, no force at all, numbers that are not finite, times that do not increase.
    """
    if not measurements:
        raise InputError("fit", "no measurement given")
    notes: list[str] = []
    checked = [_checked(m, notes) for m in measurements]
    depth = max(float(m.position_mm.max()) for m in checked)
    force = max(float(np.abs(m.force_N[_counted(m)]).max()) for m in checked)
    names = ", ".join(m.name for m in checked)
    if depth <= 0:
        raise InputError(names, "the position never passes the surface (0 mm), so there is no contact to fit",
                         "Is the sign of the position right, and its zero at the surface?")  # fmt: skip
    if force <= 0:
        raise InputError(names, "the force is zero throughout", "Is the force channel connected, its column right?")
    runs, where = [], []
    for m in checked:
        run, at = _run(m, depth, force)
        runs.append(run)
        where.append(at)
    return Problem(tuple(runs), depth, force, tuple(checked), tuple(where), tuple(notes))


def _counted(m: Measurement) -> NDArray[np.bool_]:
    return (m.force_time_s >= m.fit_from_s) & (m.force_time_s <= m.fit_to_s)


def _checked(m: Measurement, notes: list[str]) -> Measurement:
    arrays = (m.position_time_s, m.position_mm, m.force_time_s, m.force_N)
    if any(a.ndim != 1 or len(a) == 0 for a in arrays):
        raise InputError(m.name, "there are no samples to fit")
    if not all(np.isfinite(a).all() for a in arrays):
        raise InputError(m.name, "there are numbers that are not finite among the samples")
    if np.any(np.diff(m.position_time_s) <= 0) or np.any(np.diff(m.force_time_s) <= 0):
        raise InputError(m.name, "times do not increase from sample to sample")
    inside = (m.force_time_s >= m.position_time_s[0]) & (m.force_time_s <= m.position_time_s[-1])
    if not inside.all():
        lost = int((~inside).sum())
        notes.append(f"{m.name}: {lost} force samples lie outside the times of the position and were left out.")
        m = replace(m, force_time_s=m.force_time_s[inside], force_N=m.force_N[inside])
    counted = int(_counted(m).sum())
    if counted < 20:
        raise InputError(m.name, f"only {counted} force samples can be fitted", "At least 20 are needed.")
    return m


def _run(m: Measurement, depth_mm: float, force_N: float) -> tuple[Run, NDArray[np.intp]]:
    if np.array_equal(m.position_time_s, m.force_time_s):
        time, position = m.position_time_s, m.position_mm
        at = np.arange(len(time))
    else:
        time, at = union(m.position_time_s, m.force_time_s)
        position = np.interp(time, m.position_time_s, m.position_mm)
    y, weight = np.zeros(len(time)), np.zeros(len(time))
    y[at] = m.force_N / force_N
    weight[at[_counted(m)]] = 1.0
    return Run(time, np.diff(time, prepend=time[0]), position / depth_mm, y, weight), at
