"""Iris Dynamics Orca linear motors: Modbus RTU with the vendor's position stream (function 0x64).

Each stream exchange commands a position and returns position, force and errors in one reply, so that a sample costs
nothing beyond the command. Facts and frames: docs/devices.md 1 and 7.2, 7.3. Not used, because not confirmed (7.5): the
limits POS_MAX_VEL/ACCEL/DECEL, whose units are unknown, and functions 0x41, 0x68 and 0x69.

Watchdog: the motor raises an error and produces no force when no command came for USER_COMMS_TIMEOUT. So `hold` lasts
only as long as somebody keeps streaming; a bench that must hold with the host gone needs a brake or a counterweight.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal

from drivers.errors import DeviceFault, DriverError, ReadbackError
from drivers.modbus import ModbusClient
from drivers.motor import MotorIdentity, MotorLimits, MotorSample, SafeState
from drivers.orca_frames import (
    APPLY_GAINS,
    AUTO_ZERO_DONE,
    AUTO_ZERO_FAILED,
    COMMS_TIMEOUT_ERROR,
    STATORS,
    STREAM,
    STREAM_REPLY_SIZE,
    ZERO_MODES,
    Command,
    Mode,
    Register,
    command_frame,
    command_reply,
    error_names,
    mode_name,
)
from drivers.values import decode, encode
from drivers.wire import Exchange, Link, Pause, Steps

DEFAULT_BAUDRATE = 19200
FAST_BAUDRATE = 625_000
"""The vendor's fast recipe from here on: 80 µs between frames; below it the default, 2 ms (docs/devices.md 7.3)."""

TURNAROUND_S = 0.025
"""Longest wait for the beginning of a reply: what the vendor's SDK waits for a whole one."""

STREAM_TURNAROUND_S = 0.020
"""The same for the stream: the SDK's response time-out there."""

POLL_S = 0.005
SETTLE_S = 0.5
"""How long a change of mode may take until it reads back."""

HOMING_TIMEOUT_S = 120.0
FRESH_S = 0.1
"""A sample that old still says where to stop."""

GAINS = ("p", "i", "dv", "de")
"""Names of `gains` in the bench file: registers 133 to 136, raw numbers (their scale is not confirmed)."""

_BLOCK = Register.POSITION
_BLOCK_COUNT = Register.ERRORS - Register.POSITION + 1


def default_gap_s(baudrate: int) -> float:
    """Silence before each request where the bench file gives none."""
    return 80e-6 if baudrate >= FAST_BAUDRATE else 2e-3


