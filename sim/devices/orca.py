"""Iris Dynamics Orca motor on Modbus RTU: registers, stream frames, modes, watchdog.

Sources: docs/devices.md 1.1 to 1.5, 7.2, 7.3. The interframe delay is the motor's wait before it answers.

Not documented, and chosen here (docs/devices.md 7.5): exception codes (the Modbus standard's); 0x41, 0x68 and 0x69 are
served as in the 2023 SDK; commands act and values are taken when a request has arrived; the watchdog counts in
force and position mode, and its error stays until sleep mode; SAFETY_DGAIN is taken as mN·s/mm; gains, filters and
haptic effects are kept but do not act; the sensed force is that of the motor, without noise.
"""

from __future__ import annotations

import struct

from sim.clock import Event
from sim.devices import orca_registers as r
from sim.devices.drive import Drive
from sim.devices.modbus import ILLEGAL_ADDRESS, ILLEGAL_VALUE, Refusal, RtuServer, standard_functions
from sim.devices.orca_motion import AutoZero, Kinematics
from sim.line import Line

CHANGE_CONNECTION, COMMAND, READ, WRITE = 0x41, 0x64, 0x68, 0x69
_REQUEST_SIZES = {CHANGE_CONNECTION: 12, COMMAND: 9, READ: 7, WRITE: 11}
_COMMAND_REQUEST = struct.Struct(">xBi")
_COMMAND_REPLY = struct.Struct(">BiiHBHH")
_READ_REQUEST = struct.Struct(">xHB")
_READ_REPLY = struct.Struct(">BHHBiiHBHH")
_WRITE_REQUEST = struct.Struct(">xHBI")
_WRITE_REPLY = struct.Struct(">BBiiHBHH")
_CONNECTION = struct.Struct(">BHIH")

_STREAM_MODES = {28: r.FORCE_MODE, 30: r.POSITION, 32: r.KINEMATIC, 34: r.HAPTIC}
_STOPPING = 1 << 0 | 1 << 6 | 1 << 8 | 1 << 9 | 1 << 10 | r.COMMS_TIMEOUT
"""Errors with which the force and position controllers put out nothing."""

_WATCHED = (r.FORCE_MODE, r.POSITION)
_AT_ONCE_mm_s = 2000.0
_AT_ONCE_mm_s2 = 100_000.0


