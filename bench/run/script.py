"""The run itself, phase by phase: checks, home, tare, approach, then the planned segments, then the safe state.

What is executed is the plan that preflight has checked. Its positions are in the pad frame; what goes to the axis is
in the motor frame (surface added).
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from bench.config import Bench
from bench.errors import InputError, Stopped
from bench.plan import Plan, Segment
from bench.protocol import Approach, Protocol
from bench.recording.schemas import POLLED
from bench.recording.types import StepMark
from bench.run.approach import slow_mm_s, tare, touch_off
from bench.run.force import hold_force, press
from bench.run.loop import Loop, Script
from bench.run.motion import Mover, Shape
from bench.run.stopping import Stopping
from bench.run.touchoff import Air, Surface
from drivers.errors import DeviceTimeout, DriverError
from drivers.motor import MotorLimits, MotorSample

SLOW_MM_S = 5.0
"""Speed of moves that no protocol asks for (backing off before the tare)."""

INSIDE_MM = 0.05
"""How far inside the travel an axis is set that was homed outside of it."""

REST_MM_S = 1.0
"""A free axis that is slower than this stands: the encoder's steps over `REST_S` are less."""

REST_S = 0.05
PUSHED_MM = 0.05
PUSHED_N = 0.1
"""So far, and with so much less force, a free axis has been pushed out of a pad."""

REST_PATIENCE_S = 2.0
"""How long a free axis that moves is waited for before it is energised."""

STARTLED_S, STARTLED_MM = 0.1, 0.25
"""For so long it is watched as it is energised; it may settle by so much, half the following error at the most."""

STARTLED_SHARE, STARTLED_N = 0.05, 0.5
"""And the force may change by that share of its limit, or so much."""

LONGEST_EXCHANGE = 200
"""Bytes of the longest request and reply together, about."""

QUIET_S = 0.5
"""The motor is safe: a load cell that does not end its stream is not waited for any longer."""

WATCHDOG_S = 0.1
"""What a motor with a watchdog of its own is told: no command for so long, and it lets go."""


@dataclass
class Findings:
    """What the run learned on the way."""

    air: Air | None = None
    surface: Surface | None = None
    surface_mm: float = 0.0
    air_mm: float | None = None
    """Where the tare was taken (motor frame): a place that is known to be air."""

    safe_state: dict[str, Any] | None = None
    not_safe: str = ""
    """Why nobody can say that the motor is in its safe state; empty where it was read back."""


