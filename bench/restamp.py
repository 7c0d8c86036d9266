"""Stamps that are off by themselves, put right by the motion: a smooth move says when each position was passed.

Where a host stamps samples as they come in, position and force of a row belong together, and its stamp is off by
chance. The force at a depth is none the worse for it; an acceleration taken from such positions is worth nothing, and
neither is what a delay or a lag answers to.

- Most devices sample by a clock of their own: times that are even put all stamps right at once, where the positions of
  moves lie on smoother curves over those times than over the stamps.
- Else, in a move that is a planner's trapezoid but for that, each sample's own place tells its time, the better the
  faster the move.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from bench.felt_motion import _rested, smoothed
from bench.fitted_moves import fitted_moves, from_rest
from bench.motion_between import LEAST, _grouped, _moving
from bench.position_noise import position_noise
from bench.profiles import Trapezoid
from bench.recording.types import Measurement

Array = NDArray[np.float64]

MOST = 0.15  # of a step between samples, the standard deviation of stamps that are off
INSIDE = 200  # samples of a move that are looked at: each of them is off by itself
LONG, FEWEST = 6, 20  # samples of a move, and of fast motion in all, that can show it
WHITE = 1.3  # von Neumann's ratio, 2 for errors that are independent and 0 for a motion that is another
CLEAR = 2.0  # times the noise of position, in squares
AGREED = 5.0  # standard deviations of χ² within which a move is a trapezoid
FAR = 4.0  # standard deviations: what is farther off does not decide
TICK = 1e-3  # of a step: stamps that are off by less are even
WINDOW, MOST_WINDOWS = 7, 2000  # neighbours that a curve goes through; such curves that are looked at
BETWEEN, SMOOTHER = 0.2, 0.3  # of curves, that are clear of corners; of what those over the stamps leave


def restamped(m: Measurement) -> Measurement:
    """The measurement with the stamps of its rows where the motion says that they belong; the very same one where it
    says nothing, or where position and force are not stamped together.
    """
    t, stamps = m.position_time_s, m.force_time_s
    if len(t) < FEWEST or not len(stamps):
        return m
    at = np.searchsorted(t, stamps)
    if at[-1] >= len(t) or not np.array_equal(t[at], stamps):
        return m
    time = even_times(t, m.position_mm)
    if time is None:
        late = stamp_errors(t, m.position_mm)
        if late is None:
            return m
        time = t + late
    return replace(m, position_time_s=time, force_time_s=time[at])


def even_times(time_s: Array, position_mm: Array) -> Array | None:
    """Even times (n,) that the samples were taken at, s; None where the stamps are as good, or say that there are none.

    Rows may be missing. A sample that a move passes at v is off its curve by v times the error of its stamp: what
    parabolas over some neighbours leave is compared, over the stamps and over even times.
    """
    between = np.diff(time_s)
    rows_missing = np.cumsum(np.maximum(np.rint(between / float(np.median(between))), 1.0))
    slots = [np.arange(len(time_s), dtype=np.float64), np.concatenate([[0.0], rows_missing])]
    lines = [np.polyfit(slot, time_s, 1) for slot in slots]
    off, slot, step, even = min(
        ((float(np.std(time_s - np.polyval(line, slot))), slot, float(line[0]), np.polyval(line, slot))
         for slot, line in zip(slots, lines, strict=True)),
        key=lambda tried: tried[0],
    )  # fmt: skip
    if off < TICK * step or float(np.abs(time_s - even).max()) > 0.5 * step:
        return None
    noise = position_noise(position_mm).of_means_mm
    start = np.arange(0, len(slot) - WINDOW + 1)
    speed = np.abs(position_mm[start + WINDOW - 1] - position_mm[start]) / (step * (WINDOW - 1))
    in_a_row = slot[start + WINDOW - 1] - slot[start] == WINDOW - 1
    start = start[in_a_row & (speed * off > CLEAR * noise)]
    start = start[:: max(1, len(start) // MOST_WINDOWS)]
    if len(start) < FEWEST:
        return None
    over_even, over_stamps = (
        _about_parabolas((times[start[:, None] + np.arange(WINDOW)] - times[start][:, None]) / step,
                         position_mm[start[:, None] + np.arange(WINDOW)])
        for times in (even, time_s)
    )  # fmt: skip
    # corners bend both alike; some moves have no room between theirs
    clear_even, clear_stamps = (float(np.quantile(left, BETWEEN)) for left in (over_even, over_stamps))
    return even if clear_even < SMOOTHER * clear_stamps else None


def _about_parabolas(u: Array, x: Array) -> Array:
    """Sum of squares (m,) that a parabola leaves of each row of x over its row of u, both (m, w)."""
    basis, _ = np.linalg.qr(np.stack([np.ones_like(u), u, u * u], axis=-1))
    taken = np.einsum("mwk,mw->mk", basis, x)
    return np.asarray(np.sum((x - np.einsum("mwk,mk->mw", basis, taken)) ** 2, axis=1))


def stamp_errors(time_s: Array, position_mm: Array) -> Array | None:
    """What to add to each stamp (n,), s; 0 at rest. None where stamps are as good as the positions can tell.

    `time_s` (n,) increases strictly.
    """
    position = position_noise(position_mm)
    noise = position.of_means_mm
    clean, std = smoothed(time_s, position_mm, position)
    left, reach = float(np.median(std)), float(np.ptp(clean))
    if not 0.0 < left <= noise or not reach > 0.0:
        return None
    clean, _, _ = _rested(position_mm, clean, std, position, left)
    step = np.diff(time_s)
    moving, _ = _moving(clean, reach, noise)  # slower ones tell nothing
    groups = [g for g in _grouped(moving, moving) if g[1] - g[0] >= LEAST and from_rest(moving, clean, g)]
    if not groups:
        return None
    speeds = np.array([np.max(np.abs(np.diff(clean[a : b + 1]) / step[a:b])) for a, b in groups])
    allowed = np.maximum(noise, 0.5 * MOST * float(np.median(step)) * speeds)
    found = sorted(fitted_moves(time_s, clean, moving, groups, reach, allowed, position_mm, INSIDE).items())
    parts = [_passed(time_s, position_mm, group, move) for group, move in found]
    spread = _spread_s(parts, noise, float(np.median(step)))
    if spread is None:
        return None
    late = np.zeros(len(time_s))
    for (a, b), (off, speed) in zip((group for group, _ in found), parts, strict=True):
        square = noise**2 + (speed * spread) ** 2
        if float(np.sum(off**2 / square)) <= 1.2 * len(off) + AGREED * np.sqrt(2.0 * len(off)):
            late[a : b + 1] = off * speed * spread**2 / square
    room = 0.45 * np.minimum(np.append(step, step[-1]), np.append(step[0], step))
    return np.clip(late, -room, room)


def _passed(t: Array, x: Array, group: tuple[int, int], move: Trapezoid) -> tuple[Array, Array]:
    """How far samples of a move are ahead of it, mm, and its speed there, mm/s."""
    time = t[group[0] : group[1] + 1]
    h = 1e-3 * float(np.min(np.diff(time)))
    speed = (move.position(time + h) - move.position(time - h)) / (2.0 * h)
    return x[group[0] : group[1] + 1] - move.position(time), speed


def _spread_s(parts: list[tuple[Array, Array]], noise_mm: float, step_s: float) -> float | None:
    """Standard deviation of the stamps' errors, s; None where there are none, or where they are no such thing."""
    late, pairs, told = [], [], []
    for off, speed in parts:
        fast = np.abs(speed) * 0.1 * MOST * step_s > noise_mm
        if np.count_nonzero(fast) < LONG:
            continue
        z = np.where(fast, off / np.where(fast, speed, 1.0), 0.0)
        late.append(z[fast])
        told.append(off[fast] / noise_mm)
        both = fast[1:] & fast[:-1]
        pairs.append(np.diff(z)[both])
    if not late:
        return None
    z, differences, off = np.concatenate(late), np.concatenate(pairs), np.concatenate(told)
    if len(z) < FEWEST or len(differences) < FEWEST // 2:
        return None
    spread = 1.4826 * float(np.median(np.abs(z)))
    near = np.abs(z) < FAR * spread
    if not near.any() or float(np.mean(off[near] ** 2)) < CLEAR or spread > MOST * step_s:
        return None
    ratio = float(np.mean(np.clip(differences, -FAR * spread, FAR * spread) ** 2) / np.mean(z[near] ** 2))
    return spread if ratio > WHITE else None
