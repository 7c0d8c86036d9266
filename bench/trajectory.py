"""Motion from rest to rest: trapezoids, and S-curves with limited jerk.

A profile is a few stretches of constant jerk; each is a cubic, so that one evaluation is a search and a Horner scheme.
Times of the stretches: L. Biagiotti, C. Melchiorri, *Trajectory Planning for Automatic Machines and Robots*,
Springer 2008, sections 3.2 (trapezoidal) and 3.4 (double S), for zero speed and acceleration at both ends.
"""

from __future__ import annotations

import math
from bisect import bisect_right
from itertools import accumulate
from typing import overload

import numpy as np
from numpy.typing import ArrayLike, NDArray

Array = NDArray[np.float64]


def braking_distance(speed_mm_s: float, deceleration_mm_s2: float) -> float:
    """How far an axis runs on while it decelerates to rest (mm): v²/2a."""
    return speed_mm_s * speed_mm_s / (2.0 * deceleration_mm_s2)


class Profile:
    """A ramp from rest at `start_mm` to rest at `end_mm`, as fast as the limits allow but no faster than asked.

    Without a jerk it is a trapezoid, a triangle where the way is too short for the speed; with one, an S-curve.
    `peak_speed_mm_s` and `peak_acceleration_mm_s2` are what it really reaches. Before 0 it stands at the start,
    after `duration_s` at the end. Raises ValueError unless speed, acceleration and jerk are finite and positive.
    """

    __slots__ = (
        "start_mm",
        "end_mm",
        "speed_mm_s",
        "acceleration_mm_s2",
        "jerk_mm_s3",
        "duration_s",
        "peak_speed_mm_s",
        "peak_acceleration_mm_s2",
        "_times",
        "_rows",
        "_table",
        "_low",
        "_high",
    )

    def __init__(
        self,
        start_mm: float,
        end_mm: float,
        speed_mm_s: float,
        acceleration_mm_s2: float,
        jerk_mm_s3: float | None = None,
    ) -> None:
        for name, value in (("speed", speed_mm_s), ("acceleration", acceleration_mm_s2), ("jerk", jerk_mm_s3)):
            if value is not None and not (math.isfinite(value) and value > 0):
                raise ValueError(f"{name} must be finite and positive, not {value}")
        if not (math.isfinite(start_mm) and math.isfinite(end_mm)):
            raise ValueError(f"a ramp needs two ends, not {start_mm} and {end_mm}")
        self.start_mm, self.end_mm = float(start_mm), float(end_mm)
        self.speed_mm_s, self.acceleration_mm_s2, self.jerk_mm_s3 = speed_mm_s, acceleration_mm_s2, jerk_mm_s3
        distance = abs(self.end_mm - self.start_mm)
        if jerk_mm_s3 is None:
            stretches, speed, acceleration = _trapezoid(distance, speed_mm_s, acceleration_mm_s2)
        else:
            stretches, speed, acceleration = _s_curve(distance, speed_mm_s, acceleration_mm_s2, jerk_mm_s3)
        self.peak_speed_mm_s, self.peak_acceleration_mm_s2 = speed, acceleration
        self.duration_s = sum(duration for duration, _, _ in stretches)
        self._times = list(accumulate((duration for duration, _, _ in stretches), initial=0.0))[:-1] or [0.0]
        self._rows = _cubics(stretches, self.start_mm, math.copysign(1.0, self.end_mm - self.start_mm))
        self._table = np.array(self._rows)
        self._low, self._high = min(self.start_mm, self.end_mm), max(self.start_mm, self.end_mm)

    @overload
    def position(self, t: float) -> float: ...
    @overload
    def position(self, t: ArrayLike) -> Array: ...
    def position(self, t: ArrayLike) -> float | Array:
        """Position in mm at `t` seconds after the start; a float for a float (about a microsecond), else an array."""
        if isinstance(t, float):
            if t >= self.duration_s:
                return self.end_mm
            if t <= 0.0:
                return self.start_mm
            begin, p, v, a, j = self._rows[bisect_right(self._times, t) - 1]
            u = t - begin
            position = p + u * (v + u * (a + u * j))
            return self._low if position < self._low else min(position, self._high)  # rounding never passes an end
        time = np.asarray(t, dtype=np.float64)
        begin_s, p_mm, v_mm_s, a_half, j_sixth = self._columns(time)
        u_s = time - begin_s
        position = np.clip(p_mm + u_s * (v_mm_s + u_s * (a_half + u_s * j_sixth)), self._low, self._high)
        position = np.where(time >= self.duration_s, self.end_mm, position)
        return np.where(time <= 0.0, self.start_mm, position)

    @overload
    def velocity(self, t: float) -> float: ...
    @overload
    def velocity(self, t: ArrayLike) -> Array: ...
    def velocity(self, t: ArrayLike) -> float | Array:
        """Velocity in mm/s at `t` seconds after the start, with its sign; a float for a float, else an array."""
        if isinstance(t, float):
            if not 0.0 < t < self.duration_s:
                return 0.0
            begin, _, v, a, j = self._rows[bisect_right(self._times, t) - 1]
            u = t - begin
            return v + u * (2.0 * a + u * 3.0 * j)
        time = np.asarray(t, dtype=np.float64)
        begin_s, _, v_mm_s, a_half, j_sixth = self._columns(time)
        u_s = time - begin_s
        moving = (time > 0.0) & (time < self.duration_s)
        return np.where(moving, v_mm_s + u_s * (2.0 * a_half + u_s * 3.0 * j_sixth), 0.0)

    def _columns(self, time: Array) -> tuple[Array, Array, Array, Array, Array]:
        index = np.clip(np.searchsorted(self._times, time, side="right") - 1, 0, len(self._times) - 1)
        rows = self._table[index]
        return rows[..., 0], rows[..., 1], rows[..., 2], rows[..., 3], rows[..., 4]


