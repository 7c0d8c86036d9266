"""The axis as the run sees it: one profile at a time, whichever way the motor wants to be told.

A "stream" motor gets a position every tick; a "move" motor gets the end of the profile once and is polled, and the
planned profile stands in for its own between polls. Both answer the same questions: what is commanded now, is the
profile over, and which samples have come.
"""

from __future__ import annotations

import contextlib
import math
from collections import deque
from dataclasses import dataclass
from itertools import pairwise
from statistics import median
from typing import Any, Protocol

from bench.recording.schemas import HALT, MOVE
from drivers.errors import DeviceTimeout, DriverError, ReadbackError
from drivers.motor import Motor, MotorSample
from drivers.registers import RegisterMotor
from drivers.wire import Exchange, Pause, Steps

SEGMENT_S = 0.2
"""A motor without a watchdog is told no more of a move than it makes in that time (and the way to stand still after
it): so far it goes on when the host is gone. Half of it is left when it is told more."""

SEGMENT_MM = 0.1
"""And no less than that, for slow moves: ten counts of an IAI controller."""

REPLIES, SLOWER = 25, 1.03
"""So many replies tell how often a motor answers, in times of what was planned."""

AT_ONCE = 0.7
"""Of the following error that is allowed: from one position to the next."""


class Curve(Protocol):
    """A planned motion: positions in mm, motor frame, `t` in seconds from its start."""

    duration_s: float
    end_mm: float

    def position(self, t: float, /) -> float:
        """Planned position; the end position after the end."""
        ...

    def velocity(self, t: float, /) -> float:
        """Planned velocity; 0 after the end."""
        ...


@dataclass(slots=True)
class Rest:
    """Standing still at `end_mm`."""

    end_mm: float
    duration_s: float = 0.0

    def position(self, t: float, /) -> float:
        """The one position."""
        return self.end_mm

    def velocity(self, t: float, /) -> float:
        """Zero."""
        return 0.0


class Braking:
    """From a position and a velocity to rest at a constant deceleration (mm, mm/s, mm/s²)."""

    def __init__(self, start_mm: float, velocity_mm_s: float, deceleration_mm_s2: float) -> None:
        self.start_mm = start_mm
        self.velocity_mm_s = velocity_mm_s
        self.deceleration_mm_s2 = deceleration_mm_s2
        self.duration_s = abs(velocity_mm_s) / deceleration_mm_s2
        self.end_mm = self.position(self.duration_s)

    def position(self, t: float, /) -> float:
        """Position `t` seconds after braking began."""
        t = min(max(t, 0.0), self.duration_s)
        return (
            self.start_mm
            + self.velocity_mm_s * t
            - math.copysign(0.5 * self.deceleration_mm_s2 * t * t, self.velocity_mm_s)
        )

    def velocity(self, t: float, /) -> float:
        """Velocity `t` seconds after braking began."""
        if t >= self.duration_s:
            return 0.0
        return self.velocity_mm_s - math.copysign(self.deceleration_mm_s2 * t, self.velocity_mm_s)


class Shifted:
    """A curve planned in the pad frame, moved into the motor frame."""

    def __init__(self, curve: Curve, offset_mm: float) -> None:
        self.curve = curve
        self.offset_mm = offset_mm
        self.duration_s = curve.duration_s
        self.end_mm = curve.end_mm + offset_mm

    def position(self, t: float, /) -> float:
        """Position in the motor frame."""
        return self.curve.position(t) + self.offset_mm

    def velocity(self, t: float, /) -> float:
        """Velocity, the same in both frames."""
        return self.curve.velocity(t)


