"""The file against what the library's own writer makes of the same calls."""

from pathlib import Path

import numpy as np
from mcap.reader import make_reader
from mcap.writer import CompressionType, Writer

from bench.recording.mcap_file import CHUNK_SIZE, McapFile
from bench.recording.schemas import LIBRARY, RUN_TOPICS

EPOCH_NS = 1_767_225_600_000_000_000


class Library:
    """The same calls on the library's writer."""

    def __init__(self, path: Path) -> None:
        self.stream = path.open("wb")
        self.writer = Writer(self.stream, chunk_size=CHUNK_SIZE, compression=CompressionType.ZSTD)
        self.writer.start(profile="", library=LIBRARY)
        for topic in RUN_TOPICS:
            schema = self.writer.register_schema(topic.schema_name, "jsonschema", topic.schema_bytes())
            self.writer.register_channel(topic.name, "json", schema, topic.metadata(EPOCH_NS))
        self.add_message = self.writer.add_message
        self.flush = self.writer.flush

    def metadata(self, name: str, fields: dict[str, str]) -> None:
        self.writer.flush()
        self.writer.add_metadata(name, fields)

    def attachment(self, name: str, media_type: str, data: bytes, log_ns: int) -> None:
        self.writer.flush()
        self.writer.add_attachment(0, log_ns, name, media_type, data)

    def finish(self) -> None:
        self.writer.finish()
        self.stream.close()


def fill(file: McapFile | Library, messages: int, seed: int) -> None:
    """Metadata, attachments, messages whose log times are not in order, flushes in between, more than a chunk."""
    rng = np.random.default_rng(seed)
    file.metadata("padbench.run", {"protocol": "quick", "note": "größer als ASCII"})
    file.attachment("bench.yaml", "application/yaml", b"name: x\n" * 40, EPOCH_NS)
    counts = dict.fromkeys((topic.id for topic in RUN_TOPICS), 0)
    for k in range(messages):
        channel = int(rng.integers(1, len(RUN_TOPICS) + 1))
        at = EPOCH_NS + 1_000_000 * k + int(rng.integers(-3_000_000, 3_000_000))
        file.add_message(channel, at, b'{"position_mm":%d}' % k * int(rng.integers(1, 5)), at - 500, counts[channel])
        counts[channel] += 1
        if rng.random() < 0.001:
            file.flush()
    file.metadata("padbench.result", {})
    file.finish()


def test_same_bytes_as_the_library_writes(tmp_path):
    for messages in (0, 1, 9000):
        ours, theirs = tmp_path / f"ours{messages}.mcap", tmp_path / f"theirs{messages}.mcap"
        fill(McapFile(ours, RUN_TOPICS, EPOCH_NS), messages, seed=messages)
        fill(Library(theirs), messages, seed=messages)
        assert ours.read_bytes() == theirs.read_bytes(), f"{messages} messages"


def test_library_reads_it_in_order_of_log_time(tmp_path):
    path = tmp_path / "file.mcap"
    fill(McapFile(path, RUN_TOPICS, EPOCH_NS), 9000, seed=3)
    with path.open("rb") as stream:
        times = [message.log_time for _, _, message in make_reader(stream, validate_crcs=True).iter_messages()]
    assert len(times) == 9000 and times == sorted(times)
