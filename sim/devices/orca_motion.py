"""Motions an Orca makes by itself: kinematic motions and the auto zero (docs/devices.md 1.3, 7.3)."""

from __future__ import annotations

from collections.abc import Callable

from sim.devices import orca_registers as r
from sim.devices.drive import Drive

RUNNING = 1 << 15
AUTO_ZERO_TIMEOUT_S = 10.0


def minimum_power(share: float) -> float:
    """Acceleration linear in time, no speed at either end: type 0. Share of the way at a share of the time."""
    return share * share * (3.0 - 2.0 * share)


def minimum_jerk(share: float) -> float:
    """Type 1, "maximum smoothness"; the motor's polynomial is not published, this is the minimum-jerk one."""
    return share**3 * (10.0 + share * (6.0 * share - 15.0))


class Kinematics:
    """Runs the motions of registers 780…971; `registers` is the motor's map."""

    def __init__(self, drive: Drive, registers: list[int]) -> None:
        self.drive = drive
        self.registers = registers
        self.status = 0
        self.completed = 0

    def start(self, motion: int, at_s: float) -> None:
        """Run a motion, and those chained to it; motions there are not (above 31) are ignored."""
        if not 0 <= motion < 32:
            return
        base = r.KIN_MOTION_0 + 6 * motion
        registers = self.registers
        target_mm = self.drive.plant_mm(r.wide(registers, base))
        duration_s = max(1e-3, (registers[base + 2] | registers[base + 3] << 16) * 1e-3)
        begin_s = at_s + registers[base + 4] * 1e-3
        config = registers[base + 5]
        shape = minimum_jerk if config >> 1 & 3 else minimum_power
        from_mm = self.drive.plant.setpoint_mm
        self.status = motion | RUNNING

        def act(now_s: float) -> bool:
            share = min(max((now_s - begin_s) / duration_s, 0.0), 1.0)
            self.drive.plant.hold(from_mm + (target_mm - from_mm) * shape(share))
            if share < 1.0:
                return True
            self.status = motion
            self.completed = (self.completed + 1) & 0xFFFF
            if config & 1:
                self.start(config >> 3 & 31, now_s)
            return False

        self.drive.every_tick(at_s, act)

    def cancel(self) -> None:
        """Forget the motion under way."""
        self.status &= ~RUNNING


class AutoZero:
    """Retracts until the force says that the end is reached, and takes that place as zero."""

    def __init__(self, drive: Drive, registers: list[int]) -> None:
        self.drive = drive
        self.registers = registers
        self.complete = False
        self.running = False

    def start(self, at_s: float, done: Callable[[bool, float], None]) -> None:
        """Begin; `done(success, time)` is called at the end."""
        drive = self.drive
        limit_N = float(self.registers[r.AUTO_ZERO_FORCE_N])
        speed_mm_s = max(1.0, float(self.registers[r.AUTO_ZERO_SPEED_MMPS]))
        position_mm = drive.plant.position_mm
        give_up_s = at_s + AUTO_ZERO_TIMEOUT_S
        drive.hold(position_mm)
        self.complete = False
        self.running = True

        def act(now_s: float) -> bool:
            nonlocal position_mm
            if abs(drive.plant.motor_force_N) >= limit_N and drive.plant.at_end_stop:
                drive.set_zero_here()
                return finish(True, now_s)
            if now_s >= give_up_s:
                return finish(False, now_s)
            position_mm -= drive.direction * speed_mm_s * 1e-3
            drive.plant.hold(position_mm)
            return True

        def finish(success: bool, now_s: float) -> bool:
            self.running = False
            self.complete = success
            done(success, now_s)
            return False

        drive.every_tick(at_s, act)

    def cancel(self) -> None:
        """Forget it."""
        self.running = False
