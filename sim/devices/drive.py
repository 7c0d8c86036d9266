"""The axis as a device sees it: in its own counts, through its encoder, with its force limits.

A device counts in its own direction and from its own zero; the plant lives in the motor frame (positive into the
pad). `Drive` converts, adds encoder noise and resolution, and makes force control out of the set-points that the
plant follows: to push with a force, the servo is limited to it and sent far beyond what is in its way.
"""

from __future__ import annotations

import math
from collections.abc import Callable

from sim.axis import BenchPlant
from sim.clock import Event, SimClock
from sim.noise import GaussianNoise

TICK_S = 0.001
"""Period of what a device does by itself: motions of its own making, force control, supervision."""

HARD_STOP_mm_s2 = 20_000.0
FAR_mm = 1e4


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
        self.distortions: list[Callable[[float], float]] = []
        """What faults make of the encoder's readings (mm, motor frame), one after the other."""
        self._noise = noise
        self._tick: Event | None = None
        self._pushing = False
        # A vertical axis that nobody drives yet stands on something: a brake, a prop, a hand.
        self._propped = plant.settings.vertical
        plant.brake(self._propped)

    # -- readings ----------------------------------------------------------------------------------------------

    def counts(self) -> int:
        """Position as the encoder reads it now, in device counts."""
        reading_mm = self.plant.reported_position_mm + self._noise.draw()
        for distort in self.distortions:
            reading_mm = distort(reading_mm)
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

    def _unprop(self) -> None:
        """The servo is on: whatever held the axis until then is taken away."""
        if self._propped:
            self._propped = False
            self.plant.brake(False)

    def set_zero_here(self) -> None:
        """Let the device read 0 where it is."""
        self.zero_mm = self.plant.position_mm

    # -- commands: each ends what the device was doing by itself -------------------------------------------------

    def take_over(self) -> None:
        """End a motion of the device's own making; the plant keeps its last set-point, the force its own limit."""
        if self._tick is not None:
            self._tick.cancel()
            self._tick = None
        if self._pushing:
            self._pushing = False
            self.plant.limit_force(self.force_limit_N)

    def hold(self, position_mm: float) -> None:
        """Servo on, set-point now (motor frame)."""
        if self._pushing or self._tick is not None:
            self.take_over()
        if self._propped:
            self._unprop()
        self.plant.hold(position_mm)

    def profile(self, target_mm: float, speed_mm_s: float, acceleration_mm_s2: float) -> None:
        """A trapezoid to the target (motor frame)."""
        self.take_over()
        self._unprop()
        self.plant.profile(target_mm, speed_mm_s, acceleration_mm_s2)

    def halt(self, deceleration_mm_s2: float = HARD_STOP_mm_s2) -> None:
        """Decelerate and hold."""
        self.take_over()
        self.plant.halt(deceleration_mm_s2)

    def release(self) -> None:
        """Servo off."""
        self.take_over()
        self.plant.release()

    def press(self, force_N: float) -> None:
        """Push with a force (motor frame), whatever moves; 0 is free."""
        self.take_over()
        self._unprop()
        if force_N == 0.0:
            self.plant.release()
        else:
            self.push_with(abs(force_N))
            self.plant.hold(math.copysign(FAR_mm, force_N))

    def push_with(self, force_N: float) -> None:
        """Limit the force of the motion under way, until the next command."""
        self._pushing = True
        self.plant.limit_force(min(force_N, self.force_limit_N))

    def damp(self, at_s: float, damping_N_s_mm: float) -> None:
        """Resist motion only. Light damping comes out as half of what the servo's own would be."""
        self.take_over()
        plant = self.plant
        servo = plant.settings
        own_N_s_mm = 2.0 * servo.damping_ratio * servo.omega * servo.moving_mass_kg / 1000.0
        mobility_mm_s_N = min(1.0 / damping_N_s_mm, 0.5 / own_N_s_mm)
        setpoint_mm = plant.position_mm
        plant.hold(setpoint_mm)

        def act(now_s: float) -> bool:
            nonlocal setpoint_mm
            setpoint_mm -= TICK_S * mobility_mm_s_N * plant.motor_force_N
            plant.hold(setpoint_mm)
            return True

        self.every_tick(at_s + TICK_S, act)

    def every_tick(self, at_s: float, act: Callable[[float], bool]) -> None:
        """Call `act(time)` every millisecond from `at_s` on, until it returns False or another command is given."""
        self.take_over()

        def run(now_s: float) -> None:
            self._tick = None
            self.plant.advance(now_s)
            if act(now_s) and self._tick is None:
                self._tick = self.clock.schedule(now_s + TICK_S, run)

        self._tick = self.clock.schedule(at_s, run)

    def limit_force(self, force_N: float) -> None:
        """Limit what the motor can push, as a device's own clamp does; never above what the drive can."""
        self.force_limit_N = min(force_N, self.plant.settings.max_force_N)
        if not self._pushing:
            self.plant.limit_force(self.force_limit_N)
