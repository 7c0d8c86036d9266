"""What a fit works on: every run on the union of its position and force stamps, scaled to order one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace

import numpy as np
from numpy.typing import NDArray

from bench.errors import InputError
from bench.motion_between import motion_between
from bench.readings import LONG_RUN, copies, drop_outs, runs, said_of
from bench.recording.types import Measurement
from sim.grid import union

from ._kernel import Array
from .long import is_long, shortened
from .motion import LONG, glanced, jitter
from .noise import noise_of
from .returns import with_returns
from .runs import Run

__all__ = ["Problem", "Run", "build"]

PIECE = 1 << 17  # samples looked at at once
LARGEST = 1e12  # N, mm, s: what is beyond is no measurement, and its square soon no number
FAR, ACTS, NONE = 0.7, 0.3, 0.1  # of the way up; of the largest force, that acts there and does not below
FEW_SAMPLES = 10
SURELY = 3.0  # standard deviations of the surface beyond which a depth is one


@dataclass(frozen=True)
class Problem:
    """Runs that share one pad. `depth_mm` = D and `force_N` are the units of `Run.u` and `Run.y`."""

    runs: tuple[Run, ...]
    depth_mm: float
    force_N: float
    measurements: tuple[Measurement, ...] = ()
    where: tuple[NDArray[np.intp], ...] = ()
    """Of each run: where its force samples stand in the union grid; empty for a long run in blocks (`long`)."""
    notes: tuple[str, ...] = field(default=())
    prior: tuple[float, ...] = ()
    """Of each doubtful surface what its shift squared (units of D) costs, and then of each run's doubtful stamps what
    the square of their lateness (standard deviations) does, in the units of Σ w e²."""
    noise_square: float = 0.0
    """Variance of the force's noise, scaled; the prior was weighed by it."""
    rebuilt: bool = False
    """Whether there are nodes between samples (`bench.motion_between`, `returns`)."""
    moves_rebuilt: bool = False
    """Whether some of them stand in moves."""

    @property
    def weight(self) -> float:
        """Samples that count."""
        return float(sum(run.weight.sum() for run in self.runs))

    @property
    def in_blocks(self) -> bool:
        """Whether a long run stands in blocks."""
        return any(len(at) == 0 for at in self.where)

    @property
    def pasts(self) -> int:
        """Runs that begin loaded."""
        return sum(run.past is not None for run in self.runs)

    @property
    def rows(self) -> int:
        """Samples, or blocks, that count."""
        return int(sum(np.count_nonzero(run.weight) for run in self.runs))

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


def build(measurements: Sequence[Measurement], between: bool = False, blocks: bool = False) -> Problem:
    """Union grids and scales of the measurements.

    `between`: with nodes where the motion between samples matters; `blocks`: very long runs as block means.
    Raises InputError, naming the measurement, where there is nothing to fit: fewer than 20 force samples that count,
    no pad that is pressed (`must_touch`), numbers that are not finite, times that do not increase; and for numbers that
    are none of a bench (`sized`).
    """
    if not measurements:
        raise InputError("fit", "no measurement given")
    notes: list[str] = []
    checked = [_checked(m, notes) for m in measurements]
    depth = max(float(m.position_mm.max()) for m in checked)
    force = max(_largest(m) for m in checked)
    must_touch(checked)
    runs: list[Run] = []
    where: list[NDArray[np.intp]] = []
    in_moves = in_all = 0
    for k, m in enumerate(checked):
        if blocks and is_long(m):
            if between and len(m.position_time_s) <= LONG:  # many forces to few positions
                time, position = motion_between(m.position_time_s, m.position_mm, noise_mm=jitter(m.position_mm))
                in_moves += len(time) - len(m.position_time_s)
                checked[k] = m = replace(m, position_time_s=time, position_mm=position)
            run, at = shortened(m, depth, force), np.zeros(0, dtype=np.intp)
        else:
            run, at, nodes = _run(m, depth, force, between)
            in_moves, in_all = in_moves + nodes[0], in_all + nodes[1]
        runs.append(run)
        where.append(at)
    return Problem(
        tuple(runs), depth, force, tuple(checked), tuple(where), tuple(notes),
        rebuilt=in_moves + in_all > 0, moves_rebuilt=in_moves > 0,
    )  # fmt: skip


