"""The axis as a device sees it: in its own counts, through its encoder, with its force limits.

A device counts in its own direction and from its own zero; the plant lives in the motor frame (positive into the
pad). `Drive` converts, adds encoder noise and resolution, and makes force control out of set-points, which the
plant follows: where a force is commanded, the set-point moves in proportion to the force that is missing. That is
a gentler, slower force control than a real drive's current loop.
"""

from __future__ import annotations

from collections.abc import Callable

from sim import axis_kernel
from sim.axis import BenchPlant
from sim.clock import Event, SimClock
from sim.noise import GaussianNoise

TICK_S = 0.001
"""Period of what a device does by itself: motions of its own making, force control, supervision."""

HARD_STOP_mm_s2 = 20_000.0
FORCE_GAIN_mm_s_N = 4.0
"""Speed of the set-point per newton missing; stable against an end stop, where the servo's own stiffness counts."""


class Drive:
    """One axis in device units of `quantum_mm`; `direction` -1 where the device counts up away from the pad."""

    def __init__(
        self,
        clock: SimClock,
        plant: BenchPlant,
        noise: GaussianNoise,
        *,
        direction: int,
        quantum_mm: float,
    ) -> None:
        self.clock = clock
        self.plant = plant
        self.direction = direction
        self.quantum_mm = quantum_mm
        self.zero_mm = 0.0
        self.force_limit_N = plant.settings.max_force_N
        self._noise = noise
        self._tick: Event | None = None

    # -- readings ----------------------------------------------------------------------------------------------

    def counts(self) -> int:
        """Position as the encoder reads it now, in device counts."""
        reading_mm = self.plant.reported_position_mm + self._noise.draw()
        return round(self.direction * (reading_mm - self.zero_mm) / self.quantum_mm)

    def speed_mm_s(self) -> float:
        """Speed in the device's direction."""
        return self.direction * self.plant.speed_mm_s

    def force_N(self) -> float:
        """Force of the motor in the device's direction."""
        return self.direction * self.plant.motor_force_N

    def plant_mm(self, counts: float) -> float:
        """Motor-frame position of a number of device counts."""
        return self.zero_mm + self.direction * counts * self.quantum_mm

    def set_zero_here(self) -> None:
        """Let the device read 0 where it is."""
        self.zero_mm = self.plant.position_mm

    # -- commands: each ends what the device was doing by itself -------------------------------------------------

    def stop_ticking(self) -> None:
        """End a motion of the device's own making; the plant keeps its last set-point."""
        if self._tick is not None:
            self._tick.cancel()
            self._tick = None

    def hold(self, position_mm: float) -> None:
        """Servo on, set-point now (motor frame)."""
        if self._tick is not None:
            self.stop_ticking()
        self.plant.hold(position_mm)

    def profile(self, target_mm: float, speed_mm_s: float, acceleration_mm_s2: float) -> None:
        """A trapezoid to the target (motor frame)."""
        self.stop_ticking()
        self.plant.profile(target_mm, speed_mm_s, acceleration_mm_s2)

    def halt(self, deceleration_mm_s2: float = HARD_STOP_mm_s2) -> None:
        """Decelerate and hold."""
        self.stop_ticking()
        self.plant.halt(deceleration_mm_s2)

    def release(self) -> None:
        """Servo off."""
        self.stop_ticking()
        self.plant.release()

    def every_tick(self, at_s: float, act: Callable[[float], bool]) -> None:
        """Call `act(time)` every millisecond from `at_s` on, until it returns False or another command is given."""
        self.stop_ticking()

        def run(now_s: float) -> None:
            self._tick = None
            self.plant.advance(now_s)
            if act(now_s) and self._tick is None:
                self._tick = self.clock.schedule(now_s + TICK_S, run)

        self._tick = self.clock.schedule(at_s, run)

    def press(
        self,
        at_s: float,
        force_N: Callable[[], float],
        gain_mm_s_N: float = FORCE_GAIN_mm_s_N,
        speed_mm_s: float = 500.0,
        each: Callable[[float], bool] | None = None,
    ) -> None:
        """Control the motor's force (motor frame) to `force_N()`; with 0 N the gain is a damper's reciprocal.

        `each(time)` runs every tick and ends the control where it returns False.
        """
        plant = self.plant
        setpoint_mm = plant.position_mm
        plant.hold(setpoint_mm)

        def act(now_s: float) -> bool:
            nonlocal setpoint_mm
            if each is not None and not each(now_s):
                return False
            wanted_mm_s = gain_mm_s_N * (force_N() - plant.motor_force_N)
            setpoint_mm += TICK_S * min(max(wanted_mm_s, -speed_mm_s), speed_mm_s)
            low_mm, high_mm = plant.settings.stroke_mm
            setpoint_mm = min(max(setpoint_mm, low_mm - 0.5), high_mm + 0.5)
            plant.hold(setpoint_mm)
            return True

        self.every_tick(at_s + TICK_S, act)

    def limit_force(self, force_N: float) -> None:
        """Limit what the motor can push, as a device's own clamp does; never above what the drive can."""
        self.force_limit_N = min(force_N, self.plant.settings.max_force_N)
        # BenchPlant has no call for it: its settings array is what its loop reads.
        self.plant._s[axis_kernel.MAX_FORCE] = self.force_limit_N