class Axis:
    """Feeds one motor and collects its samples; nothing here blocks.

    `period_s` is the time between commands (stream) or polls (move). `following_mm`: how far the axis may be from where
    it was told to be; a motor that takes longer to answer than planned is told no more than a part of that at once.
    """

    def __init__(self, motor: Motor, period_s: float, following_mm: float = math.inf) -> None:
        self.motor = motor
        self.period_s = period_s
        self._most_mm = AT_ONCE * following_mm
        self._slower = False
        self._told_mm = math.nan
        self.clock = motor.link.clock
        self.live = False
        self.overruns = 0
        self.held_up_s = 0.0
        """By how much moves have taken longer than planned: for so long the motor could not be told where to go."""
        self._replies_s: deque[float] = deque(maxlen=REPLIES)
        self._curve: Curve = Rest(0.0)
        self._start_s = 0.0
        self._next_s = 0.0
        self._waiting: deque[tuple[Exchange[MotorSample], float]] = deque()
        self._goal_mm = 0.0
        self._move: tuple[float, float] = (0.0, 0.0)
        self._unwatched = isinstance(motor, RegisterMotor) and not motor.has_watchdog
        self._steps: Steps[Any] | None = None
        self._item: Exchange[Any] | Pause | None = None
        self._pause_until_s = 0.0
        self._taken_s = 0.0
        self._doubtful = self._checking = False
        self.failures: list[DriverError] = []
        self.told: list[tuple[float, str, dict[str, float]]] = []
        """Moves that a move motor has taken, and halts: time, name, numbers; for whoever records."""
        self._telling: tuple[float, dict[str, float]] | None = None
        self.refused: DriverError | None = None
        """Why the motor did not take a move or a stop, or no longer holds its clamps; the run must not go on so."""

    # -- what is commanded -------------------------------------------------------------------------------------

    def command(self, now_s: float) -> float:
        """The position commanded at a time, mm, motor frame."""
        return self._curve.position(now_s - self._start_s)

    def lag_mm(self, time_s: float) -> float:
        """How far a move motor may be behind the plan at a time: what was planned since two polls before.

        It begins when it has taken the command, which no poll tells to better than that; a stream tells it exactly.
        """
        if self.motor.kind == "stream":
            return 0.0
        return abs(self.command(time_s) - self.command(time_s - 2.5 * self.period_s))

    def over_s(self, time_s: float) -> float:
        """For how long a move motor has had to be where it was sent: since its profile was over, and all of it told.

        0 while it is under way, and for a stream, whose every position is judged by what was commanded just then.
        """
        if self.motor.kind == "stream" or self._steps is not None or self._goal_mm != self._curve.end_mm:
            return 0.0
        return max(0.0, time_s - max(self._start_s + self._curve.duration_s, self._taken_s))

    def velocity(self, now_s: float) -> float:
        """The velocity commanded at a time, mm/s."""
        return self._curve.velocity(now_s - self._start_s)

    def ended(self, now_s: float) -> bool:
        """Whether the planned profile is over, and a move motor has taken it to its end."""
        told = self.motor.kind == "stream" or self._goal_mm == self._curve.end_mm
        return told and self._steps is None and now_s - self._start_s >= self._curve.duration_s

    def go_live(self, position_mm: float) -> None:
        """Begin to feed (or poll) the motor, holding a position."""
        now = self.clock.now()
        self._curve = Rest(position_mm)
        self._goal_mm = position_mm
        self._start_s = now
        self._next_s = now
        self.live = True

    def follow(self, curve: Curve, speed_mm_s: float, acceleration_mm_s2: float) -> None:
        """Start a profile now; a move motor is told its end, speed (mm/s) and acceleration (mm/s²)."""
        self._curve = curve
        self._start_s = self.clock.now()
        if self.motor.kind == "move":
            self._telling = (self._start_s, self._as_written(curve.end_mm, speed_mm_s, acceleration_mm_s2))
            self._move = (speed_mm_s, acceleration_mm_s2)
            self._goal_mm = self._segment_end(SEGMENT_S)
            self._begin(self.motor.move(self._goal_mm, speed_mm_s, acceleration_mm_s2))

    def _segment_end(self, ahead_s: float) -> float:
        """As far as the motor may be told to go by itself, having followed its profile for so long: to rest from there.

        Told more before it brakes for that end, it makes the one profile that it would have made of the whole move.
        """
        curve = self._curve
        if not self._unwatched:
            return curve.end_mm
        speed_mm_s, acceleration_mm_s2 = self._move
        ahead_s = max(ahead_s, SEGMENT_MM / speed_mm_s)
        at_s = max(self.clock.now() - self._start_s, 0.0) + ahead_s
        velocity = curve.velocity(at_s)
        end = curve.position(at_s) + math.copysign(0.5 * velocity * velocity / acceleration_mm_s2, velocity)
        left = curve.end_mm - end
        # What is left is told with the rest where it is less than a segment, and where rounding passed the end.
        near = abs(left) <= max(SEGMENT_MM, abs(velocity) * 0.5 * SEGMENT_S) or at_s >= curve.duration_s
        return curve.end_mm if near else end

    def _tell_more(self, now_s: float) -> None:
        """The next segment of a move, when half of the last one is left."""
        speed_mm_s, acceleration_mm_s2 = self._move
        braking_mm = 0.5 * speed_mm_s * speed_mm_s / acceleration_mm_s2
        left_mm = abs(self._goal_mm - self.command(now_s)) - braking_mm
        if left_mm <= max(0.5 * SEGMENT_S * speed_mm_s, 0.5 * SEGMENT_MM):
            self._goal_mm = self._segment_end(SEGMENT_S)
            self._begin(self.motor.move(self._goal_mm, speed_mm_s, acceleration_mm_s2))

    @property
    def slowest_mm_s(self) -> float:
        """The slowest speed that the motor can be told (mm/s); 0 for one that is streamed."""
        return self.motor.slowest_mm_s if isinstance(self.motor, RegisterMotor) else 0.0

    def stamp_std_s(self) -> float:
        """Doubt of the polls' stamps: a device looks where it is at some time while it works on its reply, and always
        at the same; stamps are in the middle, so that half of that time is not too much for a standard deviation."""
        if isinstance(self.motor, RegisterMotor):
            return 0.5e-3 * self.motor.map.reply.processing_ms
        return 0.0

    def halt(self, deceleration_mm_s2: float) -> None:
        """Decelerate from the present commanded motion and stand."""
        now = self.clock.now()
        velocity = self.velocity(now)
        here = self.command(now)
        self._curve = Braking(here, velocity, deceleration_mm_s2) if velocity else Rest(here)
        self._goal_mm = self._curve.end_mm
        self._start_s = now
        if self.motor.kind == "move":
            self._note_taken(now)
            self.told.append((now, HALT, {}))
            self.clear_queue()
            self._begin(self.motor.stop())
        else:
            self._next_s = now

    def clear_queue(self) -> None:
        """Forget commands and polls that are not yet on the wire."""
        dropped = self.motor.link.drop_queue()
        self._waiting = deque((exchange, at) for exchange, at in self._waiting if exchange not in dropped)

    def freeze(self, position_mm: float) -> None:
        """Take a position as commanded from now on (after a move motor was stopped where nobody planned it)."""
        self._curve = Rest(position_mm)
        self._goal_mm = position_mm
        self._start_s = self.clock.now()

    def go_silent(self) -> None:
        """Feed and poll no more."""
        self.live = False
        self._steps = None
        self._checking = False
        self._waiting.clear()

    # -- the bytes ---------------------------------------------------------------------------------------------

    def catch_up(self, now_s: float) -> None:
        """To be called first in each turn: where the host was late by more than a period, the profile waited for it."""
        late = now_s - self._next_s
        if self.live and late > self.period_s and self.motor.kind == "stream":
            self.overruns += 1
            self._put_off(late)
            self._next_s = now_s

    def tick(self, now_s: float) -> None:
        """Submit what is due: the next command or poll, and the next exchange of a running move."""
        if self._steps is not None:
            self._advance(now_s)
        elif self.live and self._unwatched and self._goal_mm != self._curve.end_mm:
            self._tell_more(now_s)
        if not self.live or now_s < self._next_s:
            return
        if len(self._waiting) > 1:
            # The last command is still unanswered a whole period later: skip this one, and say so.
            self.overruns += 1
            self._keep_to_replies(now_s)
            self._put_off(now_s + self.period_s - self._next_s)
            self._next_s = now_s + self.period_s
            return
        if self.motor.kind == "stream":
            target = self._next_mm(now_s) if self._slower else self.command(now_s)
            self._told_mm = target
            self._waiting.append((self.motor.link.submit(self.motor.stream(target)), target))
        else:
            self._waiting.append((self.motor.link.submit(self.motor.read()), math.nan))
        late = now_s - self._next_s
        if late > self.period_s:
            self.overruns += 1
            self._next_s = now_s + self.period_s
        else:
            self._next_s += self.period_s

    def _next_mm(self, now_s: float) -> float:
        """Where a motor is to go next that is slower than planned: the plan was for a period in which it does not go so
        far from where it was told to go before."""
        for _ in range(4):
            target = self.command(now_s)
            way_mm = abs(target - self._told_mm)
            if not way_mm > self._most_mm:
                break
            self._put_off(self.period_s * (1.0 - self._most_mm / way_mm))
        return self.command(now_s)

    def _put_off(self, seconds: float) -> None:
        """Let a streamed profile go on where it was, so much later: a set-point that jumps is a blow to the pad."""
        if self.motor.kind == "stream":
            if not self.ended(self._next_s):
                self.held_up_s += seconds
            self._start_s += seconds

    def _keep_to_replies(self, now_s: float) -> None:
        """From now on as often as the motor answers, where it has taken longer than planned again and again: its own
        silence before a reply, or an adapter's, are set to what nobody knew. Else each move would be held up."""
        if self.motor.kind != "stream" or len(self._replies_s) < REPLIES:
            return
        apart_s = median(b - a for a, b in pairwise(self._replies_s))  # one command waits: that is a whole exchange
        if apart_s > SLOWER * self.period_s:
            self.period_s, self._slower = apart_s, True
            self._replies_s.clear()
            self.told.append((now_s, "motor_slower", {"period_s": apart_s}))

    def collect(self) -> list[tuple[MotorSample, float]]:
        """Samples that have come, each with the position commanded when it was measured; errors go to `failures`."""
        found = []
        waiting = self._waiting
        while waiting and waiting[0][0].done:
            exchange, target = waiting.popleft()
            if exchange.error is not None:
                self.failures.append(exchange.error)
                self._doubtful |= isinstance(exchange.error, DeviceTimeout)
                continue
            sample = exchange.result()
            self._replies_s.append(sample.received_s)
            if self._doubtful and self.live and self._steps is None:
                # it answers again: has it been off, and lost its clamps?
                self._doubtful, self._checking = False, True
                self._begin(self.motor.held())
            found.append((sample, self.command(sample.time_s) if math.isnan(target) else target))
        return found

    def wake_at(self) -> float:
        """When `tick` has something to do (bench clock)."""
        due = self._next_s if self.live else math.inf
        if self._steps is not None and isinstance(self._item, Pause):
            due = min(due, self._pause_until_s)
        return due

    def _as_written(self, target_mm: float, speed_mm_s: float, acceleration_mm_s2: float) -> dict[str, float]:
        """The move in the device's own counts, where it has such; what it refuses is told by the move itself."""
        move = target_mm, speed_mm_s, acceleration_mm_s2
        if isinstance(self.motor, RegisterMotor):
            with contextlib.suppress(DriverError):
                move = self.motor.as_written(*move)
        return dict(zip(("target_mm", "speed_mm_s", "acceleration_mm_s2"), move, strict=True))

    def _note_taken(self, now_s: float) -> None:
        """The move under way began between its command and now."""
        if self._telling is not None:
            commanded_s, move = self._telling
            self.told.append((now_s, MOVE, {**move, "waited_s": now_s - commanded_s}))
            self._telling = None

    def _begin(self, steps: Steps[Any]) -> None:
        """Start a conversation; a check under way gives way to it, and is made later."""
        if self._checking and self._steps is not None:
            self._doubtful, self._checking = True, False
        self._steps = steps
        self._item = None
        self._advance(self.clock.now())

    def _advance(self, now_s: float) -> None:
        """Drive the running conversation (a move, a stop) one exchange further, if it is ready."""
        assert self._steps is not None
        item = self._item
        reply: Any = None
        error: DriverError | None = None
        if isinstance(item, Pause):
            if now_s < self._pause_until_s:
                return
        elif item is not None:
            if not item.done:
                return
            reply, error = item.value, item.error
        try:
            item = self._steps.throw(error) if error is not None else self._steps.send(reply)
        except StopIteration:
            self._steps = None
            self._item = None
            if not self._checking:
                self._taken_s = now_s
                self._note_taken(now_s)
            self._checking = False
            return
        except DriverError as failure:
            self._steps = None
            self._item = None
            if self._checking and not isinstance(failure, ReadbackError):
                self._doubtful = True  # not answered; to be asked again
            else:
                self._telling = None
                self.refused = failure
            self._checking = False
            return
        self._item = item
        if isinstance(item, Pause):
            self._pause_until_s = now_s + item.seconds
        else:
            self.motor.link.submit(item, urgent=True)