class Orca:
    """The motor; `drive` in micrometres."""

    def __init__(self, line: Line, drive: Drive, *, address: int = 1, delay_us: int = 2000) -> None:
        self.line = line
        self.drive = drive
        self.plant = drive.plant
        self.delay_s = delay_us * 1e-6
        force_mN = round(drive.force_limit_N * 1000.0)
        self.registers = r.power_up_values(line.baudrate, delay_us, address, force_mN)
        self.mode = r.SLEEP
        self.errors = 0
        self.latched = 0
        self.kinematics = Kinematics(drive, self.registers)
        self.auto_zero = AutoZero(drive, self.registers)
        self._direction = drive.direction
        self._limit_mN = force_mN
        self._last_command_s = 0.0
        self._watchdog: Event | None = None
        self._window = (0, 0, 0)
        functions = standard_functions(self, (3, 6, 16, 23)) | {
            0x08: self._diagnostics,
            CHANGE_CONNECTION: self._change_connection,
            COMMAND: self._command_stream,
            READ: self._read_stream,
            WRITE: self._write_stream,
        }
        self.server = RtuServer(line, address, functions, lambda pdu: self.delay_s, _REQUEST_SIZES)
        self.plant.release()

    # -- stream frames (docs/devices.md 1.2) --------------------------------------------------------------------------

    def _command_stream(self, pdu: bytes, at_s: float) -> bytes:
        code, value = _COMMAND_REQUEST.unpack(pdu)
        mode = _STREAM_MODES.get(code, r.SLEEP)
        if mode == r.POSITION:
            r.put_wide(self.registers, r.POS_CMD, value)
        elif mode == r.FORCE_MODE:
            r.put_wide(self.registers, r.FORCE_CMD, value)
        if mode != self.mode:
            self.plant.advance(at_s)
            self._enter(mode, at_s)
        elif mode in _WATCHED:
            self._commanded(at_s)
        return self.stream_reply(COMMAND, at_s)

    def stream_reply(self, code: int, at_s: float) -> bytes:
        """The answer's PDU to a command (0x64) or a write (0x69) of the stream."""
        values = self._stream_values(at_s)
        return (
            _COMMAND_REPLY.pack(COMMAND, *values) if code == COMMAND else _WRITE_REPLY.pack(WRITE, self.mode, *values)
        )

    def _read_stream(self, pdu: bytes, at_s: float) -> bytes:
        address, width = _READ_REQUEST.unpack(pdu)
        if width not in (1, 2):
            raise Refusal(ILLEGAL_VALUE)
        low, *high = self.read_registers(address, width, at_s)
        values = self._stream_values(at_s)
        return _READ_REPLY.pack(READ, high[0] if high else 0, low, self.mode, *values)

    def _write_stream(self, pdu: bytes, at_s: float) -> bytes:
        address, width, value = _WRITE_REQUEST.unpack(pdu)
        if width not in (1, 2):
            raise Refusal(ILLEGAL_VALUE)
        self.write_registers(address, [value & 0xFFFF, value >> 16][:width], at_s)
        return self.stream_reply(WRITE, at_s)

    def _stream_values(self, at_s: float) -> tuple[int, int, int, int, int, int]:
        """Position µm, force mN, power W, temperature °C, voltage mV, errors."""
        self.plant.advance(at_s)
        force_mN = self._sensed_force_mN()
        self._check_force(force_mN)
        power_W = int(2e-8 * force_mN * force_mN)
        return self.drive.counts(), force_mN, power_W, r.BOARD_TEMPERATURE_C, r.VOLTAGE_mV, self.errors

    def _diagnostics(self, pdu: bytes, at_s: float) -> bytes:
        if pdu[1:3] != b"\0\0":
            raise Refusal(ILLEGAL_VALUE)
        return pdu

    def _change_connection(self, pdu: bytes, at_s: float) -> bytes:
        """The handshake: answers with what it realises at the old rate, and changes when that has left."""
        _, state, baudrate, delay_us = _CONNECTION.unpack(pdu)
        if state not in (0x0000, 0xFF00):
            raise Refusal(ILLEGAL_VALUE)
        if state == 0:
            baudrate = r.wide(self.registers, r.USR_MB_BAUD) or 19200
            delay_us = self.registers[r.USR_MB_DELAY]
        baudrate = min(max(baudrate, 9600), 1_250_000)

        def change(now_s: float) -> None:
            self.line.set_device(baudrate, self.line.parity)
            self.delay_s = delay_us * 1e-6
            r.put_wide(self.registers, r.MB_BAUD, baudrate)
            self.registers[r.MB_IF_DELAY] = delay_us

        reply_size = len(pdu) + 3
        self.line.clock.schedule(at_s + self.delay_s + reply_size * self.line.byte_s, change)
        return _CONNECTION.pack(CHANGE_CONNECTION, state, baudrate, delay_us)

    # -- registers (docs/devices.md 1.3) ------------------------------------------------------------------------------

    def read_registers(self, address: int, count: int, at_s: float) -> list[int]:
        """Registers as they are now."""
        if address + count > r.MAP_SIZE:
            raise Refusal(ILLEGAL_ADDRESS)
        if address + count > r.MB_FREQ and address <= r.MB_ADDRESS:
            self._refresh(at_s)
        return self.registers[address : address + count]

    def write_registers(self, address: int, values: list[int], at_s: float) -> None:
        """Write, then do what the registers written stand for, in the order of their addresses."""
        written = range(address, address + len(values))
        if not all(place in r.WRITABLE for place in written):
            raise Refusal(ILLEGAL_ADDRESS)
        self.registers[address : address + len(values)] = values
        self.plant.advance(at_s)
        for place in written:
            self._react(place, at_s)
        if self.mode in _WATCHED and (r.POS_CMD in written or r.FORCE_CMD in written):
            self._commanded(at_s)

    def read_bits(self, address: int, count: int, at_s: float) -> list[bool]:
        """There are no bits."""
        raise Refusal(ILLEGAL_ADDRESS)

    def write_bit(self, address: int, value: bool, at_s: float) -> None:
        """There are no bits."""
        raise Refusal(ILLEGAL_ADDRESS)

    def _react(self, place: int, at_s: float) -> None:
        value = self.registers[place]
        if place == r.CTRL_REG_3:
            self._enter(value, at_s)
        elif place == r.CTRL_REG_0:
            self._control(value, at_s)
        elif place == r.KIN_SW_TRIGGER and self.mode == r.KINEMATIC:
            self.kinematics.start(value, at_s)
        elif place == r.POS_SIGN:
            self.drive.direction = -self._direction if value & 1 else self._direction
        elif place in (r.USER_MAX_FORCE, r.USER_MAX_FORCE + 1, r.PC_FSATU, r.PC_FSATU + 1):
            self._limit_mN = abs(r.wide(self.registers, r.USER_MAX_FORCE))
            self.drive.limit_force(min(self._limit_mN, abs(r.wide(self.registers, r.PC_FSATU))) / 1000.0)
        elif place == r.USER_COMMS_TIMEOUT:
            self._last_command_s = at_s
            self._watch(at_s)
        if place <= r.CTRL_REG_4:
            self.registers[place] = 0  # self-clearing

    def _control(self, bits: int, at_s: float) -> None:
        if bits & 1:
            self._enter(r.SLEEP, at_s)
            self.errors = self.latched = 0
        if bits & 2:
            self.errors = self.latched = 0
            if self.mode in _WATCHED:
                self._last_command_s = at_s
                self._watch(at_s)
        if bits & 4:
            self.drive.set_zero_here()
        if bits & 8:
            self.registers[r.POS_SIGN] ^= 1
            self._react(r.POS_SIGN, at_s)

    def _refresh(self, at_s: float) -> None:
        """Bring the status registers up to date."""
        self.plant.advance(at_s)
        registers, server = self.registers, self.server
        force_mN = self._sensed_force_mN()
        self._check_force(force_mN)
        for place, value in (
            (r.POS_CURSOR, round(self.drive.direction * (self.plant.setpoint_mm - self.drive.zero_mm) * 1000.0)),
            (r.SHAFT_POS_UM, self.drive.counts()),
            (r.SHAFT_SPEED_MMPS, round(self.drive.speed_mm_s())),
            (r.FORCE, force_mN),
        ):
            r.put_wide(registers, place, value)
        registers[r.POWER] = registers[r.AVG_POWER] = int(2e-8 * force_mN * force_mN)
        registers[r.MODE_OF_OPERATION] = self.mode
        registers[r.KINEMATIC_STATUS] = self.kinematics.status
        registers[r.KIN_COMPLETE_COUNT] = self.kinematics.completed
        moving = self.mode == r.POSITION and self.plant.moving
        registers[r.MOTOR_STATUS] = self.auto_zero.complete | self.auto_zero.running << 1 | moving << 2
        registers[r.ERROR_0], registers[r.ERROR_1] = self.errors, self.latched
        registers[r.MB_FREQ] = self._message_rate(at_s)
        counters = (server.bus_messages, server.bus_errors, server.exceptions, server.messages, server.unanswered)
        registers[r.MB_CNT : r.MB_CNT + 5] = [count & 0xFFFF for count in counters]

    def _message_rate(self, at_s: float) -> int:
        """Good messages in the last whole second that was looked at."""
        second, before, rate = self._window
        if int(at_s) != second:
            rate = round((self.server.messages - before) / max(1, int(at_s) - second))
            self._window = (int(at_s), self.server.messages, rate)
        return min(rate, 0xFFFF)

    def _sensed_force_mN(self) -> int:
        return round(self.drive.force_N() * 1000.0)

    # -- modes ---------------------------------------------------------------------------------------------------

    def _enter(self, mode: int, at_s: float) -> None:
        """Change the mode; modes that are not simulated are ignored."""
        if mode == r.AUTO_ZERO and self.registers[r.ZERO_MODE] not in (2, 3):
            return
        if mode not in (r.SLEEP, r.FORCE_MODE, r.POSITION, r.HAPTIC, r.KINEMATIC, r.AUTO_ZERO):
            return
        self.kinematics.cancel()
        self.auto_zero.cancel()
        if self.mode == r.FORCE_MODE and mode != r.FORCE_MODE:
            self.drive.hold(self.plant.position_mm)  # its set-point is where the force would take it
        self.mode = mode
        if mode in (r.SLEEP, r.HAPTIC):
            self.drive.release()
            self.errors = 0 if mode == r.SLEEP else self.errors
        elif mode in _WATCHED:
            self._commanded(at_s, entering=True)
            self._watch(at_s)
        elif self.errors & _STOPPING:
            self.drive.release()
        elif mode == r.KINEMATIC:
            self.plant.hold(self.plant.position_mm)
            self.kinematics.start(self.registers[r.KIN_HOME_ID], at_s)
        else:
            self.auto_zero.start(at_s, self._zeroed)

    def _zeroed(self, success: bool, at_s: float) -> None:
        if not success:
            self._raise(r.AUTO_ZERO_FAILED)
            self._enter(r.SLEEP, at_s)
            self._raise(r.AUTO_ZERO_FAILED)
            return
        r.put_wide(self.registers, r.POS_CMD, 0)
        self._enter(self.registers[r.AUTO_ZERO_EXIT_MODE], at_s)

    def _commanded(self, at_s: float, entering: bool = False) -> None:
        """A force or position command has come, or its mode was entered."""
        self._last_command_s = at_s
        if self.errors & _STOPPING:
            if entering:
                self.drive.release()
            return
        self.plant.advance(at_s)
        if self.mode == r.FORCE_MODE:
            self.drive.press(self._force_command_N())
            return
        target_mm = self.drive.plant_mm(r.wide(self.registers, r.POS_CMD))
        speed, acceleration = self.registers[r.POS_MAX_VEL], self.registers[r.POS_MAX_ACCEL]
        if speed or acceleration:
            self.drive.profile(target_mm, speed or _AT_ONCE_mm_s, acceleration or _AT_ONCE_mm_s2)
        else:
            self.drive.hold(target_mm)

    def _force_command_N(self) -> float:
        """The force commanded, motor frame, clipped to what the user allows."""
        wanted_mN = r.wide(self.registers, r.FORCE_CMD)
        allowed_mN = min(max(wanted_mN, -self._limit_mN), self._limit_mN)
        self._set(r.FORCE_CLIPPING, wanted_mN != allowed_mN)
        return self.drive.direction * allowed_mN / 1000.0

    # -- errors --------------------------------------------------------------------------------------------------

    def fail(self, bits: int, at_s: float) -> None:
        """Errors from outside (heat, supply): the motor lets go; 0: those pass, and the mode's next command acts."""
        self.plant.advance(at_s)
        if bits:
            self._raise(bits)
            if bits & _STOPPING:
                self.drive.release()
        else:
            self.errors &= ~_STOPPING | r.COMMS_TIMEOUT

    def power_up(self, at_s: float) -> None:
        """The motor starts anew: asleep, its registers as after power-up, counting from where it is."""
        self.plant.advance(at_s)
        self._enter(r.SLEEP, at_s)
        self.errors = self.latched = 0
        force_mN = round(self.plant.settings.max_force_N * 1000.0)
        delay_us = round(self.delay_s * 1e6)
        self.registers[:] = r.power_up_values(self.line.baudrate, delay_us, self.server.address, force_mN)
        self._limit_mN = force_mN
        self.drive.limit_force(force_mN / 1000.0)
        self.drive.direction = self._direction
        self.drive.set_zero_here()

    def _set(self, bit: int, active: bool) -> None:
        if active:
            self._raise(bit)
        else:
            self.errors &= ~bit

    def _raise(self, bit: int) -> None:
        self.errors |= bit
        self.latched |= bit

    def _check_force(self, force_mN: int) -> None:
        """Max force: while the motor pushes as hard as the user's limit lets it."""
        at_limit = abs(force_mN) >= self._limit_mN - 1
        if at_limit or self.errors & r.MAX_FORCE:
            self._set(r.MAX_FORCE, at_limit)

    def _watch(self, at_s: float) -> None:
        """Have the watchdog look when the present time-out would run out."""
        if self._watchdog is None and self.mode in _WATCHED and self.registers[r.USER_COMMS_TIMEOUT]:
            due_s = self._last_command_s + self.registers[r.USER_COMMS_TIMEOUT] * 1e-3
            self._watchdog = self.line.clock.schedule(max(due_s, at_s), self._check_comms)

    def _check_comms(self, at_s: float) -> None:
        self._watchdog = None
        timeout_s = self.registers[r.USER_COMMS_TIMEOUT] * 1e-3
        if self.mode not in _WATCHED or not timeout_s or self.errors & r.COMMS_TIMEOUT:
            return
        if at_s < self._last_command_s + timeout_s - 1e-9:
            self._watch(at_s)
            return
        self.plant.advance(at_s)
        self._raise(r.COMMS_TIMEOUT)
        damping_N_s_mm = self.registers[r.SAFETY_DGAIN] * 1e-3
        if damping_N_s_mm:
            self.drive.damp(at_s, damping_N_s_mm)
        else:
            self.drive.release()