def must_touch(measurements: Sequence[Measurement]) -> None:
    """Raises InputError, naming them, where none of some measurements shows a pad that is pressed: no sample deeper
    than the surface, or not while the force counts, or a force that is the same throughout or acts above it alone."""
    names = ", ".join(m.name for m in measurements)
    if max(float(m.position_mm.max()) for m in measurements) <= 0:
        raise InputError(names, "the position never passes the surface (0 mm), so there is no contact to fit",
                         "Is the sign of the position right, and its zero at the surface?")  # fmt: skip
    if not any(touches(m) for m in measurements):
        raise InputError(names, "the probe is never in the pad where the force counts, so there is no contact to fit",
                         "Was the run stopped before its first step reached the pad?")  # fmt: skip
    must_vary(measurements)
    for m in measurements:
        must_be_upright(m)


def must_be_upright(m: Measurement) -> None:
    """Raises InputError where the force acts far above the surface and not below: a machine that counts compression
    as negative."""
    m = glanced(m)
    counted = m.counted()
    position, force = m.position_at_forces_mm()[counted], np.abs(m.force_N[counted])
    lowest, top = float(position.min(initial=0.0)), float(np.quantile(force, 0.99)) if force.size else 0.0
    above, below = position < FAR * lowest, position > 0.0
    if lowest >= -float(position.max(initial=0.0)) or min(above.sum(), below.sum()) < FEW_SAMPLES:
        return
    if float(np.median(force[above])) > ACTS * top and float(np.median(force[below])) < NONE * top:
        said = f"the force acts down to a position of {lowest:.4g} mm, above the surface, and not below it"
        cure = "Is the position's sign turned? It counts into the pad: `--units position=-mm` (and `force=-N`) turn it."
        raise InputError(m.name, said, cure)


def must_vary(measurements: Sequence[Measurement]) -> None:
    """Raises InputError, naming them, where the force of each of some measurements is the same throughout."""
    level_N = 0.0
    for m in measurements:
        counted = m.counted()
        lowest = float(np.min(m.force_N, initial=np.inf, where=counted))
        if lowest < float(np.max(m.force_N, initial=-np.inf, where=counted)):
            return
        level_N = lowest if counted.any() else level_N
    said = f"the force is {f'{level_N:.6g} N' if level_N else 'zero'} throughout"
    names = ", ".join(m.name for m in measurements)
    raise InputError(names, said, "Is the force channel connected, its column right?")


def touches(m: Measurement) -> bool:
    """Whether the probe is deeper than the surface, beyond its doubt, while the force counts."""
    counted = m.counted()
    if not counted.any():
        return False
    first, last = int(np.argmax(counted)), len(counted) - 1 - int(np.argmax(counted[::-1]))
    begin = int(np.searchsorted(m.position_time_s, m.force_time_s[first]))
    end = int(np.searchsorted(m.position_time_s, m.force_time_s[last], side="right"))
    return float(np.max(m.position_mm[begin:end], initial=-np.inf)) > SURELY * m.surface_std_mm


def sized(m: Measurement) -> None:
    """Raises InputError, naming the measurement, for numbers too large, or forces too small, to be those of a bench."""
    cure = "Are the columns and their units right (`--columns`, `--units`)?"
    span_s = float(m.position_time_s[-1] - m.position_time_s[0])
    largest = _extreme(m.force_N)
    for value, said in (
        (largest, f"a force of {largest:.3g} N"),
        (_extreme(m.position_mm), f"a position of {_extreme(m.position_mm):.3g} mm"),
        (span_s, f"a time of {span_s:.3g} s from first to last"),
    ):
        if value > LARGEST:
            raise InputError(m.name, f"holds {said}", cure)
    if 0 < largest < 1 / LARGEST:
        raise InputError(m.name, f"holds no force beyond {largest:.3g} N", cure)


