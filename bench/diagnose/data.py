"""What a diagnosis works on: one measurement on one grid, with its noise; and a short stand-in for searching."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from bench.errors import InputError
from bench.felt_motion import Felt, felt
from bench.identify.noise import stiffness_along
from bench.identify.past import begins_inside
from bench.identify.problem import must_vary, sized, touches
from bench.readings import resolution
from bench.recording.types import Measurement
from bench.restamp import restamped
from sim.grid import Grid, union

from .blocks import blocks
from .coarse import rounded
from .hum import Line, find
from .louder import Loudness, loudness
from .noise import Colour, ForceNoise, force_noise, hold_errors, least_N
from .whiten import Whitening, whitening
from .work import Work

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

BLOCKS, FOLDS = 20, 5
FEWEST = 20  # force samples
LEAST_SHARED = 1e-2  # of the noise's own square: what is shared and less changes nothing


@dataclass(frozen=True)
class Data:
    """One grid of stamps; all arrays (n,). `weight`: force samples that an entry stands for, 0: none, or history."""

    time_s: Array
    position_mm: Array
    force_N: Array
    weight: Array
    sigma_N: Array
    """Standard deviation of one force sample there, by itself."""
    fold: NDArray[np.intp]
    shared_N: Array | None = None
    """Standard deviation of what errors of the position make beside it, the same for all of a stretch."""
    stretch: NDArray[np.intp] | None = None
    """Number of the hold, the move or the window, from 0 on."""
    tared: Mask | None = None
    """Entries at which the force was taken for zero (the tare); None: the force's zero is its own."""
    colour: Colour = Colour()
    """Of the noise, from force sample to force sample, which are `sample_s` apart, as far as the cost knows of it."""
    sample_s: float = 1.0
    work: Work = field(default_factory=Work, compare=False)
    """What has been simulated on it and on what stands for it."""

    @property
    def size(self) -> int:
        """Entries of the grid."""
        return len(self.time_s)

    @property
    def total_N(self) -> Array:
        """Standard deviation of one force sample, all in all (n,)."""
        return self.sigma_N if self.shared_N is None else np.asarray(np.hypot(self.sigma_N, self.shared_N))

    @cached_property
    def grid(self) -> Grid:
        """The stamps, as simulations take them."""
        return Grid(self.time_s)

    @cached_property
    def speed_mm_s(self) -> Array:
        """Of the motion (n,)."""
        return np.asarray(np.gradient(self.position_mm, self.time_s))

    @cached_property
    def scale(self) -> Array:
        """√w/σ (n,)."""
        return np.asarray(np.sqrt(self.weight) / self.sigma_N)

    @cached_property
    def _filter(self) -> Whitening | None:
        return whitening(self.colour, self.time_s, self.weight, self.sample_s)

    def _uncoloured(self, e: Array) -> Array:
        return e if self._filter is None else self._filter(e)

    @cached_property
    def _modes(self) -> tuple[NDArray[np.intp], Array, Array] | None:
        """(stretch, u (n,), factor · u (n,)): in each stretch (1 + u uᵀ)^−½ = 1 − factor u uᵀ; None: nothing to do."""
        if self.shared_N is None or self.stretch is None:
            return None
        u = self._uncoloured(self.scale * self.shared_N)
        squares = np.bincount(self.stretch, u * u)
        if not (squares > LEAST_SHARED).any():
            return None
        factors = (1.0 - 1.0 / np.sqrt(1.0 + squares)) / np.maximum(squares, 1e-300)
        return self.stretch, u, (np.where(squares > LEAST_SHARED, factors, 0.0))[self.stretch] * u

    def whitened(self, force_N: Array) -> Array:
        """Forces (n,) in units of noise that is independent from entry to entry: what a stretch shares counts once."""
        with np.errstate(over="ignore", invalid="ignore"):  # a model may run away: no step is taken to where it does
            e = self._uncoloured(self.scale * force_N)
            if self._modes is None:
                return np.asarray(e)
            stretch, u, factor = self._modes
            return np.asarray(e - factor * np.bincount(stretch, u * e)[stretch])

    def without(self, fold: int) -> Data:
        """One fold's samples out of the cost."""
        return replace(self, weight=np.where(self.fold == fold, 0.0, self.weight))

    def only(self, fold: int) -> Data:
        """One fold's samples alone in the cost."""
        return replace(self, weight=np.where(self.fold == fold, self.weight, 0.0))


