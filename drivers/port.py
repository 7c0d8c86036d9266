"""Ports: opening them, and the shortest way to their bytes."""

from __future__ import annotations

import contextlib
import os
from collections.abc import Callable
from typing import Any, Protocol

import serial

from drivers.errors import PortError


class Port(Protocol):
    """What is used of a pyserial port (`sim://`, pseudo-terminals and `socket://` included)."""

    def read(self, size: int = 1, /) -> bytes:
        """Bytes that are there, at most `size`; the port is opened with timeout 0."""
        ...

    def write(self, data: bytes, /) -> int | None:
        """Queue bytes for sending."""
        ...

    def close(self) -> None:
        """Close the port."""
        ...


def open_port(device: str, url: str, baudrate: int, *, parity: str = "N", stopbits: int = 1) -> Port:
    """Open a serial device or any URL pyserial knows (`sim://…`, `socket://…`), exclusively and non-blocking.

    Pseudo-terminals have no parity: where the kernel refuses it there, the port is opened without.
    Raises `PortError` that names the port and the cure.
    """
    options: dict[str, Any] = {"baudrate": baudrate, "stopbits": stopbits, "timeout": 0}
    if "://" not in url:
        options["exclusive"] = True
    try:
        if url.startswith("/dev/pts/"):
            parity = "N"
        port = serial.serial_for_url(url, parity=parity, **options)
    except (OSError, ValueError, serial.SerialException) as error:
        message = f"cannot open port {url!r}: {_reason(error)}; check 'port' in the bench file"
        raise PortError(device, message) from error
    if hasattr(port, "set_low_latency_mode"):
        # USB adapters hold bytes back for up to 16 ms otherwise; ports without the ioctl say so with an error.
        with contextlib.suppress(OSError, ValueError, NotImplementedError):
            port.set_low_latency_mode(True)
    return port


def _reason(error: Exception) -> str:
    """The system's own word for it, where pyserial wraps it in others."""
    number = getattr(error, "errno", None)
    return os.strerror(number).lower() if isinstance(number, int) else str(error)


def raw_io(port: Port) -> tuple[Callable[[int], bytes], Callable[[bytes], int | None]]:
    """Read and write functions of a port; a POSIX terminal is used by its descriptor (30 µs saved a call)."""
    fd = getattr(port, "fd", None)
    if not isinstance(fd, int):
        return port.read, port.write

    def read(size: int) -> bytes:
        try:
            return os.read(fd, size)
        except BlockingIOError:
            return b""

    def write(data: bytes) -> int:
        sent = os.write(fd, data)
        while sent < len(data):
            sent += os.write(fd, data[sent:])
        return sent

    return read, write
