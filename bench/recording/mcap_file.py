"""One MCAP file being written, and when its bytes reach the disk.

The records are the library's own (`mcap.records`), but for the messages (`mcap_chunk`) at every sample; a test holds
the file against what the library's writer makes of the same calls, byte for byte.
"""

from __future__ import annotations

import contextlib
import os
import zlib
from collections import Counter
from collections.abc import Iterable, Mapping
from pathlib import Path

import zstandard
from mcap import records
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.writer import MCAP0_MAGIC

from bench.errors import InputError
from bench.recording.lock import hold
from bench.recording.mcap_chunk import ChunkBuffer
from bench.recording.schemas import LIBRARY, Topic
from bench.recording.spool import Spool

CHUNK_SIZE = 128 * 1024
"""Bytes before compression; what a torn or damaged chunk costs at most. A run flushes long before that."""

_FOOTER_SIZE = 8 + 8 + 4


class McapFile:
    """A new MCAP file with the given topics; the channel ids are the topics' own.

    Messages stay in memory until a chunk is full; `flush` ends the chunk and hands it to the operating system (safe
    from a killed process), `sync` brings it onto the disk (safe from a power cut). Chunks are zstd with CRC. Raises
    OSError when the disk does not take the bytes: the file then ends with its last whole record, and what it did not
    take is kept, for the next call to try again.
    """

    def __init__(self, path: Path, topics: Iterable[Topic], epoch_ns: int) -> None:
        self._stream = path.open("wb", buffering=0)
        hold(self._stream.fileno())  # as long as it is written: a file that ends early and is not held was cut off
        self._size = 0  # bytes that the operating system has
        self._out = bytearray()  # whole records on their way to it
        self._chunk = ChunkBuffer()
        self._schemas: list[records.Schema] = []
        self._channels: list[records.Channel] = []
        self._compressor = zstandard.ZstdCompressor()
        self._chunk_count = 0
        self._chunk_indices = Spool(path.parent)  # 25 a second: the one part of the summary that grows with the run
        self._attachments: list[records.AttachmentIndex] = []
        self._metadata: list[records.MetadataIndex] = []
        self._counts: Counter[int] = Counter()
        self._span_ns: tuple[int, int] | None = None
        self._out += MCAP0_MAGIC
        self._out += _bytes(records.Header(profile="", library=LIBRARY))
        for topic in topics:
            self._define(topic, epoch_ns)
        try:
            self._hand_over()
        except OSError:
            self._close()
            raise

    def _define(self, topic: Topic, epoch_ns: int) -> None:
        """Schema and channel of a topic, into the first chunk."""
        number = len(self._channels) + 1
        assert number == topic.id, "topics are written in the order of their ids"
        schema = records.Schema(id=number, name=topic.schema_name, encoding="jsonschema", data=topic.schema_bytes())
        channel = records.Channel(
            id=number, topic=topic.name, message_encoding="json", schema_id=number, metadata=topic.metadata(epoch_ns)
        )
        self._schemas.append(schema)
        self._channels.append(channel)
        self._chunk.data += _bytes(schema) + _bytes(channel)

    def add_message(self, channel_id: int, log_ns: int, data: bytes, publish_ns: int, sequence: int) -> None:
        """One message into the chunk; a full chunk is written."""
        if self._chunk.add_message(channel_id, log_ns, data, publish_ns, sequence) > CHUNK_SIZE:
            self.flush()

    def metadata(self, name: str, fields: Mapping[str, str]) -> None:
        """A metadata record, after the messages written so far."""
        self._end_chunk()
        offset, size = self._write(records.Metadata(name=name, metadata=dict(fields)))
        self._metadata.append(records.MetadataIndex(offset=offset, length=size, name=name))
        self._hand_over()

    def attachment(self, name: str, media_type: str, data: bytes, log_ns: int) -> None:
        """An attachment, after the messages written so far."""
        self._end_chunk()
        record = records.Attachment(create_time=0, log_time=log_ns, name=name, media_type=media_type, data=data)
        offset, size = self._write(record)
        self._attachments.append(
            records.AttachmentIndex(
                offset=offset,
                length=size,
                create_time=0,
                log_time=log_ns,
                data_size=len(data),
                name=name,
                media_type=media_type,
            )
        )
        self._hand_over()

    def flush(self) -> None:
        """End the chunk and hand everything to the operating system."""
        self._end_chunk()
        self._hand_over()

    def sync(self) -> None:
        """Wait until what was flushed is on the disk: some milliseconds, or many. May run beside the other calls."""
        os.fsync(self._stream.fileno())

    @property
    def waiting(self) -> int:
        """Bytes of records that the operating system did not take yet."""
        return len(self._out)

    def finish(self) -> None:
        """Write index and footer, sync, close. Nothing may be written afterwards; after an OSError only `abandon`."""
        self._end_chunk()
        self._hand_over()  # the samples first: they count without an index too
        self._write(records.DataEnd(data_section_crc=0))
        self._write_summary()
        self._out += MCAP0_MAGIC
        self._hand_over()
        self.sync()
        self._close()

    def abandon(self) -> None:
        """Close without index, after the disk refused bytes; what is on it stays readable."""
        self._close()

    def _close(self) -> None:
        self._stream.close()
        self._chunk_indices.close()

    # -- inside ------------------------------------------------------------------------------------------------

    def _write(self, record: records.McapRecord) -> tuple[int, int]:
        """Append a record; returns its offset and size."""
        data = _bytes(record)
        offset = self._size + len(self._out)
        self._out += data
        return offset, len(data)

    def _hand_over(self) -> None:
        """Give the operating system what waits; all of it, or nothing."""
        out = self._out
        if not out:
            return
        done = 0
        try:
            while done < len(out):
                done += self._stream.write(memoryview(out)[done:]) or 0
        except OSError:
            with contextlib.suppress(OSError):  # half a record would be damage
                self._stream.truncate(self._size)
                self._stream.seek(self._size)
            raise
        self._size += done
        self._out = bytearray()

    def _end_chunk(self) -> None:
        """Write the chunk in progress with its message index, if there are messages in it."""
        chunk = self._chunk
        if chunk.empty:
            return
        first_ns, last_ns = chunk.span_ns()
        offset = self._size + len(self._out)
        record, index, index_record = chunk.records(offset, (first_ns, last_ns), self._compressor)
        self._out += record
        self._out += index
        self._chunk_indices.append(index_record)
        self._chunk_count += 1
        self._counts.update(chunk.counts())
        before = self._span_ns or (first_ns, last_ns)
        self._span_ns = (min(before[0], first_ns), max(before[1], last_ns))
        chunk.clear()

    def _write_summary(self) -> None:
        """What stands behind the data: definitions again, statistics, indices, their places, and the footer."""
        first_ns, last_ns = self._span_ns or (0, 0)
        statistics = records.Statistics(
            attachment_count=len(self._attachments),
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=self._chunk_count,
            message_count=self._counts.total(),
            message_end_time=last_ns,
            message_start_time=first_ns,
            metadata_count=len(self._metadata),
            schema_count=len(self._schemas),
        )

        def packed(group: Iterable[records.McapRecord]) -> Iterable[bytes]:
            return (_bytes(record) for record in group)

        groups: tuple[tuple[Opcode, Iterable[bytes]], ...] = (
            (Opcode.SCHEMA, packed(self._schemas)),
            (Opcode.CHANNEL, packed(self._channels)),
            (Opcode.STATISTICS, packed([statistics])),
            (Opcode.CHUNK_INDEX, self._chunk_indices.pieces()),
            (Opcode.ATTACHMENT_INDEX, packed(self._attachments)),
            (Opcode.METADATA_INDEX, packed(self._metadata)),
        )
        start = at = self._size + len(self._out)
        checksum = 0
        offsets = bytearray()
        for opcode, group in groups:
            begin = at
            for piece in group:
                checksum = zlib.crc32(piece, checksum)
                self._out += piece
                at += len(piece)
                if len(self._out) > CHUNK_SIZE:
                    self._hand_over()
            offsets += _bytes(records.SummaryOffset(opcode, group_start=begin, group_length=at - begin))
        footer = records.Footer(summary_start=start, summary_offset_start=at, summary_crc=0)
        checksum = zlib.crc32(offsets, checksum)
        footer.summary_crc = zlib.crc32(_bytes(footer)[: 9 + _FOOTER_SIZE - 4], checksum)
        self._out += offsets
        self._write(footer)


def _bytes(record: records.McapRecord) -> bytes:
    """A record with its opcode and length before it."""
    builder = RecordBuilder()
    record.write(builder)
    return bytes(builder.end())  # type: ignore[no-untyped-call]  # the library leaves it without types


def claim(path: Path) -> None:
    """Make sure that a new file can be made at `path`; raises `InputError` where it exists or cannot be."""
    try:
        path.open("xb").close()
    except FileExistsError:
        raise InputError(str(path), "exists already", "a recording is never overwritten: name another") from None
    except OSError as error:
        cure = "give a folder that exists and may be written to"
        raise InputError(str(path), f"cannot be written ({error.strerror})", cure) from None
