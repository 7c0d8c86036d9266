"""SMC LEC step-data controller (LECP6, LECA6, JXC) on Modbus RTU: docs/devices.md 2.2.

Signals are coils 10…1E (valid with coil 30, serial drive, on), status is in discrete inputs 40…4F, and a move is a
block of step data at 9102 that writing 1 to 9100 starts.

Not documented there, and chosen here: HOLD halts and lets the rest of the move go on when it is taken back, but ends a
return to origin; RESET clears an alarm, and ends a motion for good; SVRE follows SVON after 0.1 s; commands that
cannot be (no servo, no origin, step data outside of what the axis can, DRIVE without stored step data) raise ALARM, and
moves are refused while it is on; a start while it moves takes the new step data; replies come after 2 ms; bits 46 and
47 read 0; homing ends at the zero of the bench's motor frame; 100 % of force is the drive's own; areas and the parallel
outputs are not simulated.
"""

from __future__ import annotations

from sim.devices.drive import Drive
from sim.devices.modbus import ILLEGAL_ADDRESS, Refusal, RtuServer, standard_functions
from sim.devices.register_axis import Mover, RegisterAxis, high_first
from sim.line import Line

REPLY_DELAY_S = 0.002
SERVO_READY_S = 0.1

IN0, HOLD, SVON, DRIVE, RESET, SETUP, JOG_MINUS, JOG_PLUS, SERIAL = 0x10, 0x18, 0x19, 0x1A, 0x1B, 0x1C, 0x1D, 0x1E, 0x30
COILS = (*range(IN0, IN0 + 6), HOLD, SVON, DRIVE, RESET, SETUP, JOG_MINUS, JOG_PLUS, SERIAL)
OUT0, BUSY, SVRE, SETON, INP, ESTOP, ALARM = 0x40, 0x48, 0x49, 0x4A, 0x4B, 0x4E, 0x4F

START, MODE, SPEED, POSITION, ACCELERATION, DECELERATION = 0x9100, 0x9102, 0x9103, 0x9104, 0x9106, 0x9107
PUSH_FORCE, MOVING_FORCE, IN_POSITION, STEP_END = 0x9108, 0x910B, 0x9110, 0x9112
ABSOLUTE, RELATIVE = 1, 2
JOG_mm_s, JOG_mm_s2 = 20.0, 1000.0


