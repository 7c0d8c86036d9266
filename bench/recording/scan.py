"""The records of an MCAP file, whatever happened to it.

A whole file is walked from the first record to the footer, with every checksum looked at. Where a record is damaged,
the walk goes on at the next place that is known to be good: the index tells it, if the file was finished, else the
next chunk is searched by its own form and proven by its checksum. A file that ends early is read to its last whole
record. What had to be passed over is kept in `damage`.

Format: https://mcap.dev/spec (opcodes, records, chunk layout).
"""

from __future__ import annotations

import mmap
import struct
import zlib
from bisect import bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO

import lz4.frame
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, ChunkIndex, Header, Metadata, Schema
from mcap.writer import MCAP0_MAGIC as MAGIC

Buffer = bytes | mmap.mmap

_RECORD = struct.Struct("<BQ")
_CHUNK = struct.Struct("<QQQII")
"""Start time, end time, uncompressed size, uncompressed CRC, length of the compression's name."""

_FOOTER_SIZE = 20
_MAX_KNOWN_OPCODE = int(Opcode.DATA_END)
_FIRST_PRIVATE_OPCODE = 0x80
_SIGNATURES = (b"\x04\x00\x00\x00zstd", b"\x03\x00\x00\x00lz4")
"""How the compression stands in a chunk: the pattern that a search for chunks looks for."""

_MAX_UNCOMPRESSED = 1 << 31
_UNREADABLE = (ValueError, McapError, struct.error, zstandard.ZstdError, RuntimeError, MemoryError)
"""What the decoders raise over bytes that are not theirs (`RuntimeError` is LZ4's)."""


@dataclass(frozen=True)
class Block:
    """Content of one chunk (or one message outside of chunks): records one after the other, checked."""

    data: bytes


@dataclass(frozen=True)
class Damage:
    """Bytes that could not be read."""

    offset: int
    size: int
    what: str

    def __str__(self) -> str:
        return f"{self.what} ({self.size} bytes at byte {self.offset})"


Found = Header | Schema | Channel | Metadata | Attachment | Block


class _Damaged(Exception):
    """A record that cannot be what it says; `whole`: its length can be trusted all the same."""

    def __init__(self, what: str, *, whole: bool) -> None:
        super().__init__(what)
        self.whole = whole


@dataclass
class Scan:
    """One pass over the bytes of a file; `damage`, `finished` and `chunks` are complete when `records` has ended."""

    data: Buffer
    damage: list[Damage] = field(default_factory=list)
    finished: bool = False
    """The footer is there: the writer closed the file in order."""
    chunks: int = 0

    def records(self) -> Iterator[Found]:
        """What the file holds, in order, without what the index repeats."""
        index = _read_index(self.data)
        position = len(MAGIC) if self.data[: len(MAGIC)] == MAGIC else self._resume(0, index, "no MCAP magic")
        size = len(self.data)
        while position < size:
            if size - position < _RECORD.size:
                self._lose(position, size, "the file ends within a record")
                return
            opcode, length = _RECORD.unpack_from(self.data, position)
            end = position + _RECORD.size + length
            if opcode == Opcode.FOOTER and length == _FOOTER_SIZE:
                self.finished = self.data[end : end + len(MAGIC)] == MAGIC
                if not self.finished:
                    self._lose(position, size, "the file ends within its footer")
                return
            if opcode == Opcode.DATA_END and end <= size and index is not None:
                position = index.summary
                continue
            try:
                self._check_frame(opcode, position, end, index)
                found = _parse(opcode, self.data[position + _RECORD.size : end])
            except _Damaged as problem:
                if problem.whole and end <= size:
                    self._lose(position, end, str(problem))
                    position = end
                else:
                    position = self._resume(position, index, str(problem))
                continue
            if isinstance(found, Block) and opcode == Opcode.CHUNK:
                self.chunks += 1
            if found is not None:
                yield found
            position = end

    # -- inside ------------------------------------------------------------------------------------------------

    def _check_frame(self, opcode: int, position: int, end: int, index: _Index | None) -> None:
        """Whether a record can begin at `position` and stop before `end`."""
        if opcode == 0 or _MAX_KNOWN_OPCODE < opcode < _FIRST_PRIVATE_OPCODE:
            raise _Damaged("no record begins here", whole=False)
        if end > len(self.data):
            raise _Damaged(f"{_name(opcode)} is not complete", whole=False)
        if index is None or position >= index.summary:
            return
        known = index.known.get(position)
        if known is not None and known != (opcode, end - position):
            raise _Damaged(f"{_name(known[0])} has a damaged head", whole=False)
        if known is None and index.next_after(position) < end:
            raise _Damaged(f"{_name(opcode)} has a damaged length", whole=False)

    def _resume(self, position: int, index: _Index | None, what: str) -> int:
        """Where the walk goes on after trouble at `position`; the bytes between are lost."""
        resume = index.next_after(position) if index is not None else _find_chunk(self.data, position)
        if resume > position:
            self._lose(position, resume, what)
        return resume

    def _lose(self, start: int, end: int, what: str) -> None:
        self.damage.append(Damage(start, end - start, what))


