"""The motion behind noisy positions: what friction, backlash or a moving mass answer to is not the encoder's noise.

Each position becomes the value of a local parabola over as many neighbours as agree with one: windows grow while the
intervals that they give for the value overlap and their scatter is that of the noise (the intersection of confidence
intervals: A. Goldenshluger, A. Nemirovski, Math. Methods Statist. 6, 1997, 135–170). So a hold is averaged over many
samples, a trapezoid's pieces are met exactly, and corners keep their place.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from bench.fitted_moves import Moves
from bench.identify.motion import jitter
from bench.motion_between import missed, motion_between, planned_moves
from bench.position_noise import EDGE, PositionNoise, position_noise
from bench.profiles import Trapezoid
from bench.readings import resolution
from sim.jit import compiled

Array = NDArray[np.float64]

REACHES = np.array([2, 3, 4, 6, 8, 11, 15, 21, 29, 40, 56, 80, 112, 160], dtype=np.int64)
"""Half-widths of the windows, in samples."""
SHORTEST = 30  # samples of a hold that can show it to be at rest
LIKELY, CHANCE = 4.0, 5.0  # standard deviations: levels nearer are one, samples farther off are no noise
FEWEST = 10  # samples of a level within a hold
BLURRED = 0.3  # of a step: noise that makes a mean of readings better than one
TOGETHER = 20  # samples that share the error of a window, about
BESIDE = 2.5  # deviations of a reading from where its window puts it, that are more than its noise
ASTRAY = 1.4  # times what noise makes of a window's value: so far off is it, in sines of any speed
BETWEEN = 40  # samples with no window of their own between such as have one
ALONE = 2.5  # times what is left of the noise on either side
WIDTH = 2.2  # standard deviations on either side of a value
CLEARLY = 0.005  # of a model's error


@compiled("void(float64[::1], float64[::1], float64, float64, float64, int64[::1], int64, float64[::1], float64[::1])")
def _windows(
    t: Array,
    x: Array,
    sigma: float,
    memory: float,
    width: float,
    reaches: NDArray[np.int64],
    side: int,
    out: Array,
    std: Array,
) -> None:
    """Values by windows around each sample (`side` 0), after it (1) or before it (−1), where they are surer; of noise
    `sigma`, of which `memory` samples say the same as one."""
    n = t.shape[0]
    for i in range(n):
        low, high = x[i] - width * sigma, x[i] + width * sigma
        s0 = 1.0
        s1 = s2 = s3 = s4 = 0.0
        x0 = x1 = x2 = xx = 0.0  # of x less x[i]
        done = 0
        for reach in reaches:
            first = i - reach if side == 0 else (i if side > 0 else i - 2 * reach)
            last = i + reach if side == 0 else (i + 2 * reach if side > 0 else i)
            if first < 0 or last >= n:
                break
            unit = t[last] - t[first]
            for k in range(done + 1, last - first - (reach if side == 0 else 0) + 1):
                for half in range(2 if side == 0 else 1):
                    j = i - k if (half == 1 or side < 0) else i + k
                    u = t[j] - t[i]
                    d = x[j] - x[i]
                    uu = u * u
                    s0 += 1.0
                    s1 += u
                    s2 += uu
                    s3 += uu * u
                    s4 += uu * uu
                    x0 += d
                    x1 += d * u
                    x2 += d * uu
                    xx += d * d
            done = reach if side == 0 else 2 * reach
            # normal equations with u scaled to order one
            a1, a2, a3, a4 = s1 / unit, s2 / unit**2, s3 / unit**3, s4 / unit**4
            b0, b1, b2 = x0, x1 / unit, x2 / unit**2
            c00 = a2 * a4 - a3 * a3
            c01 = a2 * a3 - a1 * a4
            c02 = a1 * a3 - a2 * a2
            det = s0 * c00 + a1 * c01 + a2 * c02
            if det <= 0.0:
                break
            c11 = s0 * a4 - a2 * a2
            c12 = a1 * a2 - s0 * a3
            c22 = s0 * a2 - a1 * a1
            p0 = (c00 * b0 + c01 * b1 + c02 * b2) / det
            p1 = (c01 * b0 + c11 * b1 + c12 * b2) / det
            p2 = (c02 * b0 + c12 * b1 + c22 * b2) / det
            left = xx - p0 * b0 - p1 * b1 - p2 * b2
            freedom = s0 - 3.0
            if left > sigma * sigma * (freedom + 2.6 * np.sqrt(2.0 * freedom * memory)):
                break
            value = x[i] + p0
            error = sigma * np.sqrt(memory * c00 / det)
            low, high = max(low, value - width * error), min(high, value + width * error)
            if low > high:
                break
            if error < std[i]:
                out[i], std[i] = value, error


def smoothed(time_s: Array, position_mm: Array, noise: PositionNoise) -> tuple[Array, Array]:
    """(positions without most of their noise (n,), standard deviation of what is left (n,)), mm.

    `time_s` (n,) increases strictly. Positions without noise come back as they are.
    """
    sigma = noise.each_mm
    if sigma <= 1e-7 * max(float(np.ptp(position_mm)), 1e-9) or len(time_s) < 8:
        return position_mm, np.zeros(len(position_mm))
    time, position = np.ascontiguousarray(time_s), np.ascontiguousarray(position_mm)
    out, std = position.copy(), np.full(len(time), sigma)
    for side in (0, 1, -1):
        _windows(time, position, sigma, noise.memory, WIDTH, REACHES, side, out, std)
    _without_strays(time, position, sigma, out, std)
    return out, std


def _without_strays(time_s: Array, position_mm: Array, sigma: float, out: Array, std: Array) -> None:
    """Put values with which no window of their neighbours agrees, though noise may be all that they are, on the line
    between those neighbours. Friction that has slid to its end would keep such a stray until the axis turns."""
    n, at = len(out), np.arange(len(out))
    sure = np.maximum(std[np.maximum(at - BETWEEN, 0)], std[np.minimum(at + BETWEEN, n - 1)])
    alone = std > ALONE * sure
    edges = np.flatnonzero(np.diff(np.concatenate([[0], alone.astype(np.int8), [0]]))).reshape(-1, 2)
    for first, end in edges.tolist():
        if end - first > BETWEEN or first == 0 or end == n:
            continue
        beside = [first - 1, end]
        line = np.interp(time_s[first:end], time_s[beside], out[beside])
        if _by_chance((position_mm[first:end] - line) / sigma):
            out[first:end], std[first:end] = line, std[beside].max()


@dataclass(frozen=True)
class Felt:
    """The motion as the pad felt it: `time_s`, `position_mm` (k,) with nodes between samples where they matter;
    `std_mm` (k,): what is left of the noise; `noise`: what it was. `stretch` (k,): nodes of one number
    share most of the error that is left. `rest` (k,): number of the rest, 0: in motion."""

    time_s: Array
    position_mm: Array
    std_mm: Array
    noise: PositionNoise
    stretch: NDArray[np.intp]
    rest: NDArray[np.intp]
    doubt_mm: Array
    """Of a planned move, how far another profile that the samples exclude as little goes beside it (k,)."""
    planned: tuple[tuple[float, float, Trapezoid], ...] = ()
    """(from when, s; to when, s; how) the motion is a planned move."""

    def at(self, time_s: Array) -> Array:
        """Positions at some times (m,), which rise, mm: of planned moves their own, else linear between the nodes. A
        mass feels what a chord is off by."""
        position = np.interp(time_s, self.time_s, self.position_mm)
        for begin_s, end_s, move in self.planned:
            inside = slice(*np.searchsorted(time_s, [begin_s, np.nextafter(end_s, np.inf)]))
            position[inside] = move.position(time_s[inside])
        return np.asarray(position)

    def planned_at(self, time_s: Array) -> NDArray[np.bool_]:
        """Whether some times (m,) are of planned moves."""
        inside = np.zeros(len(time_s), dtype=bool)
        for begin_s, end_s, _ in self.planned:
            inside |= (time_s >= begin_s) & (time_s <= end_s)
        return inside

    def corners_at(self, time_s: Array) -> NDArray[np.bool_]:
        """Which of some times (m,), nodes among them, are where a planned move changes its acceleration."""
        return np.isin(time_s, [corner_s for *_, move in self.planned for corner_s in move.corners_s().tolist()])

    def rest_at(self, time_s: Array) -> NDArray[np.intp]:
        """Number of the rest at some times (m,)."""
        return self.rest[np.clip(np.searchsorted(self.time_s, time_s, side="right") - 1, 0, len(self.rest) - 1)]


def _coarse(position_mm: Array) -> float:
    """What no averaging takes away, mm: the error of a scale whose steps the noise does not blur."""
    step = resolution(position_mm)
    return step / np.sqrt(12.0) if jitter(position_mm) < BLURRED * step else 0.0


def _rested(
    position_mm: Array, clean_mm: Array, std_mm: Array, noise: PositionNoise, left_mm: float
) -> tuple[Array, Array, NDArray[np.intp]]:
    """Positions (n,), their standard deviations (n,): one for each hold whose samples are that of one, or for each
    of the levels between which it creeps; and the number of the level, from 1 on; 0: none."""
    clean, std = clean_mm.copy(), std_mm.copy()
    hold = np.zeros(len(clean), dtype=np.intp)
    coarse, reached = _coarse(position_mm) > 0.0, dict[float, int]()
    # a coarse scale hops between two levels, and neither says which of them is nearer
    hop = resolution(position_mm) if coarse else 0.0
    each_mm, noise_mm = max(noise.each_mm, 0.5 * hop), max(noise.of_means_mm, 0.5 * hop)
    quiet_mm = max(6 * left_mm, 1e-5 * float(np.ptp(clean_mm)), 0.6 * hop)
    numbered = 0
    for a, b in _rests(position_mm, clean_mm, noise_mm, quiet_mm):
        inside = position_mm[a + EDGE : b + 1 - EDGE]
        n = len(inside)
        if n < SHORTEST:
            continue
        level = float(inside.mean())
        if float(np.sum((inside - level) ** 2)) > each_mm**2 * (n + 4.0 * np.sqrt(2.0 * n * noise.memory)):
            continue
        halves = abs(float(inside[: n // 2].mean() - inside[n // 2 :].mean())) / (2.0 * noise_mm / np.sqrt(n))
        cuts = [] if coarse else _steps((inside - level) / noise_mm)
        if cuts or halves < LIKELY:
            edges = [a, *(a + EDGE + cut for cut in cuts), b + 1]
            levels = [float(inside[i:j].mean()) for i, j in pairwise([0, *cuts, n])]
            # from within the rest: what begins gently is a move before it is quick enough to be seen
            first, last = a + FEWEST, b + 1 - FEWEST
            behind, ahead = position_mm[max(a - SHORTEST, 0) : first][::-1], position_mm[last : b + 1 + SHORTEST]
            edges[0] = first - _staying((behind - levels[0]) / noise_mm)
            edges[-1] = last + _staying((ahead - levels[-1]) / noise_mm)
            whole = slice(min(a, edges[0]), max(b + 1, edges[-1]))
            if not (cuts or coarse) and _turns((position_mm[whole] - level) / noise_mm):
                continue
            for (first, end), value in zip(pairwise(edges), levels, strict=True):
                numbered += 1
                clean[first:end], std[first:end] = value, noise_mm / np.sqrt(end - first)
                # a coarse scale is off by as much whenever the same level is held
                hold[first:end] = reached.setdefault(float(np.median(inside)), numbered) if coarse else numbered
    return clean, std, hold


def _steps(off: Array) -> list[int]:
    """Where a level held changes, as samples that begin another; `off`: from its mean, in standard deviations.

    A servo's integral and a pad that relaxes let a mover creep by less than a step of its scale, which many readings
    tell and friction answers to. Cut in two where the means on either side differ most, and again: binary segmentation
    (A. J. Scott, M. Knott, Biometrics 30, 1974, 507–512).
    """
    n = len(off)
    if n < 2 * FEWEST:
        return []
    before = np.arange(1, n)
    differs = np.abs(np.cumsum(off)[:-1] - before * off.mean()) / np.sqrt(before * (n - before) / n)
    at = FEWEST + int(np.argmax(differs[FEWEST - 1 : n - FEWEST]))
    if differs[at - 1] < CHANCE:
        return []
    return [*_steps(off[:at]), at, *(at + cut for cut in _steps(off[at:]))]


def _staying(off: Array) -> int:
    """How many of the samples after a rest belong to it still; `off`: from its level, in standard deviations. A move
    that begins gently is seen late: it began where the samples up to there are the least a level's."""
    strays = np.maximum(np.abs(off), np.abs(np.cumsum(off)) / np.sqrt(np.arange(1, len(off) + 1))) > LIKELY
    if not strays.any():
        return len(off)
    seen = int(np.argmax(strays))
    since = np.abs(np.cumsum(off[seen::-1])) / np.sqrt(np.arange(1, seen + 2))
    return max(seen - max(int(np.argmax(since)), EDGE), 0)


