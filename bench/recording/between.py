"""The motion between slow polls: the commanded profile, laid through them move by move.

An axis that makes its own moves is asked where it is some hundred times a second, and a fast ramp is over after three
answers. A straight line between two of them misses the profile by a p²/8 (acceleration a, poll period p): 40 µm. The
run has recorded what the device was told (`move` events) and when it had taken it. So each move's profile is known
but for its start in time, which the polls around it give. What is then left between profile and polls is what the servo
gives way to the force (`giving_way`); what that does not explain is carried on from poll to poll. What stays unknown is
said, and told to whoever fits.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from bench.recording.giving_way import TIMES_S, GivingWay, giving_way
from bench.recording.schemas import HALT, MOVE, POLLED
from bench.recording.types import Array, Event
from bench.trajectory import Profile

LINE_MISSES_MM = 1e-3
"""A line between polls that misses the profile by less is as good as the profile."""

COARSE_MM = 4e-3
"""Steps of a count that are stairs where several polls are of one: they are off by more than `LINE_MISSES_MM`."""

FEWEST, MOST = 4, 3000
"""Polls that a start in time is found by."""

FINE_MM = 2.5e-4
"""The samples added follow the profile to within so much."""

SMALL = 10.0
"""Moves shorter than so many times the position's own noise show no profile; they stay as they are."""

TAIL_PERIODS = 10
"""For so many polls after a move its servo may still be settling."""

SETTLE_S = 0.25
"""… and at least for so long."""

SERVO_S = 4e-3
"""Between polls, what the servo gives way is drawn in steps of so much."""

ROUNDS = 3
"""Starts and giving way are found in turn so many times."""

SLOPE_SAMPLES = 4
"""The force's slope is taken over so many samples to either side."""

TOGETHER = 2.0
"""A shift in time is one and the same for all moves, and its errors add up: they weigh so much more than noise …"""

LASTING = 4.0
"""… and the doubt of a motion's shape, which no parameter of a fit stands for, still more."""

STARTS = 161
"""Starts in time that are weighed against each other, twice: over all that is possible, then about the best."""

Spans = list[tuple[float, float]]


@dataclass(frozen=True)
class Between:
    """Positions with samples added in the moves: `time_s`, `position_mm` (k,), and what is to be known of them.

    `doubtful`: spans of time in which the doubt about the motion makes more force than the force's own noise;
    `stamp_std_s`: by how much all stamps of positions may be early or late together.
    """

    time_s: Array
    position_mm: Array
    doubtful: Spans
    stamp_std_s: float
    notes: list[str]
    way_doubt: tuple[Array, Array] | None
    """As `Measurement.way_doubt`."""


@dataclass(frozen=True)
class Noise:
    """Of the polls: the steps in which the device counts, and what it jitters by when it stands."""

    count_mm: float
    jitter_mm: float

    @property
    def both_mm(self) -> float:
        """As one standard deviation."""
        return float(np.hypot(self.count_mm / np.sqrt(12.0), self.jitter_mm))


@dataclass(frozen=True)
class Move:
    """What the device was told, as far as it was carried out: `earliest_s` and `latest_s` bound its start."""

    earliest_s: float
    latest_s: float
    over_s: float
    """When the next move was commanded, or infinity."""
    profile: Profile


@dataclass
class Placed:
    """One move among its polls: `time_s`, `poll_mm` (n,); `start_s` with its standard deviation."""

    move: Move
    time_s: Array
    poll_mm: Array
    start_s: float = 0.0
    std_s: float = 0.0

    def planned_mm(self, time_s: Array) -> Array:
        """The profile where it was placed."""
        return self.move.profile.position(time_s - self.start_s)

    def speed_mm_s(self, time_s: Array) -> Array:
        """The profile's speed, with its sign."""
        return self.move.profile.velocity(time_s - self.start_s)


