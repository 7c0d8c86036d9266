"""The server side of Modbus: framing (RTU, TCP), exceptions, the standard functions on a register store.

Written from the Modbus specifications (Application Protocol V1.1b3, Serial Line V1.02, TCP/IP V1.0b), and not with
the library the drivers use, so that the two check each other.
"""

from __future__ import annotations

import struct
from collections.abc import Callable
from typing import Protocol, TypeAlias

from sim.line import Line

ILLEGAL_FUNCTION = 1
ILLEGAL_ADDRESS = 2
ILLEGAL_VALUE = 3
DEVICE_FAILURE = 4

BROADCAST = 0

Function: TypeAlias = Callable[[bytes, float], bytes]
"""Takes a request's PDU and the time it arrived, returns the reply's PDU; raises `Refusal`."""


class Refusal(Exception):
    """The device answers with an exception code."""

    def __init__(self, code: int) -> None:
        super().__init__(f"exception code {code}")
        self.code = code


def _crc_table() -> tuple[int, ...]:
    table = []
    for byte in range(256):
        crc = byte
        for _ in range(8):
            crc = (crc >> 1) ^ 0xA001 if crc & 1 else crc >> 1
        table.append(crc)
    return tuple(table)


_CRC_TABLE = _crc_table()


def crc16(data: bytes) -> int:
    """CRC-16/Modbus; 0 over a frame that ends in its own correct CRC (low byte first on the wire)."""
    crc = 0xFFFF
    table = _CRC_TABLE
    for byte in data:
        crc = (crc >> 8) ^ table[(crc ^ byte) & 0xFF]
    return crc


class Store(Protocol):
    """Registers and bits of a device; addresses as on the wire. Every method may raise `Refusal`."""

    def read_registers(self, address: int, count: int, at_s: float) -> list[int]:
        """Values of `count` registers, 0..65535 each."""
        ...

    def write_registers(self, address: int, values: list[int], at_s: float) -> None:
        """Write registers, and do what writing them does."""
        ...

    def read_bits(self, address: int, count: int, at_s: float) -> list[bool]:
        """Coils or discrete inputs."""
        ...

    def write_bit(self, address: int, value: bool, at_s: float) -> None:
        """Write one coil, and do what writing it does."""
        ...