class Run:
    """One protocol on one bench; `phases` is the script for `Loop.run`, `wind_down` what follows whatever happened."""

    def __init__(self, loop: Loop, protocol: Protocol, bench: Bench, plan: Plan) -> None:
        self.loop = loop
        self.protocol = protocol
        self.bench = bench
        self.plan = plan
        self.motor = loop.rig.motor
        self.clock = loop.clock
        ramp = next((segment for segment in plan.segments if segment.kind in ("ramp", "force_ramp")), None)
        acceleration = ramp.acceleration_mm_s2 if ramp is not None else plan.limits.acceleration_mm_s2
        self.mover = Mover(loop, Shape(acceleration, ramp.jerk_mm_s3 if ramp is not None else None))
        self.found = Findings()
        self.label = "starting"
        self._stiffness_N_mm = 1.0
        self._identified = False

    # -- phases ------------------------------------------------------------------------------------------------

    def phases(self) -> Script[None]:
        """Everything from the first byte to the safe state."""
        yield from self.start_devices()
        approach = self.protocol.approach
        if isinstance(approach, Approach):
            yield from self.meet_pad(approach)
        else:
            self._mark("tare", "tare", "air")
            self.found.air = yield from tare(self.loop, self.mover, None, SLOW_MM_S)
            self.loop.sink.event(self.clock.now(), "no_surface", {"surface_mm": 0.0})
        for segment in self.plan.segments:
            yield from self.segment(segment)
        yield from self.make_safe()

    def start_devices(self) -> Script[None]:
        """Identify both devices, start the load cell first, then clamp, energise and home the motor.

        Raises `InputError` where one of them does not answer, or is not what the bench file says it is.
        """
        loop, motor, cell = self.loop, self.motor, self.loop.rig.load_cell
        self.label = "connecting"
        try:
            cell_identity = yield from loop.perform_on(cell.connect(), cell.link)
            identity = yield from loop.perform(motor.connect())
        except DriverError as error:
            raise InputError(self.bench.place((error.device,)), str(error)) from error
        self._identified = True
        loop.sink.event(
            self.clock.now(),
            "devices",
            {
                "motor": identity.model,
                "load_cell": cell_identity.model,
                **{f"motor_{key}": value for key, value in identity.details.items()},
                **{f"load_cell_{key}": value for key, value in cell_identity.details.items()},
            },
        )
        yield from loop.perform_on(cell.start(), cell.link)
        loop.begin_measuring()
        held = yield from loop.perform(motor.prepare(self._clamps()))
        loop.sink.event(self.clock.now(), "clamps", dict(held))
        if motor.kind == "move":
            polled = {"period_s": loop.axis.period_s, "stamp_std_s": loop.axis.stamp_std_s()}
            loop.sink.event(self.clock.now(), POLLED, polled)
        free_mm, free_N = yield from self._await_rest()
        yield from loop.perform(motor.energise())
        yield from self._go_live(free_mm)
        homed = yield from loop.perform(motor.is_homed())
        if homed:
            yield from self._stand(free_mm, free_N)
        else:
            self.label = "homing"
            loop.axis.go_silent()
            yield from loop.perform(motor.home())
            yield from self.enter_travel()

    def meet_pad(self, approach: Approach) -> Script[None]:
        """Tare in air, find the surface, go to where step 1 starts."""
        loop, found = self.loop, self.found
        self.label = "tare"
        self._mark("tare", "tare", "air")
        found.air = yield from tare(loop, self.mover, approach, SLOW_MM_S)
        found.air_mm = self.mover.here()
        self.label = "approach"
        self._mark("approach", "approach", "ramp", speed_mm_s=approach.speed)
        surface = yield from touch_off(loop, self.mover, approach, found.air, self._position_doubt(approach))
        found.surface = surface
        found.surface_mm = surface.position_mm
        envelope = loop.monitor.envelope
        deepest = max((part.target_mm for part in self.plan.segments if part.kind == "ramp"), default=0.0)
        if surface.position_mm + deepest > envelope.position_mm[1]:
            raise Stopped(
                f"the pad's surface is at {surface.position_mm:.3f} mm: the deepest step ({deepest:g} mm) would go "
                f"beyond limits.position ({envelope.position_mm[1]:g} mm); move the pad, or allow more travel"
            )
        envelope.surface_mm = surface.position_mm
        if loop.foresight is not None:
            loop.foresight.start(surface.position_mm)
        yield from self.mover.go(self._motor_frame(self.plan.start_mm), approach.speed)

    def segment(self, segment: Segment) -> Script[None]:
        """One stretch of the plan: a ramp or a hold, by position or by force."""
        loop, mover = self.loop, self.mover
        self.label = segment.name
        target = segment.target_mm
        if segment.kind == "hold" and math.isnan(target):
            target = mover.here() - self.found.surface_mm
        self._mark(segment.name, segment.phase, segment.kind, target, segment.speed_mm_s)
        if segment.kind == "ramp":
            if loop.foresight is not None:
                here = mover.here() - self.found.surface_mm
                loop.foresight.allow(segment.name, mover.shape.profile(here, target, segment.speed_mm_s))
            yield from mover.go(self._motor_frame(segment.target_mm), segment.speed_mm_s)
        elif segment.kind == "force_ramp":
            away = self._motor_frame(self.plan.start_mm)
            noise = self.found.air.sigma_N if self.found.air is not None else 0.0
            speed = self._force_speed(segment)
            self._stiffness_N_mm = yield from press(loop, mover, segment.target_N, segment.name, speed, away, noise)
        elif segment.kind == "force_hold":
            stiffness = self._stiffness_N_mm
            yield from hold_force(loop, mover, segment.target_N, segment.duration_s, stiffness, segment.speed_mm_s)
        else:
            yield from loop.sleep(segment.duration_s)

    def make_safe(self) -> Script[None]:
        """The bench file's safe state, read back from the device; then the load cell is quiet."""
        loop = self.loop
        self.label = "safe state"
        state = self.bench.motor.safe_state
        loop.axis.go_silent()
        if not self._identified:
            return  # nothing was commanded, and nobody knows what is at the end of the line: it stays so
        self.found.safe_state = yield from loop.perform(self.motor.safe_state(state))
        loop.sink.event(self.clock.now(), "safe_state", {"asked": state, **self.found.safe_state})
        yield from self.quieten()

    def wind_down(self, cause: str) -> Script[None]:
        """After a stop: softly or hard, then the safe state. Nothing here lets an error hide the first cause."""
        self.loop.sink.event(self.clock.now(), "stopped", {"cause": cause})
        self.label = "stopping"
        yield from Stopping(self).stop()

    def quieten(self) -> Script[None]:
        """End the load cell's stream; that it does not listen is noted, harms nobody, and is not waited out."""
        loop, cell = self.loop, self.loop.rig.load_cell
        loop.end_measuring()
        until_s = self.clock.now() + QUIET_S
        try:
            for _ in loop.perform_on(cell.stop(), cell.link):
                if self.clock.now() > until_s:
                    raise DeviceTimeout(cell.name, f"no answer within {QUIET_S:g} s of being asked to be quiet")
                yield
        except DriverError as error:
            loop.sink.event(self.clock.now(), "load_cell_not_stopped", {"message": str(error)})

    # -- inside ------------------------------------------------------------------------------------------------

    def _await_rest(self) -> Script[tuple[float, float]]:
        """A free axis may be moving (a pad pushes it out, a vertical one sinks): it is not caught in flight.

        Returns where it rests (mm) and the gross force there (N).
        """
        loop = self.loop
        give_up = self.clock.now() + REST_PATIENCE_S
        while loop.last_force is None:
            yield
        force_N = loop.last_gross_N
        first: MotorSample = yield from loop.perform(_one(self.motor.read()))
        before = first
        while True:
            yield from loop.sleep(REST_S)
            now: MotorSample = yield from loop.perform(_one(self.motor.read()))
            speed = (now.position_mm - before.position_mm) / (now.time_s - before.time_s)
            if abs(speed) < REST_MM_S:
                break
            if self.clock.now() > give_up:
                raise Stopped(
                    f"the axis moves by itself, at {speed:+.2f} mm/s, before it is energised: something pushes it "
                    "(a pad, its own weight); see to it, and start again"
                )
            before = now
        moved, fell = first.position_mm - now.position_mm, force_N - loop.last_gross_N
        if moved > PUSHED_MM and fell > PUSHED_N:
            raise Stopped(
                f"the probe already touches something: the free axis was pushed back by {moved:.2f} mm, and the force "
                f"fell by {fell:.2f} N; retract the probe (or lower the pad) and start again"
            )
        return now.position_mm, loop.last_gross_N

    def _stand(self, free_mm: float, free_N: float) -> Script[None]:
        """An axis that is energised stays where it was. One that moves, or presses, holds another place than it says.

        Raises `Stopped`; the motor is to blame, and is commanded no more.
        """
        loop, limits = self.loop, self.loop.monitor.envelope
        most_N = max(STARTLED_N, STARTLED_SHARE * limits.force_N)
        until_s, seen, apart = self.clock.now() + STARTLED_S, loop.force_count, 0
        while self.clock.now() < until_s:
            if loop.last_motor is not None:
                self._judge_start(free_mm, loop.last_motor.position_mm)
            if loop.force_count != seen:
                seen = loop.force_count
                rose_N = loop.last_gross_N - free_N
                apart = apart + 1 if abs(rose_N) > most_N else 0
                if apart > 1:
                    loop.monitor.violate(
                        f"the force changed by {rose_N:+.2f} N as the motor was energised, before any motion: the "
                        "probe touches something, or the axis moved and does not say so",
                        "motor",
                    )
            loop.monitor.check()
            yield

    def _judge_start(self, free_mm: float, now_mm: float) -> None:
        if abs(now_mm - free_mm) > min(STARTLED_MM, 0.5 * self.loop.monitor.envelope.following_error_mm):
            self.loop.monitor.violate(
                f"the axis went from {free_mm:.3f} to {now_mm:.3f} mm as the motor was energised, before any motion: "
                "its reading and what it holds are not the same place",
                "motor",
            )

    def _force_speed(self, segment: Segment) -> float:
        """The planned speed, less where the opened cell is slower (a filter, an average) than the bench file told."""
        cell = self.loop.rig.load_cell
        latency_s = cell.latency_s() + self.loop.axis.period_s + max(0.0, self.bench.timing.force_delay)
        if latency_s <= 1.05 * self.plan.force_latency_s:
            return segment.speed_mm_s
        speed = segment.speed_mm_s * self.plan.force_latency_s / latency_s
        data = {"step": segment.name, "planned_mm_s": segment.speed_mm_s, "taken_mm_s": speed, "latency_s": latency_s}
        self.loop.sink.event(self.clock.now(), "slower", data)
        return speed

    def _go_live(self, free_mm: float | None = None) -> Script[None]:
        """Read where the axis is, and hold it there from now on; `free_mm` is where it was before, if it stood."""
        loop = self.loop
        sample: MotorSample = yield from loop.perform(_one(self.motor.read()))
        if free_mm is not None:
            self._judge_start(free_mm, sample.position_mm)
            loop.monitor.check()
        if sample.fault:
            names = ", ".join(self.motor.fault_names(sample.fault))
            raise Stopped(f"the motor reports a fault before any motion: {names}")
        loop.last_motor = sample
        loop.axis.go_live(sample.position_mm)
        loop.monitor.expect_motor_from(self.clock.now())

    def enter_travel(self) -> Script[None]:
        """After homing: from the end of the axis to the near end of the travel allowed, slowly.

        Before it was homed, nobody knew where the axis stood, and its home may lie outside the limits.
        """
        loop = self.loop
        envelope = loop.monitor.envelope
        allowed = envelope.position_mm
        stroke = self.bench.motor.stroke
        envelope.position_mm = (min(stroke[0], allowed[0]), max(stroke[1], allowed[1]))
        yield from self._go_live()
        home_mm = self.mover.here()
        inside = (allowed[0] + INSIDE_MM, allowed[1] - INSIDE_MM)
        yield from self.mover.go(min(max(home_mm, inside[0]), inside[1]), SLOW_MM_S)
        yield from self.mover.settle()
        envelope.position_mm = allowed
        loop.sink.event(self.clock.now(), "homed", {"home_mm": home_mm, "position_mm": self.mover.here()})

    def _clamps(self) -> MotorLimits:
        limits = self.bench.limits
        return MotorLimits(
            speed_mm_s=limits.speed,
            acceleration_mm_s2=limits.acceleration,
            force_N=2.0 * limits.force + self.bench.motor.moving_mass * limits.acceleration / 1000.0,
            position_mm=limits.position,
            # A watchdog must outlive the longest exchange there is, which on a slow line is the reading of a block.
            watchdog_s=max(WATCHDOG_S, 3.0 * self.motor.link.wire_s(LONGEST_EXCHANGE)),
        )

    def _position_doubt(self, approach: Approach) -> float:
        """What stamps that are off by half a poll do to the surface, at the speed it is measured with (mm)."""
        return slow_mm_s(approach, self.loop.axis) * 0.5 * self.loop.axis.period_s

    def _motor_frame(self, pad_mm: float) -> float:
        return pad_mm + self.found.surface_mm

    def _mark(
        self, name: str, phase: str, kind: str, target_mm: float = math.nan, speed_mm_s: float = math.nan
    ) -> None:
        self.loop.sink.step(StepMark(self.clock.now(), name, phase, kind, target_mm, speed_mm_s))


def _one(exchange: Any) -> Any:
    """A conversation of one exchange."""
    return (yield exchange)