def _turns(off: Array) -> bool:
    """Whether samples lie about a bow, and so are no rest: the turn of a slow sine goes by less than its noise. `off`:
    from their mean, in standard deviations."""
    u = np.linspace(-1.0, 1.0, len(off))
    bow = u**2 - np.mean(u**2)
    return abs(float(bow @ off)) > CHANCE * float(np.linalg.norm(bow))


def _between(hold: NDArray[np.intp], first: int, last: int) -> list[slice]:
    """The samples before and after a move that lie between it and a rest near by."""
    before = np.flatnonzero(hold[max(first - SHORTEST, 0) : first][::-1])
    after = np.flatnonzero(hold[last + 1 : last + 1 + SHORTEST])
    out = [slice(first - int(before[0]), first)] if len(before) else []
    return [*out, slice(last + 1, last + 1 + int(after[0]))] if len(after) else out


def _rests(position_mm: Array, clean_mm: Array, noise_mm: float, quiet_mm: float) -> list[tuple[int, int]]:
    """Runs of samples (first, last), not the shortest, that differ by less than `quiet_mm` from one to the next.

    Some samples in a thousand are noise that no window of neighbours agrees with, and a mass would feel them as blows:
    a few between two rests at one level are of that rest, where chance can have thrown them.
    """
    still = np.abs(np.diff(clean_mm)) <= quiet_mm
    edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]]).astype(np.int8))).reshape(-1, 2)
    total = np.concatenate([[0.0], np.cumsum(position_mm - position_mm[0])])
    out: list[tuple[int, int]] = []
    for a, b in edges[edges[:, 1] - edges[:, 0] > 2 * EDGE].tolist():
        if out and _one_rest(position_mm - position_mm[0], total, out[-1], (a, b), noise_mm):
            out[-1] = out[-1][0], b
        else:
            out.append((a, b))
    return out