def standard_functions(store: Store, codes: tuple[int, ...]) -> dict[int, Function]:
    """The standard functions of the given codes (1 to 6, 15, 16, 23), on a store."""

    def read_bits(pdu: bytes, at_s: float) -> bytes:
        address, count = struct.unpack(">xHH", pdu)
        if not 1 <= count <= 2000:
            raise Refusal(ILLEGAL_VALUE)
        bits = store.read_bits(address, count, at_s)
        packed = bytearray((count + 7) // 8)
        for k, bit in enumerate(bits):
            packed[k // 8] |= bit << (k % 8)
        return bytes((pdu[0], len(packed))) + packed

    def read_registers(pdu: bytes, at_s: float) -> bytes:
        address, count = struct.unpack(">xHH", pdu)
        if not 1 <= count <= 125:
            raise Refusal(ILLEGAL_VALUE)
        values = store.read_registers(address, count, at_s)
        return struct.pack(f">BB{count}H", pdu[0], 2 * count, *values)

    def write_bit(pdu: bytes, at_s: float) -> bytes:
        address, value = struct.unpack(">xHH", pdu)
        if value not in (0x0000, 0xFF00):
            raise Refusal(ILLEGAL_VALUE)
        store.write_bit(address, value != 0, at_s)
        return pdu

    def write_register(pdu: bytes, at_s: float) -> bytes:
        address, value = struct.unpack(">xHH", pdu)
        store.write_registers(address, [value], at_s)
        return pdu

    def write_bits(pdu: bytes, at_s: float) -> bytes:
        address, count = struct.unpack(">xHH", pdu[:5])
        if not 1 <= count <= 1968 or pdu[5] != (count + 7) // 8 or len(pdu) != 6 + pdu[5]:
            raise Refusal(ILLEGAL_VALUE)
        for k in range(count):
            store.write_bit(address + k, bool(pdu[6 + k // 8] >> (k % 8) & 1), at_s)
        return pdu[:5]

    def write_registers(pdu: bytes, at_s: float) -> bytes:
        address, count = struct.unpack(">xHH", pdu[:5])
        if not 1 <= count <= 123 or pdu[5] != 2 * count or len(pdu) != 6 + 2 * count:
            raise Refusal(ILLEGAL_VALUE)
        store.write_registers(address, list(struct.unpack(f">{count}H", pdu[6:])), at_s)
        return pdu[:5]

    def read_write_registers(pdu: bytes, at_s: float) -> bytes:
        read_address, read_count, write_address, write_count, size = struct.unpack(">xHHHHB", pdu[:10])
        if not (1 <= read_count <= 125 and 1 <= write_count <= 121 and size == 2 * write_count == len(pdu) - 10):
            raise Refusal(ILLEGAL_VALUE)
        store.write_registers(write_address, list(struct.unpack(f">{write_count}H", pdu[10:])), at_s)
        values = store.read_registers(read_address, read_count, at_s)
        return struct.pack(f">BB{read_count}H", pdu[0], 2 * read_count, *values)

    functions: dict[int, Function] = {
        1: read_bits,
        2: read_bits,
        3: read_registers,
        4: read_registers,
        5: write_bit,
        6: write_register,
        15: write_bits,
        16: write_registers,
        23: read_write_registers,
    }
    return {code: functions[code] for code in codes}


_FIXED_SIZE = {1: 8, 2: 8, 3: 8, 4: 8, 5: 8, 6: 8}
_COUNT_AT = {15: 6, 16: 6, 23: 10}
"""Where the byte count stands in an RTU request; data and CRC follow it."""


class RtuServer:
    """A device's end of a Modbus RTU line.

    `functions` by code; `sizes` gives the whole length (address and CRC included) of requests of custom codes,
    0 for codes whose length only the silence after them tells. `delay_s(request PDU)` is how long the device
    waits before it answers. Frames with a wrong CRC or for another address are ignored, broadcasts are not
    answered, unknown codes answer exception 1. A frame that stays incomplete is forgotten after 3.5 characters of
    silence (never under 1.75 ms).
    """

    def __init__(
        self,
        line: Line,
        address: int,
        functions: dict[int, Function],
        delay_s: Callable[[bytes], float],
        sizes: dict[int, int] | None = None,
    ) -> None:
        self.line = line
        self.address = address
        self.functions = functions
        self.delay_s = delay_s
        self.refuse: Callable[[float], int | None] | None = None
        """A fault: the exception code with which requests at a time are answered, if they are."""
        self.bus_messages = 0
        self.bus_errors = 0
        self.exceptions = 0
        self.messages = 0
        self.unanswered = 0
        self.reply_end_s = 0.0
        self._sizes = _FIXED_SIZE | (sizes or {})
        self._buffer = b""
        self._last_s = 0.0
        line.device = self

    def receive(self, data: bytes, at_s: float) -> None:
        """Take bytes from the line; answers complete requests."""
        if self._buffer:
            silence_s = at_s - len(data) * self.line.byte_s - self._last_s
            if silence_s > max(3.5 * self.line.byte_s, 0.00175):
                self.bus_errors += 1
            else:
                data = self._buffer + data
            self._buffer = b""
        size = self._request_size(data)
        if size > len(data) or (size == 0 and crc16(data)):
            self._buffer = data[-512:]
            self._last_s = at_s
            return
        if (size and len(data) > size) or crc16(data):
            self.bus_errors += 1
            return
        self.bus_messages += 1
        self._serve(data, at_s)

    def _request_size(self, data: bytes) -> int:
        """Length of the whole request; 0 where nothing but silence tells."""
        if len(data) < 4:
            return 4
        code = data[1]
        if code in _COUNT_AT:
            place = _COUNT_AT[code]
            return place + 3 + data[place] if len(data) > place else place + 3
        return self._sizes.get(code, 0)

    def _serve(self, frame: bytes, at_s: float) -> None:
        address = frame[0]
        if address not in (self.address, BROADCAST):
            return
        self.messages += 1
        pdu = frame[1:-2]
        delay_s = self.delay_s(pdu)
        reply = answer(self.functions, pdu, at_s, self.refuse)
        if reply[0] & 0x80:
            self.exceptions += 1
        if address == BROADCAST:
            self.unanswered += 1
            return
        reply = bytes((address,)) + reply
        crc = crc16(reply)
        self.reply_end_s = self.line.device_write(reply + bytes((crc & 0xFF, crc >> 8)), at_s + delay_s)


class TcpServer:
    """A device's end of a Modbus TCP connection (MBAP framing); answers any unit identifier with its own."""

    def __init__(self, line: Line, functions: dict[int, Function], delay_s: Callable[[bytes], float]) -> None:
        self.line = line
        self.functions = functions
        self.delay_s = delay_s
        self.refuse: Callable[[float], int | None] | None = None
        self.messages = 0
        self._buffer = b""
        line.device = self

    def receive(self, data: bytes, at_s: float) -> None:
        """Take bytes of the stream; answers each complete request in turn."""
        buffer = self._buffer + data
        while len(buffer) >= 8:
            transaction, protocol, length, unit = struct.unpack(">HHHB", buffer[:7])
            if protocol != 0 or not 2 <= length <= 254:
                buffer = b""  # not Modbus: nothing after it can be trusted
                break
            if len(buffer) < 6 + length:
                break
            pdu, buffer = buffer[7 : 6 + length], buffer[6 + length :]
            self.messages += 1
            reply = answer(self.functions, pdu, at_s, self.refuse)
            head = struct.pack(">HHHB", transaction, 0, len(reply) + 1, unit)
            self.line.device_write(head + reply, at_s + self.delay_s(pdu))
        self._buffer = buffer


def answer(
    functions: dict[int, Function], pdu: bytes, at_s: float, refuse: Callable[[float], int | None] | None = None
) -> bytes:
    """The reply's PDU: the function's, or an exception; `refuse(time)` may give the code of one."""
    function = functions.get(pdu[0])
    try:
        code = refuse(at_s) if refuse is not None else None
        if code is not None:
            raise Refusal(code)
        if function is None:
            raise Refusal(ILLEGAL_FUNCTION)
        return function(pdu, at_s)
    except Refusal as refusal:
        return bytes((pdu[0] | 0x80, refusal.code))
    except (struct.error, IndexError):
        return bytes((pdu[0] | 0x80, ILLEGAL_VALUE))  # the PDU is shorter or longer than its function's