@dataclass(frozen=True)
class Drawn:
    """The motion of one move as a fit gets it, (k,), and how far the true one may be from it beside the shift in time
    that `std_s` allows."""

    time_s: Array
    position_mm: Array
    speed_mm_s: Array
    doubt_mm: Array
    std_s: float


def between_polls(
    events: Sequence[Event],
    time_s: Array,
    position_mm: Array,
    force_time_s: Array,
    force_N: Array,
) -> Between | None:
    """Positions (n,) with the profiles of recorded moves between them; None where polls are quick, or no moves known.

    Times are when things were measured, strictly increasing; positions in the motor frame.
    """
    if time_s.size < 4 or not any(event.name == MOVE for event in events):
        return None
    noise = _noise_of(position_mm)
    stamp_std_s = max((_number(e, "stamp_std_s") for e in events if e.name == POLLED), default=0.0)
    every = (_among_polls(move, time_s, position_mm, noise) for move in _moves(events, time_s, position_mm, noise))
    placed = [part for part in every if part is not None]
    if not placed:
        return None
    way = _place(placed, force_time_s, force_N, noise)
    drawn = [_drawn(part, way, noise) for part in placed]
    kept = np.ones(time_s.size, dtype=bool)
    for part in drawn:
        kept[np.searchsorted(time_s, part.time_s[0]) : np.searchsorted(time_s, part.time_s[-1], side="right")] = False
    standing_mm = position_mm if way is None else _standing(placed, way, time_s, position_mm, noise)
    stamps = np.concatenate([time_s[kept], *(part.time_s for part in drawn)])
    values = np.concatenate([standing_mm[kept], *(part.position_mm for part in drawn)])
    # The first polls of a move are the last ones of the move before it.
    stamps, order = np.unique(stamps, return_index=True)
    force_noise_N = white(force_N) if force_N.size > 2 else 0.0
    doubtful = [span for part in drawn for span in _doubtful(part, stamp_std_s, force_time_s, force_N, force_noise_N)]
    together_s = float(np.hypot(stamp_std_s, _together_s(drawn, force_time_s, force_N)))
    notes = _notes(len(drawn), way, together_s, time_s, doubtful)
    way_doubt = None if way is None else (way.time_s, np.sign(way.way_mm) * way.std_mm)
    return Between(stamps, values[order], doubtful, together_s, notes, way_doubt)


# -- what was commanded ------------------------------------------------------------------------------------------


def _moves(events: Sequence[Event], time_s: Array, position_mm: Array, noise: Noise) -> list[Move]:
    told = sorted((e for e in events if e.name == MOVE), key=_commanded_s)
    halts = [event.time_s for event in events if event.name == HALT]
    moves: list[Move] = []
    end_mm = float("nan")  # where the move before ended, by what was commanded
    for i, event in enumerate(told):
        begin_s = _commanded_s(event)
        over_s = _commanded_s(told[i + 1]) if i + 1 < len(told) else np.inf
        halt_s = next((at for at in halts if begin_s <= at < over_s), None)
        start_mm = _stand_mm(time_s, position_mm, begin_s) if np.isnan(end_mm) else end_mm
        target_mm = _number(event, "target_mm")
        speed, acceleration = _number(event, "speed_mm_s"), _number(event, "acceleration_mm_s2")
        if not (np.isfinite([start_mm, target_mm]).all() and speed > 0 and acceleration > 0):
            end_mm = float("nan")
            continue
        move = Move(begin_s, event.time_s, over_s, Profile(start_mm, target_mm, speed, acceleration))
        if halt_s is not None:
            # It brakes as hard as it would have at its end: a trapezoid to where it came to stand.
            target_mm = _halted_mm(move, halt_s + 0.5 * _number(event, "waited_s"), time_s, position_mm, noise)
            move = replace(move, profile=Profile(start_mm, target_mm, speed, acceleration))
        end_mm = target_mm
        moves.append(move)
    return moves