def _one_rest(
    position_mm: Array, total: Array, before: tuple[int, int], after: tuple[int, int], noise_mm: float
) -> bool:
    """Whether two runs, and what is between them, are samples of one level; `total`: running sums of the positions."""
    (a, b), (c, d) = before, after
    n, m, between = b - a + 1 - 2 * EDGE, d - c + 1 - 2 * EDGE, c - b - 1
    if between >= SHORTEST:
        return False
    level, other = (total[b + 1 - EDGE] - total[a + EDGE]) / n, (total[d + 1 - EDGE] - total[c + EDGE]) / m
    if abs(level - other) > LIKELY * noise_mm * np.sqrt(1.0 / n + 1.0 / m):
        return False
    return _by_chance((position_mm[b + 1 : c] - (n * level + m * other) / (n + m)) / noise_mm)


def _by_chance(off: Array) -> bool:
    """Whether noise may be all of some errors, in its standard deviations: each of them, and their mean."""
    return bool(np.all(np.abs(off) <= CHANCE) and abs(float(off.sum())) <= CHANCE * np.sqrt(len(off)))


def settled(time_s: Array, position_mm: Array) -> Array:
    """Smoothed positions (n,), each rest at its level; what `felt` begins with."""
    return _settled(time_s, position_mm).clean_mm


