"""What positioning controllers behind a register map have in common: a store of registers and coils, and a mover.

A controller of this kind makes its own profiles; the host writes a target and polls. A new one is one file with a
subclass of `RegisterAxis` that says what its addresses mean, and drives a `Mover`.
"""

from __future__ import annotations

from sim.devices.drive import TICK_S, Drive
from sim.devices.modbus import ILLEGAL_ADDRESS, Refusal

G_mm_s2 = 9806.65
HOMING_mm_s = 20.0
HOMING_mm_s2 = 500.0
PUSHING_mm_s = 20.0
REACHED_mm = 0.005
PUSH_SETTLE_S = 0.255
"""A push counts as done when the force has been there for so long."""


class RegisterAxis:
    """Registers and bits by address. Subclasses fill `values` and answer for what is not just memory."""

    def __init__(self) -> None:
        self.values: dict[int, int] = {}
        self.write_only: frozenset[int] = frozenset()

    def status(self, at_s: float) -> dict[int, int]:
        """Registers that cannot be written, as they are now."""
        raise NotImplementedError

    def written(self, addresses: range, at_s: float) -> None:
        """Called after registers were written: do what they stand for."""
        raise NotImplementedError

    def bits(self, at_s: float) -> dict[int, bool]:
        """All coils and discrete inputs, as they are now."""
        raise NotImplementedError

    def write_bit(self, address: int, value: bool, at_s: float) -> None:
        """Write one coil. Raises `Refusal` for one there is not."""
        raise NotImplementedError

    def read_registers(self, address: int, count: int, at_s: float) -> list[int]:
        """Registers in a row; a gap among them is an illegal address."""
        status = self.status(at_s)
        result = []
        for place in range(address, address + count):
            value = status.get(place, self.values.get(place))
            if value is None or place in self.write_only:
                raise Refusal(ILLEGAL_ADDRESS)
            result.append(value)
        return result

    def write_registers(self, address: int, values: list[int], at_s: float) -> None:
        """Write all or, where one of them cannot be written, none."""
        places = range(address, address + len(values))
        if not all(place in self.values for place in places):
            raise Refusal(ILLEGAL_ADDRESS)
        for place, value in zip(places, values, strict=True):
            self.values[place] = value
        self.written(places, at_s)

    def read_bits(self, address: int, count: int, at_s: float) -> list[bool]:
        """Bits in a row; a gap among them is an illegal address."""
        bits = self.bits(at_s)
        try:
            return [bits[place] for place in range(address, address + count)]
        except KeyError:
            raise Refusal(ILLEGAL_ADDRESS) from None

    def signed(self, address: int) -> int:
        """A signed 32-bit value in `values`, high word first."""
        value = self.unsigned(address)
        return value - (1 << 32) if value & 0x8000_0000 else value

    def unsigned(self, address: int) -> int:
        """An unsigned 32-bit value in `values`, high word first."""
        return self.values[address] << 16 | self.values[address + 1]


def high_first(address: int, value: int) -> dict[int, int]:
    """Two registers that hold a 32-bit value, high word first."""
    return {address: value >> 16 & 0xFFFF, address + 1: value & 0xFFFF}


