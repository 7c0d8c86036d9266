"""From air to the pad's surface: tare, contact check, touch-off."""

from __future__ import annotations

import math
from dataclasses import replace

import numpy as np

from bench.errors import Stopped
from bench.protocol import Approach
from bench.run.axis import Axis
from bench.run.loop import Loop, Script, Window
from bench.run.motion import Mover
from bench.run.safety import ZERO_LOST_SHARE
from bench.run.touchoff import (
    MIN_SAMPLES_IN_CONTACT,
    Air,
    Surface,
    air_of,
    surface_in_pieces,
    threshold_N,
    turned,
    unsteady_N,
)

TARE_S = 1.0
"""How long the zero is averaged: 550 samples of 10 mN noise give it to 0.4 mN."""

CHECK_S = 0.2
"""How long the force is averaged before and after backing off, and at the end of a rest between two approaches."""

TURN_MM, TURN_S = 0.1, 0.3
"""The way to the place of the tare ends so far in the direction of the pad, which is more than friction and play need
to turn round, and takes so long, in which a slow cell is read often enough."""

SLOWER = 8.0
"""The second approach is so many times slower than the first, for as many more samples at the surface."""

BEFORE_MM = 0.1
"""The second approach starts so far above where the first found the pad."""

BEYOND_MM = 0.3
"""The second approach gives up so far below where the first felt the pad."""

RECOVER_S, RECOVER_TIMES = 0.5, 5.0
"""Rest between two approaches, so that the last touch relaxes: at least so long, and so many times as long as it
lasted. What has not relaxed keeps the surface lower than it was."""

TARE_KEEPS_S = 600.0
"""A zero older than that is not touched off with: a load cell drifts with the room in minutes."""

AIR_S = 0.05
"""How long a force below the tare is looked at before it is believed."""

STARTING_S = 0.012
"""For so long the mass that is set in motion may press on the cell: the servo's blow, which is no touch."""

NOT_WATCHED = "the cell's readings repeat in air for longer than a frozen cell could be told by: give it more decimals"

FEW = 8
"""Samples of a move that tell its force."""

MOVED_MM, MOVED_SHARE = 0.05, 0.2
"""A move of so much at least must be seen in the measured positions, as that share of what was commanded."""

MOST_PASSES = 4
"""The slow approach is repeated from further above, twice as long each time, where it began too near or in the pad."""


def slow_mm_s(approach: Approach, axis: Axis) -> float:
    """The speed of the second approach; not below what the motor can be told."""
    return max(approach.speed / SLOWER, axis.slowest_mm_s)


def tare(loop: Loop, mover: Mover, approach: Approach | None, slow_mm_s: float, seconds: float = TARE_S) -> Script[Air]:
    """Average the force in free air and make it the zero; refuse where the probe already touches something.

    With a pad, the axis first backs off by `approach.retract` (as far as travel allows): if the force falls by more
    than the touch threshold and more than friction makes of turning round, there was contact. It gets there from
    further off, so that friction and play stand as on the way to the pad. The zero is averaged over `seconds`. Raises
    `Stopped` with what was found.
    """
    before = yield from _average(loop, CHECK_S)
    asked_N = approach.force if approach is not None else 0.0
    backed_mm = rubs_N = 0.0
    if approach is not None:
        start = mover.here()
        lowest = loop.monitor.envelope.position_mm[0]
        target = max(lowest, start - approach.retract)
        backed_mm = start - target
        turned_mm = min(TURN_MM, 0.5 * backed_mm)
        away = mover.watch()
        furthest = max(lowest, target - turned_mm)
        yield from mover.go(furthest, slow_mm_s)
        back = mover.watch()
        unhurried_mm_s = max(min(slow_mm_s, turned_mm / TURN_S), mover.axis.slowest_mm_s)
        yield from mover.go(furthest + turned_mm, unhurried_mm_s)
        mover.unwatch()
        yield from loop.sleep(CHECK_S)
    window = mover.watch()
    yield from loop.sleep(seconds)
    mover.unwatch()
    if len(window.gross_N) < 8:
        raise Stopped(
            f"only {len(window.gross_N)} force samples came in {seconds:g} s of tare; at least 8 are needed: "
            "raise the load cell's rate"
        )
    air = air_of(np.array(window.force_time_s), np.array(window.gross_N))
    if backed_mm > 0:
        rubs_N, moving_N = _friction_N(away, back, air)
        fall, touch = before - air.mean_N, threshold_N(asked_N, air)
        if fall > touch + rubs_N:
            raise Stopped(
                f"the probe already touches something: the force fell by {fall:.3f} N when it backed off "
                f"{backed_mm:.2f} mm (threshold {touch:.3f} N); retract the probe (or lower the pad) and start again. "
                "Where nothing is there, the bench's own force changes along its travel: raise approach.force above it"
            )
        air = replace(air, moving_N=moving_N, turns_N=rubs_N)
    # a servo that settles creeps within what friction needs to turn round
    steady_N = max(asked_N, min(5.0 * air.sigma_N, unsteady_N(np.array(window.gross_N)))) + 0.5 * rubs_N
    if abs(air.drift_N_s) * seconds > steady_N:
        raise Stopped(
            f"the force is not steady in air ({air.drift_N_s:+.3f} N/s): the probe touches something, "
            "or the load cell is still warming up; no zero can be taken"
        )
    loop.tare_N, loop.tared_s = air.mean_N, loop.clock.now()
    loop.monitor.tared(air.sigma_N)
    if not loop.monitor.frozen.learned():
        loop.sink.event(loop.clock.now(), "frozen_not_watched", {"message": NOT_WATCHED})
    loop.sink.event(
        loop.clock.now(),
        "tare",
        {
            "tare_N": air.mean_N,
            "sigma_N": air.sigma_N,
            "drift_N_s": air.drift_N_s,
            "samples": air.samples,
            "contact_check": "passed" if backed_mm > 0 else "not possible: no travel to back off",
            "backed_off_mm": backed_mm,
            "friction_turns_N": rubs_N,
        },
    )
    return air


