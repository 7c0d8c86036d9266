"""Laumas TLB weight transmitter on Modbus RTU: docs/devices.md 3.3, 7.6.

Weights are whole numbers without their decimal point and without their sign, high word first; signs and errors are bits
of the status register. At most 32 registers a query.

Not documented, and chosen here: three decimals; a reply begins 2 ms after its request, with values taken when that
arrived; register 13 reads 0; of the commands only 99 (save) is taken, all others answer exception 3; set-points are
memory; full scale is the cell's capacity, and a division one count.
"""

from __future__ import annotations

from sim.devices.amplifier import Amplifier
from sim.devices.modbus import ILLEGAL_ADDRESS, ILLEGAL_VALUE, Refusal, RtuServer, standard_functions
from sim.line import Line

REPLY_DELAY_S = 0.002
DECIMALS = 3
MOST_REGISTERS = 32
COMMAND, STATUS, GROSS, NET, PEAK, SETPOINTS, MAP_END = 5, 6, 7, 9, 11, 18, 30
FIRMWARE, INSTRUMENT, YEAR, SERIAL, PROGRAM = 104, 31, 2024, 4711, 0
SAVE = 99
DISPLAY_END = 999_999

MAXIMUM_EXCEEDED, OVER_110_PERCENT, GROSS_BEYOND, NET_BEYOND = 1 << 2, 1 << 3, 1 << 4, 1 << 5
GROSS_NEGATIVE, NET_NEGATIVE, PEAK_NEGATIVE, STABLE, NEAR_ZERO = 1 << 7, 1 << 8, 1 << 9, 1 << 11, 1 << 12


class Laumas:
    """The transmitter; counts have three decimals of the unit that the cell is calibrated in."""

    def __init__(self, line: Line, amplifier: Amplifier, *, address: int = 1) -> None:
        self.amplifier = amplifier
        self.setpoints = [0] * (MAP_END - SETPOINTS)
        # The nominal load: the amplifier's own range ends at 1.5 times the capacity.
        self._full_scale = round(amplifier.max_counts * 10.0 ** (DECIMALS - amplifier.decimals) / 1.5)
        self.server = RtuServer(line, address, standard_functions(self, (3, 6, 16)), lambda pdu: REPLY_DELAY_S)

    def _counts(self, raw: int) -> int:
        return round(raw * 10.0 ** (DECIMALS - self.amplifier.decimals))

    def _registers(self, at_s: float) -> list[int]:
        amplifier = self.amplifier
        raw = amplifier.gross(at_s)
        gross, net, peak = (self._counts(value) for value in (raw, raw - amplifier.tare, amplifier.peak))
        status = (
            (MAXIMUM_EXCEEDED if gross > self._full_scale + 9 else 0)
            | (OVER_110_PERCENT if gross > 1.1 * self._full_scale else 0)
            | (GROSS_BEYOND if abs(gross) > DISPLAY_END else 0)
            | (NET_BEYOND if abs(net) > DISPLAY_END else 0)
            | (GROSS_NEGATIVE if gross < 0 else 0)
            | (NET_NEGATIVE if net < 0 else 0)
            | (PEAK_NEGATIVE if peak < 0 else 0)
            | (STABLE if amplifier.still(at_s) else 0)
            | (NEAR_ZERO if gross == 0 else 0)
        )
        words = [FIRMWARE, INSTRUMENT, YEAR, SERIAL, PROGRAM, 0, status]
        for value in (gross, net, peak):
            words += [abs(value) >> 16 & 0xFFFF, abs(value) & 0xFFFF]
        return [*words, 0, 0, 0, 0, 0, *self.setpoints]

    def read_registers(self, address: int, count: int, at_s: float) -> list[int]:
        """Registers as they are now."""
        if count > MOST_REGISTERS:
            raise Refusal(ILLEGAL_VALUE)
        if address + count > MAP_END:
            raise Refusal(ILLEGAL_ADDRESS)
        return self._registers(at_s)[address : address + count]

    def write_registers(self, address: int, values: list[int], at_s: float) -> None:
        """The command register, or set-points."""
        if address == COMMAND and len(values) == 1:
            if values[0] != SAVE:
                raise Refusal(ILLEGAL_VALUE)
        elif address >= SETPOINTS and address + len(values) <= MAP_END:
            self.setpoints[address - SETPOINTS : address - SETPOINTS + len(values)] = values
        else:
            raise Refusal(ILLEGAL_ADDRESS)

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