@dataclass(frozen=True)
class FeltErrors:
    """What errors of the positions make of a model's force through more than the pad's stiffness, standard deviations
    (n,), N: of each sample by itself, and the same for all of a stretch."""

    own_N: Array
    shared_N: Array
    stretch: NDArray[np.intp]
    late_s: float = 0.0
    """In `own_N` too: the standard deviation of when forces were felt."""

    @property
    def total_N(self) -> Array:
        """Of a sample all in all (n,)."""
        return np.asarray(np.hypot(self.own_N, self.shared_N))


@dataclass(frozen=True)
class Prepared:
    """`full`: every sample; `short`: blocks; `owner` (full.size,): the block of each. `at`: force samples in `full`."""

    name: str
    full: Data
    short: Data
    owner: NDArray[np.intp]
    at: NDArray[np.intp]
    kept: Mask
    """Of the measurement's force samples, those within the time of the positions: they are the ones `at` the grid."""
    good: Mask
    """Of those, which are no channel faults."""
    noise: ForceNoise
    louder: Array
    """By how much it is louder (full.size,) than at rest, in the mean of the run."""
    said_of_noise: list[str]
    """That it is, in sentences."""
    hum: Line | None
    """What hums, and has been taken out of the force."""
    hum_N: Array
    """What was taken out (full.size,), N."""
    position_noise_mm: float
    sample_s: float
    doubt_mm: float
    zero_N: float
    stamp_s: float
    depth_mm: float
    force_scale_N: float
    pressed: bool
    """Whether the probe is in the pad from the first sample on."""
    position_time_s: Array
    """Stamps of the positions (p,)."""
    motion: Felt
    """The motion behind their noise."""
    position_step_mm: float
    """What they are rounded to; 0: nothing."""
    felt: FeltErrors
    """In `full.sigma_N` too, as if each sample were off by itself: a fit that let go of what stretches share would let
    go of the friction itself."""

    @property
    def raw(self) -> Data:
        """`full` with the hum still in it."""
        if self.hum is None:
            return self.full
        return replace(self.full, force_N=self.full.force_N + self.hum_N)

    @property
    def mains(self) -> Line | None:
        """`hum`, where it is the mains'."""
        return self.hum if self.hum is not None and self.hum.of_the_mains else None

    @property
    def colour(self) -> Colour:
        """Of the force's noise."""
        return self.noise.colour

    def noise_N(self, force_N: Array) -> Array:
        """Standard deviations of the force's noise where a model has these forces (full.size,), N."""
        return np.asarray(self.noise.at(force_N) * self.louder)

    @property
    def memory(self) -> float:
        """Samples that say the same as one, and that χ² does not know of."""
        return 1.0 if self.full.colour == self.colour else self.colour.memory

    def white(self) -> Prepared:
        """With a cost that knows the noise's colour. It is for fits that leave little beside the noise: it makes much
        of what changes fast, and so of what a model that is far off leaves there.
        """
        colour = self.colour
        return replace(self, full=replace(self.full, colour=colour), short=replace(self.short, colour=colour))

    def doubting(self, felt: FeltErrors) -> Prepared:
        """With other such errors than before."""
        full = replace(self.full, sigma_N=np.hypot(self.without_felt_N, felt.total_N))
        return replace(self, full=full, short=_averaged(full, self.owner), felt=felt)

    @property
    def without_felt_N(self) -> Array:
        """Standard deviation of one force sample by itself (full.size,), N, but for what such errors make."""
        return np.asarray(np.sqrt(np.maximum(self.full.sigma_N**2 - self.felt.total_N**2, 0.0)))

    @cached_property
    def judged(self) -> Data:
        """`full`, with what the motion's errors make the same for all of a stretch as just that."""
        full, felt = self.full, self.felt
        if not felt.shared_N.any():
            return full
        own = np.sqrt(np.maximum(full.sigma_N**2 - felt.shared_N**2, 0.0))
        before = 0.0 if full.shared_N is None else full.shared_N
        return replace(full, sigma_N=own, shared_N=np.hypot(before, felt.shared_N), stretch=felt.stretch)

    @cached_property
    def judged_short(self) -> Data:
        """The stand-in for `judged`."""
        return self.short if self.judged is self.full else _averaged(self.judged, self.owner)

    @property
    def floor_N(self) -> float:
        """RMS of an error with nothing left to explain."""
        return self._rms(self.full.total_N)

    @property
    def felt_floor_N(self) -> float:
        """Of it, RMS of what errors of the positions make through more than the pad."""
        return self._rms(self.felt.total_N)

    def _rms(self, values: Array) -> float:
        w = self.full.weight
        return float(np.sqrt(np.sum(w * values**2) / max(w.sum(), 1.0)))

    @property
    def floor_square_std(self) -> float:
        """Standard deviation of a mean square of the noise, N²: few stretches share few errors."""
        full, n = self.judged, max(float(self.full.weight.sum()), 1.0)
        together = 0.0
        if full.shared_N is not None and full.stretch is not None:
            together = float(np.sum(np.bincount(full.stretch, full.weight * full.shared_N**2) ** 2))
        own = self.colour.memory * float(np.sum(full.weight * full.sigma_N**4))
        return float(np.sqrt(2.0 * (own + together))) / n