class Mover:
    """Servo, homing, moves, pushes, pause: the motion side of such a controller, in motor-frame millimetres.

    Homing goes to the lower end of the stroke (away from the pad) until the stop is felt, then to the zero of the
    motor frame (the controller's home offset), and is complete there. Before, it counts from where it was switched on.
    """

    def __init__(self, drive: Drive) -> None:
        self.drive = drive
        self.plant = drive.plant
        self.servo_on = False
        self.homed = False
        self.homing = False
        self.paused = False
        self.pushing = False
        self.pushed = False
        self.missed = False
        self.target_mm: float | None = None
        self.band_mm = 0.1
        self.speed_mm_s = 0.0
        self.acceleration_mm_s2 = 1.0
        self.push_N = 0.0
        drive.zero_mm = self.plant.position_mm
        drive.release()

    def switch(self, on: bool) -> None:
        """Servo on (holds where it is) or off (the target is forgotten)."""
        if on and not self.servo_on:
            self.drive.hold(self.plant.position_mm)
        if not on:
            self._forget()
            self.drive.release()
        self.servo_on = on

    def home(self, at_s: float) -> None:
        """Find the lower end, and go from there to zero."""
        self._forget()
        self.homing = True
        self.homed = False
        low_mm, high_mm = self.plant.settings.stroke_mm
        zero_mm = min(max(0.0, low_mm), high_mm)
        setpoint_mm = self.plant.position_mm

        def search(now_s: float) -> bool:
            nonlocal setpoint_mm
            if self.plant.at_end_stop >= 0:
                setpoint_mm -= HOMING_mm_s * TICK_S
                self.plant.hold(setpoint_mm)
                return True
            self.drive.zero_mm = 0.0
            self.drive.hold(low_mm)
            self.drive.every_tick(now_s, arrive)
            self.plant.profile(zero_mm, HOMING_mm_s, HOMING_mm_s2)
            return False

        def arrive(now_s: float) -> bool:
            if self.plant.moving:
                return True
            self.homing, self.homed = False, True
            return False

        self.drive.every_tick(at_s, search)

    def move(self, target_mm: float, speed_mm_s: float, acceleration_mm_s2: float, band_mm: float) -> None:
        """Start a trapezoid."""
        self._forget()
        self.target_mm, self.band_mm = target_mm, band_mm
        self.speed_mm_s, self.acceleration_mm_s2 = speed_mm_s, acceleration_mm_s2
        self.drive.profile(target_mm, speed_mm_s, acceleration_mm_s2)

    def push(
        self, at_s: float, target_mm: float, speed_mm_s: float, acceleration_mm_s2: float, stroke_mm: float
    ) -> None:
        """Move to the target, then on by at most `stroke_mm` (signed) with the force limited to `push_N`."""
        self.move(target_mm, speed_mm_s, acceleration_mm_s2, 0.0)
        self.pushing = True
        sign = 1.0 if stroke_mm >= 0.0 else -1.0
        reached_s = at_s

        def feel(now_s: float) -> bool:
            nonlocal reached_s
            self.drive.push_with(self.push_N)
            if sign * self.plant.motor_force_N < 0.9 * self.push_N:
                reached_s = now_s
            self.pushed = self.pushed or now_s - reached_s >= PUSH_SETTLE_S
            if sign * (self.plant.position_mm - target_mm) < abs(stroke_mm) - REACHED_mm:
                return True
            self.pushing, self.missed = False, True
            return False

        def wait(now_s: float) -> bool:
            if self.plant.moving:
                return True
            self.drive.every_tick(now_s, feel)
            self.plant.profile(target_mm + stroke_mm, min(speed_mm_s, PUSHING_mm_s), acceleration_mm_s2)
            return False

        self.drive.every_tick(at_s, wait)

    def stop(self) -> None:
        """Decelerate, hold, and forget the rest of the way."""
        self._forget()
        if self.servo_on:
            self.drive.halt(self.acceleration_mm_s2 if self.speed_mm_s else 3000.0)

    def pause(self, on: bool) -> None:
        """Decelerate and hold; go on when it ends."""
        if on == self.paused:
            return
        self.paused = on
        if not self.servo_on or self.target_mm is None:
            return
        if on:
            self.drive.halt(self.acceleration_mm_s2)
        elif not self.pushing:
            self.drive.profile(self.target_mm, self.speed_mm_s, self.acceleration_mm_s2)

    def change_speed(self, speed_mm_s: float, acceleration_mm_s2: float) -> None:
        """Change the speed of the move under way."""
        if self.target_mm is not None and not self.paused and not self.pushing and self.plant.moving:
            self.speed_mm_s, self.acceleration_mm_s2 = speed_mm_s, acceleration_mm_s2
            self.drive.profile(self.target_mm, speed_mm_s, acceleration_mm_s2)

    def _forget(self) -> None:
        self.drive.take_over()
        if self.pushing:  # the set-point is ahead, behind what is in the way
            self.drive.hold(self.plant.position_mm)
        self.target_mm = None
        self.homing = self.pushing = self.pushed = self.missed = False

    @property
    def moving(self) -> bool:
        """Whether it is on its way (homing and pushing included)."""
        return self.homing or (self.servo_on and self.plant.moving) or (self.pushing and not self.pushed)

    @property
    def complete(self) -> bool:
        """In position, or pushed."""
        if self.target_mm is None or not self.servo_on or self.paused:
            return False
        if self.pushing or self.missed:
            return self.pushed or self.missed
        return abs(self.plant.position_mm - self.target_mm) <= self.band_mm
