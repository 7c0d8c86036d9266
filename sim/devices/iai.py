"""IAI ROBO Cylinder controller (PCON, ACON, SCON) on Modbus RTU: docs/devices.md 2.1 and 7.1.

Not documented there, and chosen here: alarm codes (0x80 move with the servo off, 0x81 table move and 0x83 direct
move before homing, 0x84 move while homing, 0xA2 empty table row, 0xA3 position, speed or acceleration outside
what the axis can); commands while the switch PMSL gives the PIO the say are answered and ignored; the commanded
values of the 9900 block are kept between moves; homing ends at the zero of the bench's motor frame; 100 % push is
the drive's full force, 1000 mA; functions 07 and 11h are refused; values are taken when a request has arrived.
"""

from __future__ import annotations

import struct

from sim.devices.drive import Drive
from sim.devices.modbus import ILLEGAL_ADDRESS, ILLEGAL_VALUE, Refusal, RtuServer, standard_functions
from sim.devices.register_axis import G_mm_s2, Mover, RegisterAxis, high_first
from sim.line import Line

TRANSMITTER_DELAY_S = 0.005
INTERNAL_S = 0.001
TABLE_READ_S, TABLE_WRITE_S = 0.004, 0.015

DRG1, DRG2, POSR, POSR2 = 0x0D00, 0x0D01, 0x0D03, 0x9800
TABLE, TABLE_ROWS, ROW = 0x1000, 64, 16
PCMD, INP, VCMD, ACMD, PPOW, CTLF = 0x9900, 0x9902, 0x9904, 0x9906, 0x9907, 0x9908
BLOCK_END = 0x9909
TARGET_RANGE = 999_999
COIL_DRG1, COIL_DRG2, CLBR, PMSL, STOP = 0x0400, 0x0410, 0x0426, 0x0427, 0x042C
SON, ALRS, BKRL, STP, HOME, CSTR = 1 << 12, 1 << 8, 1 << 7, 1 << 5, 1 << 4, 1 << 3
JOG_PLUS, JOG_MINUS = 1 << 9, 1 << 8
JOG_mm_s, JOG_mm_s2 = 30.0, 3000.0

SERVO_OFF, TABLE_UNHOMED, UNHOMED, WHILE_HOMING, EMPTY_ROW, OUT_OF_RANGE = 0x80, 0x81, 0x83, 0x84, 0xA2, 0xA3


