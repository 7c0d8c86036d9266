"""Single MCAP records, taken from bytes that may be damaged: what they hold, or that they cannot be believed.

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
from typing import Any, cast

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import Attachment, Channel, Chunk, ChunkIndex, Header, Metadata, Schema
from mcap.stream_reader import get_chunk_data_stream
from mcap.writer import MCAP0_MAGIC

MAGIC: bytes = MCAP0_MAGIC
Buffer = bytes | mmap.mmap

RECORD = struct.Struct("<BQ")
"""Opcode and length of the content."""

_MESSAGE = struct.Struct("<BQHIQQ")
_CHUNK = struct.Struct("<QQQII")
"""Start time, end time, uncompressed size, uncompressed CRC, length of the compression's name."""

_FOOTER_SIZE = 20
_SIGNATURES = (b"\x04\x00\x00\x00zstd", b"\x03\x00\x00\x00lz4")
"""How the compression stands in a chunk: the pattern that a search for chunks looks for."""

_MAX_UNCOMPRESSED = 1 << 31


@dataclass(frozen=True)
class Block:
    """Content of one chunk (or one message outside of chunks): records one after the other, checked."""

    data: bytes


Found = Header | Schema | Channel | Metadata | Attachment | Block


class Damaged(Exception):
    """A record that is not what was written; `whole`: its length can be believed all the same."""

    def __init__(self, what: str, *, whole: bool) -> None:
        super().__init__(what)
        self.whole = whole


def name_of(opcode: int) -> str:
    """A kind of record in words."""
    try:
        return f"a {Opcode(opcode).name.lower().replace('_', ' ')}"
    except ValueError:
        return f"a record of kind {opcode}"


def parse(opcode: int, body: bytes) -> Found | None:
    """A record's content, checked as far as the format allows; None for those that only repeat others.

    Raises `Damaged`.
    """
    if opcode == Opcode.CHUNK:
        return _chunk(body)
    if opcode == Opcode.MESSAGE:
        return Block(RECORD.pack(opcode, len(body)) + body)
    if opcode == Opcode.MESSAGE_INDEX:
        if len(body) < 6 or struct.unpack_from("<I", body, 2)[0] != len(body) - 6:
            raise Damaged("a message index has a damaged length", whole=False)
        return None
    kind = _KINDS.get(opcode)
    if kind is None:
        return None
    try:
        stream = ReadDataStream(BytesIO(body))
        found = kind.read(stream)
    except Exception as error:  # the library meets damaged bytes with whatever its parts raise
        raise Damaged(f"{name_of(opcode)} is damaged", whole=False) from error
    if stream.count != len(body):
        raise Damaged(f"{name_of(opcode)} has a damaged length", whole=False)
    if isinstance(found, Attachment):
        (crc,) = struct.unpack("<I", body[-4:])
        if crc and zlib.crc32(body[:-4]) != crc:
            raise Damaged(f"attachment {found.name!r} does not match its checksum", whole=True)
    return cast(Found, found)


_KINDS: dict[int, Any] = {
    Opcode.HEADER: Header,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.METADATA: Metadata,
    Opcode.ATTACHMENT: Attachment,
}


def _chunk(body: bytes) -> Block:
    try:
        _, _, plain_size, crc, name_size = _CHUNK.unpack_from(body)
        name = body[_CHUNK.size : _CHUNK.size + name_size]
        (data_size,) = struct.unpack_from("<Q", body, _CHUNK.size + name_size)
    except struct.error:
        raise Damaged("a chunk has a damaged head", whole=False) from None
    begin = _CHUNK.size + name_size + 8
    if begin + data_size != len(body):
        raise Damaged("a chunk has a damaged head", whole=False)
    plain = _inflate(name, body[begin:], plain_size, crc)
    if plain is None:
        raise Damaged("a chunk does not match its checksum", whole=True)
    return Block(plain)


def _inflate(name: bytes, data: bytes, plain_size: int, crc: int) -> bytes | None:
    """A chunk's records, or None where they are not what was written."""
    if plain_size > _MAX_UNCOMPRESSED or name not in (b"zstd", b"lz4", b""):
        return None
    chunk = Chunk(name.decode(), data, 0, 0, crc, plain_size)
    try:
        stream, size = get_chunk_data_stream(chunk, validate_crc=True)
        plain: bytes = stream.read(size)
    except Exception:  # each compression has errors of its own, a wrong checksum is a ValueError
        return None
    return plain if len(plain) == plain_size and (crc or _well_formed(plain)) else None


def _well_formed(plain: bytes) -> bool:
    """Whether records fill a chunk exactly; asked where the writer left no checksum."""
    position = 0
    while position + RECORD.size <= len(plain):
        opcode, length = RECORD.unpack_from(plain, position)
        if opcode == Opcode.MESSAGE and length < _MESSAGE.size - RECORD.size:
            return False
        position += RECORD.size + length
    return position == len(plain)