# A stretch: duration (s), acceleration at its start (mm/s²), jerk (mm/s³); along the way, so positive is forward.
_Stretch = tuple[float, float, float]


def _trapezoid(distance: float, speed: float, acceleration: float) -> tuple[list[_Stretch], float, float]:
    if distance == 0.0:
        return [], 0.0, 0.0
    if speed * speed >= distance * acceleration:  # too short to reach the speed: a triangle
        speed = math.sqrt(distance * acceleration)
    rise = speed / acceleration
    cruise = max(0.0, distance / speed - rise)
    return [(rise, acceleration, 0.0), (cruise, 0.0, 0.0), (rise, -acceleration, 0.0)], speed, acceleration


def _s_curve(distance: float, speed: float, most: float, jerk: float) -> tuple[list[_Stretch], float, float]:
    if distance == 0.0:
        return [], 0.0, 0.0
    # Time of one jerk, and of the whole rise to the speed.
    turn, rise = (math.sqrt(speed / jerk),) * 2 if speed * jerk < most * most else (most / jerk, speed / most)
    rise += turn
    cruise = distance / speed - rise
    if cruise < 0.0:  # the speed is not reached
        cruise = 0.0
        turn = most / jerk
        if distance >= 2.0 * most * turn * turn:
            rise = turn / 2.0 + math.sqrt(turn * turn / 4.0 + distance / most)
        else:  # nor is the acceleration
            turn = (distance / (2.0 * jerk)) ** (1.0 / 3.0)
            rise = 2.0 * turn
    level = max(0.0, rise - 2.0 * turn)
    acceleration = jerk * turn
    stretches = [
        (turn, 0.0, jerk),
        (level, acceleration, 0.0),
        (turn, acceleration, -jerk),
        (cruise, 0.0, 0.0),
        (turn, 0.0, -jerk),
        (level, -acceleration, 0.0),
        (turn, -acceleration, jerk),
    ]
    return stretches, acceleration * (turn + level), acceleration


def _cubics(stretches: list[_Stretch], start: float, sign: float) -> list[tuple[float, float, float, float, float]]:
    """Rows of begin time and the cubic's coefficients: position, velocity, half acceleration, sixth of the jerk."""
    rows = []
    begin, position, velocity = 0.0, 0.0, 0.0
    for duration, acceleration, jerk in stretches:
        a, j = acceleration / 2.0, jerk / 6.0
        rows.append((begin, start + sign * position, sign * velocity, sign * a, sign * j))
        position += duration * (velocity + duration * (a + duration * j))
        velocity += duration * (acceleration + duration * jerk / 2.0)
        begin += duration
    return rows or [(0.0, start, 0.0, 0.0, 0.0)]
