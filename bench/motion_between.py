"""Motion between samples, rebuilt from the samples: nodes where a straight line would miss what matters.

At 100 samples a second a ramp of 80 mm/s goes nearly a millimetre in a sample, and its corners fall anywhere within
one. The force feels both: where the corner was, and the law's bend along the way. Two reconstructions:

- a move from rest to rest is tried as a trapezoid of speed, which is what motion planners make (`bench.fitted_moves`).
  Its middle in time and its speed are the move's own; the acceleration, and what drives smooth of it, is shared by all
  moves, so that two samples inside a move suffice;
- anything else, and moves that such a profile does not meet, follow a cubic that neither overshoots nor smooths corners
  away (modified Akima: H. Akima, J. ACM 17, 1970, 589-602, with the weights of MATLAB's `makima`).

Measured samples stay as they are: the curve is bent to go through each of them.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from bench.fitted_moves import AGREED, ALL, Moves, fitted_moves, smoothed_shape, strays
from bench.profiles import Trapezoid

if TYPE_CHECKING:
    from bench.position_noise import PositionNoise

Array = NDArray[np.float64]

STEP = 1 / 100  # of the reach: a longer way between two nodes is cut
BEND = 1e-4  # of the reach: a bend that a line between nodes may leave out
WIDEST = 64  # nodes an interval at the most
LEAST = 3  # samples of a move that can show it to be a trapezoid
PARTS, SHORTEST = 6, 4  # of a move, whose means show another profile; samples of one
ENDS = 6  # samples at either end of a move, which are off together where its level is not that of the rest beside it
LOOSE = 2.5  # times the power of the noise: another profile that is as near as a smoothed motion would be
FARTHER = 8.0  # times the noise, that a planned move goes at the least
PAUSE = 2  # intervals that are no rest where the motion hardly slows down
GAPS = (30, 10, PAUSE)  # samples that noise can make look like a rest amid a slow move


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
    trapezoids = known | fitted_moves(time_s, position_mm, moving, groups, reach, noise_mm)
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


def planned_moves(
    time_s: Array,
    position_mm: Array,
    clean_mm: Array,
    noise: PositionNoise,
    left_mm: float,
    resting: NDArray[np.bool_] | None = None,
) -> tuple[Moves, Moves]:
    """Moves whose noisy positions (n,) are those of a trapezoid and nothing else, within the noise of the samples. And
    those of them that may be of another shape as well, in that.

    `clean_mm` (n,): the same positions smoothed, with noise `left_mm`: they tell where moves begin and end. `resting`
    (n,): where they are means over a long rest; a move begins and ends at such a level where one is near.
    """
    reach = float(np.ptp(clean_mm))
    if len(time_s) < 5 or not reach > 0:
        return {}, {}
    out: Moves = {}
    asked, shape, other = False, None, None
    noise_mm, back = noise.of_means_mm, 4.0 * noise.of_means_mm
    for quiet_mm in (left_mm, noise_mm):  # what is left beside a move may hide that it begins at rest
        moving = _carried_on(_moving(clean_mm, reach, quiet_mm)[0], clean_mm)
        pieces = [_onward(clean_mm, *group) for group in _grouped(moving, moving)]
        for gap in GAPS:
            groups = [(a, b) for a, b in _chained(clean_mm, pieces, gap) if b - a >= LEAST]
            groups = [g for g in groups if not any(g[0] < o[1] and o[0] < g[1] for o in out)]
            if groups:
                if not asked:
                    asked = True
                    shape, other = smoothed_shape(
                        time_s, clean_mm, moving, groups, reach, noise, position_mm, resting, back
                    )
                found = fitted_moves(
                    time_s, clean_mm, moving, groups, reach, noise_mm, position_mm, ALL, resting, back, shape
                )
                told = _told(found, time_s, position_mm, noise)
                out |= {k: v for k, v in told.items() if not any(k[0] < o[1] and o[0] < k[1] for o in out)}
    power, parts = missed(out, time_s, position_mm, noise_mm)
    if not out or power > LOOSE + AGREED * np.sqrt(2.0 / parts):
        return {}, {}
    out = _apart(out)
    if other is None:
        return out, {}
    return out, fitted_moves(
        time_s, clean_mm, moving, list(out), reach, noise_mm, position_mm, ALL, resting, back, other
    )


def missed(found: Moves, time_s: Array, position_mm: Array, noise_mm: float) -> tuple[float, int]:
    """(power of what moves leave of the noisy positions, in means over parts of them, over the noise's own; parts).

    What each of them hides in the noise of its samples shows there, where another profile goes beside it again and
    again.
    """
    power, parts = 0.0, 0
    for (first, last), move in found.items():
        inside = slice(first, last + 1)
        off = (position_mm[inside] - move.position(time_s[inside])) / noise_mm
        for part in np.array_split(off, max(min(PARTS, len(off) // SHORTEST), 1)):
            power, parts = power + float(np.sum(part)) ** 2 / len(part), parts + 1
    return power / max(parts, 1), max(parts, 1)


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


def _told(found: Moves, time_s: Array, position_mm: Array, noise: PositionNoise) -> Moves:
    """Those that the noisy positions agree with, with the slow beginnings and ends that hide in the noise. What goes no
    farther than noise does is none: a coarse scale hops to and fro, and a mass would feel that as blows."""
    out = {}
    for (first, last), move in found.items():
        if abs(move.way_mm) < FARTHER * noise.of_means_mm:
            continue
        begin_s, end_s = move.span_s()
        a = min(first, max(int(np.searchsorted(time_s, begin_s)) - 1, 0))
        b = max(last, min(int(np.searchsorted(time_s, end_s)) + 1, len(time_s) - 1))
        off = position_mm[a : b + 1] - move.position(time_s[a : b + 1])
        at_ends = max(abs(float(end.sum())) / np.sqrt(len(end)) for end in (off[:ENDS], off[-ENDS:]))
        agrees = strays(float(off @ off), len(off), noise) <= AGREED and at_ends <= AGREED * noise.of_means_mm
        if len(off) >= LEAST and agrees:
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
