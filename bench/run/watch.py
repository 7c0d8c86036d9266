"""Watchdogs over what the devices say: a cell that repeats itself or jumps, a motor that disagrees, a host asleep.

Each keeps a little state, is given the samples one by one, and answers with a cause or with None.
"""

from __future__ import annotations

import itertools
import math
import time
from collections import deque

import numpy as np

BY_CHANCE = 1e-12
"""A run of equal readings that noise would make less often than that is no chance."""

LONGER = 4
"""And it must be so many times as long as the longest that was seen in air: what repeats is not always independent."""

ENOUGH_SAMPLES, ENOUGH_CHANGES = 64, 16
"""So much must have been seen of a cell before anything can be said of how it repeats itself."""

TAIL_PERCENT, TAILS_SIGMA = 0.5, 5.15
"""What lies between these tails of a normal distribution, in standard deviations: few outliers do not count."""

UNWATCHABLE_S = 5.0
"""A cell whose readings may stand still for longer than that cannot be told from a frozen one."""

SENSE_S = 0.1
"""Time constant of the two forces that are compared: delays, and the servo's blows in a ramp, are shorter."""

SUSTAINED_S = 0.1
LEAST_N = 2.0
"""Below that nobody knows what a motor's own sense of force is worth."""

SHARE = 0.25
"""Motor and cell may differ by that share of the force limit; and a channel that follows by less than that is flat."""


JUMP_SIGMAS, JUMP_SHARE, JUMP_OF_LIMIT = 10.0, 0.1, 0.02
"""A jump is more than so many times the noise in air, that share of the force there, and that of the force limit."""

SIDE, BETWEEN = 6, 2
SMOOTH = 0.3
"""Readings to each side of a jump, those it may take, and what each side may spread by, of the jump."""

BACK_SHARE = 0.1
"""So many of the readings afterwards may be back on the other side: outliers."""

STANDS_S, STAYS_S = 0.15, 0.1
COMMAND_MM, STILL_MM = 1e-6, 0.015
"""The axis stands for so long before a force is judged, and so long a jump lasts. An encoder's last digit may turn."""

REPEATING_S = 1.0
"""And for so long where the cell repeats its readings: one that measures ten times a second makes stairs of all that a
pad does after a ramp."""

EVEN_MM = 2e-3
"""A command that moves evenly is so near to a line: 0.1 N at most of a sample as stiff as 50 N/mm."""

SURELY = 3.0
"""So many times as large must a jump be on the move, where noise can hide a slope, or of readings that repeat."""

STOOD, MOVED = "stood still", "moved evenly"


class FrozenWatch:
    """Whether a load cell still measures: one that repeats its last reading goes on sending frames.

    How often its readings repeat by themselves (a coarse digit, a device polled faster than it measures) is learned
    in air, until `learned`; `least` is the number of samples in the time within which a silent cell would be noticed.
    """

    def __init__(self) -> None:
        self.least = 10
        self.most = math.inf
        self._value = math.nan
        self._equal = 0
        self._longest = 0
        self._samples = 0
        self._changes = 0
        self._learning = True
        self._bound = math.inf
        self._readings: list[float] = []

    def expect(self, rate_Hz: float, stale_s: float) -> None:
        """What the cell delivers, and after how long its silence would count."""
        self.least = max(10, math.ceil(rate_Hz * stale_s))
        self.most = rate_Hz * UNWATCHABLE_S

    def learned(self) -> bool:
        """The air is over: what has been seen is what the cell does by itself. Returns whether it can be watched."""
        self._learning = False
        self._bound = max(self._limit(), self._amid_a_digit())
        self._readings.clear()
        if self._bound > self.most:
            self._bound = math.inf
        return self._bound < math.inf

    def sample(self, gross_N: float) -> str | None:
        """One reading; the cause where the cell has stood still for too long."""
        if gross_N != self._value:
            if self._learning:
                self._changes += 1
                self._longest = max(self._longest, self._equal)
                self._bound = self._limit() if self._changes >= ENOUGH_CHANGES else math.inf
            self._value = gross_N
            self._equal = 0
        if self._learning:
            self._samples += 1
            self._readings.append(gross_N)
        self._equal += 1
        if self._equal <= self._bound:
            return None
        return (
            f"the load cell is frozen: {self._equal} readings of exactly {gross_N:.4g} N, where its noise had changed "
            f"at least every {max(self._longest, 1)}; or it is at the end of its range"
        )

    def _limit(self) -> float:
        """So many equal readings are too many; infinity where nothing can be said."""
        if self._samples < ENOUGH_SAMPLES or self._changes < ENOUGH_CHANGES:
            return math.inf
        again = max(1.0 - self._changes / self._samples, 1e-6)
        return max(self.least, LONGER * self._longest, math.ceil(math.log(BY_CHANCE) / math.log(again)))

    def _amid_a_digit(self) -> float:
        """The same for a force that lies in the middle of a coarse digit, where noise changes it least.

        In air it may lie between two digits, and change all the time. The noise is at least what is left of the
        readings' spread without one digit.
        """
        levels = np.unique(self._readings)
        if levels.size < 2:
            return math.inf
        digit_N = float(np.diff(levels).min())
        low_N, high_N = np.percentile(self._readings, [TAIL_PERCENT, 100.0 - TAIL_PERCENT])
        sigma_N = (float(high_N - low_N) - digit_N) / TAILS_SIGMA
        if sigma_N <= 0.0:
            return math.inf
        again = math.erf(digit_N / (2.0 * math.sqrt(2.0) * sigma_N))
        return math.ceil(math.log(BY_CHANCE) / math.log(again)) if again < 1.0 else math.inf


