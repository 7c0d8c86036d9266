"""Where an MCAP file goes on behind damage: the next record that can be believed."""

from __future__ import annotations

import re
from dataclasses import dataclass

from mcap.opcode import Opcode

from bench.recording.records import CHUNK_HEAD, RECORD, Block, Buffer, Damaged, inflate, parse

_ZSTD, _LZ4 = b"\x04\x00\x00\x00zstd", b"\x03\x00\x00\x00lz4"
"""How the compression stands in a chunk: it is found by this where its own head is damaged."""

_CANDIDATE = re.compile(
    b"[\x03\x04\x06\x08-\x0f](?=[\x00-\xff]{4}\x00{4})|" + re.escape(_ZSTD) + b"|" + re.escape(_LZ4), re.DOTALL
)
"""The opcode of a record of under 4 GB that stands by itself, or a chunk's compression."""

_PATIENCE = 50
"""So many times the file's size may be looked at in candidates that turn out to be none: a file made to have many of
them would take for ever."""

_PATIENCE_BYTES = 1 << 28


@dataclass(frozen=True)
class Resumed:
    """The walk goes on at `position`; `block` is a chunk that ends there and began at `begin`, if one was found so."""

    begin: int
    position: int
    block: Block | None = None


class Search:
    """Looks for records in the bytes of one file; `strict`: see `records.parse`."""

    def __init__(self, data: Buffer, *, strict: bool = False) -> None:
        self._data = data
        self._strict = strict
        self._left = _PATIENCE * len(data) + _PATIENCE_BYTES

    def after(self, position: int) -> Resumed | None:
        """The next whole record behind the one at `position` that is damaged (of which the content may be whole)."""
        at = position
        while self._left > 0:
            match = _CANDIDATE.search(self._data, at)
            if match is None:
                return None
            at = match.start() + 1
            if match.end() - match.start() > 1:
                found = self._chunk_around(match.start(), match.group(), position)
            else:
                found = self._record_at(match.start()) if match.start() > position else None
            if found is not None:
                return found
        return None

    def _record_at(self, position: int) -> Resumed | None:
        data = self._data
        if position + RECORD.size > len(data):
            return None
        opcode, length = RECORD.unpack_from(data, position)
        begin, end = position + RECORD.size, position + RECORD.size + length
        if end > len(data) or (opcode == Opcode.DATA_END and length != 4):
            return None
        self._left -= length
        try:
            parse(opcode, data[begin:end], strict=self._strict)
        except Damaged:
            return None
        return Resumed(position, position)

    def _chunk_around(self, at: int, signature: bytes, start: int) -> Resumed | None:
        data = self._data
        begin = at - (CHUNK_HEAD.size - 4) - RECORD.size
        size_at = at + len(signature)
        if begin < start or size_at + 8 > len(data):
            return None
        _, length = RECORD.unpack_from(data, begin)
        _, _, plain_size, crc, _ = CHUNK_HEAD.unpack_from(data, begin + RECORD.size)
        first = size_at + 8
        # The chunk's size stands in it twice: either may be the one that is damaged.
        ends = {first + int.from_bytes(data[size_at:first], "little"), begin + RECORD.size + length}
        for end in sorted(ends):
            if not first <= end <= len(data):
                continue
            self._left -= end - first
            plain = inflate(signature[4:], data[first:end], plain_size, crc, strict=self._strict)
            if plain is not None:
                return Resumed(begin, end, Block(plain))
        return None
