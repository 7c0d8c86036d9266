"""Everything a driver can raise, in one tree.

DriverError
├── PortError           the port cannot be opened, or was lost
├── DeviceTimeout       no complete reply within the deadline
├── FrameError          bytes came, but they are no valid reply
│   ├── CrcError            a checksum does not match
│   └── UnexpectedReply     well formed, but not the answer to what was asked
├── ExceptionReply      the device refused: Modbus exception code, `ERR`, …
├── DeviceFault         the device reports a fault or alarm of its own
├── Overload            a measurement outside what the sensor can take
└── ReadbackError       what was written is not what the device holds
"""

from __future__ import annotations


class DriverError(Exception):
    """Base of all driver errors; `device` is the key in the bench file (`motor`, `load_cell`)."""

    def __init__(self, device: str, message: str) -> None:
        super().__init__(f"{device}: {message}")
        self.device = device
        self.message = message


class PortError(DriverError):
    """The port cannot be opened, or it went away."""


class DeviceTimeout(DriverError):
    """No complete reply came before the deadline."""


class FrameError(DriverError):
    """Bytes came that are no valid reply."""


class CrcError(FrameError):
    """A frame's checksum does not match its bytes."""


class UnexpectedReply(FrameError):
    """A well-formed reply, but not to the request that was sent."""


class ExceptionReply(DriverError):
    """The device refused the request.

    `code` is the Modbus exception code, or None where the protocol has no codes.
    """

    def __init__(self, device: str, message: str, code: int | None = None) -> None:
        super().__init__(device, message)
        self.code = code


class DeviceFault(DriverError):
    """The device reports a fault of its own; `bits` is the raw word, `names` what it says."""

    def __init__(self, device: str, message: str, bits: int = 0, names: tuple[str, ...] = ()) -> None:
        super().__init__(device, message)
        self.bits = bits
        self.names = names


class Overload(DriverError):
    """The sensor is outside the range it can measure."""


class ReadbackError(DriverError):
    """A value read back from the device differs from what was written."""
