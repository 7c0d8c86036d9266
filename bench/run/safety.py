"""What stops a run: limits checked at every sample, on hardware as in simulation.

A software limit is no emergency stop: it is as fast as the slowest channel it reads, and it needs this process alive.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

from bench.errors import Stopped
from drivers.loadcell import ForceSample
from drivers.motor import MotorSample

SLACK_MM = 0.01
"""How far a measured position may lie beyond a limit that a step goes to: encoder noise and the servo's overshoot."""


@dataclass
class Envelope:
    """The tighter of bench and protocol limits; positions in the motor frame, mm, N, s.

    `depth_mm` counts from the surface, and only once touch-off has set `surface_mm`.
    """

    force_N: float
    tension_N: float
    gross_N: float
    position_mm: tuple[float, float]
    speed_mm_s: float
    following_error_mm: float
    stale_s: float
    depth_mm: float = math.inf
    surface_mm: float | None = None

    @property
    def deepest_mm(self) -> float:
        """The furthest motor position that is allowed now."""
        if self.surface_mm is None:
            return self.position_mm[1]
        return min(self.position_mm[1], self.surface_mm + self.depth_mm)


class Monitor:
    """Judges each sample as it arrives; the first violation is kept in `cause`, whatever follows.

    `check` raises `Stopped` once there is a cause, unless the run is stopping already (`stopping`).
    """

    def __init__(self, envelope: Envelope) -> None:
        self.envelope = envelope
        self.cause: str | None = None
        self.stopping = False
        self.watch_following = True
        self._last_position: tuple[float, float] | None = None
        self._newest_force_s: float | None = None
        self._newest_motor_s: float | None = None
        self._fast = 0

    def violate(self, cause: str) -> None:
        """Note why the run must stop; only the first cause is kept."""
        if self.cause is None:
            self.cause = cause

    def check(self) -> None:
        """Raise `Stopped` with the first cause, if there is one and nobody is stopping yet."""
        if self.cause is not None and not self.stopping:
            raise Stopped(self.cause)

    def expect_force_from(self, now_s: float | None) -> None:
        """From now on the load cell must keep coming; None: it need not."""
        self._newest_force_s = now_s

    def expect_motor_from(self, now_s: float) -> None:
        """From now on the motor must keep answering."""
        self._newest_motor_s = now_s

    def force(self, sample: ForceSample, net_N: float) -> None:
        """Judge one force sample: pad by net force, cell by gross force."""
        e = self.envelope
        self._newest_force_s = sample.received_s
        if sample.overload:
            self.violate(f"the load cell reports overload at {sample.gross_N:.3g} N")
        elif net_N > e.force_N:
            self.violate(f"force limit: {net_N:.3f} N measured, {e.force_N:g} N allowed")
        elif net_N < -e.tension_N:
            self.violate(f"tension limit: {-net_N:.3f} N measured, {e.tension_N:g} N allowed")
        elif abs(sample.gross_N) > e.gross_N:
            self.violate(f"gross force {sample.gross_N:.3f} N is beyond the {e.gross_N:g} N the cell may carry")

    def motor(self, sample: MotorSample, command_mm: float, fault_names: tuple[str, ...], lag_mm: float = 0.0) -> None:
        """Judge one motor sample against travel, depth, speed, following error and the device's own faults.

        `lag_mm`: how far behind the command the axis may be because nobody knows when it began.
        """
        e = self.envelope
        self._newest_motor_s = sample.received_s
        x = sample.position_mm
        if sample.fault:
            self.violate(f"the motor reports a fault: {', '.join(fault_names) or hex(sample.fault)}")
        if not e.position_mm[0] - SLACK_MM <= x <= e.position_mm[1] + SLACK_MM:
            self.violate(f"travel limit: at {x:.3f} mm, allowed {e.position_mm[0]:g} to {e.position_mm[1]:g} mm")
        if e.surface_mm is not None and x - e.surface_mm > e.depth_mm + SLACK_MM:
            self.violate(f"depth limit: {x - e.surface_mm:.3f} mm into the pad, {e.depth_mm:g} mm allowed")
        if self.watch_following and abs(command_mm - x) > e.following_error_mm + lag_mm:
            self.violate(
                f"following error: commanded {command_mm:.3f} mm, at {x:.3f} mm, "
                f"allowed {e.following_error_mm:g} mm apart"
            )
        self._judge_speed(sample)

    def _judge_speed(self, sample: MotorSample) -> None:
        """Speed over at least 5 ms, and twice in a row, so that encoder noise on one pair of samples is no alarm."""
        last = self._last_position
        if last is None or sample.time_s < last[0]:
            self._last_position = (sample.time_s, sample.position_mm)
            return
        dt = sample.time_s - last[0]
        if dt < 0.005:
            return
        speed = abs(sample.position_mm - last[1]) / dt
        self._last_position = (sample.time_s, sample.position_mm)
        self._fast = self._fast + 1 if speed > 1.1 * self.envelope.speed_mm_s else 0
        if self._fast >= 2:
            self.violate(f"speed limit: {speed:.1f} mm/s measured, {self.envelope.speed_mm_s:g} mm/s allowed")

    def time(self, now_s: float, force_latency_s: float, motor_polled: bool) -> None:
        """Judge how old the newest samples are; `force_latency_s` is the age that is normal for the cell.

        The motor's silence counts while it is fed or polled (`motor_polled`).
        """
        stale = self.envelope.stale_s
        if self._newest_force_s is not None and now_s - self._newest_force_s > stale + force_latency_s:
            self.violate(
                f"the load cell is silent: no sample for {1e3 * (now_s - self._newest_force_s):.0f} ms "
                f"(limits.stale is {1e3 * stale:.0f} ms)"
            )
        if motor_polled and self._newest_motor_s is not None and now_s - self._newest_motor_s > stale:
            self.violate(
                f"the motor is silent: no answer for {1e3 * (now_s - self._newest_motor_s):.0f} ms "
                f"(limits.stale is {1e3 * stale:.0f} ms)"
            )
