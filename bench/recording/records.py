"""Single MCAP records, taken from bytes that may be damaged: what they hold, or that they cannot be believed.

Format: https://mcap.dev/spec (opcodes, records, chunk layout).
"""

from __future__ import annotations

import mmap
import struct
import zlib
from array import array
from bisect import bisect_left, bisect_right
from collections.abc import Iterator
from dataclasses import dataclass, field
from io import BytesIO
from typing import Any, cast

import lz4.frame  # type: ignore[import-untyped]  # comes with mcap, without types
import numpy as np
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import MCAP0_MAGIC

MAGIC: bytes = MCAP0_MAGIC
Buffer = bytes | mmap.mmap

RECORD = struct.Struct("<BQ")
"""Opcode and length of the content."""

_MESSAGE = struct.Struct("<BQHIQQ")
CHUNK_HEAD = struct.Struct("<QQQII")
"""Start time, end time, uncompressed size, uncompressed CRC, length of the compression's name."""

_CHUNK_INDEX_HEAD = struct.Struct("<QQQQ")
"""Start time, end time, offset and length of the chunk; the rest is not needed here."""

_PLACE = struct.Struct("<QQ")
"""Offset and length of a metadata record or an attachment, at the head of its index."""

_PIECE = 1 << 20
_FOOTER_SIZE = 20
_MAX_UNCOMPRESSED = 1 << 27
"""A chunk that says it is larger is not unpacked: writers make chunks of some megabytes."""


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


def parse(opcode: int, body: bytes, *, strict: bool = False) -> Found | None:
    """A record's content, checked as far as the format allows; None for those that only repeat others.

    `strict`: the writer leaves no checksum out, so that a missing one is damage too. Raises `Damaged`.
    """
    if opcode == Opcode.CHUNK:
        return _chunk(body, strict)
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
    if opcode in _REPEATING:
        return None
    if not getattr(found, "name", getattr(found, "topic", "a header has none")):
        raise Damaged(f"{name_of(opcode)} has no name", whole=False)
    if isinstance(found, Attachment):
        (crc,) = struct.unpack("<I", body[-4:])
        if (crc or strict) and zlib.crc32(body[:-4]) != crc:
            raise Damaged(f"attachment {found.name!r} does not match its checksum", whole=True)
    return cast(Found, found)


_COMPRESSIONS = (b"zstd", b"lz4", b"")

_REPEATING: dict[int, Any] = {
    Opcode.CHUNK_INDEX: ChunkIndex,
    Opcode.ATTACHMENT_INDEX: AttachmentIndex,
    Opcode.METADATA_INDEX: MetadataIndex,
    Opcode.STATISTICS: Statistics,
    Opcode.SUMMARY_OFFSET: SummaryOffset,
    Opcode.FOOTER: Footer,
    Opcode.DATA_END: DataEnd,
}
"""What a finished file says of itself; met on the way only where the end of its data is damaged."""

_KINDS: dict[int, Any] = {
    **_REPEATING,
    Opcode.HEADER: Header,
    Opcode.SCHEMA: Schema,
    Opcode.CHANNEL: Channel,
    Opcode.METADATA: Metadata,
    Opcode.ATTACHMENT: Attachment,
}


def _chunk(body: bytes, strict: bool) -> Block:
    try:
        _, _, plain_size, crc, name_size = CHUNK_HEAD.unpack_from(body)
        name = body[CHUNK_HEAD.size : CHUNK_HEAD.size + name_size]
        (data_size,) = struct.unpack_from("<Q", body, CHUNK_HEAD.size + name_size)
    except struct.error:
        raise Damaged("a chunk has a damaged head", whole=False) from None
    begin = CHUNK_HEAD.size + name_size + 8
    if begin + data_size != len(body):
        raise Damaged("a chunk has a damaged head", whole=False)
    if name not in _COMPRESSIONS:
        raise Damaged(f"a chunk is packed as {name[:20].decode(errors='replace')!r}, which is not known", whole=True)
    if plain_size > _MAX_UNCOMPRESSED:
        raise Damaged(f"a chunk says it unpacks to {plain_size} bytes: more than any writer makes", whole=True)
    plain = inflate(name, body[begin:], plain_size, crc, strict=strict)
    if plain is None:
        raise Damaged("a chunk does not match its checksum", whole=True)
    return Block(plain)


def inflate(name: bytes, data: bytes, plain_size: int, crc: int, *, strict: bool) -> bytes | None:
    """A chunk's records, or None where they are not what was written. Never unpacks to more than a chunk may have."""
    if plain_size > _MAX_UNCOMPRESSED:
        return None
    try:
        plain = _unpacked(name, data, plain_size)
    except Exception:  # each compression has errors of its own
        return None
    if len(plain) != plain_size or ((crc or strict) and zlib.crc32(plain) != crc):
        return None
    return plain if _well_formed(plain) else None


