"""Lines of the DAD 141.1: the combined string with its checksum, cut out of whatever comes.

Format (docs/devices.md 3.1): `W`, signed 6-digit net, signed 6-digit gross, two hex digits of status, two of checksum,
then CR or CR LF. The checksum is the two's complement of the sum of the 17 characters before it (3.1.1); the example
in the DAD 141 manual itself ends in another one, which is why checking can be switched off.
"""

from __future__ import annotations

import re
from dataclasses import dataclass

LINE_SIZE = 19
"""Characters of the combined string, terminator excluded."""

MAX_LINE = 64
"""No line of this device is as long; what is, is noise without an end."""

STATUS_FLAGS = {0: "stable", 1: "zeroed", 2: "tared", 5: "output_0", 6: "output_1", 7: "output_2"}
"""Bits of the two status digits taken as one byte (docs/devices.md 3.1; unused bits left out)."""

_COMBINED = re.compile(rb"W([+-]\d{6})([+-]\d{6})([0-9A-F]{2})([0-9A-F]{2})")
_FLAGS = [tuple(name for bit, name in STATUS_FLAGS.items() if byte >> bit & 1) for byte in range(256)]

FULL_SCALE = 999_999
"""The largest number the display has room for: the amplifier is at the end of its range."""


def checksum(characters: bytes) -> int:
    """Two's complement of the low byte of the sum."""
    return -sum(characters) & 0xFF


@dataclass(frozen=True, slots=True)
class Combined:
    """A combined string: counts of the display (no decimal point), status as words."""

    net: int
    gross: int
    flags: tuple[str, ...]


def parse_combined(line: bytes, *, strict: bool) -> Combined | None:
    """A combined string, or None where the line is none, or (strict) its checksum does not match."""
    match = _COMBINED.fullmatch(line)
    if match is None:
        return None
    if strict and int(match[4], 16) != checksum(line[:17]):
        return None
    return Combined(int(match[1]), int(match[2]), _FLAGS[int(match[3], 16)])


class LineCutter:
    """Cuts a byte stream into lines at CR and LF; empty lines (the LF of CR LF) are dropped."""

    def __init__(self) -> None:
        self._rest = b""

    def feed(self, data: bytes) -> list[tuple[bytes, int]]:
        """Lines completed by the data, each with the number of bytes that came behind its terminator."""
        data = (self._rest + data).replace(b"\n", b"\r")
        lines = []
        start = 0
        while (end := data.find(b"\r", start)) >= 0:
            if end > start:
                lines.append((data[start:end], len(data) - end - 1))
            start = end + 1
        self._rest = data[start:]
        if len(self._rest) > MAX_LINE:
            lines.append((self._rest, 0))
            self._rest = b""
        return lines

    def clear(self) -> None:
        """Forget the beginning of a line."""
        self._rest = b""
