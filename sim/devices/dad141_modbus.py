"""The DAD 141.1 by its Modbus map: over TCP (it has an Ethernet port), or RTU where the bench's map says so.

Sources: docs/devices.md 3.1; DAD 141.1 Modbus Communication manual rev. 2.3, p. 3-10: 32-bit values are read high word
first (p. 4, register 202E: "the high word (202E) … and the low word (202F)").

Not documented, and chosen here: floats are in the unit, with the decimal point applied; a request is answered
after 2 ms with values taken when it arrived; refused zero and tare commands answer exception 4.
"""

from __future__ import annotations

import struct
from collections.abc import Callable

from sim.devices.amplifier import Amplifier
from sim.devices.modbus import (
    DEVICE_FAILURE,
    ILLEGAL_ADDRESS,
    ILLEGAL_VALUE,
    Refusal,
    RtuServer,
    TcpServer,
    standard_functions,
)
from sim.line import Line

REPLY_DELAY_S = 0.002
IDENTITY, FIRMWARE, SERIAL = 1410, 0x0101, 147_301

UNDER_RANGE, OVER_RANGE, NO_MOTION, TARE_SET = 0x0001, 0x0002, 0x0010, 0x0020


def _words(value: int) -> list[int]:
    return [value >> 16 & 0xFFFF, value & 0xFFFF]


def _float_words(value: float) -> list[int]:
    return list(struct.unpack(">HH", struct.pack(">f", value)))


class Dad141Modbus:
    """The device; `tcp` chooses MBAP framing on a line without wire time."""

    def __init__(self, line: Line, amplifier: Amplifier, *, address: int = 1, tcp: bool = True) -> None:
        self.line = line
        self.amplifier = amplifier
        functions = standard_functions(self, (3, 4, 6, 16))
        self.server: TcpServer | RtuServer
        if tcp:
            self.server = TcpServer(line, functions, lambda pdu: REPLY_DELAY_S)
        else:
            self.server = RtuServer(line, address, functions, lambda pdu: REPLY_DELAY_S)
        self._settings = self._setting_table()

    # -- reading -------------------------------------------------------------------------------------------------

    def read_registers(self, address: int, count: int, at_s: float) -> list[int]:
        """Registers in a row; a gap among them is an illegal address, as is the wrong size of a combined read."""
        blocks = self._blocks(at_s)
        for start, words in blocks.items():
            if start <= address and address + count <= start + len(words):
                return words[address - start : address - start + count]
        result: list[int] = []
        while len(result) < count:
            place = address + len(result)
            if place not in blocks:
                raise Refusal(ILLEGAL_ADDRESS)
            result += blocks[place]
        if len(result) > count:
            raise Refusal(ILLEGAL_ADDRESS)
        return result

    def _blocks(self, at_s: float) -> dict[int, list[int]]:
        amplifier = self.amplifier
        gross = amplifier.gross(at_s)
        net = gross - amplifier.tare
        unit = 10.0**-amplifier.decimals
        beyond = amplifier.over_range(gross)
        still = amplifier.still(at_s)
        qualifier = (
            (UNDER_RANGE if beyond < 0 else 0)
            | (OVER_RANGE if beyond > 0 else 0)
            | (NO_MOTION if still else 0)
            | (TARE_SET if amplifier.tared else 0)
        )
        status = still | amplifier.zeroed << 1 | amplifier.tared << 2
        gross_f, net_f = _float_words(gross * unit), _float_words(net * unit)
        blocks = {
            0x2000: gross_f,
            0x2002: net_f,
            0x2008: gross_f,
            0x2020: _words(gross),
            0x2022: _words(net),
            0x2028: _words(gross),
            0x202A: _words(gross + amplifier.zero),
            0x202C: _words(IDENTITY),
            0x202E: _words(FIRMWARE),
            0x2030: _words(status),
            0x2034: _words(SERIAL),
            0x2060: [qualifier],
            0x2118: _words(amplifier.tare),
            0x3300: _words(gross) + _words(net) + [qualifier],
            0x3500: gross_f + net_f + [qualifier],
        }
        return blocks | {place: _words(get()) for place, (get, _, _) in self._settings.items()}

    # -- writing -------------------------------------------------------------------------------------------------

    def write_registers(self, address: int, values: list[int], at_s: float) -> None:
        """Settings (two registers each), bit commands (2061), save (2066, accepted)."""
        if address == 0x2061 and len(values) == 1:
            self._bit_command(values[0], at_s)
        elif address in (0x2062, 0x2066) and len(values) == 1:
            return
        elif address in self._settings and len(values) == 2:
            _, put, allowed = self._settings[address]
            value = struct.unpack(">i", struct.pack(">HH", *values))[0]
            if value not in allowed:
                raise Refusal(ILLEGAL_VALUE)
            put(value)
        else:
            raise Refusal(ILLEGAL_ADDRESS)

    def _bit_command(self, command: int, at_s: float) -> None:
        amplifier = self.amplifier
        if command == 0x01:
            amplifier.reset_zero()
        elif command == 0x02:
            done = amplifier.set_zero(at_s)
            if not done:
                raise Refusal(DEVICE_FAILURE)
        elif command == 0x04:
            amplifier.reset_tare()
        elif command == 0x08:
            done = amplifier.set_tare(at_s)
            if not done:
                raise Refusal(DEVICE_FAILURE)
        elif command == 0x10:
            amplifier.peak = amplifier.valley = amplifier.gross(at_s)
        elif command == 0x20:
            amplifier.held = amplifier.gross(at_s)
        else:
            raise Refusal(ILLEGAL_VALUE)

    def _setting_table(self) -> dict[int, tuple[Callable[[], int], Callable[[int], None], range]]:
        amplifier = self.amplifier

        def attribute(name: str, allowed: range) -> tuple[Callable[[], int], Callable[[int], None], range]:
            return (lambda: int(getattr(amplifier, name))), (lambda value: setattr(amplifier, name, value)), allowed

        return {
            0x2106: (lambda: amplifier.filter_level, lambda v: amplifier.set_filter(level=v), range(8)),
            0x2110: (lambda: int(amplifier.fir), lambda v: amplifier.set_filter(fir=bool(v)), range(2)),
            0x2112: attribute("no_motion_counts", range(1, 65536)),
            0x2114: attribute("no_motion_ms", range(1, 65536)),
            0x220C: attribute("max_counts", range(1, 1_000_000)),
            0x220E: attribute("min_counts", range(-999_999, 1)),
            0x2214: (lambda: amplifier.decimals, amplifier.set_decimals, range(6)),
            0x2216: attribute("step", range(1, 501)),
        }

    def power_up(self, at_s: float) -> None:
        """The device starts anew: without tare and zero."""
        self.amplifier.reset_tare()
        self.amplifier.reset_zero()

    def read_bits(self, address: int, count: int, at_s: float) -> list[bool]:
        """There are no bits."""
        raise Refusal(ILLEGAL_ADDRESS)

    def write_bit(self, address: int, value: bool, at_s: float) -> None:
        """There are no bits."""
        raise Refusal(ILLEGAL_ADDRESS)