def messages(block: Block) -> Iterator[tuple[int, int, int, int, bytes]]:
    """Channel id, sequence, log time, publish time (ns) and data of each message in a block."""
    data = block.data
    position, last = 0, len(data) - _MESSAGE.size
    unpack, head, message = _MESSAGE.unpack_from, _MESSAGE.size, int(Opcode.MESSAGE)
    while position <= last:
        opcode, length, channel_id, sequence, log_ns, publish_ns = unpack(data, position)
        end = position + 9 + length
        if opcode == message:
            yield channel_id, sequence, log_ns, publish_ns, data[position + head : end]
        position = end


def definitions(block: Block) -> Iterator[Schema | Channel]:
    """Schemas and channels inside a block."""
    data = block.data
    position = 0
    while position + RECORD.size <= len(data):
        opcode, length = RECORD.unpack_from(data, position)
        end = position + RECORD.size + length
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            found = parse(opcode, data[position + RECORD.size : end])
            assert isinstance(found, Schema | Channel)
            yield found
        position = end


@dataclass
class Index:
    """What a finished file's summary says: offset → (opcode, length of the record), schemas and channels."""

    summary: int
    known: dict[int, tuple[int, int]] = field(default_factory=dict)
    definitions: list[Schema | Channel] = field(default_factory=list)
    order: list[int] = field(default_factory=list)

    @property
    def has_chunks(self) -> bool:
        """Messages stand in chunks, and the index knows them."""
        return any(opcode == Opcode.CHUNK for opcode, _ in self.known.values())

    def next_after(self, position: int) -> int:
        """The next record that is known to begin behind `position`; the summary after the last."""
        at = bisect_right(self.order, position)
        return self.order[at] if at < len(self.order) else self.summary


def read_index(data: Buffer) -> Index | None:
    """The index at the end of a file; None where none can be trusted (no footer, no checksum or a wrong one)."""
    foot = len(data) - len(MAGIC) - _FOOTER_SIZE - RECORD.size
    if foot < len(MAGIC) or data[len(data) - len(MAGIC) :] != MAGIC:
        return None
    opcode, length, summary, _, crc = struct.unpack_from("<BQQQI", data, foot)
    if opcode != Opcode.FOOTER or length != _FOOTER_SIZE or not len(MAGIC) <= summary < foot:
        return None
    if crc == 0 or zlib.crc32(data[summary : foot + RECORD.size + 16]) != crc:
        return None
    index = Index(summary)
    position = summary
    while position < foot:
        opcode, length = RECORD.unpack_from(data, position)
        end = position + RECORD.size + length
        body = data[position + RECORD.size : end]
        stream = ReadDataStream(BytesIO(body))
        if opcode == Opcode.CHUNK_INDEX:
            chunk = ChunkIndex.read(stream)
            index.known[chunk.chunk_start_offset] = (int(Opcode.CHUNK), chunk.chunk_length)
        elif opcode in (Opcode.METADATA_INDEX, Opcode.ATTACHMENT_INDEX):
            kind = Opcode.METADATA if opcode == Opcode.METADATA_INDEX else Opcode.ATTACHMENT
            offset, size = stream.read8(), stream.read8()
            index.known[offset] = (int(kind), size)
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            found = parse(opcode, body)
            assert isinstance(found, Schema | Channel)
            index.definitions.append(found)
        position = end
    index.order = sorted(index.known)
    return index


def find_chunk(data: Buffer, start: int) -> tuple[int, int, Block] | None:
    """Begin, end and content of the next chunk from `start` on that matches its checksum; None where there is none.

    A chunk is known by the name of its compression and the sizes around it, so that damage to its own opcode or
    length does not hide it.
    """
    best: tuple[int, int, Block] | None = None
    for signature in _SIGNATURES:
        at = data.find(signature, start)
        while at >= 0 and (best is None or at < best[0]):
            begin = at - (_CHUNK.size - 4) - RECORD.size
            if begin >= start:
                found = _chunk_around(data, at, signature)
                if found is not None:
                    best = (begin, *found)
                    break
            at = data.find(signature, at + 1)
    return best


def _chunk_around(data: Buffer, at: int, signature: bytes) -> tuple[int, Block] | None:
    size_at = at + len(signature)
    if size_at + 8 > len(data):
        return None
    _, _, plain_size, crc, _ = _CHUNK.unpack_from(data, at - (_CHUNK.size - 4))
    (data_size,) = struct.unpack_from("<Q", data, size_at)
    begin, end = size_at + 8, size_at + 8 + data_size
    if end > len(data):
        return None
    plain = _inflate(signature[4:], data[begin:end], plain_size, crc)
    return None if plain is None else (end, Block(plain))