def prepare(m: Measurement, good: Mask, felt_at: Callable[[Array], Array] | None = None) -> Prepared:
    """Grid, noise and stand-in. `good` (m,): force samples that are not channel faults. `felt_at`: when forces with
    stamps (m,) were felt, s, where that is known not to be when they say; hum goes by it. Raises InputError where there
    is next to nothing to work on.
    """
    m = restamped(m)
    inside = (m.force_time_s >= m.position_time_s[0]) & (m.force_time_s <= m.position_time_s[-1])
    if not inside.all():
        m = replace(m, force_time_s=m.force_time_s[inside], force_N=m.force_N[inside])
        good = good[inside]
    sized(m)
    if m.counted().any():
        must_vary([m])
    if m.surface_std_mm > 0 and not touches(m):  # with a surface found by touch-off there is a pad
        raise InputError(
            m.name,
            "the probe is never in the pad where the force counts",
            "Was the run stopped before its first step reached the pad?",
        )
    counted = m.counted() & good
    if counted.sum() < FEWEST:
        raise InputError(
            m.name, f"only {int(counted.sum())} force samples can be used", f"At least {FEWEST} are needed."
        )
    sample_s = float(np.median(np.diff(m.force_time_s)))
    begins_s = float(m.position_time_s[0])
    felt_s = m.force_time_s if felt_at is None else felt_at(m.force_time_s)
    errors = [(np.interp(t, m.force_time_s, felt_s), e, Q) for t, e, Q in hold_errors(m, good)]
    line = find(begins_s, errors, felt_s, m.force_N)
    line = None if line is not None and line.amplitude_N < least_N(m) else line
    taken_N = np.zeros(len(m.force_N))
    if line is not None:
        taken_N = line.force_N(felt_s - begins_s, m.force_N)
        m = replace(m, force_N=m.force_N - taken_N)
    motion = felt(m.position_time_s, m.position_mm)
    step_mm = resolution(m.position_mm)
    each_mm = max(motion.noise.each_mm, 1.05 * step_mm)
    loud = loudness(m, good)
    noise = force_noise(m, good, loud.in_time)
    least = max(rounded(m.force_N[good], resolution(m.force_N)), least_N(m))
    if noise.air_N <= least:
        loud = Loudness.even(len(m.force_N))
    noise_N = noise.at(m.force_N) * loud.times
    sigma_force = max(float(np.sqrt(np.mean(noise_N[good] ** 2))), least)
    noise_N = np.maximum(noise_N, least)
    grid, where = union(motion.time_s, m.force_time_s)
    position = motion.at(grid)
    stiffness = stiffness_along(m)
    through = stiffness * np.interp(m.force_time_s, motion.time_s, motion.std_mm)
    sigma, weight, force = np.full(len(grid), sigma_force), np.zeros(len(grid)), np.zeros(len(grid))
    shared, hum = np.zeros(len(grid)), np.zeros(len(grid))
    stretch = motion.stretch[np.clip(np.searchsorted(motion.time_s, grid, side="right") - 1, 0, None)]
    # a rest is off as a whole; windows of neighbours, and moves that may begin late and be too fast, share a part
    whole = np.where(motion.rest_at(grid)[where] > 0, 1.0, np.sqrt(0.5))
    shared[where] = whole * through
    doubt = stiffness * np.interp(m.force_time_s, motion.time_s, motion.doubt_mm)
    sigma[where] = np.hypot(noise_N, np.hypot(np.sqrt(1.0 - whole**2) * through, doubt))
    stretch = np.unique(stretch, return_inverse=True)[1]
    weight[where] = counted
    force[where], hum[where] = m.force_N, np.where(counted, taken_N, 0.0)
    depth = max(float(position.max()), 1e-3)
    pressed = begins_inside(m, depth, each_mm)
    fold = _folds(position, weight, float(np.ptp(position)), pressed)
    full = Data(
        grid, position, force, weight, sigma, fold, shared, stretch, _tared(m, grid), Colour(), sample_s,
    )  # fmt: skip
    jump_mm = 5.0 * float(np.quantile(motion.std_mm, 0.9))
    owner = blocks(full, float(np.quantile(stiffness, 0.98)), sigma_force, jump_mm, motion.corners_at(grid))
    return Prepared(
        name=m.name,
        full=full,
        short=_averaged(full, owner),
        owner=owner,
        at=where,
        kept=inside,
        good=good,
        noise=replace(noise, force_N=sigma_force, air_N=max(noise.air_N, least)),
        louder=np.interp(grid, m.force_time_s, loud.times),
        said_of_noise=loud.said,
        hum=line,
        hum_N=hum,
        position_noise_mm=each_mm,
        sample_s=sample_s,
        doubt_mm=m.surface_std_mm,
        zero_N=m.zero_std_N,
        stamp_s=m.stamp_std_s,
        depth_mm=depth,
        force_scale_N=max(float(np.abs(m.force_N[counted]).max()), 1e-6),
        pressed=pressed,
        position_time_s=m.position_time_s,
        motion=motion,
        position_step_mm=step_mm,
        felt=FeltErrors(np.zeros(len(grid)), np.zeros(len(grid)), stretch),
    )