def _unpacked(name: bytes, data: bytes, plain_size: int) -> bytes:
    """At most so many bytes, and nothing behind them: a damaged size must not take the next record along."""
    if name == b"zstd":
        # A frame's own size is what the library makes room for.
        if zstandard.frame_content_size(data) not in (plain_size, -1):
            return b""
        unpack = zstandard.ZstdDecompressor().decompress
        return unpack(data, max_output_size=plain_size, allow_extra_data=False)
    if name == b"lz4":
        frame = lz4.frame.LZ4FrameDecompressor()
        plain: bytes = frame.decompress(data, max_length=plain_size)
        return plain if frame.eof and not frame.unused_data else b""
    return bytes(data) if not name else b""


def _well_formed(plain: bytes) -> bool:
    """Whether records fill a chunk exactly, and definitions are some: a checksum may be missing, or made to fit."""
    position = 0
    while position + RECORD.size <= len(plain):
        opcode, length = RECORD.unpack_from(plain, position)
        if opcode == Opcode.MESSAGE and length < _MESSAGE.size - RECORD.size:
            return False
        end = position + RECORD.size + length
        if end > len(plain):
            return False
        if opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            try:
                parse(opcode, plain[position + RECORD.size : end])
            except Damaged:
                return False
        position = end
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
    """What a finished file's summary says: which record begins where, and how long it is; schemas and channels.

    Plain arrays: a day of recording has two million chunks.
    """

    summary: int
    definitions: list[Schema | Channel] = field(default_factory=list)
    begins: array[int] = field(default_factory=lambda: array("Q"))
    opcodes: array[int] = field(default_factory=lambda: array("B"))
    lengths: array[int] = field(default_factory=lambda: array("Q"))

    def add(self, begin: int, opcode: int, length: int) -> None:
        """A record at an offset; `settle` follows the last one."""
        self.begins.append(begin)
        self.opcodes.append(opcode)
        self.lengths.append(length)

    def settle(self) -> None:
        """Into the order of the file; of two records at one offset the one that was told last counts."""
        begins = np.array(self.begins, dtype=np.uint64)
        order = np.argsort(begins, kind="stable")
        last = np.append(np.diff(begins[order]) != 0, [True] * bool(begins.size))
        places = order[last]
        for name in ("begins", "opcodes", "lengths"):
            values = getattr(self, name)
            setattr(self, name, array(values.typecode, np.array(values)[places].tobytes()))

    def at(self, begin: int) -> tuple[int, int] | None:
        """Opcode and length of the record that is known to begin there."""
        k = bisect_left(self.begins, begin)
        return (self.opcodes[k], self.lengths[k]) if k < len(self.begins) and self.begins[k] == begin else None

    def of_kind(self, opcode: int) -> Iterator[tuple[int, int]]:
        """Offset and length of each known record of a kind."""
        return ((self.begins[k], self.lengths[k]) for k, kind in enumerate(self.opcodes) if kind == opcode)

    @property
    def has_chunks(self) -> bool:
        """Messages stand in chunks, and the index knows them."""
        return int(Opcode.CHUNK) in self.opcodes

    def next_after(self, position: int) -> int:
        """The next record that is known to begin behind `position`; the summary after the last."""
        at = bisect_right(self.begins, position)
        return self.begins[at] if at < len(self.begins) else self.summary


def read_index(data: Buffer) -> Index | None:
    """The index at the end of a file; None where none can be trusted (no footer, no checksum or a wrong one)."""
    foot = len(data) - len(MAGIC) - _FOOTER_SIZE - RECORD.size
    if foot < len(MAGIC) or data[len(data) - len(MAGIC) :] != MAGIC:
        return None
    opcode, length, summary, _, crc = struct.unpack_from("<BQQQI", data, foot)
    if opcode != Opcode.FOOTER or length != _FOOTER_SIZE or not len(MAGIC) <= summary < foot:
        return None
    if crc == 0 or _checksum(data, summary, foot + RECORD.size + 16) != crc:
        return None
    index = Index(summary)
    try:
        _fill(index, data, foot)
        index.settle()
    except Exception:  # as in `parse`: a summary that matches its checksum may still be nonsense
        return None
    return index


def _checksum(data: Buffer, begin: int, end: int) -> int:
    found = 0
    for at in range(begin, end, _PIECE):
        found = zlib.crc32(data[at : min(at + _PIECE, end)], found)
    return found


def _fill(index: Index, data: Buffer, foot: int) -> None:
    """Read the summary's records up to the footer."""
    position = index.summary
    while position < foot:
        opcode, length = RECORD.unpack_from(data, position)
        end = position + RECORD.size + length
        body = data[position + RECORD.size : end]
        if opcode == Opcode.CHUNK_INDEX:
            _, _, begin, size = _CHUNK_INDEX_HEAD.unpack_from(body)
            index.add(begin, int(Opcode.CHUNK), size)
        elif opcode in (Opcode.METADATA_INDEX, Opcode.ATTACHMENT_INDEX):
            kind = Opcode.METADATA if opcode == Opcode.METADATA_INDEX else Opcode.ATTACHMENT
            begin, size = _PLACE.unpack_from(body)
            index.add(begin, int(kind), size)
        elif opcode in (Opcode.SCHEMA, Opcode.CHANNEL):
            found = parse(opcode, body)
            assert isinstance(found, Schema | Channel)
            index.definitions.append(found)
        position = end
