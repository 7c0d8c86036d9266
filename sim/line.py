"""A serial line between the host and one simulated device: bytes take their time.

A byte of 8N1 is ten bits, of 8E1 eleven; bytes queue behind those before them. A request reaches the device when
its last byte has arrived; the host can read a reply's bytes one by one as they arrive, and is woken by the last.
Where host and device disagree about baudrate or parity, both receive garbage, as on a real line.
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable, Sequence
from typing import Protocol, TypeAlias

from sim.clock import SimClock

Pieces: TypeAlias = Sequence[tuple[bytes, float]]
"""What becomes of bytes on their way: pieces in order, each with the seconds it comes late."""

Tamper: TypeAlias = Callable[[bytes, float], Pieces]
"""Says what becomes of bytes that start on their way at a time; a fault of the line."""


class Receiver(Protocol):
    """What sits at the device's end of a line."""

    def receive(self, data: bytes, at_s: float) -> None:
        """Take bytes whose last has arrived at `at_s`."""
        ...


class _Chunk:
    """Bytes on their way to the host: byte k has arrived at start_s + (k + 1) · byte_s."""

    __slots__ = ("byte_s", "data", "end_s", "start_s", "taken")

    def __init__(self, data: bytes, start_s: float, byte_s: float, end_s: float) -> None:
        self.data = data
        self.start_s = start_s
        self.byte_s = byte_s
        self.end_s = end_s
        self.taken = 0

    def arrived(self, now_s: float) -> int:
        """How many bytes are there at `now_s`, those taken included."""
        if now_s >= self.end_s:
            return len(self.data)
        if now_s <= self.start_s:
            return 0
        return min(int((now_s - self.start_s) / self.byte_s), len(self.data) - 1)


