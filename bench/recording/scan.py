"""The records of an MCAP file, whatever happened to it.

A whole file is walked from its first record to the end of its data, with every checksum looked at. Where a record is
damaged, the walk goes on at the next place that is known to be good: the index tells it, if the file was finished,
else the next chunk is searched by its own form and proven by its checksum. A file that ends early is read to its last
whole record. What had to be passed over is kept in `damage`.
"""

from __future__ import annotations

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass, field

from mcap.opcode import Opcode
from mcap.records import Header

from bench.recording.records import (
    MAGIC,
    RECORD,
    Block,
    Buffer,
    Damaged,
    Found,
    Index,
    find_chunk,
    name_of,
    parse,
    read_index,
)

_LAST_KNOWN_OPCODE = int(Opcode.DATA_END)
_FIRST_PRIVATE_OPCODE = 0x80
_DATA_END_SIZE = 4


@dataclass(frozen=True)
class Damage:
    """Bytes that could not be read."""

    offset: int
    size: int
    what: str
    content: bool = True
    """False where the index proves that no message, record or attachment stood there."""

    def __str__(self) -> str:
        return f"{self.what} ({self.size} bytes from byte {self.offset} on)"


@dataclass
class Scan:
    """One pass over the bytes of a file; everything but `data` is complete when `records` has ended."""

    data: Buffer
    damage: list[Damage] = field(default_factory=list)
    finished: bool = False
    """The writer came to the end of its data."""
    indexed: bool = False
    """There is an index that matches its checksum: other readers open the file."""
    header: Header | None = None
    """Known as soon as the first record has come; not among the records."""

    def records(self) -> Iterator[Found]:
        """What the file holds, in order; schemas and channels come again wherever the file repeats them."""
        index = read_index(self.data)
        self.indexed = index is not None
        position = len(MAGIC) if self.data[: len(MAGIC)] == MAGIC else 0
        with contextlib.suppress(Damaged):
            opcode, end = self._frame(position, index)
            header = parse(opcode, self.data[position + RECORD.size : end])
            if isinstance(header, Header):
                self.header, position = header, end
        if index is not None:
            yield from index.definitions
        size = len(self.data)
        while position < size:
            try:
                opcode, end = self._frame(position, index)
                if opcode == Opcode.DATA_END and end - position == RECORD.size + _DATA_END_SIZE:
                    self.finished = True
                    return
                found = parse(opcode, self.data[position + RECORD.size : end])
            except Damaged as damaged:
                if damaged.whole:
                    self.damage.append(Damage(position, end - position, str(damaged)))
                    position = end
                    continue
                position, found = self._resume(position, index, str(damaged))
                if index is not None and position >= index.summary:
                    self.finished = True
                    return
                if found is None:
                    continue
                end = position
            if found is not None:
                yield found
            position = end

    def _frame(self, position: int, index: Index | None) -> tuple[int, int]:
        """Kind and end of the record at `position`; the index knows better than the record's own head."""
        if index is not None and position in index.known:
            opcode, length = index.known[position]
            return opcode, position + length
        if len(self.data) - position < RECORD.size:
            raise Damaged("the file ends within a record", whole=False)
        opcode, length = RECORD.unpack_from(self.data, position)
        end: int = position + RECORD.size + length
        if opcode == 0 or _LAST_KNOWN_OPCODE < opcode < _FIRST_PRIVATE_OPCODE:
            raise Damaged("no record begins here", whole=False)
        if end > len(self.data):
            raise Damaged(f"{name_of(opcode)} is cut off", whole=False)
        if index is not None and index.next_after(position) < end:
            raise Damaged(f"{name_of(opcode)} has a damaged length", whole=False)
        return opcode, end

    def _resume(self, position: int, index: Index | None, what: str) -> tuple[int, Block | None]:
        """Where the walk goes on after trouble at `position`, and the chunk found on the way; notes what is lost."""
        if index is not None:
            resume = index.next_after(position)
            content = position in index.known or not index.has_chunks
            self.damage.append(Damage(position, resume - position, what, content))
            return resume, None
        found = find_chunk(self.data, position)
        begin, end, block = found if found is not None else (len(self.data), len(self.data), None)
        if begin > position:
            self.damage.append(Damage(position, begin - position, what))
        return end, block
