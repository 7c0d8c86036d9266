"""Moves from rest to rest fitted as planned profiles: middle and speed of each, acceleration and smoothing of all."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from bench.profiles import PLAIN, Smoothing, Trapezoid, profile

if TYPE_CHECKING:
    from bench.position_noise import PositionNoise

Array = NDArray[np.float64]
Group = tuple[int, int]
"""(sample before, sample after) a move."""

Moves = dict[Group, Trapezoid]

Shape = tuple[Smoothing, float]
"""What smooths all moves, and their acceleration, mm/s²."""

INSIDE, ALL = 16, 200  # samples of a move that are looked at; where they are noisy
SCAN = np.geomspace(100.0, 1e6, 25)  # of accelerations, in reaches/s²
GENTLE = 0.01  # what a doubled acceleration costs, in squares of the slack and a move
SLACK = 1e-3  # of the way: what a trapezoid may miss a sample by
NEAR = 30  # samples between a move and a rest, whose first and last ones may be told late
NOISIER = 1.2  # times the noise's square as the rests tell it, that a move may leave
AGREED = 5.0  # standard deviations of χ² within which a move is a profile
MOSTLY = 0.8  # of the moves that tell: where so many are trapezoids nothing smooths them
TELLING, SHOWING = 6, 48  # samples of a move that tell how it begins and ends, at the least; and as many as it takes
APART = 10  # samples of rest between two moves, one of which would else be in the other
BEGUN = 1.02  # times the speed that is seen, where a search begins
FASTEST = 12  # moves: slow ones hardly show how they begin
SMOOTHED_S = (0.3e-3, 0.7e-3, 1.5e-3, 3e-3, 6e-3, 12e-3)  # standard deviations of smoothing that are tried first
FASTER, STARTED = (1.0, 1.5, 3.0), 2  # times the acceleration of plain trapezoids; the best of these that are begun at
TAKEN, SURELY = 12.0, 30.0  # χ² that smoothing must take; less leaves some doubt


@dataclass
class _Sampled:
    """Moves from rest to rest, padded to one width: `time_s`, `gone` (way since the start, ≥ 0), `used`: (m, w).
    `middle`, `speed` (m,): where a fit begins; `duration` (m,): the longest that a cruise can take."""

    time_s: Array
    gone: Array
    used: Array
    way: Array
    middle: Array
    speed: Array
    count: NDArray[np.intp]
    duration: Array


@dataclass
class _Asked:
    """Moves to be fitted, where each begins and ends, and what a profile may miss a sample of it by (m,), mm."""

    groups: list[Group]
    starts: Array
    ends: Array
    moves: _Sampled
    allowed: Array

    @property
    def told(self) -> NDArray[np.bool_]:
        """Which have samples enough to say anything of the acceleration."""
        return self.moves.count >= 2

    def only(self, index: NDArray[np.intp]) -> _Asked:
        """Some of the moves."""
        moves = _Sampled(*(getattr(self.moves, field.name)[index] for field in fields(self.moves)))
        groups = [self.groups[k] for k in index.tolist()]
        return _Asked(groups, self.starts[index], self.ends[index], moves, self.allowed[index])

    def cost(self, shape: Shape) -> float:
        """What profiles of a shape leave."""
        squares = _fitted(self.moves, shape)[2]
        scale = np.where(self.told, 1 / self.allowed**2, 0.0)
        # A move that is no trapezoid at any acceleration must not decide for the others.
        # Two samples inside a move are met by any acceleration above the true one: the least one counts.
        least = GENTLE * np.count_nonzero(self.told) * np.log(shape[1])
        return float(np.sum(self.moves.count * np.log1p(squares * scale / np.maximum(self.moves.count, 1))) + least)

    def acceleration(self, reach: float) -> float:
        """The acceleration of which trapezoids leave the least, mm/s²."""
        scanned = [self.cost((PLAIN, a * reach)) for a in SCAN]
        best = int(np.argmin(scanned))
        low, high = np.log(SCAN[max(best - 1, 0)] * reach), np.log(SCAN[min(best + 1, len(SCAN) - 1)] * reach)
        return _golden(lambda g: self.cost((PLAIN, float(np.exp(g)))), float(low), float(high))


def _asked(
    t: Array, x: Array, moving: NDArray[np.bool_], groups: list[Group], noise: float | Array, fitted: Array | None,
    most: int, resting: NDArray[np.bool_] | None, back: float,
) -> _Asked | None:  # fmt: skip
    rest = [g for g in groups if from_rest(moving, x, g, back)]
    if not rest:
        return None
    starts, ends = _levels(x, moving, rest)
    if resting is not None:
        starts, ends = _of_rests(x, resting, rest, starts, ends, 4 * noise)
    # within the noise a rest may be at the level of the one before, or lie the other way
    on = (ends - starts) * np.array([x[last] - x[first] for first, last in rest]) > 0.0
    if not on.any():
        return None
    rest, starts, ends = [g for g, goes in zip(rest, on, strict=True) if goes], starts[on], ends[on]
    noise = noise[on] if isinstance(noise, np.ndarray) else noise
    allowed = np.maximum(4 * noise, SLACK * np.abs(ends - starts))
    moves = _sampled(t, x, rest, starts, ends, x if fitted is None else fitted, most, allowed)
    asked = _Asked(rest, starts, ends, moves, allowed)
    return asked if asked.told.any() else None


def fitted_moves(
    t: Array,
    x: Array,
    moving: NDArray[np.bool_],
    groups: list[Group],
    reach: float,
    noise: float | Array,
    fitted: Array | None = None,
    most: int = INSIDE,
    resting: NDArray[np.bool_] | None = None,
    back: float = 0.0,
    shape: Shape | None = None,
) -> Moves:
    """The groups that are trapezoids, within what the samples tell; `fitted`: samples to fit instead of x, `most` of a
    move. `noise`: of all of them, or of each of the groups, which begin and end at rest then. `resting`: where x is the
    level of a rest. `back`: how far a step may go against the way. `shape`: smoothing and acceleration of all of them,
    where they are known (`smoothed_shape`)."""
    asked = _asked(t, x, moving, groups, noise, fitted, most, resting, back)
    if asked is None:
        return {}
    moves, told, allowed = asked.moves, asked.told, asked.allowed
    shape = shape or (PLAIN, asked.acceleration(reach))
    smoothing, acceleration = shape
    middle, speed, squares = _fitted(moves, shape)
    observed = moves.speed
    for factor in (0.8, 1.3):  # a search that ended beside a corner is begun again on its other side
        moves.speed = factor * observed
        again = _fitted(moves, shape)
        better = again[2] < squares
        middle, speed, squares = (
            np.where(better, new, old) for new, old in zip(again, (middle, speed, squares), strict=True)
        )
    lone = moves.count == 1
    cruised = told & (speed < 0.97 * np.sqrt(acceleration * moves.way))
    if lone.any():  # one sample inside tells when, not how fast: as the others
        usual = float(np.median(speed[cruised])) if cruised.any() else np.inf
        moves.speed = np.where(lone, BEGUN * np.maximum(usual, moves.way / moves.duration), speed)
        alone = _fitted(moves, shape, lone)
        middle, speed, squares = (
            np.where(lone, new, old) for new, old in zip(alone, (middle, speed, squares), strict=True)
        )
    good = np.sqrt(squares / np.maximum(moves.count, 1)) <= allowed
    if fitted is not None:
        for k in np.flatnonzero(good & (moves.count == most)).tolist():
            one = slice(k, k + 1)  # by all its samples, from what a few of them tell
            whole = _sampled(t, x, asked.groups[one], asked.starts[one], asked.ends[one], fitted, len(t), allowed[one])
            whole.middle, whole.speed = middle[one], speed[one]
            (middle[k],), (speed[k],), _ = _fitted(whole, shape)
    more = moves.count >= 3
    if more.any() and np.mean(good[more]) < 0.5:
        return {}  # no trapezoids: those with too few samples to tell are none either
    out = {}
    for k, group in enumerate(asked.groups):
        if good[k] and moves.count[k] > 0:
            sign = 1.0 if asked.ends[k] > asked.starts[k] else -1.0
            out[group] = Trapezoid(
                float(asked.starts[k]), sign * float(moves.way[k]), float(middle[k]), float(speed[k]), acceleration,
                smoothing,
            )  # fmt: skip
    return out


def smoothed_shape(
    t: Array, x: Array, moving: NDArray[np.bool_], groups: list[Group], reach: float, noise: PositionNoise,
    fitted: Array, resting: NDArray[np.bool_] | None = None, back: float = 0.0,
) -> tuple[Shape | None, Shape | None]:  # fmt: skip
    """(what smooths the moves, where they are trapezoids but for that: None where they are as they are, or something
    else; what these samples exclude as little)."""
    every = _asked(t, x, moving, groups, noise.of_means_mm, fitted, SHOWING, resting, back)
    if every is None:
        return None, None
    # where a move turns round at once, the end of the one before is in it
    firsts, lasts = np.array(every.groups).T
    apart = np.minimum(np.append(firsts[1:] - lasts[:-1], NEAR), np.append(NEAR, firsts[1:] - lasts[:-1])) >= APART
    telling = np.flatnonzero((every.moves.count >= TELLING) & apart)
    if not len(telling):
        return None, None
    asked = every.only(telling[np.argsort(-every.moves.speed[telling], kind="stable")[:FASTEST]])

    n, bare = asked.moves.count.astype(np.float64), (PLAIN, asked.acceleration(reach))
    as_they_are = _fitted(asked.moves, bare)[2]
    agreed = strays(as_they_are, n, noise) <= AGREED
    told = float(np.sum(n[agreed]))
    enough = told - 2.0 * np.sqrt(2.0 * told * noise.memory) + TAKEN * noise.memory
    if np.mean(agreed) >= MOSTLY and float(np.sum(as_they_are[agreed])) < enough * noise.each_mm**2:
        return None, None  # there is nothing to take
    shape = _smoothed(asked, bare[1])
    smoothed = _fitted(asked.moves, shape)[2]
    of_all = np.sqrt(smoothed / n) <= asked.allowed  # others are no such profiles at all
    each_left = max(float(np.sum(smoothed[of_all])) / max(float(np.sum(n[of_all])), 1.0), noise.each_mm**2)
    taken = float(np.sum((as_they_are - smoothed)[of_all])) / each_left / noise.memory
    if taken < TAKEN:
        return None, shape if taken > 0.0 else None
    return shape, bare if taken < SURELY else None


def _smoothed(asked: _Asked, plain_mm_s2: float) -> Shape:
    """The smoothed shape that leaves the least, sought from some that plain trapezoids of an acceleration may be."""
    lags = [(np.sqrt(12.0) * std, 0.0) for std in SMOOTHED_S] + [(0.0, std / np.sqrt(2.0)) for std in SMOOTHED_S]
    begun = [np.array([np.log(factor * plain_mm_s2), *lag]) for lag in lags for factor in FASTER]

    def cost(numbers: Array) -> float:
        return asked.cost(_shape(numbers))

    ended = [_searched(cost, start) for start in sorted(begun, key=cost)[:STARTED]]
    return _shape(min(ended, key=lambda end: end[1])[0])


def _searched(cost: Callable[[Array], float], start: Array) -> tuple[Array, float]:
    """(logarithm of the acceleration, width and lag in s; cost) at the minimum near a start."""
    steps = np.array([0.3, 0.3 * start[1] + 1e-3, 0.3 * start[2] + 3e-4])
    simplex = np.vstack([start, start + np.diag(steps)])
    found = minimize(cost, start, method="Nelder-Mead", options={"initial_simplex": simplex, "maxfev": 120})
    return found.x, float(found.fun)


def _shape(numbers: Array) -> Shape:
    """Of the numbers that a search has: logarithm of the acceleration, width and lag in s."""
    return Smoothing(abs(float(numbers[1])), abs(float(numbers[2]))), float(np.exp(min(numbers[0], 25.0)))


def strays(squares: Array | float, count: Array | float, noise: PositionNoise) -> Array:
    """Standard deviations of χ² by which sums of squares of `count` samples are more than `NOISIER` times the noise of
    each of them, some of which say the same."""
    return np.asarray((squares / noise.each_mm**2 - NOISIER * count) / np.sqrt(2.0 * count * noise.memory))


def from_rest(moving: NDArray[np.bool_], x: Array, group: Group, back: float = 0.0) -> bool:
    """Whether a group goes one way, from rest to rest; `back`: how far a step may go against it."""
    first, last = group
    if first < 1 or last > len(moving) - 1:
        return False
    steps = np.diff(x[first : last + 1])
    return bool(np.all(steps > -back) and x[last] > x[first] or np.all(steps < back) and x[last] < x[first])


def _levels(x: Array, moving: NDArray[np.bool_], groups: list[Group]) -> tuple[Array, Array]:
    """Where the moves start and end: means over a few samples of the rests."""
    start, end = np.empty(len(groups)), np.empty(len(groups))
    for k, (first, last) in enumerate(groups):
        a, b = first, last
        while a > 0 and first - a < 7 and not moving[a - 1]:
            a -= 1
        while b < len(moving) and b - last < 7 and not moving[b]:
            b += 1
        start[k], end[k] = float(np.mean(x[a : first + 1])), float(np.mean(x[last : b + 1]))
    return start, end


def _of_rests(
    x: Array, resting: NDArray[np.bool_], groups: list[Group], starts: Array, ends: Array, near: float | Array
) -> tuple[Array, Array]:
    """The levels where moves start and end; where a rest is near in time and within `near`, its own."""
    at = np.flatnonzero(resting)
    if not len(at):
        return starts, ends
    firsts, lasts = np.array([g[0] for g in groups]), np.array([g[1] for g in groups])
    before = at[np.clip(np.searchsorted(at, firsts, side="right") - 1, 0, None)]
    after = at[np.clip(np.searchsorted(at, lasts), None, len(at) - 1)]
    begins = (np.abs(firsts - before) <= NEAR) & (np.abs(x[before] - starts) <= near)
    stops = (np.abs(after - lasts) <= NEAR) & (np.abs(x[after] - ends) <= near)
    return np.where(begins, x[before], starts), np.where(stops, x[after], ends)


def _sampled(
    t: Array, x: Array, groups: list[Group], starts: Array, ends: Array, fitted: Array, most: int, allowed: Array
) -> _Sampled:
    picked = []
    for first, last in groups:
        inside = np.arange(first + 1, last)
        if len(inside) > most:  # both ends tell the corners
            inside = inside[np.unique(np.round(np.linspace(0, len(inside) - 1, most)).astype(np.intp))]
        picked.append(inside)
    width = max(max(len(p) for p in picked), 1)
    m = len(groups)
    time, gone, used = np.zeros((m, width)), np.zeros((m, width)), np.zeros((m, width))
    middle, speed = np.empty(m), np.empty(m)
    way = np.abs(ends - starts)
    for k, ((first, last), p) in enumerate(zip(groups, picked, strict=True)):
        sign = 1.0 if ends[k] > starts[k] else -1.0
        time[k], used[k, : len(p)] = t[first], 1.0
        time[k, : len(p)], gone[k, : len(p)] = t[p], sign * (fitted[p] - starts[k])
        along = sign * (x[first : last + 1] - starts[k])
        middle[k] = np.interp(way[k] / 2, np.maximum.accumulate(along), t[first : last + 1])
        speed[k] = BEGUN * np.max(np.diff(along) / np.diff(t[first : last + 1]))
    firsts, lasts = np.array([g[0] for g in groups]), np.array([g[1] for g in groups])
    # what a move begins and ends with may hide in the noise of the rests, so that it took longer than it is seen to
    duration = (t[lasts] - t[firsts]) / np.maximum(1.0 - 2.0 * allowed / way, 0.5)
    return _Sampled(time, gone, used, way, middle, speed, np.array([len(p) for p in picked]), duration)


def _fitted(moves: _Sampled, shape: Shape, speed_kept: NDArray[np.bool_] | None = None) -> tuple[Array, Array, Array]:
    """Middle, speed and Σ error² of each move, by damped Gauss-Newton steps on all moves at once, (m,) each."""
    smoothing, acceleration = shape
    fastest = np.sqrt(acceleration * moves.way)
    slowest = moves.way / moves.duration
    middle, speed = moves.middle.copy(), np.clip(moves.speed, np.minimum(slowest, fastest), fastest)
    kept = np.zeros(len(middle), dtype=bool) if speed_kept is None else speed_kept
    damping = np.full(len(middle), 1e-3)

    def model(middle: Array, speed: Array) -> tuple[Array, Array, Array]:
        s, by_middle, by_speed = profile(
            moves.time_s - middle[:, None], moves.way[:, None], speed[:, None], acceleration, smoothing
        )
        return (moves.gone - s) * moves.used, by_middle * moves.used, by_speed * moves.used

    error, by_middle, by_speed = model(middle, speed)
    squares = np.sum(error**2, axis=1)
    for _ in range(10):
        H11, H22 = np.sum(by_middle**2, axis=1), np.sum(by_speed**2, axis=1)
        H12 = np.sum(by_middle * by_speed, axis=1)
        g1, g2 = np.sum(by_middle * error, axis=1), np.sum(by_speed * error, axis=1)
        held = kept | ((speed >= fastest) & (g2 > 0)) | (1e-12 * np.max(H22, initial=1e-300) >= H22)
        H12, g2 = np.where(held, 0.0, H12), np.where(held, 0.0, g2)
        H11, H22 = H11 * (1 + damping) + 1e-300, np.where(held, 1.0, H22 * (1 + damping)) + 1e-300
        whole = H11 * H22 - H12**2 + 1e-300
        tried_middle = middle + (H22 * g1 - H12 * g2) / whole
        tried_speed = np.clip(speed + (H11 * g2 - H12 * g1) / whole, np.minimum(slowest, fastest), fastest)
        tried = model(tried_middle, np.where(held, speed, tried_speed))
        now = np.sum(tried[0] ** 2, axis=1)
        better = now < squares
        damping = np.where(better, damping / 5, damping * 6)
        middle = np.where(better, tried_middle, middle)
        speed = np.where(better & ~held, tried_speed, speed)
        error, by_middle, by_speed = (
            np.where(better[:, None], new, old) for new, old in zip(tried, (error, by_middle, by_speed), strict=True)
        )
        squares = np.where(better, now, squares)
        if not better.any():
            break
    return middle, speed, squares


def _golden(f: Callable[[float], float], low: float, high: float) -> float:
    """exp of where a function of one minimum is least, by golden section."""
    ratio = (np.sqrt(5) - 1) / 2
    a, b = low, high
    c, d = b - ratio * (b - a), a + ratio * (b - a)
    fc, fd = f(c), f(d)
    for _ in range(16):
        if fc <= fd:
            b, d, fd = d, c, fc
            c = b - ratio * (b - a)
            fc = f(c)
        else:
            a, c, fc = c, d, fd
            d = a + ratio * (b - a)
            fd = f(d)
    return float(np.exp((a + b) / 2))