def _friction_N(away: Window, back: Window, air: Air) -> tuple[float, float]:
    """From moves in air, away from the pad and back: what turning round makes of the force, and by how much more the
    cell reads on the way to the pad than at rest. 0 where it does not show."""
    if min(len(away.gross_N), len(back.gross_N)) < FEW:
        return 0.0, 0.0
    towards_N = float(np.median(back.gross_N))
    turns_N, moving_N = towards_N - float(np.median(away.gross_N)), towards_N - air.mean_N
    return (turns_N, max(moving_N, 0.0)) if turns_N > air.sigma_N else (0.0, 0.0)


def touch_off(loop: Loop, mover: Mover, approach: Approach, air: Air, position_sigma_mm: float) -> Script[Surface]:
    """Find the surface: a first approach feels it, a second, slower one measures it.

    Raises `Stopped` where there is contact at once, or none within the travel allowed, and where the tare is too old
    or no zero any more.
    """
    limit = threshold_N(approach.force, air)
    _fresh_tare(loop)
    start = mover.here()
    deepest = loop.monitor.envelope.deepest_mm
    window = mover.watch()
    found = yield from mover.go_until(deepest, approach.speed, _above(loop, limit))
    mover.unwatch()
    _must_have_moved(loop, window, start, mover.here())
    if not found:
        raise Stopped(
            f"no contact: the probe went from {start:.2f} to {deepest:.2f} mm and felt less than {limit:.3f} N; "
            "is the pad in place, and limits.position deep enough?"
        )
    felt, felt_N = mover.here(), max(window.net_N)
    if felt - start < min(max(0.05, 2.0 * STARTING_S * approach.speed), 0.5 * approach.retract):
        raise Stopped(
            f"contact after only {felt - start:.3f} mm of approach: the probe stood on the pad when it was tared; "
            "retract the probe (or lower the pad) and start again"
        )
    loop.sink.event(loop.clock.now(), "contact", {"position_mm": felt, "net_N": loop.last_net_N, "threshold_N": limit})
    rough = yield from _surface_of(window, air, position_sigma_mm)
    begin = max(start, _in_air_mm(felt, rough, approach))
    rest_s = RECOVER_S
    for _ in range(MOST_PASSES):
        _fresh_tare(loop)
        here_N = yield from _rest_at(loop, mover, begin, approach.speed, rest_s, air)
        if here_N > limit and begin > start:
            begin = start
            here_N = yield from _rest_at(loop, mover, begin, approach.speed, rest_s, air)
        if here_N > limit:
            raise Stopped(
                f"the load cell reads {here_N:.3f} N at {begin:.3f} mm, where it was tared: its zero has moved "
                "since, or the pad has followed the probe"
            )
        last = mover.watch()
        surface = yield from _slow_approach(loop, mover, last, approach, air, felt, position_sigma_mm)
        reached = mover.here()
        if begin <= start or (surface is not None and _enough_air(surface, begin, reached)):
            break
        rest_s = max(RECOVER_S, RECOVER_TIMES * (reached - begin) / slow_mm_s(approach, mover.axis))
        begin = max(start, begin - max(BEFORE_MM, reached - begin))
    if surface is None:
        raise Stopped(_why_no_surface(last, felt, felt_N, limit, slow_mm_s(approach, mover.axis)))
    loop.sink.event(
        loop.clock.now(),
        "touch_off",
        {
            "surface_mm": surface.position_mm,
            "surface_std_mm": surface.std_mm,
            "threshold_N": limit,
            "sigma_N": air.sigma_N,
            "exponent": surface.exponent,
            "stiffness_N_mm": surface.stiffness_N_mm,
        },
    )
    return surface