@dataclass(frozen=True)
class _Settled:
    """Smoothed positions (n,) with each rest at its level, their standard deviations (n,), the number of the rest (n,),
    0: in motion; what is left of the noise of all, mm, and that noise."""

    clean_mm: Array
    std_mm: Array
    hold: NDArray[np.intp]
    left_mm: float
    noise: PositionNoise

    @property
    def smoother(self) -> bool:
        """Whether there was noise that smoothing took away."""
        return 0.0 < self.left_mm < self.noise.of_means_mm


def _settled(time_s: Array, position_mm: Array) -> _Settled:
    noise = position_noise(position_mm)
    clean, std = smoothed(time_s, position_mm, noise)
    left = float(np.median(std)) if len(std) else 0.0
    found = _Settled(clean, std, np.zeros(len(clean), dtype=np.intp), left, noise)
    if not found.smoother:
        return found
    clean, std, hold = _rested(position_mm, clean, std, noise, left)
    return replace(found, clean_mm=clean, std_mm=std, hold=hold)


def felt(time_s: Array, position_mm: Array) -> Felt:
    """Smoothed positions, and the motion between them rebuilt (`bench.motion_between`).

    A move that is a planner's trapezoid, as far as its noisy samples tell, becomes that trapezoid: a moving mass and a
    lag feel accelerations and corners that no smoothing keeps.
    """
    begun = _settled(time_s, position_mm)
    clean, std, hold, left, noise = begun.clean_mm, begun.std_mm, begun.hold, begun.left_mm, begun.noise.of_means_mm
    planned: Moves = {}
    doubt = np.zeros(len(clean))
    stretch = -1 - np.arange(len(clean)) // TOGETHER
    if begun.smoother:
        step, coarse = resolution(position_mm), _coarse(position_mm)
        stretch = np.where(hold > 0, hold, stretch)
        planned, others = planned_moves(time_s, position_mm, clean, begun.noise, left, hold > 0)
        worse = float(np.sqrt(max(missed(planned, time_s, position_mm, noise)[0], 1.0)))
        for (first, last), move in planned.items():
            inside = slice(first, last + 1)
            clean[inside] = move.position(time_s[inside])
            for rest in _between(hold, first, last):  # what is left between the move and the rest beside it
                level = move.position(time_s[rest])
                if _by_chance((position_mm[rest] - level) / noise):
                    clean[rest] = level
            if (other := others.get((first, last))) is not None:
                doubt[inside] = np.abs(other.position(time_s[inside]) - clean[inside])
            at_ends = max(float(std[first]), float(std[last]), 0.7 * coarse)
            std[inside] = max(2.0 * worse * noise / np.sqrt(last - first + 1), at_ends)
            stretch[inside] = 1 + len(clean) + first
        # a window grows until it shows that the motion is no parabola: by then it is off by as much again
        std = np.where(stretch < 0, np.minimum(ASTRAY * std, np.maximum(std, noise)), std)
        # at a corner a window that it hardly shows in may be off by as much as the reading is from it
        beside = np.abs(position_mm - clean)
        std = np.where((stretch < 0) & (beside > BESIDE * begun.noise.each_mm), np.maximum(std, beside), std)
        # a coarse scale's error averages out over levels that are passed, not over readings of one
        std = np.where(np.abs(np.gradient(clean)) < 2.0 * step, np.maximum(std, coarse), std)
    time, position = motion_between(time_s, clean, noise_mm=left, planned=planned)
    before = np.clip(np.searchsorted(time_s, time, side="right") - 1, 0, len(clean) - 1)
    moves = tuple((float(time_s[a]), float(time_s[b]), move) for (a, b), move in sorted(planned.items()))
    std, doubt = np.interp(time, time_s, std), np.interp(time, time_s, doubt)
    return Felt(time, position, std, begun.noise, stretch[before], hold[before], doubt, moves)


def serves(felt_N: float, reported_N: float) -> bool:
    """Whether a model errs clearly less on the motion as felt than on the positions as reported, by its errors on both;
    else what was taken for noise of the positions was felt, or makes no difference."""
    return not felt_N >= (1.0 - CLEARLY) * reported_N  # nor where on those it is no plant at all
