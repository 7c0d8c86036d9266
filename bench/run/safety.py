"""What stops a run: limits checked at every sample, on hardware as in simulation.

A software limit is no emergency stop: it is as fast as the slowest channel it reads, and it needs this process alive.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

from bench.errors import Stopped
from bench.run.watch import JUMP_OF_LIMIT, LEAST_N, SENSE_S, SHARE, FrozenWatch, JumpWatch, SenseWatch
from drivers.loadcell import ForceSample
from drivers.motor import MotorSample

Blame = Literal["limit", "cell", "motor", "host", "operator", "run"]
"""What a cause is about, which decides how to stop: with the cell to blame there is no force to go by, with the motor
to blame there is no motion to trust."""

LATE_TURN_S = 0.04
"""The loop turns every 20 ms at the most: so long between two turns is noted as late."""

ZERO_LOST_SHARE = 0.05
"""Air that reads below the tare by that share of the force limit: the tare is not the cell's zero any more."""

ARRIVES_S, ARRIVED_MM = 0.5, 0.1
"""A controller that makes its own moves is where it was sent so long after the end of the profile, to within its band.
Its following error says little of that: it allows for a move that begins some messages late."""

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
    moving_mass_kg: float = 0.0

    @property
    def sense_N(self) -> float:
        """How far the motor's own sense of force and the load cell may be apart.

        The mass that a ramp sets in motion takes its share of the motor's force; smoothed it is m·v over the time
        constant at the most.
        """
        return max(LEAST_N, SHARE * self.force_N) + self.moving_mass_kg * self.speed_mm_s / 1000.0 / SENSE_S

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
        self.blame: Blame = "run"
        self.stopping = False
        self.frozen = FrozenWatch()
        self.sense = SenseWatch(envelope.sense_N)
        self.jump = JumpWatch(JUMP_OF_LIMIT * envelope.force_N)
        self.cell_lost = False
        """There is no force to go by: silent, frozen, unplugged, contradicted by the motor; first cause or not."""

        self.motor_lost = False
        """There is no motion to trust: a fault, a following error, silence; first cause or not."""

        self._tared = False
        self._zeroed: bool | None = None
        self._force_stamp_s = -math.inf
        self.watch_following = True
        self._last_position: tuple[float, float] | None = None
        self._newest_force_s: float | None = None
        self._newest_motor_s: float | None = None
        self._fast = 0

    def violate(self, cause: str, blame: Blame = "limit") -> None:
        """Note why the run must stop; only the first cause is kept."""
        if blame == "cell":
            self.cell_lost = True
        elif blame == "motor":
            self.motor_lost = True
        if self.cause is None:
            self.cause, self.blame = cause, blame

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

    def tared(self, sigma_N: float = math.nan) -> None:
        """The zero has been taken, in air and at rest: what motor and cell feel from now on is more than that.

        `sigma_N`: the noise there; not a number: jumps of the force are not judged (somebody works by hand).
        """
        self._tared, self._zeroed = True, None
        self.sense.in_air()
        self.jump.in_air(sigma_N)

    def force(self, sample: ForceSample, net_N: float) -> None:
        """Judge one force sample: pad by net force, cell by gross force."""
        e = self.envelope
        self._newest_force_s = sample.received_s
        self._judge_cell(sample, net_N)
        if sample.overload:
            self.violate(f"the load cell reports overload at {sample.gross_N:.3g} N")
        elif net_N > e.force_N:
            self.violate(f"force limit: {net_N:.3f} N measured, {e.force_N:g} N allowed")
        elif net_N < -e.tension_N:
            self.violate(f"tension limit: {-net_N:.3f} N measured, {e.tension_N:g} N allowed")
        elif abs(sample.gross_N) > e.gross_N:
            self.violate(f"gross force {sample.gross_N:.3f} N is beyond the {e.gross_N:g} N the cell may carry")

    def motor(
        self,
        sample: MotorSample,
        command_mm: float,
        fault_names: tuple[str, ...],
        lag_mm: float = 0.0,
        over_s: float = 0.0,
    ) -> None:
        """Judge one motor sample against travel, depth, speed, following error and the device's own faults.

        `lag_mm`: how far behind the command the axis may be because nobody knows when it began. `over_s`: for how long
        its move has been over.
        """
        e = self.envelope
        self._newest_motor_s = sample.received_s
        x = sample.position_mm
        if sample.fault:
            self.violate(f"the motor reports a fault: {', '.join(fault_names) or hex(sample.fault)}", "motor")
        if not math.isfinite(x):
            self.violate(f"the motor reports {x} as its position", "motor")
        if sample.force_N is not None:
            apart = self.sense.motor(sample.time_s, sample.force_N)
            if apart is not None:
                self.violate(apart, "cell")
        self.jump.motor(sample.time_s, command_mm, x)
        if not e.position_mm[0] - SLACK_MM <= x <= e.position_mm[1] + SLACK_MM:
            self.violate(f"travel limit: at {x:.3f} mm, allowed {e.position_mm[0]:g} to {e.position_mm[1]:g} mm")
        if e.surface_mm is not None and x - e.surface_mm > e.depth_mm + SLACK_MM:
            self.violate(f"depth limit: {x - e.surface_mm:.3f} mm into the pad, {e.depth_mm:g} mm allowed")
        if self.watch_following and abs(command_mm - x) > e.following_error_mm + lag_mm:
            self.violate(
                f"following error: commanded {command_mm:.3f} mm, at {x:.3f} mm, "
                f"allowed {e.following_error_mm:g} mm apart",
                "motor",
            )
        if self.watch_following and over_s > ARRIVES_S and abs(command_mm - x) > ARRIVED_MM:
            self.violate(
                f"the axis did not get where it was sent: {command_mm:.3f} mm, and {over_s:.1f} s after the move it "
                f"stands at {x:.3f} mm (stuck, too weak, or it does not do what it is told)",
                "motor",
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
            message = f"speed limit: {speed:.1f} mm/s measured, {self.envelope.speed_mm_s:g} mm/s allowed"
            self.violate(message, "motor")

    def _judge_cell(self, sample: ForceSample, net_N: float) -> None:
        """Whether what came is a measurement at all: a number, one that changes, of this time, from the same zero."""
        if not math.isfinite(sample.gross_N):
            self.violate(f"the load cell reports {sample.gross_N} as a force", "cell")
            return
        frozen = self.frozen.sample(sample.gross_N)
        if frozen is not None:
            self.violate(frozen, "cell")
        self.sense.cell(sample.time_s, net_N)
        jumped = self.jump.cell(sample.time_s, net_N)
        if jumped is not None:
            self.violate(jumped, "cell")
        zeroed = "zeroed" in sample.flags
        if self._zeroed is None:
            self._zeroed = zeroed
        elif zeroed != self._zeroed and self._tared:
            what = "was zeroed" if zeroed else "has lost its zero (switched off and on?)"
            self.violate(f"the load cell's amplifier {what} since the tare: the tare is not valid any more", "cell")
        late_s, back_s = sample.received_s - sample.time_s, self._force_stamp_s - sample.time_s
        self._force_stamp_s = sample.time_s
        stale = self.envelope.stale_s
        if back_s > stale or -late_s > stale:
            what = (
                f"{1e3 * back_s:.0f} ms before the one that came before it"
                if back_s > stale
                else (f"{-1e3 * late_s:.0f} ms after it came")
            )
            self.violate(f"a clock jumped: a force is said to be measured {what}", "cell")

    def turn(self, gap_s: float, slept_s: float) -> None:
        """Judge the loop itself: how long ago its last turn was, and how long the computer slept meanwhile."""
        stale = max(self.envelope.stale_s, LATE_TURN_S)
        if slept_s > stale:
            self.violate(f"the computer was suspended for {slept_s:.1f} s during the run", "host")
        if gap_s > stale:
            self.violate(
                f"the host stalled: {1e3 * gap_s:.0f} ms between two turns of the loop "
                f"(limits.stale is {1e3 * self.envelope.stale_s:.0f} ms)",
                "host",
            )

    def time(self, now_s: float, force_latency_s: float, motor_polled: bool) -> None:
        """Judge how old the newest samples are; `force_latency_s` is the age that is normal for the cell.

        The motor's silence counts while it is fed or polled (`motor_polled`).
        """
        stale = self.envelope.stale_s
        if self._newest_force_s is not None and now_s - self._newest_force_s > stale + force_latency_s:
            self.violate(
                f"the load cell is silent: no sample for {1e3 * (now_s - self._newest_force_s):.0f} ms "
                f"(limits.stale is {1e3 * stale:.0f} ms)",
                "cell",
            )
        if motor_polled and self._newest_motor_s is not None and now_s - self._newest_motor_s > stale:
            self.violate(
                f"the motor is silent: no answer for {1e3 * (now_s - self._newest_motor_s):.0f} ms "
                f"(limits.stale is {1e3 * stale:.0f} ms)",
                "motor",
            )
