"""Motion between samples, rebuilt from the samples: nodes where a straight line would miss what matters.

At 100 samples a second a ramp of 80 mm/s goes nearly a millimetre in a sample, and its corners fall anywhere within
one. The force feels both: where the corner was, and the law's bend along the way. Two reconstructions:

- a move from rest to rest is tried as a trapezoid of speed, which is what motion planners make. Its middle in time and
  its speed are the move's own; the acceleration is shared by all moves, so that two samples inside a move suffice;
- anything else, and moves that the trapezoid does not meet, follow a cubic that neither overshoots nor smooths corners
  away (modified Akima: H. Akima, J. ACM 17, 1970, 589-602, with the weights of MATLAB's `makima`).

Measured samples stay as they are: the curve is bent to go through each of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

STEP = 1 / 100  # of the reach: a longer way between two nodes is cut
BEND = 1e-4  # of the reach: a bend that a line between nodes may leave out
WIDEST = 64  # nodes an interval at the most
INSIDE, ALL = 16, 200  # samples of a move that are looked at; where they are noisy
SCAN = np.geomspace(100.0, 1e6, 25)  # of accelerations, in reaches/s²
GENTLE = 0.01  # what a doubled acceleration costs, in squares of the slack and a move
SLACK = 1e-3  # of the way: what a trapezoid may miss a sample by
LEAST = 3  # samples of a move that can show it to be a trapezoid
NEAR = 30  # samples between a move and a rest, whose first and last ones may be told late
PAUSE = 2  # intervals that are no rest where the motion hardly slows down
GAPS = (30, 10, PAUSE)  # samples that noise can make look like a rest amid a slow move
AGREED = 5.0  # standard deviations of χ² within which it is one


def motion_between(
    time_s: Array,
    position_mm: Array,
    reach_mm: float | None = None,
    noise_mm: float = 0.0,
    planned: Moves | None = None,
) -> tuple[Array, Array]:
    """Samples with more nodes between them where they matter; the very same arrays where none does.

    `time_s`, `position_mm`: shape (n,), times rising. `reach_mm`: the depth that the precision is measured by, by
    default the range of the positions. `noise_mm`: standard deviation of the position's noise; steps within it are no
    motion. `planned`: moves that are known to be trapezoids (`planned_moves`), which the positions follow already.
    Returns times and positions, shape (n + k,), with every sample of the input among them.
    """
    reach = float(np.ptp(position_mm)) if reach_mm is None else reach_mm
    if len(time_s) < 5 or not reach > 0:
        return time_s, position_mm
    moving, groups = _moving(position_mm, reach, noise_mm)
    known = planned or {}
    groups = [g for g in groups if not any(g[0] < k[1] and k[0] < g[1] for k in known)]
    if not groups and not known:
        return time_s, position_mm
    trapezoids = known | _trapezoids(time_s, position_mm, moving, groups, reach, noise_mm)
    groups = sorted([*groups, *known])
    cut = [
        _cut(time_s, position_mm, *group, trapezoids.get(group), reach, noise_mm, group in known) for group in groups
    ]
    times = np.concatenate([t for t, _ in cut])
    if not len(times):
        return time_s, position_mm
    place = np.searchsorted(time_s, times)
    values = np.concatenate([x for _, x in cut])
    return np.insert(time_s, place, times), np.insert(position_mm, place, values)


Moves = dict[tuple[int, int], "Trapezoid"]
"""By (sample before, sample after)."""


def planned_moves(
    time_s: Array,
    position_mm: Array,
    clean_mm: Array,
    noise_mm: float,
    left_mm: float,
    resting: NDArray[np.bool_] | None = None,
) -> Moves:
    """Moves whose noisy positions (n,) are those of a trapezoid and nothing else, within the noise of the samples.

    `clean_mm` (n,): the same positions smoothed, with noise `left_mm`: they tell where moves begin and end. `resting`
    (n,): where they are means over a long rest; a move begins and ends at such a level where one is near.
    """
    reach = float(np.ptp(clean_mm))
    if len(time_s) < 5 or not reach > 0:
        return {}
    out: Moves = {}
    for quiet_mm in (left_mm, noise_mm):  # what is left beside a move may hide that it begins at rest
        moving = _carried_on(_moving(clean_mm, reach, quiet_mm)[0], clean_mm)
        pieces = [_onward(clean_mm, *group) for group in _grouped(moving, moving)]
        for gap in GAPS:
            groups = [(a, b) for a, b in _chained(clean_mm, pieces, gap) if b - a >= LEAST]
            groups = [g for g in groups if not any(g[0] < o[1] and o[0] < g[1] for o in out)]
            if groups:
                found = _trapezoids(
                    time_s, clean_mm, moving, groups, reach, noise_mm, position_mm, ALL, resting, 4.0 * noise_mm
                )
                told = _told(found, time_s, position_mm, noise_mm)
                out |= {k: v for k, v in told.items() if not any(k[0] < o[1] and o[0] < k[1] for o in out)}
    return _apart(out)


def _onward(position_mm: Array, first: int, last: int) -> tuple[int, int]:
    """The stretch without steps at its ends that go against its way: they are noise of the rests beside it."""
    on = np.flatnonzero(np.diff(position_mm[first : last + 1]) * (position_mm[last] - position_mm[first]) > 0.0)
    return (first + int(on[0]), first + int(on[-1]) + 1) if len(on) else (first, first)


def _chained(position_mm: Array, pieces: list[tuple[int, int]], gap: int) -> list[tuple[int, int]]:
    """Stretches of motion, those of one way that are no more than `gap` samples apart as one."""
    out: list[tuple[int, int]] = []
    for first, last in pieces:
        if last <= first:
            continue
        if out and first - out[-1][1] <= gap:
            a, b = out[-1]
            ways = position_mm[last] - position_mm[first], position_mm[b] - position_mm[a]
            if ways[0] * ways[1] > 0.0:
                out[-1] = a, last
                continue
        out.append((first, last))
    return out


def _told(found: Moves, time_s: Array, position_mm: Array, noise_mm: float) -> Moves:
    """Those that the noisy positions agree with, with the slow beginnings and ends that hide in the noise."""
    out = {}
    for (first, last), move in found.items():
        corners = move.corners_s()
        a = min(first, max(int(np.searchsorted(time_s, corners[0])) - 1, 0))
        b = max(last, min(int(np.searchsorted(time_s, corners[-1])) + 1, len(time_s) - 1))
        off = (position_mm - move.position(time_s))[a : b + 1] / noise_mm
        n = len(off)
        if n >= LEAST and float(np.sum(off**2)) <= 1.2 * n + AGREED * np.sqrt(2.0 * n):
            out[a, b] = move
    return out


def _apart(moves: Moves) -> Moves:
    """The same moves, each ending where the next begins at the latest."""
    out: Moves = {}
    pairs = sorted(moves.items())
    for k, ((first, last), move) in enumerate(pairs):
        following = pairs[k + 1][0][0] if k + 1 < len(pairs) else last
        if first < min(last, following):
            out[first, min(last, following)] = move
    return out


def _moving(position_mm: Array, reach: float, noise_mm: float) -> tuple[NDArray[np.bool_], list[tuple[int, int]]]:
    """(which intervals are motion, stretches of them that want nodes)."""
    steps = np.abs(np.diff(position_mm))
    moving = steps > max(6 * noise_mm, 1e-5 * reach)
    needed = moving & (steps > max(STEP / 2 * reach, 12 * noise_mm))
    return moving, _grouped(moving, needed)


def _carried_on(moving: NDArray[np.bool_], position_mm: Array) -> NDArray[np.bool_]:
    """The same, with short intervals too that are no rest: the way goes on there at no less than half the speed."""
    out, steps = moving.copy(), np.diff(position_mm)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], ~moving, [False]]).astype(np.int8))).reshape(-1, 2)
    for a, b in edges[edges[:, 1] - edges[:, 0] <= PAUSE].tolist():
        beside = steps[[max(a - 1, 0), min(b, len(steps) - 1)]]
        if np.all(steps[a:b] * beside[0] > 0.5 * np.abs(beside[0]) * np.abs(beside).min()) and beside.prod() > 0:
            out[a:b] = True
    return out


def _grouped(moving: NDArray[np.bool_], needed: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Stretches of moving intervals that hold a needed one: (sample before, sample after)."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], moving, [False]]).astype(np.int8)))
    pairs = edges.reshape(-1, 2)
    count = np.concatenate([[0], np.cumsum(needed)])
    return [(int(a), int(b)) for a, b in pairs if count[b] > count[a]]


@dataclass(frozen=True)
class Trapezoid:
    """A move from rest to rest: from `start_mm` by `way_mm` (signed), its middle at `middle_s`."""

    start_mm: float
    way_mm: float
    middle_s: float
    speed_mm_s: float
    acceleration_mm_s2: float

    def position(self, time_s: Array) -> Array:
        """Where it is, mm."""
        way = abs(self.way_mm)
        s, _, _ = _profile(time_s - self.middle_s, np.array(way), np.array(self.speed_mm_s), self.acceleration_mm_s2)
        return np.asarray(self.start_mm + np.sign(self.way_mm) * s)

    def corners_s(self) -> Array:
        """Where the acceleration changes."""
        v, a = self.speed_mm_s, self.acceleration_mm_s2
        way = abs(self.way_mm)
        long, short = (way / v + v / a) / 2, max(way / v - v / a, 0.0) / 2
        return self.middle_s + np.array([-long, -short, short, long])


def _profile(tau: Array, way: Array, speed: Array, acceleration: float | Array) -> tuple[Array, Array, Array]:
    """Way gone at τ from a trapezoid's middle, its derivatives by the middle's time and by the speed."""
    half, late = (way / speed + speed / acceleration) / 2, np.abs(tau)
    left = np.maximum(half - late, 0.0)  # until it stands
    cruising = late <= (way / speed - speed / acceleration) / 2
    rise = np.where(cruising, speed * late, way / 2 - acceleration / 2 * left**2)
    slope = np.where(cruising, speed, acceleration * left)
    by_half = (-way / speed**2 + 1 / acceleration) / 2
    by_speed = np.where(cruising, late, -acceleration * left * by_half)
    side = np.sign(tau)
    return way / 2 + side * rise, -slope, side * by_speed


@dataclass
class _Moves:
    """Moves from rest to rest, padded to one width: `time_s`, `gone` (way since the start, ≥ 0), `used`: (m, w)."""

    time_s: Array
    gone: Array
    used: Array
    way: Array
    middle: Array
    speed: Array
    count: NDArray[np.intp]
    duration: Array


def _trapezoids(
    t: Array,
    x: Array,
    moving: NDArray[np.bool_],
    groups: list[tuple[int, int]],
    reach: float,
    noise: float | Array,
    fitted: Array | None = None,
    most: int = INSIDE,
    resting: NDArray[np.bool_] | None = None,
    back: float = 0.0,
) -> Moves:
    """The groups that are trapezoids, within what the samples tell; `fitted`: samples to fit instead of x, `most` of a
    move. `noise`: of all of them, or of each of the groups, which begin and end at rest then. `resting`: where x is the
    level of a rest. `back`: how far a step may go against the way."""
    rest = [g for g in groups if _from_rest(moving, x, g, back)]
    if not rest:
        return {}
    starts, ends = _levels(x, moving, rest)
    if resting is not None:
        starts, ends = _of_rests(x, resting, rest, starts, ends, 4 * noise)
    # within the noise a rest may be at the level of the one before, or lie the other way
    on = (ends - starts) * np.array([x[last] - x[first] for first, last in rest]) > 0.0
    if not on.any():
        return {}
    rest, starts, ends = [g for g, goes in zip(rest, on, strict=True) if goes], starts[on], ends[on]
    noise = noise[on] if isinstance(noise, np.ndarray) else noise
    moves = _moves(t, x, rest, starts, ends, x if fitted is None else fitted, most)
    allowed = np.maximum(4 * noise, SLACK * moves.way)
    told = moves.count >= 2
    if not told.any():
        return {}
    scale = np.where(told, 1 / allowed**2, 0.0)

    def misfit(acceleration: float) -> tuple[float, tuple[Array, Array, Array]]:
        fitted = _fitted(moves, acceleration)
        # A move that is no trapezoid at any acceleration must not decide for the others.
        # Two samples inside a move are met by any acceleration above the true one: the least one counts.
        least = GENTLE * np.count_nonzero(told) * np.log(acceleration)
        return float(np.sum(moves.count * np.log1p(fitted[2] * scale / np.maximum(moves.count, 1))) + least), fitted

    scanned = [misfit(a * reach)[0] for a in SCAN]
    best = int(np.argmin(scanned))
    low, high = np.log(SCAN[max(best - 1, 0)] * reach), np.log(SCAN[min(best + 1, len(SCAN) - 1)] * reach)
    acceleration = _golden(lambda g: misfit(float(np.exp(g)))[0], float(low), float(high))
    _, (middle, speed, squares) = misfit(acceleration)
    observed = moves.speed
    for factor in (0.8, 1.3):  # a search that ended beside a corner is begun again on its other side
        moves.speed = factor * observed
        again = _fitted(moves, acceleration)
        better = again[2] < squares
        middle, speed, squares = (
            np.where(better, new, old) for new, old in zip(again, (middle, speed, squares), strict=True)
        )
    lone = moves.count == 1
    cruised = told & (speed < 0.97 * np.sqrt(acceleration * moves.way))
    if lone.any():  # one sample inside tells when, not how fast: as the others
        usual = float(np.median(speed[cruised])) if cruised.any() else np.inf
        moves.speed = np.where(lone, np.maximum(usual, moves.way / moves.duration), speed)
        alone = _fitted(moves, acceleration, lone)
        middle, speed, squares = (
            np.where(lone, new, old) for new, old in zip(alone, (middle, speed, squares), strict=True)
        )
    good = np.sqrt(squares / np.maximum(moves.count, 1)) <= allowed
    more = moves.count >= 3
    if more.any() and np.mean(good[more]) < 0.5:
        return {}  # no trapezoids: those with too few samples to tell are none either
    out = {}
    for k, group in enumerate(rest):
        if good[k] and moves.count[k] > 0:
            sign = 1.0 if ends[k] > starts[k] else -1.0
            out[group] = Trapezoid(
                float(starts[k]), sign * float(moves.way[k]), float(middle[k]), float(speed[k]), acceleration
            )
    return out


def _from_rest(moving: NDArray[np.bool_], x: Array, group: tuple[int, int], back: float = 0.0) -> bool:
    first, last = group
    if first < 1 or last > len(moving) - 1:
        return False
    steps = np.diff(x[first : last + 1])
    return bool(np.all(steps > -back) and x[last] > x[first] or np.all(steps < back) and x[last] < x[first])


def _levels(x: Array, moving: NDArray[np.bool_], groups: list[tuple[int, int]]) -> tuple[Array, Array]:
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
    x: Array, resting: NDArray[np.bool_], groups: list[tuple[int, int]], starts: Array, ends: Array, near: float | Array
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


def _moves(
    t: Array, x: Array, groups: list[tuple[int, int]], starts: Array, ends: Array, fitted: Array, most: int
) -> _Moves:
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
        speed[k] = np.max(np.diff(along) / np.diff(t[first : last + 1]))
    firsts, lasts = np.array([g[0] for g in groups]), np.array([g[1] for g in groups])
    return _Moves(time, gone, used, way, middle, speed, np.array([len(p) for p in picked]), t[lasts] - t[firsts])


def _fitted(
    moves: _Moves, acceleration: float, speed_kept: NDArray[np.bool_] | None = None
) -> tuple[Array, Array, Array]:
    """Middle, speed and Σ error² of each move, by damped Gauss-Newton steps on all moves at once, (m,) each."""
    fastest = np.sqrt(acceleration * moves.way)
    slowest = moves.way / moves.duration
    middle, speed = moves.middle.copy(), np.clip(1.02 * moves.speed, np.minimum(slowest, fastest), fastest)
    kept = np.zeros(len(middle), dtype=bool) if speed_kept is None else speed_kept
    damping = np.full(len(middle), 1e-3)

    def model(middle: Array, speed: Array) -> tuple[Array, Array, Array]:
        s, by_middle, by_speed = _profile(
            moves.time_s - middle[:, None], moves.way[:, None], speed[:, None], acceleration
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


def _cut(
    t: Array, x: Array, first: int, last: int, trapezoid: Trapezoid | None, reach: float, noise: float, exact: bool
) -> tuple[Array, Array]:
    """New nodes of one group, times and positions; `exact`: the samples are the trapezoid's own."""
    time = t[first : last + 1]
    h, steps = np.diff(time), np.abs(np.diff(x[first : last + 1]))
    corners = np.zeros(0)
    position: Callable[[Array], Array]
    if trapezoid is not None:
        position = trapezoid.position
        corners = trapezoid.corners_s()
        corners = corners[(corners > time[0]) & (corners < time[-1])]
        bend = trapezoid.acceleration_mm_s2 * h**2 / 8
        bend = np.minimum(bend, steps)
    else:
        position = _cubic(t, x, first, last)
        middles = time[:-1] + h / 2
        bend = np.abs(position(middles) - (x[first:last] + x[first + 1 : last + 1]) / 2)
        bend = np.where(bend > 3 * noise, bend, 0.0)
    pieces = np.ceil(np.maximum(steps / (STEP * reach), np.sqrt(bend / (BEND * reach))))
    pieces = np.clip(pieces, 1, WIDEST).astype(np.intp)
    new = [time[k] + h[k] * np.arange(1, n) / n for k, n in enumerate(pieces) if n > 1]
    if exact and len(corners):  # where the acceleration jumped, the next sample wants some nodes of the new one alone
        following = time[np.clip(np.searchsorted(time, corners, side="right"), 0, len(time) - 1)]
        new += [corners, corners + (following - corners) / 3, corners + (following - corners) * 2 / 3]
    fresh = np.unique(np.concatenate([*new, corners])) if new or len(corners) else np.zeros(0)
    # A node on a sample says nothing, and a sliver of a step costs digits.
    at = np.clip(np.searchsorted(time, fresh, side="right") - 1, 0, len(h) - 1)
    away = np.minimum(fresh - time[at], time[at + 1] - fresh)
    fresh = fresh[away > 1e-3 * h[at]]
    if exact:
        fresh = fresh[np.diff(fresh, prepend=-np.inf) > 1e-3 * float(h.min())]
    miss = x[first : last + 1] - position(time)
    return fresh, np.asarray(position(fresh) + np.interp(fresh, time, miss))


def _cubic(t: Array, x: Array, first: int, last: int) -> Callable[[Array], Array]:
    """A smooth curve through the samples of a group and some beside it."""
    from scipy.interpolate import Akima1DInterpolator

    a, b = max(first - 3, 0), min(last + 4, len(t))
    curve: Callable[[Array], Array] = Akima1DInterpolator(t[a:b], x[a:b], method="makima")
    return curve
