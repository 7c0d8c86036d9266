"""Modbus requests as exchanges: frames, PDUs and checksums from pymodbus, deadlines and retries from `wire`.

The reply's length is known before it comes, so that it is taken the moment its last byte is there. Bytes that cannot
belong to it (line noise before a frame) are skipped; a frame of another device or another request is refused.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, Literal, TypeVar

from pymodbus.framer import FramerRTU, FramerSocket
from pymodbus.pdu import DecodePDU, ModbusPDU
from pymodbus.pdu.bit_message import (
    ReadCoilsRequest,
    ReadDiscreteInputsRequest,
    WriteMultipleCoilsRequest,
    WriteSingleCoilRequest,
)
from pymodbus.pdu.register_message import (
    ReadHoldingRegistersRequest,
    ReadInputRegistersRequest,
    ReadWriteMultipleRegistersRequest,
    WriteMultipleRegistersRequest,
    WriteSingleRegisterRequest,
)

from drivers.errors import CrcError, ExceptionReply, FrameError, UnexpectedReply
from drivers.wire import Exchange, Link

T = TypeVar("T")
Transport = Literal["rtu", "tcp"]
Convert = Callable[[Any, float, float], T]
"""Turns the decoded reply PDU, the time in the middle of the exchange and the time of receipt into a value."""

EXCEPTIONS = {
    1: "illegal function",
    2: "illegal data address",
    3: "illegal data value",
    4: "device failure",
    5: "acknowledged, still working on it",
    6: "device busy",
    7: "negative acknowledge",
    8: "memory parity error",
    10: "gateway path unavailable",
    11: "gateway: the target device does not answer",
}
"""Names of Modbus exception codes (Modbus application protocol 1.1b3, section 7)."""

MAX_TCP_LENGTH = 254
"""Largest length field of a Modbus TCP header: unit and PDU."""

_READS = {"holding": ReadHoldingRegistersRequest, "input": ReadInputRegistersRequest}
_BIT_READS = {"coil": ReadCoilsRequest, "discrete": ReadDiscreteInputsRequest}

compute_crc = FramerRTU.compute_CRC


def rtu_frame(body: bytes) -> bytes:
    """Address and PDU with their checksum behind."""
    return body + compute_crc(body).to_bytes(2, "big")


def rtu_gap_s(baudrate: int, bits_per_byte: int) -> float:
    """Silence between RTU frames: 3.5 characters, 1.75 ms above 19200 baud (Modbus over serial line 1.02, 2.5.1.1)."""
    return 0.00175 if baudrate > 19200 else 3.5 * bits_per_byte / baudrate


class ModbusClient:
    """Builds the exchanges with one device on a link.

    `turnaround_s` is the longest time the device may take before its reply begins; wire time is added to it.
    `reply_delay_s` is how long the device is known to hold a finished reply back: it looked before that.
    """

    def __init__(
        self,
        link: Link,
        address: int,
        *,
        transport: Transport = "rtu",
        turnaround_s: float = 0.025,
        reply_delay_s: float = 0.0,
    ) -> None:
        self.link = link
        self.address = address
        self.transport = transport
        self.turnaround_s = turnaround_s
        self.reply_delay_s = reply_delay_s
        self._decoder = DecodePDU(False)
        self._framer = FramerRTU(self._decoder) if transport == "rtu" else FramerSocket(self._decoder)
        self._transaction = 0

    # -- standard functions ------------------------------------------------------------------------------------

    def read_registers(self, table: Literal["holding", "input"], address: int, count: int) -> Exchange[list[int]]:
        """Registers from a table (functions 03, 04)."""
        return self.sample_registers(
            table, address, count, lambda registers, _time, _received: registers, repeatable=True
        )

    def sample_registers(
        self,
        table: Literal["holding", "input"],
        address: int,
        count: int,
        convert: Callable[[list[int], float, float], T],
        *,
        repeatable: bool | None = None,
    ) -> Exchange[T]:
        """Registers turned into a value; `convert(registers, time_s, received_s)` gets the time they were read at.

        Over TCP it is not repeated of itself: a second try bears the same number, so that a late reply to the first
        would be taken for its own, and for a value of that time.
        """

        def convert_reply(reply: ModbusPDU, time_s: float, received_s: float) -> T:
            if len(reply.registers) != count:  # its byte count says less than the frame holds
                raise UnexpectedReply(
                    self.link.name, f"{len(reply.registers)} registers came where {count} were asked for"
                )
            return convert(list(reply.registers), time_s, received_s)

        request = _READS[table](address=address, count=count)
        name = f"read {count} from {table} {address:#06x}"
        again = self.transport == "rtu" if repeatable is None else repeatable
        return self.request(name, request, 5 + 2 * count, convert_reply, repeatable=again)

    def read_holding(self, address: int, count: int = 1) -> Exchange[list[int]]:
        """Holding registers (function 03)."""
        return self.read_registers("holding", address, count)

    def read_input(self, address: int, count: int = 1) -> Exchange[list[int]]:
        """Input registers (function 04)."""
        return self.read_registers("input", address, count)

    def read_bits(self, table: Literal["coil", "discrete"], address: int, count: int) -> Exchange[list[bool]]:
        """Coils (function 01) or discrete inputs (function 02)."""

        def convert(reply: ModbusPDU, _time_s: float, _received_s: float) -> list[bool]:
            if len(reply.bits) < count:
                raise UnexpectedReply(self.link.name, f"{len(reply.bits)} bits came where {count} were asked for")
            return list(reply.bits)[:count]

        request = _BIT_READS[table](address=address, count=count)
        return self.request(f"read {count} from {table} {address:#06x}", request, 5 + (count + 7) // 8, convert)

    def write_register(self, address: int, value: int, *, repeatable: bool = True) -> Exchange[None]:
        """One register (function 06). `repeatable=False` where the device acts on each write."""
        request = WriteSingleRegisterRequest(address=address, registers=[value])
        return self._write(f"write {value} to {address:#06x}", request, repeatable)

    def write_registers(self, address: int, values: list[int], *, repeatable: bool = True) -> Exchange[None]:
        """Neighbouring registers in one message (function 16)."""
        request = WriteMultipleRegistersRequest(address=address, registers=values)
        return self._write(f"write {len(values)} from {address:#06x}", request, repeatable)

    def write_coil(self, address: int, on: bool, *, repeatable: bool = True) -> Exchange[None]:
        """One coil (function 05)."""
        request = WriteSingleCoilRequest(address=address, bits=[on])
        return self._write(f"set coil {address:#06x} to {int(on)}", request, repeatable)

    def write_coils(self, address: int, on: list[bool], *, repeatable: bool = True) -> Exchange[None]:
        """Neighbouring coils in one message (function 15)."""
        request = WriteMultipleCoilsRequest(address=address, bits=on)
        return self._write(f"set {len(on)} coils from {address:#06x}", request, repeatable)

    def readwrite(
        self, read_address: int, read_count: int, write_address: int, values: list[int], *, repeatable: bool = True
    ) -> Exchange[list[int]]:
        """Write, then read, in one message (function 23)."""

        def convert(reply: ModbusPDU, _time_s: float, _received_s: float) -> list[int]:
            if len(reply.registers) != read_count:
                raise UnexpectedReply(
                    self.link.name, f"{len(reply.registers)} registers came where {read_count} were asked"
                )
            return list(reply.registers)

        request = ReadWriteMultipleRegistersRequest(
            read_address=read_address, read_count=read_count, write_address=write_address, write_registers=values
        )
        name = f"write {len(values)} from {write_address:#06x} and read {read_count} from {read_address:#06x}"
        return self.request(name, request, 5 + 2 * read_count, convert, repeatable=repeatable)

    def _write(self, name: str, request: ModbusPDU, repeatable: bool) -> Exchange[None]:
        # Replies to writes repeat the head of the request (single writes all of it, multiple ones address and count).
        expected = request.encode()[:4]

        def convert(reply: ModbusPDU, _time_s: float, _received_s: float) -> None:
            if reply.encode()[:4] != expected:
                raise UnexpectedReply(self.link.name, f"the reply to '{name}' confirms something else")

        return self.request(name, request, 8, convert, repeatable=repeatable)

    # -- any function ------------------------------------------------------------------------------------------

    def register(self, reply: type[ModbusPDU]) -> None:
        """Teach the decoder a device's own function code."""
        self._decoder.register(reply)

    def request(
        self, name: str, pdu: ModbusPDU, reply_size: int, convert: Convert[T], *, repeatable: bool = True
    ) -> Exchange[T]:
        """An exchange for any PDU; `reply_size` is that of the RTU reply frame, address and checksum included.

        Its result raises `CrcError`, `ExceptionReply`, `UnexpectedReply` or `DeviceTimeout`.
        """
        pdu.dev_id = self.address
        self._transaction = self._transaction % 0xFFFF + 1
        pdu.transaction_id = self._transaction
        frame = self._framer.buildFrame(pdu)
        if self.transport == "rtu":
            length = self.rtu_length(pdu.function_code, reply_size, frame)
            parse = self._rtu_parse(name, len(frame), convert)
        else:
            length = self._tcp_length(self._transaction)
            parse = self._tcp_parse(name, pdu.function_code, reply_size - 3, len(frame), convert)
        timeout_s = self.turnaround_s + self.link.wire_s(reply_size)
        return Exchange(name, frame, length, parse, timeout_s, repeatable)

    def middle_s(self, sent_s: float, received_s: float, request_size: int, reply_size: int) -> float:
        """When the device looked: the middle between the last byte of the request and the reply it then held back."""
        wire_s = self.link.wire_s
        asked_s = sent_s + wire_s(request_size)
        if asked_s >= received_s:  # faster than the wire: a pseudo-terminal or an adapter that has none
            return 0.5 * (sent_s + received_s)
        return 0.5 * (asked_s + max(asked_s, received_s - wire_s(reply_size) - self.reply_delay_s))

    # -- RTU ---------------------------------------------------------------------------------------------------

    def rtu_length(self, function: int, size: int, request: bytes) -> Callable[[bytearray], int]:
        """Length function of an RTU reply (see `Exchange`): `size` bytes, or 5 for an exception reply."""
        address = self.address
        head = bytes((address, function))
        refusal = bytes((address, function | 0x80))
        byte_count = size - 5 if function in (1, 2, 3, 4, 23) else None

        def length(buffer: bytearray) -> int:
            if len(buffer) < 3:
                return 0
            if not buffer.startswith(head):
                if buffer.startswith(refusal):
                    return 5
                return self._resynchronise(buffer, head, refusal, length)
            if byte_count is not None and buffer[2] != byte_count:
                if buffer.startswith(request):
                    raise FrameError(self.link.name, "the adapter echoes what is sent; switch its local echo off")
                raise UnexpectedReply(
                    self.link.name, f"the reply carries {buffer[2]} bytes where {byte_count} were asked for"
                )
            return size

        return length

    def _resynchronise(self, buffer: bytearray, head: bytes, refusal: bytes, length: Callable[[bytearray], int]) -> int:
        """Skip bytes before the reply, unless they are a whole frame of something else."""
        starts = [index for index in (buffer.find(head, 1), buffer.find(refusal, 1)) if index > 0]
        if starts:
            del buffer[: min(starts)]
            return length(buffer)
        if len(buffer) >= 5 and not compute_crc(bytes(buffer[:-2])) ^ int.from_bytes(buffer[-2:], "big"):
            if self.link.shared:
                buffer.clear()  # another device on the line, late
                return 0
            raise UnexpectedReply(
                self.link.name,
                f"a reply from address {buffer[0]}, function {buffer[1]:#04x}, where address {head[0]}, function "
                f"{head[1]:#04x} was asked; check 'address' and that no other master is on the line",
            )
        return 0

    def check_rtu(self, name: str, frame: bytes) -> None:
        """Raise what is wrong with a complete RTU frame: `CrcError`, or the `ExceptionReply` it is."""
        if compute_crc(frame[:-2]) != (frame[-2] << 8) | frame[-1]:
            raise CrcError(self.link.name, f"the reply to '{name}' has a wrong checksum; check cable and shielding")
        if frame[1] & 0x80:
            self._refused(name, frame[2])

    def _rtu_parse(self, name: str, request_size: int, convert: Convert[T]) -> Callable[[bytes, float, float], T]:
        def parse(frame: bytes, sent_s: float, received_s: float) -> T:
            self.check_rtu(name, frame)
            time_s = self.middle_s(sent_s, received_s, request_size, len(frame))
            return convert(self._decode(name, frame[1:-2]), time_s, received_s)

        return parse

    # -- TCP ---------------------------------------------------------------------------------------------------

    def _tcp_length(self, transaction: int) -> Callable[[bytearray], int]:
        def length(buffer: bytearray) -> int:
            while len(buffer) >= 6:
                protocol = int.from_bytes(buffer[2:4], "big")
                size = int.from_bytes(buffer[4:6], "big")
                if protocol != 0 or not 3 <= size <= MAX_TCP_LENGTH:
                    raise FrameError(self.link.name, "what comes is no Modbus TCP; check 'port'")
                if len(buffer) < 6 + size:
                    return 0
                if int.from_bytes(buffer[:2], "big") == transaction:
                    return 6 + size
                # A reply to an earlier request that was given up.
                del buffer[: 6 + size]
            return 0

        return length

    def _tcp_parse(
        self, name: str, function: int, pdu_size: int, request_size: int, convert: Convert[T]
    ) -> Callable[[bytes, float, float], T]:
        def parse(frame: bytes, sent_s: float, received_s: float) -> T:
            if frame[6] != self.address or frame[7] & 0x7F != function:
                raise UnexpectedReply(
                    self.link.name,
                    f"a reply from unit {frame[6]}, function {frame[7]:#04x}, where unit {self.address}, function "
                    f"{function:#04x} was asked; check 'address'",
                )
            if frame[7] & 0x80:
                self._refused(name, frame[8])
            if len(frame) - 7 != pdu_size:
                raise UnexpectedReply(
                    self.link.name, f"the reply to '{name}' has {len(frame) - 7} bytes where {pdu_size} were expected"
                )
            time_s = self.middle_s(sent_s, received_s, request_size, len(frame))
            return convert(self._decode(name, frame[7:]), time_s, received_s)

        return parse

    # -- both --------------------------------------------------------------------------------------------------

    def _decode(self, name: str, pdu: bytes) -> ModbusPDU:
        reply = self._decoder.decode(pdu)
        if reply is None:
            raise UnexpectedReply(self.link.name, f"the reply to '{name}' cannot be decoded")
        return reply

    def _refused(self, name: str, code: int) -> None:
        meaning = EXCEPTIONS.get(code, "a code that Modbus does not define")
        raise ExceptionReply(self.link.name, f"the device refuses '{name}': exception {code}, {meaning}", code=code)