def as_reported(m: Measurement) -> tuple[Data, NDArray[np.intp]]:
    """Positions and stamps of a measurement as they were reported, to simulate on: what no force is held against; and
    where its forces stand there (m,)."""
    time, at = union(m.position_time_s, m.force_time_s)
    none, fold = np.zeros(len(time)), np.zeros(len(time), dtype=np.intp)
    position = np.interp(time, m.position_time_s, m.position_mm)
    return Data(time, position, none, none, np.ones(len(time)), fold, tared=_tared(m, time)), at


def _tared(m: Measurement, grid: Array) -> Mask | None:
    if m.tared_s is None:
        return None
    inside = (grid >= m.tared_s[0]) & (grid <= m.tared_s[1])
    return inside if inside.any() else None


def _folds(position: Array, weight: Array, travel_mm: float, pressed: bool) -> NDArray[np.intp]:
    """Contiguous blocks dealt out in turn; half by samples and half by travel, so that fast moves are spread too. Of a
    run that begins `pressed` the first is in none (−1): nothing else tells what its past has left; nor is one that goes
    deeper than all others, as the end of a single press: what holds there is not told by what is shallower."""
    travel = np.abs(np.diff(position, prepend=position[0]))
    travel[travel < 2e-3 * travel_mm] = 0.0
    along = np.cumsum(weight / max(weight.sum(), 1.0) / 2 + travel / max(travel.sum(), 1e-300) / 2)
    block = np.minimum((along * BLOCKS).astype(np.intp), BLOCKS - 1)
    deepest = np.full(BLOCKS, -np.inf)
    np.maximum.at(deepest, block, position)
    alone = int(np.argmax(deepest))
    inside = position[block == alone]
    beyond = bool(np.median(inside) > np.delete(deepest, alone).max())
    return np.where((block == 0) & pressed | (block == alone) & beyond, -1, block % FOLDS)


def _averaged(full: Data, owner: NDArray[np.intp]) -> Data:
    weight = np.asarray(np.bincount(owner, full.weight), dtype=np.float64)
    inverse = np.asarray(np.bincount(owner, full.weight / full.sigma_N**2), dtype=np.float64)
    with np.errstate(invalid="ignore", divide="ignore"):
        force = np.where(weight > 0, np.bincount(owner, full.weight * full.force_N) / weight, 0.0)
        sigma = np.where(weight > 0, np.sqrt(weight / inverse), full.sigma_N.max())
    starts = np.flatnonzero(np.diff(owner, prepend=-1))
    # a block with forces stands at their mean time, one without at its middle: on the way, where that bends too
    middle = np.zeros(full.size)
    middle[starts + np.bincount(owner) // 2] = 1.0
    share = np.where(weight[owner] > 0, full.weight, middle)
    shares = np.where(weight > 0, weight, 1.0)
    time = np.bincount(owner, share * full.time_s) / shares
    position = np.bincount(owner, share * full.position_mm) / shares
    shared = None
    if full.shared_N is not None:
        shared = np.bincount(owner, share * full.shared_N) / shares
    tared = None if full.tared is None else full.tared[starts]
    return Data(
        time, position, force, weight, sigma, full.fold[starts], shared,
        None if full.stretch is None else full.stretch[starts],
        tared if tared is not None and tared.any() else None,
        full.colour, full.sample_s, full.work,
    )  # fmt: skip