def messages(block: Block) -> Iterator[tuple[int, int, int, int, bytes]]:
    """Channel id, sequence, log time, publish time (ns) and data of each message in a block."""
    data = block.data
    size = len(data)
    position = 0
    unpack, head = _MESSAGE.unpack_from, _MESSAGE.size
    while position + head <= size:
        opcode, length, channel_id, sequence, log_ns, publish_ns = unpack(data, position)
        end = position + 9 + length
        if opcode == 5:  # Opcode.MESSAGE
            yield channel_id, sequence, log_ns, publish_ns, data[position + head : end]
        position = end


_MESSAGE = struct.Struct("<BQHIQQ")


def definitions(block: Block) -> Iterator[Schema | Channel]:
    """Schemas and channels inside a block (before the first message, in files of ours)."""
    data = block.data
    position = 0
    while position + _RECORD.size <= len(data):
        opcode, length = _RECORD.unpack_from(data, position)
        end = position + _RECORD.size + length
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            found = _parse(opcode, data[position + _RECORD.size : end])
            assert isinstance(found, Schema | Channel)
            yield found
        position = end


# -- single records --------------------------------------------------------------------------------------------------


def _parse(opcode: int, body: bytes) -> Found | None:
    """A record's content, checked as far as the format allows; None for those that only repeat others."""
    try:
        if opcode == Opcode.CHUNK:
            return _chunk(body)
        if opcode == Opcode.MESSAGE:
            return Block(_RECORD.pack(opcode, len(body)) + body)
        if opcode == Opcode.ATTACHMENT:
            return _attachment(body)
        if opcode == Opcode.MESSAGE_INDEX:
            if len(body) < 6 or struct.unpack_from("<I", body, 2)[0] != len(body) - 6:
                raise _Damaged("an index has a damaged length", whole=False)
            return None
        kind = {
            Opcode.HEADER: Header,
            Opcode.SCHEMA: Schema,
            Opcode.CHANNEL: Channel,
            Opcode.METADATA: Metadata,
        }.get(opcode)
        if kind is None:
            return None
        stream = ReadDataStream(BytesIO(body))
        found: Found = kind.read(stream)
    except _UNREADABLE as error:
        raise _Damaged(f"{_name(opcode)} is damaged", whole=False) from error
    if stream.count != len(body):
        raise _Damaged(f"{_name(opcode)} has a damaged length", whole=False)
    return found


def _chunk(body: bytes) -> Block:
    start_size = _CHUNK.size
    _, _, plain_size, crc, name_size = _CHUNK.unpack_from(body)
    name = body[start_size : start_size + name_size]
    (data_size,) = struct.unpack_from("<Q", body, start_size + name_size)
    begin = start_size + name_size + 8
    if begin + data_size != len(body):
        raise _Damaged("a chunk has a damaged head", whole=False)
    plain = _inflate(name, body[begin:], plain_size, crc)
    if plain is None:
        raise _Damaged("a chunk does not match its checksum", whole=True)
    return Block(plain)


def _inflate(name: bytes, data: bytes, plain_size: int, crc: int) -> bytes | None:
    """A chunk's records, or None where they are not what was written."""
    if plain_size > _MAX_UNCOMPRESSED:
        return None
    try:
        if name == b"zstd":
            plain = zstandard.decompress(data, plain_size)
        elif name == b"lz4":
            plain = lz4.frame.decompress(data)
        elif name == b"":
            plain = data
        else:
            return None
    except _UNREADABLE:
        return None
    if len(plain) != plain_size or (crc and zlib.crc32(plain) != crc) or not _well_formed(plain):
        return None
    return plain