def _commanded_s(event: Event) -> float:
    return event.time_s - _number(event, "waited_s")


def _number(event: Event, key: str) -> float:
    value = event.data.get(key, 0.0)
    return float(value) if isinstance(value, int | float) else 0.0


def _stand_mm(time_s: Array, position_mm: Array, until_s: float) -> float:
    """Where the axis stands just before a time, by its last two polls."""
    end = int(np.searchsorted(time_s, until_s))
    return float(np.mean(position_mm[max(end - 2, 0) : end])) if end else float("nan")


def _halted_mm(move: Move, halted_s: float, time_s: Array, position_mm: Array, noise: Noise) -> float:
    """Where a move that was halted about then came to stand: as the polls have it, and within their count as its
    profile does, which they tell while it moves."""
    stand_mm = _stand_mm(time_s, position_mm, move.over_s)
    moving = slice(int(np.searchsorted(time_s, move.earliest_s)), int(np.searchsorted(time_s, halted_s)))
    if moving.stop - moving.start < FEWEST:
        return stand_mm
    start_s, _ = _start_of(move, time_s[moving], position_mm[moving], noise.both_mm)
    reached_mm = float(move.profile.position(halted_s - start_s))
    return float(np.clip(reached_mm, stand_mm - 0.5 * noise.count_mm, stand_mm + 0.5 * noise.count_mm))


# -- one move ----------------------------------------------------------------------------------------------------


def _among_polls(move: Move, time_s: Array, position_mm: Array, noise: Noise) -> Placed | None:
    """The polls of a move, from two before its command until its servo has settled; None where they need no help: where
    lines between them are as good as the profile, and no stairs of the device's count."""
    profile = move.profile
    first = int(np.searchsorted(time_s, move.earliest_s)) - 2
    last = int(np.searchsorted(time_s, min(move.over_s, move.latest_s + profile.duration_s)))
    if first < 0 or last - first < 3:
        return None
    period_s = float(np.median(np.diff(time_s[first : last + 1])))
    line_misses_mm = profile.peak_acceleration_mm_s2 * period_s**2 / 8.0
    stairs = noise.count_mm > COARSE_MM and profile.peak_speed_mm_s * period_s < noise.count_mm
    if line_misses_mm < max(noise.both_mm, LINE_MISSES_MM) and not stairs:
        return None
    if abs(profile.end_mm - profile.start_mm) < SMALL * noise.both_mm:
        return None
    settled_s = min(move.over_s, move.latest_s + profile.duration_s + max(SETTLE_S, TAIL_PERIODS * period_s))
    if abs(_stand_mm(time_s, position_mm, move.over_s) - profile.end_mm) > LINE_MISSES_MM:
        settled_s = move.over_s  # halted between two counts, it stands there
    window = slice(first, int(np.searchsorted(time_s, settled_s)))
    return Placed(move, time_s[window], position_mm[window])


def _place(placed: list[Placed], force_time_s: Array, force_N: Array, noise: Noise) -> GivingWay | None:
    """Find each move's start, and what the axis gives way, in turn, as each shifts the other."""
    way: GivingWay | None = None
    for _ in range(ROUNDS):
        for part in placed:
            poll_mm = part.poll_mm if way is None else part.poll_mm + way.at(part.time_s)
            part.start_s, part.std_s = _start_of(part.move, part.time_s, poll_mm, noise.both_mm)
        after = [part.time_s > part.start_s + part.move.profile.duration_s for part in placed]
        time_s = np.concatenate([part.time_s[late] for part, late in zip(placed, after, strict=True)])
        missed_mm = np.concatenate(
            [part.poll_mm[late] - part.move.profile.end_mm for part, late in zip(placed, after, strict=True)]
        )
        way = giving_way(time_s, missed_mm, force_time_s, force_N, noise.count_mm, noise.jitter_mm)
        if way is None:
            break
    return way


