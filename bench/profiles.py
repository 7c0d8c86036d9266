"""Profiles of planned moves: a trapezoid of speed from rest to rest, as it is or smoothed.

Drives smooth what a planner hands them: a mean over some milliseconds makes ramps of acceleration out of its steps (the
S-curve of a jerk limit), and the mover follows its set-point late (a critically damped second order). Both at once are
closed forms: each corner of the trapezoid is a step of acceleration, and the response to one is integrated twice.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

SETTLED = 12.0  # time constants after which a lag has ended: what is left is less than a ten-thousandth


@dataclass(frozen=True)
class Smoothing:
    """A mean over `width_s`, and a critically damped second-order lag of time constant `lag_s`; both without what they
    delay a ramp by."""

    width_s: float = 0.0
    lag_s: float = 0.0

    @property
    def delay_s(self) -> float:
        """By how much it would delay a ramp."""
        return 0.5 * self.width_s + 2.0 * self.lag_s

    @property
    def after_s(self) -> float:
        """For how long after a corner the motion still differs; before it, for `delay_s`."""
        return 0.5 * self.width_s + SETTLED * self.lag_s

    def to_a_step(self, since_s: Array) -> tuple[Array, Array]:
        """(position, speed) that an acceleration of 1, from 0 s on, has made."""
        u = since_s + self.delay_s
        if self.width_s <= 0.0:
            return self._integral(3, u), self._integral(2, u)
        later, width = u - self.width_s, self.width_s
        return (
            (self._integral(4, u) - self._integral(4, later)) / width,
            (self._integral(3, u) - self._integral(3, later)) / width,
        )

    def _integral(self, times: int, u: Array) -> Array:
        """The lag's response to an impulse, integrated so many times (2, 3 or 4), at u after it.

        With s = u/τ: u − τ (2 − (2 + s) e^−s), u²/2 − 2 τ u + τ² (3 − (3 + s) e^−s), and so on.
        """
        u = np.maximum(u, 0.0)
        if self.lag_s <= 0.0:
            return np.asarray(u ** (times - 1) / math.factorial(times - 1))
        tau = self.lag_s
        gone = (times + u / tau) * np.exp(-u / tau)
        if times == 2:
            return np.asarray(u - tau * (2.0 - gone))
        if times == 3:
            return np.asarray(0.5 * u**2 - 2.0 * tau * u + tau**2 * (3.0 - gone))
        return np.asarray(u**3 / 6.0 - tau * u**2 + 3.0 * tau**2 * u - tau**3 * (4.0 - gone))


PLAIN = Smoothing()


@dataclass(frozen=True)
class Trapezoid:
    """A move from rest to rest: from `start_mm` by `way_mm` (signed), its middle at `middle_s`."""

    start_mm: float
    way_mm: float
    middle_s: float
    speed_mm_s: float
    acceleration_mm_s2: float
    smoothing: Smoothing = PLAIN

    def position(self, time_s: Array) -> Array:
        """Where it is, mm."""
        way = np.array(abs(self.way_mm))
        s, _, _ = profile(
            time_s - self.middle_s, way, np.array(self.speed_mm_s), self.acceleration_mm_s2, self.smoothing
        )
        return np.asarray(self.start_mm + np.sign(self.way_mm) * s)

    def corners_s(self) -> Array:
        """Where the acceleration changes, or begins and ends to change."""
        long, short = _corners(np.array(abs(self.way_mm)), np.array(self.speed_mm_s), self.acceleration_mm_s2)
        corners = self.middle_s + np.array([-long, -short, short, long])
        if self.smoothing == PLAIN:
            return corners
        begin = corners - self.smoothing.delay_s
        return np.sort(np.concatenate([begin, begin + self.smoothing.width_s]))

    def span_s(self) -> tuple[float, float]:
        """From when to when it moves."""
        corners = self.corners_s()
        lagging = SETTLED * self.smoothing.lag_s
        return float(corners[0]), float(corners[-1]) + lagging


def _corners(way: Array, speed: Array, acceleration: float | Array) -> tuple[Array, Array]:
    """How far from the middle, in time, the speed begins to rise, and has risen."""
    return (way / speed + speed / acceleration) / 2, np.maximum(way / speed - speed / acceleration, 0.0) / 2


def profile(
    tau: Array, way: Array, speed: Array, acceleration: float | Array, smoothing: Smoothing = PLAIN
) -> tuple[Array, Array, Array]:
    """Way gone at τ from a trapezoid's middle, its derivatives by the middle's time and by the speed."""
    if smoothing != PLAIN:
        return _smoothed(tau, way, speed, acceleration, smoothing)
    (long, short), late = _corners(way, speed, acceleration), np.abs(tau)
    left = np.maximum(long - late, 0.0)  # until it stands
    cruising = late < short
    rise = np.where(cruising, speed * late, way / 2 - acceleration / 2 * left**2)
    slope = np.where(cruising, speed, acceleration * left)
    by_half = (-way / speed**2 + 1 / acceleration) / 2
    by_speed = np.where(cruising, late, -acceleration * left * by_half)
    side = np.sign(tau)
    return way / 2 + side * rise, -slope, side * by_speed


def _smoothed(
    tau: Array, way: Array, speed: Array, acceleration: float | Array, smoothing: Smoothing
) -> tuple[Array, Array, Array]:
    long, short = _corners(way, speed, acceleration)
    by_long = (-way / speed**2 + 1 / acceleration) / 2
    by_short = np.where(short > 0.0, (-way / speed**2 - 1 / acceleration) / 2, 0.0)
    (s1, v1), (s2, v2), (s3, v3), (s4, v4) = (
        smoothing.to_a_step(tau + corner) for corner in (long, short, -short, -long)
    )
    gone = acceleration * (s1 - s2 - s3 + s4)
    by_middle = -acceleration * (v1 - v2 - v3 + v4)
    by_speed = acceleration * ((v1 - v4) * by_long - (v2 - v3) * by_short)
    return gone, by_middle, by_speed
