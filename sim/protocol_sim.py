"""pyserial's handler for `sim://NAME/KEY`: a port of a simulated bench.

pyserial looks for a module of this name in the packages of `serial.protocol_handler_packages`; importing
`sim.world` adds this one there. Any client that opens its port with `serial.serial_for_url` reaches the simulated
devices with its own unchanged code. On a virtual clock a read with a timeout moves the clock; clients that sleep
or measure time by themselves need a bench on the wall clock.
"""

from __future__ import annotations

from typing import Any

from serial.serialutil import PortNotOpenError, SerialBase, SerialException

from sim.line import Line
from sim.world import lookup


class Serial(SerialBase):
    """One end of a simulated line, as pyserial shows a serial port."""

    line: Line | None = None

    def open(self) -> None:
        """Connect to the line; raises `SerialException` where there is none of that name, or it is taken."""
        if self.is_open:
            raise SerialException("the port is already open")
        line = lookup(str(self.port)).line
        holder = line.holder
        if isinstance(holder, Serial) and holder.is_open and (self.exclusive or holder.exclusive):
            raise SerialException(f"{self.port} is in use by another client")
        self.line = line
        line.holder = self
        self.is_open = True
        self._reconfigure_port()
        line.drop_received()

    def close(self) -> None:
        """Leave the line; the device goes on by itself."""
        if self.is_open and self.line is not None:
            if self.line.holder is self:
                self.line.holder = None
                self.line.set_host(None, None)
            self.is_open = False

    def _reconfigure_port(self, force_update: bool = False) -> None:
        if self.is_open and self.line is not None:
            self.line.set_host(self.baudrate, self.parity)

    def _update_rts_state(self) -> None: ...

    def _update_dtr_state(self) -> None: ...

    def _update_break_state(self) -> None: ...

    def _connected(self) -> Line:
        if not self.is_open or self.line is None:
            raise PortNotOpenError
        return self.line

    @property
    def in_waiting(self) -> int:
        """Bytes that have arrived and were not read."""
        return self._connected().available()

    @property
    def frame_waiting(self) -> bool:
        """Whether a whole frame waits to be read: what a waiting reader is woken for."""
        return self._connected().frame_arrived()

    @property
    def out_waiting(self) -> int:
        """Bytes written that have not left yet."""
        return self._connected().to_device_waiting()

    def read(self, size: int = 1, /) -> bytes:
        """At most `size` bytes: those that are there (timeout 0), or waiting for all of them (timeout, None)."""
        line = self._connected()
        timeout_s = self.timeout
        data = line.host_read(size)
        if timeout_s == 0 or len(data) == size:
            return data
        clock = line.clock
        until_s = float("inf") if timeout_s is None else clock.now() + timeout_s
        while len(data) < size and clock.now() < until_s:
            clock.wait((self,), until_s)
            data += line.host_read(size - len(data))
        return data

    def write(self, data: Any, /) -> int:
        """Put bytes on the wire; never blocks. Raises `PortNotOpenError` on a closed port."""
        payload = bytes(data)
        line = self._connected()
        if line.clock.wall:
            line.clock.run_due()
        line.host_write(payload)
        return len(payload)

    def flush(self) -> None:
        """Wait until everything written has left."""
        line = self._connected()
        while line.to_device_waiting():
            line.clock.wait((), line.clock.now() + line.to_device_waiting() * line.host_byte_s)

    def reset_input_buffer(self) -> None:
        """Throw away what has arrived."""
        self._connected().drop_received()

    def reset_output_buffer(self) -> None:
        """Nothing to throw away: what was written is on the wire."""
        self._connected()

    def send_break(self, duration: float = 0.25) -> None:
        """A break means nothing to the simulated devices."""
        self._connected()

    @property
    def cts(self) -> bool:
        """Clear to send: always."""
        return True

    @property
    def dsr(self) -> bool:
        """Data set ready: always."""
        return True

    @property
    def ri(self) -> bool:
        """Ring indicator: never."""
        return False

    @property
    def cd(self) -> bool:
        """Carrier detect: always."""
        return True
