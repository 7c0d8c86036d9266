"""One MCAP file being written: the library's writer, and when its bytes reach the disk."""

from __future__ import annotations

import os
from collections.abc import Callable, Iterable
from pathlib import Path

from mcap.writer import CompressionType, Writer

from bench.errors import InputError
from bench.recording.schemas import LIBRARY, Topic

CHUNK_SIZE = 128 * 1024
"""Bytes before compression; what a torn or damaged chunk costs at most. A quarter of a second of a run is less."""


class McapFile:
    """A new MCAP file with the given topics; the channel ids are the topics' own.

    The library keeps messages in memory until a chunk is full; `flush` ends the chunk and hands it to the operating
    system (safe from a killed process), `sync` brings it onto the disk (safe from a power cut). Chunks are zstd with
    CRC. Raises OSError when the disk does not take the bytes.
    """

    def __init__(self, path: Path, topics: Iterable[Topic], epoch_ns: int) -> None:
        self._stream = path.open("wb")
        self._writer = Writer(self._stream, chunk_size=CHUNK_SIZE, compression=CompressionType.ZSTD)
        self._writer.start(profile="", library=LIBRARY)
        for topic in topics:
            schema_id = self._writer.register_schema(topic.schema_name, "jsonschema", topic.schema_bytes())
            channel = self._writer.register_channel(topic.name, "json", schema_id, topic.metadata(epoch_ns))
            assert channel == topic.id, "topics are written in the order of their ids"
        self._stream.flush()
        self._end_chunk: Callable[[], None] = self._writer.flush
        self._finish: Callable[[], None] = self._writer.finish
        self.add_message: Callable[[int, int, bytes, int, int], None] = self._writer.add_message
        """(channel_id, log_time, data, publish_time, sequence); the library's own, for speed."""

    def metadata(self, name: str, fields: dict[str, str]) -> None:
        """A metadata record, after the messages written so far."""
        self._end_chunk()
        self._writer.add_metadata(name, fields)
        self._stream.flush()

    def attachment(self, name: str, media_type: str, data: bytes, log_ns: int) -> None:
        """An attachment, after the messages written so far."""
        self._end_chunk()
        self._writer.add_attachment(0, log_ns, name, media_type, data)
        self._stream.flush()

    def flush(self) -> None:
        """End the chunk and hand everything to the operating system."""
        self._end_chunk()

    def sync(self) -> None:
        """`flush`, and wait until it is on the disk (some milliseconds)."""
        self._end_chunk()
        os.fsync(self._stream.fileno())

    def finish(self) -> None:
        """Write index and footer, sync, close. Nothing may be written afterwards."""
        self._finish()
        self._stream.flush()
        os.fsync(self._stream.fileno())
        self._stream.close()

    def abandon(self) -> None:
        """Close without index, after the disk refused bytes; what is on it stays readable."""
        try:
            self._stream.close()  # tries once more to write what it holds
        except OSError:
            # the descriptor is closed all the same; the first failure has been reported
            return


def claim(path: Path) -> None:
    """Make sure that a new file can be made at `path`; raises `InputError` where it exists or cannot be."""
    try:
        path.open("xb").close()
    except FileExistsError:
        raise InputError(str(path), "exists already", "a recording is never overwritten: name another") from None
    except OSError as error:
        cure = "give a folder that exists and may be written to"
        raise InputError(str(path), f"cannot be written ({error.strerror})", cure) from None
