"""Moves as parts of a script: go there, go until the force says so, stand for a while."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass

from bench.rates import made_speed_mm_s
from bench.run.axis import Axis
from bench.run.loop import Loop, Script, Window
from bench.trajectory import Profile

STANDING_MM = 2e-3
"""A move motor's position may still change by so much between polls when it is said to stand."""


@dataclass(frozen=True)
class Shape:
    """How this run moves: acceleration (mm/s²) and, for S-curves, jerk (mm/s³; None: trapezoid); and the steps in which
    the motor counts speeds (0: any)."""

    acceleration_mm_s2: float
    jerk_mm_s3: float | None = None
    speed_step_mm_s: float = 0.0

    def profile(self, start_mm: float, end_mm: float, speed_mm_s: float) -> Profile:
        """A rest-to-rest profile of this shape."""
        return Profile(start_mm, end_mm, speed_mm_s, self.acceleration_mm_s2, self.jerk_mm_s3)


class Mover:
    """Scripts for the axis of a loop; all positions in the motor frame, mm."""

    def __init__(self, loop: Loop, shape: Shape) -> None:
        self.loop = loop
        self.axis: Axis = loop.axis
        self.clock = loop.clock
        self.shape = shape

    def here(self) -> float:
        """The position commanded now."""
        return self.axis.command(self.clock.now())

    def go(self, target_mm: float, speed_mm_s: float) -> Script[None]:
        """Move to a position and return when the planned ramp has ended."""
        start = self.here()
        if abs(target_mm - start) < 1e-9:
            return
        self._follow(start, target_mm, speed_mm_s)
        while not self.axis.ended(self.clock.now()):
            yield

    def go_until(self, target_mm: float, speed_mm_s: float, reached: Callable[[], bool]) -> Script[bool]:
        """Move towards a position until `reached()`, asked once for every force sample, says so; then brake.

        Returns whether it was reached; the axis stands when this returns.
        """
        start = self.here()
        loop = self.loop
        if abs(target_mm - start) < 1e-9:
            return False
        self._follow(start, target_mm, speed_mm_s)
        seen = loop.force_count
        while not self.axis.ended(self.clock.now()):
            if loop.force_count != seen:
                seen = loop.force_count
                if reached():
                    yield from self.brake()
                    return True
            yield
        return False

    def brake(self) -> Script[None]:
        """Decelerate and stand; afterwards the commanded position is where the axis stands."""
        axis = self.axis
        axis.halt(self.shape.acceleration_mm_s2)
        while not axis.ended(self.clock.now()):
            yield
        if axis.motor.kind == "move":
            yield from self.settle()

    def settle(self, patience_s: float = 2.0) -> Script[None]:
        """Wait until the measured positions agree that the axis stands; a move motor's is then what is commanded."""
        loop = self.loop
        give_up = self.clock.now() + patience_s
        last = math.nan
        seen = loop.motor_count
        while self.clock.now() < give_up:
            if loop.motor_count != seen and loop.last_motor is not None:
                seen = loop.motor_count
                position = loop.last_motor.position_mm
                if abs(position - last) < STANDING_MM and not loop.last_motor.moving:
                    break
                last = position
            yield
        if loop.last_motor is not None and self.axis.motor.kind == "move":
            self.axis.freeze(loop.last_motor.position_mm)

    def watch(self) -> Window:
        """Begin to keep samples for the script; `unwatch` ends it."""
        self.loop.window = Window()
        return self.loop.window

    def unwatch(self) -> None:
        """Keep no more samples."""
        self.loop.window = None

    def _follow(self, start_mm: float, end_mm: float, asked_mm_s: float) -> None:
        speed_mm_s = made_speed_mm_s(asked_mm_s, self.shape.speed_step_mm_s)
        curve = self.shape.profile(start_mm, end_mm, speed_mm_s)
        self.axis.follow(curve, speed_mm_s, self.shape.acceleration_mm_s2)
