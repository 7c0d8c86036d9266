"""Bytes of the Iris Dynamics Orca: its register addresses, error bits and the command stream.

Sources: vendor's register header and SDK, in docs/devices.md 1.2 (frames), 1.3 (registers, error bits), 7.2 (vectors).
"""

from __future__ import annotations

import struct
from enum import IntEnum

from drivers.modbus import rtu_frame

STREAM = 0x64
STREAM_REPLY_SIZE = 19
"""Bytes of a reply to the command stream, address and checksum included."""

_COMMAND = struct.Struct(">BBBi")
_REPLY = struct.Struct(">2xiiHBHH2x")


class Command(IntEnum):
    """Codes in a stream frame; any other code puts the motor to sleep."""

    SLEEP = 0
    FORCE = 28
    POSITION = 30


class Mode(IntEnum):
    """Modes of operation, registers 3 and 317."""

    SLEEP = 1
    FORCE = 2
    POSITION = 3
    HAPTIC = 4
    KINEMATIC = 5
    AUTO_ZERO = 55


class Register(IntEnum):
    """Register addresses; 32-bit values have their low word first."""

    COMMANDS = 0
    TUNING_COMMANDS = 1
    MODE = 3
    GAINS = 133
    MAX_FORCE = 140
    COMMS_TIMEOUT = 163
    ZERO_MODE = 171
    MODE_NOW = 317
    MOTOR_STATUS = 321
    POSITION = 342
    FORCE = 348
    SERIAL_NUMBER = 406
    STATOR = 418
    ERRORS = 432
    LATCHED_ERRORS = 433
    BAUDRATE = 482


APPLY_GAINS = 1 << 10
"""Bit of register 1 that makes new position gains count."""

AUTO_ZERO_DONE = 1 << 0
AUTO_ZERO_RUNNING = 1 << 1
"""Bits of the motor status, register 321."""

COMMS_TIMEOUT_ERROR = 1 << 11
AUTO_ZERO_FAILED = 1 << 13
"""Error bits that homing looks at."""

ZERO_MODES = {0: "negative", 1: "manual", 2: "auto zero", 3: "auto zero on boot", 4: "IOSH auto zero"}

STATORS = {0: "ORCA-6-24", 1: "ORCA-6-48", 2: "ORCA-15-48", 3: "ORCA-3-12", 4: "ORCA-3-36"}

ERROR_BITS = {
    0: "configuration invalid",
    5: "force control clipping",
    6: "too hot",
    7: "force limit exceeded",
    8: "power limit exceeded",
    9: "shaft image failed",
    10: "supply voltage out of range",
    11: "no command in time (communication watchdog)",
    12: "current-loop input out of range",
    13: "auto zero failed",
}
"""Error bits of registers 432 and 433 and of the stream's reply."""


def error_names(errors: int) -> tuple[str, ...]:
    """Names of the bits set in an error word; bits without a name are given by number."""
    return tuple(ERROR_BITS.get(bit, f"error bit {bit}") for bit in range(16) if errors >> bit & 1)


def mode_name(mode: int) -> str:
    """A mode's name in lower case, or its number."""
    try:
        return Mode(mode).name.lower().replace("_", " ")
    except ValueError:
        return f"mode {mode}"


def command_frame(address: int, command: int, value: int) -> bytes:
    """Stream request: `value` in µm (position) or mN (force), as 32 bits with the high byte first."""
    return rtu_frame(_COMMAND.pack(address, STREAM, command, value))


def command_reply(frame: bytes) -> tuple[int, int, int, int, int, int]:
    """Stream reply: position µm, force mN, power W, temperature °C, supply mV, error word."""
    return _REPLY.unpack(frame)
