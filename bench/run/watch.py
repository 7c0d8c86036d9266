"""Watchdogs over what the devices say: a cell that repeats itself, a motor and a cell that disagree, a host that slept.

Each keeps a little state, is given the samples one by one, and answers with a cause or with None.
"""

from __future__ import annotations

import math
import time

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