def _drawn(part: Placed, way: GivingWay | None, noise: Noise) -> Drawn:
    t = part.time_s
    corners = part.start_s + _corners(part.move.profile)
    taken_up_s = min(float(t[-1]), float(corners[-1]) + max(SETTLE_S, float(TIMES_S[-1])))
    after = np.arange(corners[-1], taken_up_s, SERVO_S) if way is not None else np.zeros(0)
    stamps = np.union1d(t, np.concatenate([corners, after]))
    stamps = stamps[(stamps >= t[0]) & (stamps <= t[-1])]
    given_mm, given_std_mm = (way.at, way.std_at) if way is not None else (np.zeros_like, np.zeros_like)
    rest = part.poll_mm - part.planned_mm(t) + given_mm(t)
    # A poll within half a count of the plan agrees with it; of what is more, noise explains a part.
    rest = np.sign(rest) * np.maximum(np.abs(rest) - 0.5 * noise.count_mm, 0.0)
    square = float(np.mean(rest**2))
    carried = max(0.0, 1.0 - noise.jitter_mm**2 / square) if square > 0 else 0.0
    rest *= carried
    bow = np.zeros(t.size)
    bow[1:-1] = np.abs(rest[1:-1] - 0.5 * (rest[:-2] + rest[2:])) / 4.0  # over one period, from that over two
    unknown = np.hypot(np.interp(stamps, t, bow), np.where(np.interp(stamps, t, np.abs(rest)) > 0, noise.both_mm, 0.0))
    return Drawn(
        stamps,
        part.planned_mm(stamps) - given_mm(stamps) + np.interp(stamps, t, rest),
        part.speed_mm_s(stamps),
        np.hypot(unknown, given_std_mm(stamps)),
        part.std_s,
    )


def _standing(placed: list[Placed], way: GivingWay, time_s: Array, position_mm: Array, noise: Noise) -> Array:
    """The polls (n,), less what the axis gives way where it stands after a move and the pad relaxes: some tenths of a
    micrometre, which no poll shows that agrees with the plan."""
    out = position_mm.copy()
    for part in placed:
        end_mm = part.move.profile.end_mm
        first, last = np.searchsorted(time_s, [part.time_s[-1], part.move.over_s], side="right")
        rest = slice(int(first), int(last))
        agrees = np.abs(position_mm[rest] - end_mm) <= 0.5 * noise.count_mm + 2.0 * noise.jitter_mm
        out[rest] -= np.where(agrees, way.at(time_s[rest]), 0.0)
    return out