class SmcLec(RegisterAxis):
    """The controller; `drive` in hundredths of a millimetre."""

    def __init__(self, line: Line, drive: Drive, *, address: int = 1, max_speed_mm_s: float = 2000.0) -> None:
        super().__init__()
        self.drive = drive
        self.mover = Mover(drive)
        self.max_speed_mm_s = max_speed_mm_s
        self.alarm = False
        self.coils = dict.fromkeys(COILS, False)
        self.target = 0
        self.starts = 0
        self._ready = False
        self._clock = line.clock
        self.values = dict.fromkeys([START, *range(MODE, STEP_END)], 0)
        self.server = RtuServer(line, address, standard_functions(self, (1, 2, 3, 5, 6, 15, 16)), self._delay_s)

    def _delay_s(self, pdu: bytes) -> float:
        return REPLY_DELAY_S

    # -- what can be read ----------------------------------------------------------------------------------------

    def status(self, at_s: float) -> dict[int, int]:
        """Position, speed, thrust, target, step number: 9000…9006."""
        self.drive.plant.advance(at_s)
        full_N = self.drive.plant.settings.max_force_N
        return {
            **high_first(0x9000, self.drive.counts()),
            0x9002: round(abs(self.drive.speed_mm_s())),
            0x9003: min(round(100.0 * abs(self.drive.force_N()) / full_N), 100),
            **high_first(0x9004, self.target),
            0x9006: 0,
        }

    def bits(self, at_s: float) -> dict[int, bool]:
        """The coils as written, and the discrete inputs."""
        self.drive.plant.advance(at_s)
        mover = self.mover
        inputs = dict.fromkeys(range(OUT0, ALARM + 1), False)
        inputs |= {
            BUSY: mover.moving,
            SVRE: self._ready,
            SETON: mover.homed,
            INP: self._ready and (mover.complete or (mover.homed and mover.target_mm is None and not mover.moving)),
            ALARM: self.alarm,
        }
        return self.coils | inputs

    # -- what can be written -------------------------------------------------------------------------------------

    def write_bit(self, address: int, value: bool, at_s: float) -> None:
        """A coil; those but 30 are heard in serial drive only."""
        if address not in self.coils:
            raise Refusal(ILLEGAL_ADDRESS)
        if address != SERIAL and not self.coils[SERIAL]:
            return
        changed = self.coils[address] != value
        self.coils[address] = value
        if changed:
            self.drive.plant.advance(at_s)
            self._signal(address, value, at_s)

    def _signal(self, address: int, on: bool, at_s: float) -> None:
        mover = self.mover
        if address == SVON:
            self._servo(on, at_s)
        elif address == HOLD:
            if on and mover.homing:
                mover.stop()
            mover.pause(on)
        elif address == RESET and on:
            self.alarm = False
            if mover.moving or mover.target_mm is not None:
                mover.stop()
        elif address == SETUP and on and self._can_move(origin=False):
            mover.home(at_s)
        elif address == DRIVE and on:
            self._raise()
        elif address in (JOG_MINUS, JOG_PLUS):
            self._jog(address, on)

    def _servo(self, on: bool, at_s: float) -> None:
        self.mover.switch(on)
        self._ready = False

        def ready(now_s: float) -> None:
            self._ready = self.coils[SVON]

        if on:
            self._clock.schedule(at_s + SERVO_READY_S, ready)

    def _jog(self, address: int, on: bool) -> None:
        if on and self._can_move(origin=False):
            low_mm, high_mm = self.drive.plant.settings.stroke_mm
            up = (address == JOG_PLUS) == (self.drive.direction > 0)
            self.mover.move(high_mm if up else low_mm, JOG_mm_s, JOG_mm_s2, 0.1)
        elif not on:
            self.mover.stop()

    def written(self, addresses: range, at_s: float) -> None:
        """Writing 1 to 9100 starts the step data; it reads 0 again."""
        if START not in addresses:
            return
        start, self.values[START] = self.values[START], 0
        if start == 1 and self.coils[SERIAL]:
            self.drive.plant.advance(at_s)
            self.starts += 1
            if self._can_move(origin=True):
                self._start(at_s)

    def fail(self, code: int, at_s: float) -> None:
        """An alarm from outside (overload, heat): the servo goes off; 0 takes it back. The code is not told."""
        self.drive.plant.advance(at_s)
        self.alarm = bool(code)
        if code:
            self.mover.switch(False)
            self._ready = False

    def power_up(self, at_s: float) -> None:
        """The controller starts anew: servo off, no origin, in parallel input mode, counting from where it is."""
        self.drive.plant.advance(at_s)
        self.mover.switch(False)
        self.mover.homed = self.mover.paused = False
        self.alarm = self._ready = False
        self.coils = dict.fromkeys(COILS, False)
        self.values = dict.fromkeys(self.values, 0)
        self.drive.zero_mm = self.drive.plant.position_mm

    # -- moves ---------------------------------------------------------------------------------------------------

    def _raise(self) -> None:
        self.alarm = True
        self.mover.stop()

    def _can_move(self, *, origin: bool) -> bool:
        """Whether a motion may start; raises the alarm where not."""
        if not self._ready or self.mover.homing or (origin and not self.mover.homed):
            self._raise()
        return not self.alarm

    def _start(self, at_s: float) -> None:
        values, drive, mover = self.values, self.drive, self.mover
        wanted = self.signed(POSITION)
        if values[MODE] == RELATIVE:
            wanted += self.target
        target_mm = drive.plant_mm(wanted)
        low_mm, high_mm = drive.plant.settings.stroke_mm
        slack_mm = 0.5 * drive.quantum_mm
        possible = (
            values[MODE] in (ABSOLUTE, RELATIVE)
            and low_mm - slack_mm <= target_mm <= high_mm + slack_mm
            and 0 < values[SPEED] <= self.max_speed_mm_s
            and values[ACCELERATION] > 0
            and values[DECELERATION] > 0
            and values[PUSH_FORCE] <= 100
            and values[MOVING_FORCE] <= 300
            and self.unsigned(IN_POSITION) > 0
        )
        if not possible:
            self._raise()
            return
        self.target = wanted
        speed_mm_s = float(values[SPEED])
        acceleration_mm_s2 = float(min(values[ACCELERATION], values[DECELERATION]))
        near_mm = self.unsigned(IN_POSITION) * drive.quantum_mm
        if values[PUSH_FORCE]:
            mover.push_N = values[PUSH_FORCE] / 100.0 * drive.plant.settings.max_force_N
            way_mm = target_mm - drive.plant.position_mm
            mover.push(at_s, target_mm, speed_mm_s, acceleration_mm_s2, near_mm if way_mm >= 0.0 else -near_mm)
        else:
            mover.move(target_mm, speed_mm_s, acceleration_mm_s2, near_mm)
        if self.coils[HOLD]:
            mover.paused = False
            mover.pause(True)