class Iai(RegisterAxis):
    """The controller; `drive` in hundredths of a millimetre. `axis address` is the Modbus address (axis + 1)."""

    def __init__(self, line: Line, drive: Drive, *, address: int = 1, max_speed_mm_s: float = 1000.0) -> None:
        super().__init__()
        self.drive = drive
        self.mover = Mover(drive)
        self.max_speed_mm_s = max_speed_mm_s
        self.alarm = 0
        self.alarm_s = 0.0
        self.modbus_commands = False
        self.position_number = 0
        self._clock = line.clock
        writable = [DRG1, DRG2, POSR, POSR2, *range(PCMD, BLOCK_END)]
        rows = [TABLE + ROW * row + word for row in range(TABLE_ROWS) for word in range(15)]
        self.values = dict.fromkeys([*writable, *rows], 0)
        self.values |= high_first(INP, 10) | high_first(VCMD, 10_000) | {ACMD: 30}
        self.write_only = frozenset([POSR2, *range(PCMD, BLOCK_END)])
        functions = standard_functions(self, (1, 2, 3, 4, 5, 6, 15, 16, 23))
        self.server = RtuServer(line, address, functions, self._delay_s)

    def _delay_s(self, pdu: bytes) -> float:
        """Reply delay: parameter 17 (5 ms) and the internal time of the registers asked for."""
        address = struct.unpack(">H", pdu[1:3])[0] if len(pdu) >= 3 else 0
        if TABLE <= address < TABLE + ROW * TABLE_ROWS and pdu[0] in (3, 4, 6, 16):
            return TRANSMITTER_DELAY_S + (TABLE_READ_S if pdu[0] in (3, 4) else TABLE_WRITE_S)
        return TRANSMITTER_DELAY_S + INTERNAL_S

    # -- what can be read ----------------------------------------------------------------------------------------

    def status(self, at_s: float) -> dict[int, int]:
        """Monitor registers 9000…901F and the alarm's details."""
        self.drive.plant.advance(at_s)
        mover, drive = self.mover, self.drive
        full_N = drive.plant.settings.max_force_N
        setpoint_mm = drive.plant.setpoint_mm
        on = mover.servo_on
        dss1 = (
            1 << 13 | on << 12 | mover.missed << 11 | (self.alarm != 0) << 9 | (self.alarm != 0) << 8
            | bool(self.values[DRG1] & BKRL) << 7 | mover.paused << 5 | mover.homed << 4 | mover.complete << 3
        )  # fmt: skip
        dss2 = 1 << 15 | mover.pushed << 12 | (self.position_number & 0xFF if mover.complete else 0)
        dsse = mover.homing << 11 | mover.pushing << 10 | self.modbus_commands << 8 | mover.moving << 5
        stat = 1 | bool(self.values[DRG1] & SON) << 1 | on << 2 | mover.homed << 3
        registers = {
            0x9002: self.alarm,
            0x9003: 0,
            0x9004: 0,
            0x9005: dss1,
            0x9006: dss2,
            0x9007: dsse,
            0x9012: 0,
            0x9013: 0,
            0x9014: self.position_number if mover.complete else 0,
            0x9015: 0,
            0x0500: 0,
            0x0501: 0xFFFF,
            0x8400: 0,
            0x8401: 0,
            0x8402: 0,
            0x8403: 0,
        }
        for address, value in (
            (0x9000, drive.counts()),
            (0x9008, stat),
            (0x900A, round(100.0 * drive.speed_mm_s())),
            (0x900C, round(1000.0 * drive.force_N() / full_N)),
            (0x900E, round((setpoint_mm - drive.plant.position_mm) / drive.quantum_mm)),
            (0x9010, round(1000.0 * at_s)),
            (0x0502, self.alarm),
            (0x0504, round(1000.0 * self.alarm_s)),
        ):
            registers |= high_first(address, value)
        return registers

    def bits(self, at_s: float) -> dict[int, bool]:
        """Status bits 0100…010E (register DSS1 from its top) and the coils as commanded."""
        dss1 = self.status(at_s)[0x9005]
        bits = {0x0100 + k: bool(dss1 >> (15 - k) & 1) for k in range(15)}
        for base, register in ((COIL_DRG1, DRG1), (COIL_DRG2, DRG2)):
            bits |= {base + k: bool(self.values[register] >> (15 - k) & 1) for k in range(16)}
        return bits | {CLBR: False, PMSL: self.modbus_commands, STOP: False}

    # -- what can be written -------------------------------------------------------------------------------------

    def write_bit(self, address: int, value: bool, at_s: float) -> None:
        """Coils 0400…041F are the bits of DRG1 and DRG2; PMSL and STOP stand alone."""
        self.drive.plant.advance(at_s)
        if address == PMSL:
            self.modbus_commands = value
        elif address == STOP:
            if value and self.modbus_commands:
                self.mover.stop()
        elif COIL_DRG1 <= address < COIL_DRG1 + 32 and address != COIL_DRG1:
            register = DRG1 if address < COIL_DRG2 else DRG2
            bit = 1 << (15 - (address & 0xF))
            old = self.values[register]
            self.values[register] = old | bit if value else old & ~bit
            self._commands(register, old, at_s)
        elif address != CLBR:
            raise Refusal(ILLEGAL_ADDRESS)

    def write_registers(self, address: int, values: list[int], at_s: float) -> None:
        """As any store, but edges of DRG1 and DRG2 count against what they were, and targets have a range."""
        if address == PCMD and len(values) >= 2:
            target = struct.unpack(">i", struct.pack(">HH", *values[:2]))[0]
            if abs(target) > TARGET_RANGE:
                raise Refusal(ILLEGAL_VALUE)
        old = {register: self.values[register] for register in (DRG1, DRG2)}
        super().write_registers(address, values, at_s)
        for register, before in old.items():
            if register in range(address, address + len(values)):
                self._commands(register, before, at_s)

    def written(self, addresses: range, at_s: float) -> None:
        """The 9900 block and POSR2 act when written."""
        self.drive.plant.advance(at_s)
        if not self.modbus_commands:
            return
        if PCMD in addresses or PCMD + 1 in addresses:
            self._direct_move(at_s)
        elif VCMD in addresses or ACMD in addresses:
            self.mover.change_speed(self.unsigned(VCMD) / 100.0, self._acceleration(self.values[ACMD]))
        if PPOW in addresses:
            self.mover.push_N = self._push_N(self.values[PPOW])
        if POSR2 in addresses:
            self._table_move(self.values[POSR2], at_s)

    def _commands(self, register: int, old: int, at_s: float) -> None:
        """What the levels and rising edges of DRG1 and DRG2 do."""
        new = self.values[register]
        rising, falling = new & ~old, old & ~new
        if not self.modbus_commands:
            return
        self.drive.plant.advance(at_s)
        mover = self.mover
        if register == DRG2:
            self._jog(new, rising, falling)
            return
        if rising & ALRS:
            self.alarm = 0
            if mover.paused:
                mover.stop()
        if (rising | falling) & SON:
            mover.switch(bool(new & SON))
        if (rising | falling) & BKRL and not mover.servo_on:
            self.drive.plant.brake(not new & BKRL)
        if (rising | falling) & STP:
            mover.pause(bool(new & STP))
        if rising & HOME and self._allowed(needs_home=None, at_s=at_s):
            mover.home(at_s)
        if rising & CSTR:
            self._table_move(self.values[POSR], at_s)

    def _jog(self, new: int, rising: int, falling: int) -> None:
        mover = self.mover
        low_mm, high_mm = self.drive.plant.settings.stroke_mm
        if rising & (JOG_PLUS | JOG_MINUS) and mover.servo_on and not self.alarm:
            up = bool(rising & JOG_PLUS) == (self.drive.direction > 0)
            mover.move(high_mm if up else low_mm, JOG_mm_s, JOG_mm_s2, 0.1)
        elif falling & (JOG_PLUS | JOG_MINUS) and mover.servo_on:
            mover.stop()

    # -- moves ---------------------------------------------------------------------------------------------------

    def _raise(self, code: int, at_s: float) -> None:
        if not self.alarm:
            self.alarm, self.alarm_s = code, at_s
        if self.mover.servo_on:
            self.mover.stop()

    def fail(self, code: int, at_s: float) -> None:
        """An alarm from outside (overload, heat): the servo goes off; 0 takes it back."""
        self.drive.plant.advance(at_s)
        if code:
            self._raise(code, at_s)
            self.mover.switch(False)
        else:
            self.alarm = 0

    def power_up(self, at_s: float) -> None:
        """The controller starts anew: servo off, not homed, counting from where it is."""
        self.drive.plant.advance(at_s)
        self.mover.switch(False)
        self.mover.homed = self.mover.paused = False
        self.alarm = 0
        self.modbus_commands = False
        self.values[DRG1] = self.values[DRG2] = 0
        self.drive.zero_mm = self.drive.plant.position_mm

    def _allowed(self, needs_home: int | None, at_s: float) -> bool:
        """Whether a motion may start; raises the alarm that says why not (`needs_home`: its code, if unhomed)."""
        mover = self.mover
        if self.alarm or mover.paused:
            return False
        if not mover.servo_on:
            self._raise(SERVO_OFF, at_s)
        elif mover.homing:
            self._raise(WHILE_HOMING, at_s)
        elif needs_home is not None and not mover.homed:
            self._raise(needs_home, at_s)
        return not self.alarm

    def _acceleration(self, hundredths_G: int) -> float:
        return max(1, hundredths_G) * 0.01 * G_mm_s2

    def _push_N(self, power: int) -> float:
        return min(power, 255) / 255.0 * self.drive.plant.settings.max_force_N

    def _direct_move(self, at_s: float) -> None:
        if self._allowed(UNHOMED, at_s):
            self.position_number = 0
            self._go(
                self.signed(PCMD),
                self.unsigned(INP),
                self.unsigned(VCMD),
                self.values[ACMD],
                self.values[PPOW],
                self.values[CTLF],
                at_s,
            )

    def _table_move(self, number: int, at_s: float) -> None:
        if not self._allowed(TABLE_UNHOMED, at_s):
            return
        row = TABLE + ROW * number
        if not 0 <= number < TABLE_ROWS or not self.unsigned(row + 4):
            self._raise(EMPTY_ROW, at_s)
            return
        self.position_number = number
        target, band, speed = self.signed(row), self.unsigned(row + 2), self.unsigned(row + 4)
        push, flags = self.values[row + 12], self.values[row + 14]
        self._go(target, band, speed, self.values[row + 10], push, flags, at_s)

    def _go(self, target: int, band: int, speed: int, acceleration: int, power: int, flags: int, at_s: float) -> None:
        """Start a move given in device units; flags: 1 push, 2 push backwards, 3 incremental."""
        mover = self.mover
        if flags & 1 << 3:
            base_mm = mover.target_mm if mover.target_mm is not None else self.drive.plant.position_mm
            target_mm = base_mm + self.drive.direction * target * self.drive.quantum_mm
        else:
            target_mm = self.drive.plant_mm(target)
        low_mm, high_mm = self.drive.plant.settings.stroke_mm
        speed_mm_s = speed / 100.0
        slack_mm = self.drive.quantum_mm / 2
        reachable = low_mm - slack_mm <= target_mm <= high_mm + slack_mm
        if not reachable or not 0.0 < speed_mm_s <= self.max_speed_mm_s or not 1 <= acceleration <= 300:
            self._raise(OUT_OF_RANGE, at_s)
            return
        if flags & 1 << 1:
            mover.push_N = self._push_N(power)
            stroke_mm = self.drive.direction * (-band if flags & 1 << 2 else band) * self.drive.quantum_mm
            mover.push(at_s, target_mm, speed_mm_s, self._acceleration(acceleration), stroke_mm)
        else:
            band_mm = band * self.drive.quantum_mm
            mover.move(target_mm, speed_mm_s, self._acceleration(acceleration), band_mm)
