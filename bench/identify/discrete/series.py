"""Measurements on a uniform grid of T seconds, as a digital filter needs them.

A grid sample is the mean of all force samples within its T seconds: that takes out what is quicker than the grid can
hold (no alias), leaves white noise white, and cannot ring. The elastic response goes through the same mean:
F^e(δ) is taken at the force samples and averaged then, never F^e of a mean depth. A mean over time commutes with the
linear filter behind it, so what is averaged still obeys the model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from bench.errors import InputError
from bench.recording.types import Measurement

from .. import problem
from .._kernel import Array
from ..laws import Family

FEWEST = 20  # grid samples that can be fitted
LONGEST, GRID = 0.01, 2000  # s, samples: of the sample time chosen
FLAT = 2e-3  # of D: a cell that moves less stands still
KEPT = 4  # elastic responses remembered a run: searches over the filter ask for the same again and again


@dataclass(frozen=True)
class Series:
    """One run on the grid. `time_s` (K,): middles of the cells; `y` (K,): mean force over the force scale, 0 where a
    cell has none; `has` (K,): whether it has; `weight` (K,): 1 where it counts, else 0 (history, or no force).

    `u` (n,): depth over D at the nodes, which are the force samples (one for all of a cell that stands still) and the
    middles of empty cells; `owner` (n,): the cell of each; `count` (K,): nodes in each; `depth_mm` (K,): mean depth.
    """

    time_s: Array
    y: Array
    has: NDArray[np.bool_]
    weight: Array
    u: Array
    owner: NDArray[np.intp]
    count: Array
    depth_mm: Array
    _kept: dict[tuple[str, bytes], tuple[Array, Array]] = field(default_factory=dict, compare=False, repr=False)

    def elastic(self, family: Family, theta: Array) -> tuple[Array, Array]:
        """Elastic response over its value at D, averaged: s (K,), ds/dθ (K, k). The last few are kept."""
        key = (f"{family.name} {family.degree}", theta.tobytes())
        if key not in self._kept:
            if len(self._kept) >= KEPT:
                del self._kept[next(iter(self._kept))]
            self._kept[key] = self._averaged(family, theta)
        return self._kept[key]

    def _averaged(self, family: Family, theta: Array) -> tuple[Array, Array]:
        s, ds = family.shape(self.u, theta)
        if len(s) == len(self.count):
            return s, np.ascontiguousarray(ds)
        columns = [np.bincount(self.owner, column) / self.count for column in ds.T]
        mean = np.bincount(self.owner, s) / self.count
        return mean, np.ascontiguousarray(np.stack(columns, axis=1)) if columns else np.zeros((len(mean), 0))


@dataclass(frozen=True)
class Data:
    """Runs of one pad on a grid of `T` seconds; D = `depth_mm` and `force_N` are the units of `u` and `y`."""

    runs: tuple[Series, ...]
    T: float
    depth_mm: float
    force_N: float
    measurements: tuple[Measurement, ...]
    """As measured."""
    checked: problem.Problem
    """The same as the other methods have it."""
    notes: tuple[str, ...] = field(default=())

    @property
    def weight(self) -> float:
        """Grid samples that count."""
        return float(sum(run.weight.sum() for run in self.runs))

    def on_grid(self) -> list[Measurement]:
        """The grid samples as measurements (empty cells left out)."""
        out = []
        for m, run in zip(self.measurements, self.runs, strict=True):
            keep = run.has
            t, F = run.time_s[keep], run.y[keep] * self.force_N
            out.append(replace(m, position_time_s=t, position_mm=run.depth_mm[keep], force_time_s=t, force_N=F))
        return out

    def moved(self, j: int, by_mm: float) -> Data:
        """The same with the surface of run `j` so much higher: every depth of it is that much greater."""
        u, m = self.runs[j], self.measurements[j]
        run = replace(u, u=u.u + by_mm / self.depth_mm, depth_mm=u.depth_mm + by_mm, _kept={})
        runs = (*self.runs[:j], run, *self.runs[j + 1 :])
        measured = replace(m, position_mm=m.position_mm + by_mm)
        return replace(self, runs=runs, measurements=(*self.measurements[:j], measured, *self.measurements[j + 1 :]))


def sampled(measurements: Sequence[Measurement], T: float | None = None) -> Data:
    """The measurements on a grid of `T` seconds, or of `natural_time` where none is given.

    Raises InputError as `identify.fit` does, for a T below the spacing of the samples, and for one that leaves fewer
    than 20 of them.
    """
    checked = problem.build(measurements)
    own = own_time(checked.measurements)
    if T is None:
        T = natural_time(checked.measurements)
    elif not (np.isfinite(T) and T > 0):
        raise InputError("--sample-time", f"{T:g} is no time", "Seconds, above 0.")
    elif T / own < 0.999:
        raise InputError("--sample-time", f"{T:g} s is shorter than the {own:.4g} s between the samples")
    runs = tuple(_series(m, T, checked.depth_mm, checked.force_N) for m in checked.measurements)
    left = sum(float(run.weight.sum()) for run in runs)
    if left < FEWEST:
        samples = f"{left:.0f} sample{'' if left == 1 else 's'}"
        raise InputError("--sample-time", f"{T:g} s leaves {samples} to fit", f"At least {FEWEST} are needed.")
    notes = []
    empty = sum(int((~run.has).sum()) for run in runs)
    if empty:
        notes.append(f"{empty} samples of the grid have no measured force (gaps) and do not count.")
    return Data(runs, T, checked.depth_mm, checked.force_N, checked.measurements, checked, tuple(notes))


def own_time(measurements: Sequence[Measurement]) -> float:
    """The spacing of the data: the larger of the median steps of force and position, s."""
    steps = [float(np.median(np.diff(t))) for m in measurements for t in (m.force_time_s, m.position_time_s)]
    return _round(max(steps))


def natural_time(measurements: Sequence[Measurement]) -> float:
    """The sample time where none is given: a whole multiple of the data's own spacing, near `LONGEST` at the most.

    It is pulled two ways: noise on the force moves the poles of an ARX fit, the more the shorter T; and within T
    nothing may relax, as the zero-order hold has it. At 10 ms that error is some thousandths for rates of a few
    1/s. Short runs take less, to keep `GRID` samples.
    """
    own = own_time(measurements)
    longest = max(float(m.force_time_s[-1] - m.force_time_s[0]) for m in measurements)
    return _round(own * max(1, round(min(longest / GRID, LONGEST) / own)))


def _round(T: float) -> float:
    """Without the rounding of stamps: six digits."""
    return float(f"{T:.6g}")


def _series(m: Measurement, T: float, depth_mm: float, force_N: float) -> Series:
    own = float(np.median(np.diff(m.force_time_s)))
    edge = m.force_time_s[0] - min(own, T) / 2  # edges fall between samples
    owner = np.floor((m.force_time_s - edge) / T + 1e-6).astype(np.intp)
    K = int(owner[-1]) + 1
    time = edge + T * (np.arange(K) + 0.5)
    here = np.bincount(owner, minlength=K)
    has = here > 0
    empty = np.flatnonzero(~has)
    weight = (has & (np.bincount(owner, m.counted(), K) == here)).astype(float)
    y = np.zeros(K)
    y[has] = (np.bincount(owner, m.force_N / force_N, K) / np.maximum(here, 1))[has]
    nodes = np.concatenate([m.force_time_s, time[empty]])
    cells = np.concatenate([owner, empty])
    position = np.interp(nodes, m.position_time_s, m.position_mm)
    mean = np.bincount(cells, position, K) / np.maximum(here, 1)
    nodes_u, owner, count = _thinned(position / depth_mm, cells, K)
    return Series(time, y, has, weight, nodes_u, owner, count, mean)


def _thinned(u: Array, owner: NDArray[np.intp], K: int) -> tuple[Array, NDArray[np.intp], Array]:
    """Nodes, their cells (rising), nodes a cell: one node, at the mean depth, where a cell hardly moves.

    There F^e of the mean is the mean of F^e to within s'' range²/24, some millionths.
    """
    order = np.argsort(owner, kind="stable")
    u, owner = u[order], owner[order]
    starts = np.searchsorted(owner, np.arange(K))
    count = np.diff(np.append(starts, len(u)))
    flat = np.maximum.reduceat(u, starts) - np.minimum.reduceat(u, starts) < FLAT
    touches = (np.maximum.reduceat(u, starts) > 0) & (np.minimum.reduceat(u, starts) < 0)  # F^e has a corner at 0
    one = flat & ~touches
    keep = ~one[owner]
    keep[starts] = True
    u = u.copy()
    u[starts[one]] = (np.add.reduceat(u, starts) / count)[one]
    return np.ascontiguousarray(u[keep]), owner[keep], np.where(one, 1, count).astype(float)