def _start_of(move: Move, time_s: Array, position_mm: Array, noise_mm: float) -> tuple[float, float]:
    """When the device began, and the standard deviation of that: least squares over the polls, any start between
    command and reply being as likely as any other beforehand."""
    low, high = move.earliest_s, max(move.latest_s, move.earliest_s + 1e-6)
    every = -(-time_s.size // MOST)
    time_s, position_mm = time_s[::every], position_mm[::every]
    for _ in range(2):
        starts = np.linspace(low, high, STARTS)
        rest = position_mm - move.profile.position(time_s - starts[:, None])
        cost = np.sum(rest**2, axis=1)
        square = max(noise_mm**2, float(cost.min()) / max(time_s.size - 1, 1), 1e-18)
        weight = np.exp(-0.5 * (cost - cost.min()) / square)
        weight /= weight.sum()
        start_s = float(weight @ starts)
        variance = float(weight @ (starts - start_s) ** 2) + (starts[1] - starts[0]) ** 2 / 12.0
        std_s = float(np.sqrt(variance))
        low, high = max(low, start_s - 5.0 * std_s), min(high, start_s + 5.0 * std_s)
    return start_s, std_s


def _corners(profile: Profile) -> Array:
    """Times of a trapezoid, from its start, between which lines follow it to `FINE_MM`."""
    acceleration = profile.peak_acceleration_mm_s2
    bent_s = min(profile.peak_speed_mm_s / acceleration, 0.5 * profile.duration_s)
    pieces = max(1, int(np.ceil(bent_s / np.sqrt(8.0 * FINE_MM / acceleration))))
    bent = np.linspace(0.0, bent_s, pieces + 1)
    return np.union1d(bent, profile.duration_s - bent)


# -- what stays unknown ------------------------------------------------------------------------------------------


def _doubtful(part: Drawn, stamp_std_s: float, force_time_s: Array, force_N: Array, noise_N: float) -> Spans:
    """Where the force that the doubt makes is more than the force's noise: slope by time, stiffness by bend."""
    first, last = np.searchsorted(force_time_s, part.time_s[[0, -1]])
    t = force_time_s[first:last]
    if t.size == 0:
        return []
    before = np.maximum(np.arange(first, last) - SLOPE_SAMPLES, 0)
    after = np.minimum(np.arange(first, last) + SLOPE_SAMPLES, force_time_s.size - 1)
    slope = np.abs(force_N[after] - force_N[before]) / np.maximum(force_time_s[after] - force_time_s[before], 1e-9)
    speed = np.abs(np.interp(t, part.time_s, part.speed_mm_s))
    quick = speed > 0.5 * speed.max(initial=0.0)
    stiffness = float(np.max(slope[quick] / speed[quick], initial=0.0)) if quick.any() else 0.0
    std_s = np.hypot(part.std_s, stamp_std_s)
    doubt_N = np.hypot(TOGETHER * slope * std_s, LASTING * stiffness * np.interp(t, part.time_s, part.doubt_mm))
    over = np.concatenate([[False], doubt_N > noise_N, [False]])
    edges = np.flatnonzero(np.diff(over.astype(np.int8)))
    return [(float(t[i]), float(t[j - 1])) for i, j in zip(edges[::2], edges[1::2], strict=True)]


def _noise_of(position_mm: Array) -> Noise:
    values = np.unique(position_mm)
    steps = np.diff(values)
    steps = steps[steps > 1e-6]
    count = float(steps.min()) if steps.size and values.size < 0.5 * position_mm.size else 0.0
    return Noise(count, white(position_mm))


def white(values: Array) -> float:
    """Standard deviation of white noise on something smooth, by its second differences."""
    second: NDArray[np.float64] = np.diff(values, 2)
    return float(1.4826 * np.median(np.abs(second)) / np.sqrt(6.0))


def _together_s(drawn: list[Drawn], force_time_s: Array, force_N: Array) -> float:
    """What the moves' own doubts make of a shift of all of them together: each counts by the force it changes."""
    ends = np.interp([part.time_s[[0, -1]] for part in drawn], force_time_s, force_N)
    change_N = np.abs(ends[:, 1] - ends[:, 0])
    std_s = np.array([part.std_s for part in drawn])
    total_N = float(change_N.sum())
    return float(np.sqrt(np.sum((change_N * std_s) ** 2)) / total_N) if total_N > 0 else float(std_s.max())


def _notes(count: int, way: GivingWay | None, std_s: float, time_s: Array, doubtful: Spans) -> list[str]:
    rate = 1.0 / float(np.median(np.diff(time_s)))
    notes = [
        f"position: polled only {rate:.3g} times a second; between polls, {count} moves are the commanded profile "
        f"laid through them, in time known to {1e3 * std_s:.2g} ms"
    ]
    if way is not None:
        notes.append(
            f"position: the axis gives way by {1e3 * way.compliance_mm_N:.2g} µm/N until its servo has taken the force "
            "up (from its polls and the force); taken into account between them"
        )
    if doubtful:
        total = sum(end - begin for begin, end in doubtful)
        notes.append(
            f"force: {total:.2g} s of fast motion cost nothing in a fit: what is not known of the position between "
            "polls makes more force there than the noise"
        )
    return notes