def _extreme(values: Array) -> float:
    """The largest magnitude, of any sign."""
    return max(float(np.max(values, initial=0.0)), -float(np.min(values, initial=0.0)))


def _counted(m: Measurement) -> NDArray[np.bool_]:
    return m.counted()


def _pieces(values: Array) -> Iterator[Array]:
    """A piece at a time, each with the first value of the next: what is asked of long data needs no copy of them."""
    for start in range(0, len(values), PIECE):
        yield values[start : start + PIECE + 1]


def _largest(m: Measurement) -> float:
    counted = _counted(m)
    return max(
        float(np.max(np.abs(m.force_N[k : k + PIECE]), initial=0.0, where=counted[k : k + PIECE]))
        for k in range(0, len(counted), PIECE)
    )


def _checked(m: Measurement, notes: list[str]) -> Measurement:
    arrays = (m.position_time_s, m.position_mm, m.force_time_s, m.force_N)
    if any(a.ndim != 1 or len(a) == 0 for a in arrays):
        raise InputError(m.name, "there are no samples to fit")
    if not all(np.isfinite(piece).all() for a in arrays for piece in _pieces(a)):
        raise InputError(m.name, "there are numbers that are not finite among the samples")
    if any(np.any(np.diff(piece) <= 0) for t in (m.position_time_s, m.force_time_s) for piece in _pieces(t)):
        raise InputError(m.name, "times do not increase from sample to sample")
    sized(m)
    inside = (m.force_time_s >= m.position_time_s[0]) & (m.force_time_s <= m.position_time_s[-1])
    if not inside.all():
        lost = int((~inside).sum())
        notes.append(f"{m.name}: {lost} force samples lie outside the times of the position and were left out.")
        m = replace(m, force_time_s=m.force_time_s[inside], force_N=m.force_N[inside])
    m = _converted(m, notes)
    counted = int(_counted(m).sum())
    if counted < 20:
        raise InputError(m.name, f"only {counted} force samples can be fitted", "At least 20 are needed.")
    return m


def _converted(m: Measurement, notes: list[str]) -> Measurement:
    """Without force samples that only repeat the one before: a channel is read more often than it converts, or drops
    out."""
    again = copies(m.force_N)
    if again.any():
        notes.append(f"{m.name}: The force is {said_of(again)}. (Is the load cell read more often than it converts?)")
    elif int(runs(m.force_N)[1].max()) >= LONG_RUN:
        again = drop_outs(m.force_N, m.position_at_forces_mm(), noise_of([m]).force_N)
        if again.any():
            notes.append(
                f"{m.name}: The force stands still to its last digit for {again.sum()} samples where its noise should"
                " show: drop-outs that repeat the last value, and were left out."
            )
    if not again.any():
        return m
    return replace(m, force_time_s=m.force_time_s[~again], force_N=m.force_N[~again])


def _run(
    m: Measurement, depth_mm: float, force_N: float, between: bool
) -> tuple[Run, NDArray[np.intp], tuple[int, int]]:
    """The run, where its forces stand, and how many nodes there are beyond the samples: in moves, in all."""
    motion_s, motion_mm = m.position_time_s, m.position_mm
    in_moves = 0
    if between:
        motion_s, motion_mm = motion_between(motion_s, motion_mm, noise_mm=jitter(motion_mm))
        in_moves = len(motion_s) - len(m.position_time_s)
        motion_s, motion_mm = with_returns(m, motion_s, motion_mm)
    if np.array_equal(motion_s, m.force_time_s):
        time, position = motion_s, motion_mm
        at = np.arange(len(time))
    else:
        time, at = union(motion_s, m.force_time_s)
        position = np.interp(time, motion_s, motion_mm)
    y, weight = np.zeros(len(time)), np.zeros(len(time))
    y[at] = m.force_N / force_N
    weight[at[_counted(m)]] = 1.0
    run = Run(time, np.diff(time, prepend=time[0]), position / depth_mm, y, weight, stamp_std_s=m.stamp_std_s)
    return run, at, (in_moves, len(motion_s) - len(m.position_time_s))