def _well_formed(plain: bytes) -> bool:
    """Whether records fill a chunk exactly (a checksum of 0 means that there is none)."""
    position, size = 0, len(plain)
    unpack = _RECORD.unpack_from
    while position + 9 <= size:
        opcode, length = unpack(plain, position)
        if opcode == 5 and length < 22:
            return False
        position += 9 + length
    return position == size


def _attachment(body: bytes) -> Attachment:
    stream = ReadDataStream(BytesIO(body))
    found: Attachment = Attachment.read(stream)
    if stream.count != len(body):
        raise _Damaged("an attachment has a damaged length", whole=False)
    (crc,) = struct.unpack("<I", body[-4:])
    if crc and zlib.crc32(body[:-4]) != crc:
        raise _Damaged(f"attachment {found.name!r} does not match its checksum", whole=True)
    return found


def _name(opcode: int) -> str:
    try:
        return f"a {Opcode(opcode).name.lower().replace('_', ' ')}"
    except ValueError:
        return f"a record of kind {opcode}"


# -- finding the way again -------------------------------------------------------------------------------------------


@dataclass
class _Index:
    """What a finished file's summary says about the data section: offset → (opcode, length of the record)."""

    known: dict[int, tuple[int, int]]
    summary: int
    order: list[int] = field(default_factory=list)

    def next_after(self, position: int) -> int:
        """The next record that is known to begin behind `position`; the summary after the last."""
        at = bisect_right(self.order, position)
        return self.order[at] if at < len(self.order) else self.summary


def _read_index(data: Buffer) -> _Index | None:
    """The index at the end of a file, or None where there is none that can be trusted (no footer, wrong checksum)."""
    foot = len(data) - len(MAGIC) - _FOOTER_SIZE - _RECORD.size
    if foot < len(MAGIC) or data[len(data) - len(MAGIC) :] != MAGIC:
        return None
    opcode, length, summary, _, crc = struct.unpack_from("<BQQQI", data, foot)
    if opcode != Opcode.FOOTER or length != _FOOTER_SIZE or not len(MAGIC) <= summary < foot:
        return None
    if crc == 0 or zlib.crc32(data[summary : foot + _RECORD.size + 16]) != crc:
        return None
    index = _Index({}, summary)
    position = summary
    while position < foot:
        opcode, length = _RECORD.unpack_from(data, position)
        end = position + _RECORD.size + length
        body = ReadDataStream(BytesIO(data[position + _RECORD.size : end]))
        if opcode == Opcode.CHUNK_INDEX:
            chunk = ChunkIndex.read(body)
            index.known[chunk.chunk_start_offset] = (int(Opcode.CHUNK), chunk.chunk_length)
        elif opcode in (Opcode.METADATA_INDEX, Opcode.ATTACHMENT_INDEX):
            kind = Opcode.METADATA if opcode == Opcode.METADATA_INDEX else Opcode.ATTACHMENT
            offset, size = body.read8(), body.read8()
            index.known[offset] = (int(kind), size)
        position = end
    index.order = sorted(index.known)
    return index


def _find_chunk(data: Buffer, start: int) -> int:
    """The next place from `start` on where a chunk begins that matches its checksum; the end of the data, if none."""
    best = len(data)
    for signature in _SIGNATURES:
        at = data.find(signature, start)
        while 0 <= at < best:
            begin = at - (_CHUNK.size - 4) - _RECORD.size
            if begin > start and _chunk_at(data, at, signature):
                best = begin
            at = data.find(signature, at + 1)
    return best


def _chunk_at(data: Buffer, at: int, signature: bytes) -> bool:
    """Whether a whole chunk stands around the signature found at `at`."""
    size_at = at + len(signature)
    if size_at + 8 > len(data):
        return False
    _, _, plain_size, crc, _ = _CHUNK.unpack_from(data, at - (_CHUNK.size - 4))
    (data_size,) = struct.unpack_from("<Q", data, size_at)
    begin = size_at + 8
    if begin + data_size > len(data):
        return False
    return _inflate(signature[4:], data[begin : begin + data_size], plain_size, crc) is not None
