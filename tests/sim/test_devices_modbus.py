from __future__ import annotations

import struct

import pytest

from sim.clock import SimClock
from sim.devices.modbus import Refusal, RtuServer, TcpServer, crc16, standard_functions
from sim.line import Line
from tests.sim.world_tools import framed


class Memory:
    """Ten registers and ten bits."""

    def __init__(self) -> None:
        self.registers = list(range(100, 110))
        self.flags = [False] * 10

    def _check(self, address: int, count: int) -> None:
        if address + count > 10:
            raise Refusal(2)

    def read_registers(self, address: int, count: int, at_s: float) -> list[int]:
        self._check(address, count)
        return self.registers[address : address + count]

    def write_registers(self, address: int, values: list[int], at_s: float) -> None:
        self._check(address, len(values))
        self.registers[address : address + len(values)] = values

    def read_bits(self, address: int, count: int, at_s: float) -> list[bool]:
        self._check(address, count)
        return self.flags[address : address + count]

    def write_bit(self, address: int, value: bool, at_s: float) -> None:
        self._check(address, 1)
        self.flags[address] = value


class Bus:
    """An RTU server on a line, and its client."""

    def __init__(self) -> None:
        self.clock = SimClock()
        self.line = Line(self.clock, 19200, "E")
        self.memory = Memory()
        functions = standard_functions(self.memory, (1, 2, 3, 4, 5, 6, 15, 16, 23))
        self.server = RtuServer(self.line, 17, functions, lambda pdu: 0.003)

    def ask(self, request: bytes) -> bytes:
        self.line.host_write(request)
        self.clock.wait([], self.clock.now() + 0.5)
        return self.line.host_read(999)


# Bit by bit, and the check value of the catalogue of CRC algorithms for CRC-16/MODBUS.
def test_crc() -> None:
    assert crc16(b"123456789") == 0x4B37
    for data in (b"\x01", bytes(range(256)), b"padbench"):
        assert crc16(framed(data.hex())) == 0
        assert crc16(data).to_bytes(2, "little") == framed(data.hex())[-2:]


# Requests and replies built from the tables of the Modbus Application Protocol, chapter 6.
@pytest.mark.parametrize(
    ("request_", "reply"),
    [
        ("11 03 0000 0003", "11 03 06 0064 0065 0066"),
        ("11 04 0009 0001", "11 04 02 006D"),
        ("11 06 0002 BEEF", "11 06 0002 BEEF"),
        ("11 10 0001 0002 04 0001 FFFF", "11 10 0001 0002"),
        ("11 05 0003 FF00", "11 05 0003 FF00"),
        ("11 01 0000 000A", "11 01 02 00 00"),
        ("11 0F 0000 0009 02 41 01", "11 0F 0000 0009"),
        ("11 17 0000 0002 0000 0001 02 1234", "11 17 04 1234 0065"),
        ("11 03 0009 0002", "11 83 02"),  # beyond the map
        ("11 03 0000 0000", "11 83 03"),  # no registers
        ("11 03 0000 007E", "11 83 03"),  # more than 125
        ("11 05 0003 1234", "11 85 03"),  # neither on nor off
        ("11 10 0001 0002 02 0001", "11 90 03"),  # byte count of one register
        ("11 2B 0E 01 00", "11 AB 01"),  # function not there
    ],
)
def test_functions_and_refusals(request_: str, reply: str) -> None:
    assert Bus().ask(framed(request_)) == framed(reply)


def test_bits_are_packed_from_the_low_end() -> None:
    bus = Bus()
    bus.ask(framed("11 0F 0000 0009 02 41 01"))
    assert [k for k, flag in enumerate(bus.memory.flags) if flag] == [0, 6, 8]
    assert bus.ask(framed("11 02 0001 0008")) == framed("11 02 01 A0")  # bits 6 and 8, from bit 1 on: 5 and 7


def test_ignored_in_silence() -> None:
    bus = Bus()
    good = framed("11 03 0000 0001")
    assert bus.ask(good[:-1] + b"\x00") == b""  # wrong CRC
    assert bus.ask(framed("12 03 0000 0001")) == b""  # another address
    assert bus.ask(good + good) == b""  # no silence between two frames: one long broken frame
    assert bus.ask(good[:5]) == b""  # half a frame, forgotten after the silence
    assert bus.ask(good) == framed("11 03 02 0064")
    assert (bus.server.bus_errors, bus.server.messages) == (3, 1)


def test_a_broadcast_is_done_and_not_answered() -> None:
    bus = Bus()
    assert bus.ask(framed("00 06 0004 0007")) == b""
    assert bus.memory.registers[4] == 7


def test_a_request_in_two_writes_is_one_request() -> None:
    bus = Bus()
    request = framed("11 06 0002 0001")
    bus.line.host_write(request[:3])
    assert bus.ask(request[3:]) == request


def test_reply_time_is_request_delay_and_reply() -> None:
    bus = Bus()
    bus.line.host_write(framed("11 03 0000 0003"))
    byte_s = 11 / 19200
    bus.clock.wait([], 8 * byte_s + 0.003 + 11 * byte_s - 1e-9)
    assert bus.line.available() == 10
    bus.clock.wait([], 8 * byte_s + 0.003 + 11 * byte_s)
    assert bus.line.available() == 11


# Modbus TCP/IP Implementation Guide 3.1: transaction id, protocol 0, length, unit id.
def test_tcp_framing() -> None:
    clock = SimClock()
    line = Line(clock, 0)
    server = TcpServer(line, standard_functions(Memory(), (3, 6)), lambda pdu: 0.0)

    def ask(data: bytes) -> bytes:
        line.host_write(data)
        clock.wait([], clock.now() + 0.1)
        return line.host_read(999)

    one = bytes.fromhex("1501 0000 0006 FF 03 0004 0001")
    two = bytes.fromhex("1502 0000 0006 01 03 0009 0002")
    assert ask(one) == bytes.fromhex("1501 0000 0005 FF 03 02 0068")
    assert ask(one + two) == bytes.fromhex("1501 0000 0005 FF 03 02 0068 1502 0000 0003 01 83 02")
    assert ask(one[:9]) == b""
    assert ask(one[9:]) == bytes.fromhex("1501 0000 0005 FF 03 02 0068")
    assert ask(struct.pack(">HHHB", 1, 7, 6, 1) + b"\x03\0\0\0\1") == b""  # another protocol
    assert server.messages == 4
