"""Numbers in 16-bit registers: types, word order, scale and unit."""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from typing import Literal

NumberType = Literal["u16", "i16", "u32", "i32", "f32"]
WordOrder = Literal["high_first", "low_first"]

WORDS: dict[NumberType, int] = {"u16": 1, "i16": 1, "u32": 2, "i32": 2, "f32": 2}
"""Registers that a number of each type takes."""

_FORMATS: dict[NumberType, str] = {"u16": ">H", "i16": ">h", "u32": ">I", "i32": ">i", "f32": ">f"}
_RANGES: dict[NumberType, tuple[int, int]] = {
    "u16": (0, 0xFFFF),
    "i16": (-0x8000, 0x7FFF),
    "u32": (0, 0xFFFF_FFFF),
    "i32": (-0x8000_0000, 0x7FFF_FFFF),
}

UNITS: dict[str, float] = {
    "": 1.0,
    "um": 1e-3,
    "mm": 1.0,
    "m": 1e3,
    "um/s": 1e-3,
    "mm/s": 1.0,
    "m/s": 1e3,
    "mm/s2": 1.0,
    "m/s2": 1e3,
    "G": 9806.65,
    "mN": 1e-3,
    "N": 1.0,
    "kN": 1e3,
    "g": 9.80665e-3,
    "kg": 9.80665,
    "ms": 1e-3,
    "s": 1.0,
    "%": 1.0,
}
"""What one unit is in mm, mm/s, mm/s², N or s (`G`: standard gravity as an acceleration; `g`, `kg`: its force)."""


def decode(words: Sequence[int], kind: NumberType, order: WordOrder) -> int | float:
    """The number in one or two registers (in the order of their addresses); within a word the high byte is first."""
    if len(words) == 2 and order == "low_first":
        words = (words[1], words[0])
    number: int | float = struct.unpack(_FORMATS[kind], struct.pack(f">{len(words)}H", *words))[0]
    return number


def encode(number: float, kind: NumberType, order: WordOrder) -> list[int]:
    """A number as registers; integers are rounded. Raises `ValueError` where it does not fit or is not finite."""
    if not math.isfinite(number):
        raise ValueError(f"{number} cannot be written to a register")
    if kind == "f32":
        packed = struct.pack(">f", number)
    else:
        whole = round(number)
        low, high = _RANGES[kind]
        if not low <= whole <= high:
            raise ValueError(f"{whole} does not fit into a register value of type {kind}")
        packed = struct.pack(_FORMATS[kind], whole)
    words = list(struct.unpack(f">{len(packed) // 2}H", packed))
    return words[::-1] if order == "low_first" else words