def _rest_at(loop: Loop, mover: Mover, position_mm: float, speed_mm_s: float, rest_s: float, air: Air) -> Script[float]:
    """Go there and rest; the mean net force at the end of the rest, N.

    Where friction shows, from further off: one that turns round on the slow approach is no level in air.
    """
    if air.turns_N > 0.0:
        yield from mover.go(max(loop.monitor.envelope.position_mm[0], position_mm - TURN_MM), speed_mm_s)
    yield from mover.go(position_mm, speed_mm_s)
    yield from loop.sleep(rest_s - CHECK_S)
    return (yield from _average(loop, CHECK_S)) - loop.tare_N


def _slow_approach(
    loop: Loop, mover: Mover, window: Window, approach: Approach, air: Air, felt_mm: float, position_sigma_mm: float
) -> Script[Surface | None]:
    """From here slowly until the pad is felt a little harder than before; what the samples say of its surface."""
    limit = threshold_N(approach.force, air)
    start = mover.here()
    stop_at = max(2.0 * limit, limit + 5.0 * air.sigma_N)
    end = min(felt_mm + BEYOND_MM, loop.monitor.envelope.deepest_mm)
    yield from mover.go_until(end, slow_mm_s(approach, mover.axis), _above(loop, stop_at))
    yield from loop.sleep(0.02)
    mover.unwatch()
    _must_have_moved(loop, window, start, mover.here())
    return (yield from _surface_of(window, air, position_sigma_mm))


def _must_have_moved(loop: Loop, window: Window, from_mm: float, to_mm: float) -> None:
    """Positions that stand still while the axis is told to move: the following error is still within its limit."""
    asked_mm = abs(to_mm - from_mm)
    if asked_mm < MOVED_MM or not window.position_mm:
        return
    seen_mm = max(window.position_mm) - min(window.position_mm)
    if seen_mm < MOVED_SHARE * asked_mm:
        loop.monitor.violate(
            f"the motor's position stands still at {window.position_mm[-1]:.3f} mm, and the axis was told to go from "
            f"{from_mm:.3f} to {to_mm:.3f} mm: it is held, or the reading is frozen",
            "motor",
        )
        loop.monitor.check()