class SenseWatch:
    """The motor's own sense of force against the load cell, both from where they stood in air, smoothed alike.

    `tolerance_N` is what they may differ by; friction, cogging and the motor's crude sense are below it.
    """

    def __init__(self, tolerance_N: float) -> None:
        self.tolerance_N = tolerance_N
        self._motor_N = self._zero_N = self._cell_N = 0.0
        self._motor_s = self._cell_s = math.nan
        self._apart_s = math.nan
        self._on = False

    def in_air(self) -> None:
        """Here is air, and nothing moves: from now on both are judged by what they change."""
        self._zero_N = self._motor_N
        self._cell_N = 0.0
        self._on = not math.isnan(self._motor_s)

    def cell(self, time_s: float, net_N: float) -> None:
        """One net force."""
        self._cell_N += _weight(time_s - self._cell_s) * (net_N - self._cell_N)
        self._cell_s = time_s

    def motor(self, time_s: float, force_N: float) -> str | None:
        """One force sensed by the motor; the cause where the two have been apart for too long."""
        self._motor_N += _weight(time_s - self._motor_s) * (force_N - self._motor_N)
        self._motor_s = time_s
        if not self._on:
            return None
        pushed, felt = self._motor_N - self._zero_N, self._cell_N
        most = max(abs(pushed), abs(felt))
        apart = abs(pushed - felt) > self.tolerance_N and most > self.tolerance_N
        if not apart or (pushed * felt > 0 and min(abs(pushed), abs(felt)) > SHARE * most):
            self._apart_s = math.nan
            return None
        if math.isnan(self._apart_s):
            self._apart_s = time_s
        if time_s - self._apart_s < SUSTAINED_S:
            return None
        both = f"the motor pushes with {pushed:+.2f} N more than in air, the load cell shows {felt:+.2f} N"
        if min(abs(pushed), abs(felt)) > SHARE * most:
            return f"{both}: one of them has the wrong sign (load_cell.sign, motor.direction)"
        if abs(pushed) > abs(felt):
            return f"{both}: a broken cable, a cell that is stuck, or one that is not in the line of force"
        return f"{both}: the cell drifts, or something other than this motor presses it"


def _weight(dt_s: float) -> float:
    """Share of a new value in a smoothed one; all of it at the first."""
    return 1.0 if math.isnan(dt_s) else -math.expm1(-max(dt_s, 0.0) / SENSE_S)


