"""What runs through the pipe between a run and its writer process: frames of one kind byte, a length and a body.

The order of frames is the order in the file. The end of the pipe means that the run is over or dead; the difference
is whether a `padbench.result` record came before.
"""

from __future__ import annotations

import json
import struct
from collections.abc import Iterator

MESSAGE = 1
METADATA = 2
ATTACHMENT = 3
BOUNDARY = 4

HEAD = struct.Struct("<BI")
MESSAGE_HEAD = struct.Struct("<BIHIQQ")
"""Kind, length of the body, channel id, sequence, log time, publish time; the JSON follows."""

_BODY = struct.Struct("<HIQQ")
MESSAGE_FIXED = _BODY.size


def metadata_frame(name: str, fields: dict[str, str]) -> bytes:
    """A metadata record as a frame."""
    body = json.dumps([name, fields]).encode()
    return HEAD.pack(METADATA, len(body)) + body


def attachment_frame(name: str, media_type: str, data: bytes, log_ns: int) -> bytes:
    """An attachment as a frame: a JSON line, then the bytes."""
    body = json.dumps([name, media_type, log_ns]).encode() + b"\n" + data
    return HEAD.pack(ATTACHMENT, len(body)) + body


BOUNDARY_FRAME = HEAD.pack(BOUNDARY, 0)


def split(buffer: bytearray) -> Iterator[tuple[int, bytes]]:
    """Kind and body of each complete frame; what was given out is removed from the buffer."""
    view = bytes(buffer)
    position = 0
    while len(view) - position >= HEAD.size:
        kind, length = HEAD.unpack_from(view, position)
        end = position + HEAD.size + length
        if end > len(view):
            break
        yield kind, view[position + HEAD.size : end]
        position = end
    del buffer[:position]


def read_message(body: bytes) -> tuple[int, int, int, int, bytes]:
    """Channel id, sequence, log time, publish time and JSON of a MESSAGE body."""
    channel_id, sequence, log_ns, publish_ns = _BODY.unpack_from(body)
    return channel_id, sequence, log_ns, publish_ns, body[MESSAGE_FIXED:]


def read_metadata(body: bytes) -> tuple[str, dict[str, str]]:
    """Name and fields of a METADATA body."""
    name, fields = json.loads(body)
    return name, fields


def read_attachment(body: bytes) -> tuple[str, str, bytes, int]:
    """Name, media type, data and log time of an ATTACHMENT body."""
    head, _, data = body.partition(b"\n")
    name, media_type, log_ns = json.loads(head)
    return name, media_type, data, log_ns