def _why_no_surface(window: Window, felt_mm: float, felt_N: float, limit_N: float, speed_mm_s: float) -> str:
    """What the last slow approach saw, in words, where no surface comes out of it."""
    begun_mm, ended_mm = (window.position_mm or [math.nan])[0], max(window.position_mm, default=math.nan)
    net = np.array(window.net_N or [math.nan])
    few = max(1, net.size // 10)
    began_N, ended_N = float(net[:few].mean()), float(net[-few:].mean())
    seen = (
        f"the slow approach ({speed_mm_s:g} mm/s) went from {begun_mm:.3f} to {ended_mm:.3f} mm, and the force from "
        f"{began_N:+.3f} to {ended_N:+.3f} N (the first one had felt {felt_N:.3f} N at {felt_mm:.3f} mm)"
    )
    if net.max() < limit_N:
        why = "no contact where there was one before: the cell's zero or gain has changed, or the pad has moved"
    elif began_N > limit_N:
        why = "force where the probe should be in air: the cell's zero has moved since the tare, or the pad follows it"
    elif ended_mm < felt_mm - BEYOND_MM:
        why = "it ended far above where the pad was felt: the cell's noise or gain has grown, or its zero drifts"
    elif ended_N - began_N < 0.5 * limit_N:
        why = "the force does not rise with the depth: what was felt is no pad (the zero drifts, or noise has grown)"
    else:
        why = f"fewer than {MIN_SAMPLES_IN_CONTACT} samples were in contact; approach slower"
    return f"the surface could not be measured: {why}; {seen}"


def _in_air_mm(felt_mm: float, rough: Surface | None, approach: Approach) -> float:
    """Where the slow approach may start: `rough` is what the first one's few samples say about the surface.

    The first touch was made at speed, so that the pad begins at least up to a stopping distance above `felt_mm`.
    """
    before_mm = max(BEFORE_MM, approach.speed * 0.05)
    if rough is None or rough.std_mm > BEFORE_MM:
        return felt_mm - max(before_mm, approach.retract)
    return min(felt_mm, rough.position_mm - 2.0 * rough.std_mm) - before_mm


def _enough_air(surface: Surface, begin_mm: float, reached_mm: float) -> bool:
    """Whether an approach came through as much air as pad, for certain.

    One that begins inside the pad takes the force there for its level in air, and finds a surface that is none. A pad
    that is soft at first is felt so far below its surface that this happens.
    """
    return surface.position_mm - 2.0 * surface.std_mm - begin_mm >= reached_mm - surface.position_mm


def _above(loop: Loop, limit_N: float) -> _TwoInARow:
    return _TwoInARow(loop, limit_N)


def _fresh_tare(loop: Loop) -> None:
    age_s = loop.clock.now() - loop.tared_s
    if not age_s <= TARE_KEEPS_S:  # never taken: not a number
        raise Stopped(f"the tare is {age_s / 60.0:.0f} min old, more than {TARE_KEEPS_S / 60.0:g}: take it again")


class _TwoInARow:
    """Two samples in a row at or above a force: one alone may be an outlier.

    A probe on its way to the pad is in air. Where that reads far less than the tare, contact would be noticed late by
    as much: raises `Stopped`.
    """

    def __init__(self, loop: Loop, limit_N: float) -> None:
        self.loop = loop
        self.limit_N = limit_N
        self.before = False
        self.least_N = max(10.0 * limit_N, ZERO_LOST_SHARE * loop.monitor.envelope.force_N)
        self.below_s = math.nan
        self.from_s = loop.clock.now() + STARTING_S

    def __call__(self) -> bool:
        """Asked once for every force sample."""
        net_N, now_s = self.loop.last_net_N, self.loop.clock.now()
        if net_N >= -self.least_N:
            self.below_s = math.nan
        elif math.isnan(self.below_s):
            self.below_s = now_s
        elif now_s - self.below_s > AIR_S:
            self.loop.monitor.cell_lost = True  # nobody knows what this force means
            raise Stopped(
                f"the force fell to {net_N:.3f} N on the way to the pad: the zero has moved since the tare, or the "
                "cell's sign is wrong (load_cell.sign)"
            )
        now = net_N >= self.limit_N and now_s > self.from_s
        both = now and self.before
        self.before = now
        return both


def _average(loop: Loop, seconds: float) -> Script[float]:
    """Mean gross force over so many seconds."""
    count, total = 0, 0.0
    seen = loop.force_count
    until = loop.clock.now() + seconds
    while loop.clock.now() < until or count == 0:
        if loop.force_count != seen and loop.last_force is not None:
            seen = loop.force_count
            count += 1
            total += loop.last_force.gross_N
        yield
    return total / count


def _surface_of(window: Window, air: Air, position_sigma_mm: float) -> Script[Surface | None]:
    """The surface from the samples of the slow approach; positions are interpolated at the force samples."""
    t = np.array(window.force_time_s)
    motor_t = np.array(window.motor_time_s)
    if motor_t.size < 2:
        return None
    inside = (t >= motor_t[0]) & (t <= motor_t[-1])
    x = np.interp(t[inside], motor_t, np.array(window.position_mm))
    force = np.array(window.net_N)[inside]
    if x.size < 8:
        return None
    # What follows the deepest point is the braked stand: the pad relaxes there, and no longer tells its surface.
    end = int(np.argmax(x)) + 1
    begin = turned(force[:end], air)
    return (yield from surface_in_pieces(x[begin:end], force[begin:end], air.sigma_N, position_sigma_mm))