class JumpWatch:
    """Whether a force jumps, and stays away, while the axis stands or moves evenly: a pad does not jump.

    A cable that moved, a setting that somebody changed, a sign, a zero: all within one or two samples. Judged are six
    readings before and six after, by their medians, so that outliers do not count. What goes smoothly (relaxation,
    drift, slow hum, a ramp) spreads about as far within the six as it goes from the ones to the others. And what has
    jumped must stay there for 0.1 s and twelve readings: a knock against the bench does not, nor does what swings.

    What the axis does in between would be a jump as well, as seen by a cell that is slow or late. So it must have
    stood, or gone along a line, from 0.15 s before the first of these readings until the verdict. While it goes, only a
    pad that is pressed is judged (touching and letting go are jumps), by a cell that does not repeat its readings.
    """

    def __init__(self, least_N: float) -> None:
        self.least_N = least_N
        self._sigma_N = math.nan
        self._readings: deque[float] = deque(maxlen=2 * SIDE + BETWEEN)
        self._times_s: deque[float] = deque(maxlen=2 * SIDE + BETWEEN)
        self._motion: deque[tuple[float, float, float]] = deque()
        self._jumped: tuple[float, float, float, float] | None = None
        self._after = self._back = 0

    def in_air(self, sigma_N: float) -> None:
        """What the noise is; from now on the force is judged, from the zero that it has now."""
        self._sigma_N = sigma_N
        self._begin()

    def motor(self, time_s: float, command_mm: float, position_mm: float) -> None:
        """One position, commanded and measured."""
        motion = self._motion
        motion.append((time_s, command_mm, position_mm))
        needed_s = self._jumped[3] if self._jumped is not None else self._times_s[0] if self._times_s else time_s
        while len(motion) > 2 and motion[1][0] <= needed_s - REPEATING_S:
            motion.popleft()

    def cell(self, time_s: float, net_N: float) -> str | None:
        """One net force; the cause where it has jumped."""
        if math.isnan(self._sigma_N):
            return None
        readings = self._readings
        readings.append(net_N)
        self._times_s.append(time_s)
        if len(readings) < 2 * SIDE + BETWEEN:
            return None
        if self._jumped is None:
            self._jumped = self._seen(time_s)
            return None
        at_s, before_N, jump_N, since_s = self._jumped
        self._after += 1
        self._back += abs(net_N - before_N) < 0.5 * abs(jump_N)
        if self._back > max(1.0, BACK_SHARE * self._after):
            self._begin()  # it came back, which is no jump either
            return None
        if time_s - at_s < STAYS_S or self._after < 2 * SIDE:
            return None
        even = self._even(since_s)
        self._begin()
        if not even:
            return None
        return (
            f"the load cell's reading jumped from {before_N:.3f} to {before_N + jump_N:.3f} N while the axis {even}, "
            "which no pad does: a cable, a setting, the sign or the zero of the cell has changed"
        )

    def _begin(self) -> None:
        """Look anew."""
        self._readings.clear()
        self._times_s.clear()
        self._jumped = None

    def _seen(self, time_s: float) -> tuple[float, float, float, float] | None:
        """When, from what, by how much, since when: where the readings now at hand have a jump in their middle."""
        readings = self._readings
        if abs(readings[-1] - readings[0]) <= self._most(readings[0]):
            return None
        before, after = (
            sorted(itertools.islice(readings, SIDE)),
            sorted(itertools.islice(readings, SIDE + BETWEEN, None)),
        )
        before_N, after_N = (0.5 * (side[SIDE // 2 - 1] + side[SIDE // 2]) for side in (before, after))
        jump_N = after_N - before_N
        # One of the six may be an outlier.
        spread_N = max(min(side[-2] - side[0], side[-1] - side[1]) for side in (before, after))
        if abs(jump_N) <= self._most(before_N) or spread_N > SMOOTH * abs(jump_N):
            return None
        repeats = all(len(set(side)) <= SIDE // 2 for side in (before, after))
        even = self._even(self._times_s[0], REPEATING_S if repeats else STANDS_S)
        if even == MOVED and (repeats or before_N <= self._most(before_N)):
            return None
        if (even == MOVED or repeats) and abs(jump_N) <= SURELY * self._most(before_N):
            return None
        if not even:
            return None
        self._after = self._back = 0
        return time_s, before_N, jump_N, self._times_s[0]

    def _even(self, since_s: float, before_s: float = STANDS_S) -> str:
        """Whether the axis stood or moved along a line, from so long before a time until now; empty: neither."""
        since_s -= before_s
        motion = [sample for sample in self._motion if sample[0] >= since_s]
        if not motion or self._motion[0][0] > since_s:
            return ""
        times_s, commands_mm, positions_mm = np.array(motion).T
        if np.ptp(commands_mm) <= COMMAND_MM:
            return STOOD if np.ptp(positions_mm) <= STILL_MM else ""
        even = _off_a_line(times_s, commands_mm) <= EVEN_MM and _off_a_line(times_s, positions_mm) <= STILL_MM
        return MOVED if even else ""

    def _most(self, force_N: float) -> float:
        return max(JUMP_SIGMAS * self._sigma_N, JUMP_SHARE * abs(force_N), self.least_N)


def _off_a_line(times: np.ndarray, values: np.ndarray) -> float:
    """The farthest of the values from the straight line through them."""
    t, v = times - times.mean(), values - values.mean()
    spread = float(t @ t)
    return float(np.abs(v - (float(t @ v) / spread if spread > 0.0 else 0.0) * t).max())


class HostSleep:
    """Whether the computer was suspended: the clock of a run stands still then, and the bench does not."""

    def __init__(self) -> None:
        self._apart_s = _boot_minus_monotonic_s()

    def slept_s(self) -> float:
        """Seconds of sleep since it was asked last."""
        apart_s = _boot_minus_monotonic_s()
        slept_s, self._apart_s = apart_s - self._apart_s, apart_s
        return slept_s


def _boot_minus_monotonic_s() -> float:
    boot = getattr(time, "CLOCK_BOOTTIME", None)
    return 0.0 if boot is None else time.clock_gettime(boot) - time.monotonic()