class Orca:
    """One Orca on a link. Positive is into the pad: `direction` -1 turns position and force of the device over."""

    kind: Literal["stream", "move"] = "stream"

    def __init__(
        self,
        link: Link,
        *,
        name: str = "motor",
        address: int = 1,
        direction: int = 1,
        gains: dict[str, float] | None = None,
    ) -> None:
        self.name = name
        self.link = link
        self.address = address
        self.gains = _checked_gains(name, gains)
        self._modbus = ModbusClient(link, address, turnaround_s=TURNAROUND_S)
        self._um_per_mm = 1000.0 * direction
        self._mm_per_um = 1e-3 * direction
        self._N_per_mN = 1e-3 * direction
        self._commanding = False
        self._written: dict[int, tuple[list[int], str]] = {}
        self._last: MotorSample | None = None
        self._length: Callable[[bytearray], int] = self._modbus.rtu_length(STREAM, STREAM_REPLY_SIZE, b"")
        self._timeout_s = STREAM_TURNAROUND_S + link.wire_s(STREAM_REPLY_SIZE)
        self._request_s = link.wire_s(9)
        self._hold_back(0.0)

    # -- identity and clamps -----------------------------------------------------------------------------------

    def connect(self) -> Steps[MotorIdentity]:
        """Serial number, firmware, stator, realised link settings, zero mode, mode; commands nothing."""
        words = yield self._modbus.read_holding(Register.SERIAL_NUMBER, 7)
        stator = (yield self._modbus.read_holding(Register.STATOR))[0]
        link = yield self._modbus.read_holding(Register.BAUDRATE, 3)
        self._hold_back(1e-6 * link[2])
        zero_mode = (yield self._modbus.read_holding(Register.ZERO_MODE))[0]
        mode = (yield self._modbus.read_holding(Register.MODE_NOW))[0]
        if stator not in STATORS:
            raise DriverError(
                self.name, f"the device answers, but reports stator type {stator}, which no Orca has; check 'driver'"
            )
        return MotorIdentity(
            model=STATORS[stator],
            details={
                "serial_number": decode(words[0:2], "u32", "low_first"),
                "firmware": f"{words[2]}.{words[3]}.{words[4]}",
                "commit": f"{int(decode(words[5:7], 'u32', 'low_first')):08x}",
                "device_baudrate": decode(link[0:2], "u32", "low_first"),
                "device_gap_us": link[2],
                "zero_mode": ZERO_MODES.get(zero_mode, str(zero_mode)),
                "mode": mode_name(mode),
                "energised": mode != Mode.SLEEP,
            },
        )

    def prepare(self, limits: MotorLimits) -> Steps[dict[str, Any]]:
        """Force limit and watchdog, and gains where the bench file has some; written and read back.

        Speed, acceleration and position have no clamp that is confirmed: the bench watches them.
        """
        force_mN = round(limits.force_N * 1e3)
        watchdog_ms = max(1, round(limits.watchdog_s * 1e3))
        yield from self._write_checked(Register.MAX_FORCE, encode(force_mN, "i32", "low_first"), "force limit")
        yield from self._write_checked(Register.COMMS_TIMEOUT, encode(watchdog_ms, "u16", "low_first"), "watchdog")
        held: dict[str, Any] = {"max_force_N": force_mN * 1e-3, "watchdog_s": watchdog_ms * 1e-3}
        if self.gains is not None:
            yield from self._write_checked(Register.GAINS, self.gains, "position gains")
            yield self._modbus.write_register(Register.TUNING_COMMANDS, APPLY_GAINS)
            held["gains_raw"] = dict(zip(GAINS, self.gains, strict=True))
        return held

    def _write_checked(self, address: int, words: list[int], what: str) -> Steps[None]:
        yield self._modbus.write_registers(address, words)
        back = yield self._modbus.read_holding(address, len(words))
        if back != words:
            raise ReadbackError(self.name, f"{what}: wrote {words} to register {address}, the motor holds {back}")
        self._written[address] = words, what

    def held(self) -> Steps[None]:
        """Clamps, watchdog and gains once more: a motor that has restarted holds none of them, and streams on."""
        for address, (words, what) in self._written.items():
            back = yield self._modbus.read_holding(address, len(words))
            if back != words:
                raise ReadbackError(
                    self.name, f"the motor has restarted: {what} is {back} in register {address}, no longer {words}"
                )

    # -- energising, homing, safe states -----------------------------------------------------------------------

    def energise(self) -> Steps[None]:
        """Sleep (which clears errors), then position mode at the present position. Stream on from here."""
        yield from self._sleep()
        errors = (yield self._modbus.read_holding(Register.ERRORS))[0]
        if errors:
            raise self._fault(errors, "cannot be energised")
        yield from self._hold_here()

    def is_homed(self) -> Steps[bool]:
        """Whether an auto zero has been completed since power-up (MOTOR_STATUS bit 0).

        A motor whose zero mode allows none (negative, manual) has its zero where somebody set it: nothing to do.
        """
        if (yield self._modbus.read_holding(Register.ZERO_MODE))[0] not in (2, 3):
            return True
        status = (yield self._modbus.read_holding(Register.MOTOR_STATUS))[0]
        return bool(status & AUTO_ZERO_DONE)

    def home(self) -> Steps[None]:
        """Auto zero against the hard stop, with the force and speed set in the motor."""
        zero_mode = (yield self._modbus.read_holding(Register.ZERO_MODE))[0]
        if zero_mode not in (2, 3):
            raise DriverError(
                self.name,
                f"the motor's zero mode is {ZERO_MODES.get(zero_mode, zero_mode)!r}, which allows no auto zero; "
                "set it to auto zero (register 171 = 2) with the vendor's software if the bench has a hard stop",
            )
        yield from self._sleep()
        yield self._modbus.write_register(Register.MODE, Mode.AUTO_ZERO, repeatable=False)
        end_s = self.link.clock.now() + HOMING_TIMEOUT_S
        while True:
            yield Pause(0.05)
            mode = (yield self._modbus.read_holding(Register.MODE_NOW))[0]
            # Nothing streams meanwhile, so the watchdog may complain; energising clears that.
            errors = (yield self._modbus.read_holding(Register.ERRORS))[0] & ~COMMS_TIMEOUT_ERROR
            if errors & AUTO_ZERO_FAILED:
                raise self._fault(errors, "did not find its zero")
            if mode != Mode.AUTO_ZERO:
                break
            if self.link.clock.now() > end_s:
                yield from self._sleep()
                raise DeviceFault(self.name, f"auto zero has not ended after {HOMING_TIMEOUT_S:g} s; put to sleep")
        if errors:
            raise self._fault(errors, "stopped its auto zero")
        if not (yield from self.is_homed()):
            raise DeviceFault(self.name, "auto zero ended without the motor reporting it complete")

    def stop(self) -> Steps[None]:
        """Command the position it is at. A motor that is not following positions is left as it is, if asleep."""
        last = self._last
        if not self._commanding:
            mode = (yield self._modbus.read_holding(Register.MODE_NOW))[0]
            if mode == Mode.SLEEP:
                return
            last = None
        if last is None or self.link.clock.now() - last.received_s > FRESH_S:
            last = yield self.read()
        # The first command brakes it, the second takes it to where it was when the brake took hold.
        sample = yield self._command(last.position_mm, repeatable=True)
        yield self._command(sample.position_mm, repeatable=True)

    def safe_state(self, state: SafeState) -> Steps[dict[str, Any]]:
        """release: asleep, no force. hold (and retract, once the bench has retracted): position mode where it is.

        Both are read back from register 317; see the module's text for how long `hold` lasts.
        """
        if state == "release":
            yield from self._sleep()
        else:
            yield from self._hold_here()
        sample = yield self.read()
        mode = (yield self._modbus.read_holding(Register.MODE_NOW))[0]
        return {
            "state": "release" if state == "release" else "hold",
            "mode": mode_name(mode),
            "position_mm": sample.position_mm,
            "force_N": sample.force_N,
            "errors": list(error_names(sample.fault)),
        }

    def _sleep(self) -> Steps[None]:
        self._commanding = False
        yield self._modbus.write_register(Register.MODE, Mode.SLEEP)
        yield from self._await_mode(Mode.SLEEP)

    def _hold_here(self) -> Steps[None]:
        sample = yield self.read()
        sample = yield self._command(sample.position_mm, repeatable=True)
        yield from self._await_mode(Mode.POSITION)
        if sample.fault:
            raise self._fault(sample.fault, "does not hold its position")

    def _await_mode(self, mode: Mode) -> Steps[None]:
        end_s = self.link.clock.now() + SETTLE_S
        while True:
            now = (yield self._modbus.read_holding(Register.MODE_NOW))[0]
            if now == mode:
                return
            if self.link.clock.now() > end_s:
                raise ReadbackError(
                    self.name, f"asked for {mode_name(mode)} mode, the motor stays in {mode_name(now)} mode"
                )
            yield Pause(POLL_S)

    def _fault(self, errors: int, what: str) -> DeviceFault:
        names = error_names(errors)
        return DeviceFault(self.name, f"the motor {what}: {', '.join(names)}", errors, names)

    # -- samples -----------------------------------------------------------------------------------------------

    def read(self) -> Exchange[MotorSample]:
        """Position, force and errors by function 03, which changes no mode: one block from 342 to 432.

        Function 0x68 would do it in 24 bytes, but that today's firmware still has it is not confirmed; a stream
        frame always commands. Reading is for when nothing streams, so its 187 bytes do not matter.
        """

        def convert(words: list[int], time_s: float, received_s: float) -> MotorSample:
            return MotorSample(
                time_s,
                received_s,
                self._mm_per_um * decode(words[0:2], "i32", "low_first"),
                self._N_per_mN * decode(words[Register.FORCE - _BLOCK :][:2], "i32", "low_first"),
                words[Register.ERRORS - _BLOCK],
            )

        return self._modbus.sample_registers("holding", _BLOCK, _BLOCK_COUNT, convert)

    def stream(self, position_mm: float) -> Exchange[MotorSample]:
        """Command a position (rounded to 1 µm) and take a sample.

        Not repeated when its reply is lost: an old set-point sent again would pull the axis back, and the next one
        is on its way.
        """
        return self._command(position_mm, repeatable=False)

    def _command(self, position_mm: float, *, repeatable: bool) -> Exchange[MotorSample]:
        self._commanding = True
        frame = command_frame(self.address, Command.POSITION, round(position_mm * self._um_per_mm))
        return Exchange("stream", frame, self._length, self._parse_stream, self._timeout_s, repeatable)

    def move(self, target_mm: float, speed_mm_s: float, acceleration_mm_s2: float) -> Steps[None]:
        """Not with this motor: it follows a stream of positions; raises `DriverError`."""
        raise DriverError(self.name, "an Orca follows a stream of positions; it is sent no moves")

    def _hold_back(self, delay_s: float) -> None:
        """The motor keeps a reply for its interframe delay: what it says was measured before that."""
        self._modbus.reply_delay_s = delay_s
        self._middle_offset_s = 0.5 * (self._request_s - self.link.wire_s(STREAM_REPLY_SIZE) - delay_s)

    def _measured_s(self, sent_s: float, received_s: float) -> float:
        """When the motor looked: between the end of the request and the reply it then held back."""
        middle_s = 0.5 * (sent_s + received_s)
        time_s = middle_s + self._middle_offset_s
        asked_s = sent_s + self._request_s
        # A reply quicker than the wire (a pseudo-terminal): the middle is all that is known.
        return time_s if time_s >= asked_s else min(asked_s, middle_s)

    def _parse_stream(self, frame: bytes, sent_s: float, received_s: float) -> MotorSample:
        self._modbus.check_rtu("stream", frame)
        position_um, force_mN, _power, _temperature, _voltage, errors = command_reply(frame)
        sample = MotorSample(
            self._measured_s(sent_s, received_s),
            received_s,
            position_um * self._mm_per_um,
            force_mN * self._N_per_mN,
            errors,
        )
        self._last = sample
        return sample

    def fault_names(self, fault: int) -> tuple[str, ...]:
        """Names of the error bits."""
        return error_names(fault)


def _checked_gains(name: str, gains: dict[str, float] | None) -> list[int] | None:
    if gains is None:
        return None
    if set(gains) != set(GAINS):
        raise DriverError(
            name, f"gains of an Orca are {', '.join(GAINS)}, all of them; got {', '.join(gains) or 'none'}"
        )
    words = [round(gains[key]) for key in GAINS]
    if any(not 0 <= word <= 0xFFFF for word in words):
        raise DriverError(name, "gains of an Orca are raw register values from 0 to 65535")
    return words