class Line:
    """Both directions of one line.

    `baudrate` and `parity` are the device's; 0 baud is a line without wire time (TCP). `host_baudrate` and
    `host_parity` are what the host has set, None while it follows the device (as an emulated port must, which
    cannot know). `half_duplex`: bytes that cross in the two directions destroy each other.
    `latency_s` is added to what the host receives (a USB adapter's buffering). `holder` is the port that has the
    line open; `sink`, where set, is handed what arrives at the host instead of its being kept for reading.
    """

    def __init__(
        self,
        clock: SimClock,
        baudrate: int,
        parity: str = "N",
        *,
        half_duplex: bool = False,
        latency_s: float = 0.0,
    ) -> None:
        self.clock = clock
        self.half_duplex = half_duplex
        self.latency_s = latency_s
        self.device: Receiver | None = None
        self.sink: Callable[[bytes], None] | None = None
        self.holder: object = None
        self.bytes_to_device = 0
        self.bytes_to_host = 0
        self.collisions = 0
        self.host_baudrate: int | None = None
        self.host_parity: str | None = None
        self.gone: OSError | None = None
        """What reading and writing meet while the port is unplugged."""
        self.refusal: str | None = None
        """Why the port cannot be opened, if it cannot."""
        self._tampers: tuple[list[Tamper], list[Tamper]] = ([], [])
        self._to_host: deque[_Chunk] = deque()
        self._to_device_free_s = 0.0
        self._to_device_start_s = 0.0
        self._to_host_free_s = 0.0
        self.set_device(baudrate, parity)

    def set_device(self, baudrate: int, parity: str) -> None:
        """The device changes its baudrate or parity; what is on its way stays as it is."""
        self.baudrate = baudrate
        self.parity = parity
        self.byte_s = byte_time_s(baudrate, parity)
        self._settle()

    def set_host(self, baudrate: int | None, parity: str | None) -> None:
        """The host sets its port; None follows the device."""
        self.host_baudrate = baudrate
        self.host_parity = parity
        self._settle()

    def _settle(self) -> None:
        baudrate = self.baudrate if self.host_baudrate is None else self.host_baudrate
        parity = self.parity if self.host_parity is None else self.host_parity
        self.host_byte_s = byte_time_s(baudrate, parity) if self.baudrate else 0.0
        self._match = not self.baudrate or (baudrate == self.baudrate and parity == self.parity)

    # -- faults ------------------------------------------------------------------------------------------------

    def tamper(self, tamper: Tamper, to_device: bool) -> None:
        """Let a fault change what passes in one direction, behind the faults that do so already."""
        self._tampers[to_device].append(tamper)

    def _tampered(self, data: bytes, at_s: float, to_device: bool) -> Pieces:
        pieces: Pieces = ((data, 0.0),)
        for tamper in self._tampers[to_device]:
            pieces = [
                (part, late_s + more_s)
                for piece, late_s in pieces
                for part, more_s in tamper(piece, at_s + late_s)
                if part
            ]
        return pieces

    def unplug(self, error: OSError | None) -> None:
        """The port is pulled out: whoever uses it meets the error; None: it is there again."""
        self.gone = error
        self.refusal = None if error is None else error.strerror
        self.clock.arrived()  # a port in error wakes who waits for it

    # -- host to device ----------------------------------------------------------------------------------------

    def host_write(self, data: bytes, late_s: float = 0.0) -> None:
        """Put bytes on the wire now (so long ago as they come `late_s`), behind those that are still leaving."""
        if not data:
            return
        if self.gone is not None:
            raise self.gone
        if self._tampers[True]:
            for piece, more_s in self._tampered(data, self.clock.now(), True):
                self._host_send(piece, late_s - more_s)
            return
        self._host_send(data, late_s)

    def _host_send(self, data: bytes, late_s: float) -> None:
        now_s = self.clock.now() - late_s
        start_s = self._to_device_free_s if self._to_device_free_s > now_s else now_s
        end_s = start_s + len(data) * self.host_byte_s
        self._to_device_start_s = start_s
        self._to_device_free_s = end_s
        self.bytes_to_device += len(data)
        if self.half_duplex and self._to_host and self._garble_overlap(start_s, end_s):
            data = garbled(data)
        if not self._match:
            data = garbled(data)
        device = self.device
        assert device is not None
        self.clock.schedule(end_s, lambda at_s: device.receive(data, at_s))

    def to_device_waiting(self) -> int:
        """Bytes the host has written that have not yet left."""
        left_s = self._to_device_free_s - self.clock.now()
        return max(0, round(left_s / self.host_byte_s)) if self.host_byte_s else 0

    # -- device to host ----------------------------------------------------------------------------------------

    def device_write(self, data: bytes, at_s: float) -> float:
        """The device starts to send at `at_s`, behind what it is sending; returns when its last byte has left."""
        if self._tampers[False]:
            end_s = max(self._to_host_free_s, at_s) + len(data) * self.byte_s
            for piece, late_s in self._tampered(data, at_s, False):
                self._device_send(piece, at_s + late_s)
            return end_s
        return self._device_send(data, at_s)

    def _device_send(self, data: bytes, at_s: float) -> float:
        start_s = self._to_host_free_s if self._to_host_free_s > at_s else at_s
        end_s = start_s + len(data) * self.byte_s
        self._to_host_free_s = end_s
        self.bytes_to_host += len(data)
        if self.half_duplex and start_s < self._to_device_free_s and end_s > self._to_device_start_s:
            self.collisions += 1
            data = garbled(data)
        if not self._match:
            data = garbled(data)
        latency_s = self.latency_s
        self._to_host.append(_Chunk(data, start_s + latency_s, self.byte_s, end_s + latency_s))
        self.clock.schedule(end_s + latency_s, self._delivered)
        return end_s

    def _delivered(self, at_s: float) -> None:
        if self.sink is not None:
            self.sink(self._to_host.popleft().data)  # whole, and in its turn: nothing else takes from such a line
            return
        self.clock.arrived()

    def available(self) -> int:
        """Bytes that have arrived at the host and were not read yet."""
        if self.gone is not None:
            raise self.gone
        if self.clock.wall:
            self.clock.run_due()
        chunks = self._to_host
        if not chunks:
            return 0
        now_s = self.clock.now()
        count = 0
        for chunk in chunks:
            here = chunk.arrived(now_s)
            count += here - chunk.taken
            if here < len(chunk.data):
                break
        return count

    def frame_arrived(self) -> bool:
        """Whether something the device sent in one piece has arrived to its last byte."""
        if self.gone is not None:
            return True
        chunks = self._to_host
        return bool(chunks) and chunks[0].end_s <= self.clock.now()

    def host_read(self, size: int) -> bytes:
        """At most `size` of the bytes that have arrived."""
        if self.gone is not None:
            raise self.gone
        if self.clock.wall:
            self.clock.run_due()
        return self._take(size, self.clock.now())

    def _take(self, size: int, now_s: float) -> bytes:
        chunks = self._to_host
        parts: list[bytes] = []
        while chunks and size > 0:
            chunk = chunks[0]
            here = chunk.arrived(now_s)
            until = min(here, chunk.taken + size)
            if until > chunk.taken:
                parts.append(chunk.data[chunk.taken : until])
                size -= until - chunk.taken
                chunk.taken = until
            if until < len(chunk.data):
                break
            chunks.popleft()
            self.clock.taken()
        return parts[0] if len(parts) == 1 else b"".join(parts)

    def drop_received(self) -> None:
        """Throw away what has arrived at the host and was not read."""
        self.host_read(1 << 30)

    def _garble_overlap(self, start_s: float, end_s: float) -> bool:
        """Destroy what is on its way to the host between the two times; returns whether there was anything."""
        hit = False
        for chunk in self._to_host:
            if chunk.start_s < end_s and chunk.end_s > start_s:
                whole = chunk.arrived(start_s)
                chunk.data = chunk.data[:whole] + garbled(chunk.data[whole:])
                hit = True
        self.collisions += hit
        return hit


def byte_time_s(baudrate: int, parity: str = "N", stop_bits: int = 1) -> float:
    """Seconds one byte takes: start bit, eight data bits, parity bit if any, stop bits; 0 for 0 baud."""
    return (9 + (parity != "N") + stop_bits) / baudrate if baudrate else 0.0


def garbled(data: bytes) -> bytes:
    """What arrives where bytes were sampled at the wrong rate or destroyed: as many bytes, none of them right."""
    return bytes((byte + 0x5B) & 0xFF for byte in data)
