"""The records of an MCAP file, whatever happened to it.

A whole file is walked from its first record to the end of its data, with every checksum looked at. Where a record is
damaged, the walk goes on at the next place that is known to be good: the index tells it, if the file was finished,
else the next record is searched by its own form, and proven by its checksum or by its parts (`search`). A file that
ends early is read to its last whole record. What had to be passed over is kept in `damage`.
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
    name_of,
    parse,
    read_index,
)
from bench.recording.schemas import LIBRARY
from bench.recording.search import Search

_LAST_KNOWN_OPCODE = int(Opcode.DATA_END)
_FIRST_PRIVATE_OPCODE = 0x80
_DATA_END_SIZE = 4
_CHECKSUMMED = (Opcode.CHUNK, Opcode.ATTACHMENT)


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
        search = Search(self.data, strict=self.ours)
        if index is not None:
            yield from index.definitions
        size = len(self.data)
        while position < size:
            if size - position == len(MAGIC) and self.data[position:] == MAGIC:
                self.finished = True
                return
            try:
                opcode, end = self._frame(position, index)
                if opcode == Opcode.DATA_END and end - position == RECORD.size + _DATA_END_SIZE:
                    self.finished = True
                    return
                found = parse(opcode, self.data[position + RECORD.size : end], strict=self.ours)
                if index is None and opcode not in _CHECKSUMMED:
                    self._must_end(position, opcode, end, search)
            except Damaged as damaged:
                if damaged.whole:
                    if index is None:  # bytes may be missing in it, and its length reach too far
                        behind = search.after(position)
                        end = min(end, behind.begin) if behind is not None and behind.begin > position else end
                    self.damage.append(Damage(position, end - position, str(damaged)))
                    position = end
                    continue
                position, found = self._resume(position, index, search, str(damaged))
                if index is not None and position >= index.summary:
                    self.finished = True
                    return
                if found is None:
                    continue
                end = position
            if found is not None:
                yield found
            position = end

    @property
    def ours(self) -> bool:
        """Written by padbench, or by nobody knows whom."""
        return self.header is None or self.header.library.startswith(LIBRARY)

    def _frame(self, position: int, index: Index | None) -> tuple[int, int]:
        """Kind and end of the record at `position`; the index knows better than the record's own head."""
        told = index.at(position) if index is not None else None
        if told is not None:
            return told[0], position + told[1]
        if len(self.data) - position < RECORD.size:
            raise Damaged("the file ends within a record", whole=False)
        opcode, length = RECORD.unpack_from(self.data, position)
        end: int = position + RECORD.size + length
        if opcode == 0 or _LAST_KNOWN_OPCODE < opcode < _FIRST_PRIVATE_OPCODE:
            raise Damaged("no record begins here", whole=False)
        if end > len(self.data):
            raise Damaged(f"{name_of(opcode)} is cut off", whole=False)
        if self.ours and (opcode == Opcode.MESSAGE or opcode >= _FIRST_PRIVATE_OPCODE):
            raise Damaged("no record of this writer begins here", whole=False)  # its messages are all in chunks
        if index is not None and index.next_after(position) < end:
            raise Damaged(f"{name_of(opcode)} has a damaged length", whole=False)
        return opcode, end

    def _must_end(self, position: int, opcode: int, end: int, search: Search) -> None:
        """Bytes that were lost inside a record without a checksum make it swallow the head of the next one.

        Where nothing begins behind a record, and a whole one inside it, it is `Damaged`.
        """
        if end == len(self.data) or self.data[end : end + len(MAGIC)] == MAGIC:
            return
        with contextlib.suppress(Damaged):
            self._frame(end, None)
            return
        found = search.after(position)
        if found is not None and found.begin < end:
            raise Damaged(f"{name_of(opcode)} has lost bytes", whole=False)

    def _resume(self, position: int, index: Index | None, search: Search, what: str) -> tuple[int, Block | None]:
        """Where the walk goes on after trouble at `position`, and the chunk found on the way; notes what is lost."""
        if index is not None:
            resume = index.next_after(position)
            content = index.at(position) is not None or not index.has_chunks
            self.damage.append(Damage(position, resume - position, what, content))
            return resume, None
        found = search.after(position)
        if found is None:
            content = self.data[position] != Opcode.MESSAGE_INDEX  # which repeats what the chunk before it holds
            self.damage.append(Damage(position, len(self.data) - position, what, content))
            return len(self.data), None
        if found.begin > position:
            self.damage.append(Damage(position, found.begin - position, what))
        return found.position, found.block
