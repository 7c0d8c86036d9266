"""A torn or damaged recording rewritten as a whole one, and an account of what was lost."""

from __future__ import annotations

import contextlib
import os
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field
from pathlib import Path

from mcap.records import Attachment, Channel, Metadata, Schema
from mcap.writer import CompressionType, Writer

from bench.errors import EXIT_DONE, EXIT_LOST, InputError
from bench.recording.mcap_read import mapped
from bench.recording.reader import recording_file
from bench.recording.records import Block, Found, definitions, messages
from bench.recording.scan import Damage, Scan
from bench.recording.schemas import LIBRARY, RECOVERED, RESULT, RUN, TOPICS, epoch_of
from bench.recording.unfinished import being_written


@dataclass
class RecoverReport:
    """What is in the new file, and what could not be saved."""

    messages: int = 0
    attachments: int = 0
    metadata: int = 0
    per_topic: dict[str, int] = field(default_factory=dict)
    missing: dict[str, int] = field(default_factory=dict)
    """Messages that the sequence numbers of a topic say are gone."""
    nameless: int = 0
    """Messages of a channel that nothing in the file describes; dropped."""
    damage: list[Damage] = field(default_factory=list)
    finished: bool = True
    """The file had been written to its end."""
    has_result: bool = True
    """The run had come to its end (`padbench.result` is there)."""

    last_s: float | None = None
    """Bench time of the last message kept."""

    @property
    def lost(self) -> bool:
        """Whether anything that had been written is not in the new file, or the file ended before the run did."""
        return bool(self.gone or not self.finished)

    @property
    def gone(self) -> bool:
        """Whether something before the file's end is missing."""
        return bool(self.missing or self.nameless or any(damage.content for damage in self.damage))

    @property
    def status(self) -> int:
        """Exit status: 0 all kept, 3 something was lost."""
        return EXIT_LOST if self.lost else EXIT_DONE

    def lines(self) -> list[str]:
        """The account for a person, one fact a line."""
        topics = ", ".join(f"{count} {name}" for name, count in self.per_topic.items())
        lines = [
            f"kept: {self.messages} messages ({topics or 'none'}), {self.attachments} attachments, "
            f"{self.metadata} metadata records"
        ]
        lines += [f"lost: {damage}" for damage in self.damage if damage.content]
        lines += [f"lost: {count} messages of {name}" for name, count in self.missing.items()]
        if self.nameless:
            lines.append(f"lost: {self.nameless} messages of channels that nothing describes any more")
        if not self.finished:
            since = f"{self.last_s:.3f} s" if self.last_s is not None else "what was kept"
            lines.append(
                f"lost: what came after {since}: the file had not been finished. Of a run that was killed that is a "
                "tenth of a second at most; of a file that was cut off later, nobody knows how much"
            )
        if not self.has_result:
            lines.append(f"no {RESULT} record: the run did not come to its end")
        if not self.lost:
            lines.append("nothing that had been written is lost")
        return lines


def recover(path: str | Path, out: str | Path | None = None) -> tuple[Path, RecoverReport]:
    """Rewrite an MCAP file with index and checksums; what is intact is kept record for record, in its order.

    `path` may be a run folder. `out` is NAME.recovered.mcap beside it unless given. Works on any MCAP file, whoever
    wrote it. Raises `InputError` where nothing can be read, where input and output are the same file, or where the
    input is still being written.
    """
    source = recording_file(Path(path))
    writer = being_written(source)
    if writer is not None:
        cure = "wait for the end of the run; what is in it by now can be read as it is (padbench convert, fit)"
        raise InputError(str(source), f"is being written: the run is going on{writer}", cure)
    target = Path(out) if out is not None else source.with_name(f"{source.stem}.recovered.mcap")
    draft = target.with_name(f".recovering-{os.getpid()}")
    try:
        if target.exists() and target.samefile(source):
            raise InputError(str(target), "is the damaged file itself", "name another file: it is never overwritten")
        if target.is_dir():
            raise InputError(str(target), "is a folder", "name a file")
        with mapped(source) as data:
            report = _rewrite(Scan(data), source, draft)
        draft.replace(target)
    except OSError as error:
        cure = "name another place behind it: padbench recover MCAP OUT"
        raise InputError(str(target), f"cannot be written ({error.strerror})", cure) from None
    finally:
        with contextlib.suppress(OSError):  # it was never made, or is the target now
            draft.unlink()
    return target, report


def _rewrite(scan: Scan, source: Path, draft: Path) -> RecoverReport:
    records = scan.records()
    first = next(records, None)
    if first is None:
        cure = "it is no MCAP file, or not one whole record was written before it was cut off"
        raise InputError(str(source), "holds nothing that could be recovered", cure)
    copy = _Copy(draft, scan)
    try:
        copy.take(first)
        for found in records:
            copy.take(found)
        report = copy.account()
        if report.lost:
            lost = "; ".join(line.removeprefix("lost: ") for line in report.lines() if line.startswith("lost: "))
            # What is missing inside is told by whoever reads the file; a run without its end says so itself.
            copy.writer.add_metadata(RECOVERED, {"from": source.name, "lost" if report.gone else "unfinished": lost})
        copy.finish()
    finally:
        copy.stream.close()
    return report


class _Copy:
    """The new file while it is written; ids of schemas and channels are given anew."""

    def __init__(self, path: Path, scan: Scan) -> None:
        self.stream = path.open("wb")
        self.writer = Writer(self.stream, compression=CompressionType.ZSTD)
        self._end_chunk: Callable[[], None] = self.writer.flush
        self._scan = scan
        header = scan.header
        self._ours = header is None or header.library.startswith(LIBRARY)
        self.writer.start(header.profile if header else "", header.library if header else LIBRARY)
        self._report = RecoverReport()
        self._records: set[str] = set()
        self._kept: Counter[int] = Counter()
        self._last_sequence: dict[int, int] = {}
        self._topics: dict[int, str] = {}
        self._schemas: dict[int, int] = {0: 0}
        self._old_schemas: dict[int, Schema] = {}
        self._channels: dict[int, int] = {}
        self._last_ns = 0
        self._epoch_ns: int | None = None

    def take(self, found: Found) -> None:
        """Copy what has come."""
        if isinstance(found, Block):
            self._block(found)
        elif isinstance(found, Schema):
            self._old_schemas.setdefault(found.id, found)
        elif isinstance(found, Channel):
            self._channel(found)
        elif isinstance(found, Metadata):
            self._end_chunk()
            self.writer.add_metadata(found.name, found.metadata)
            self._report.metadata += 1
            self._epoch_ns = epoch_of(found.metadata) if found.name == RUN else self._epoch_ns
            self._records.add(found.name)
        elif isinstance(found, Attachment):
            self._end_chunk()
            self.writer.add_attachment(found.create_time, found.log_time, found.name, found.media_type, found.data)
            self._report.attachments += 1

    def finish(self) -> None:
        """Write index and footer."""
        end: Callable[[], None] = self.writer.finish
        end()

    def account(self) -> RecoverReport:
        """Counts, damage, and what the sequence numbers of our own recordings say is missing."""
        report, scan = self._report, self._scan
        report.damage, report.finished = scan.damage, scan.finished
        report.per_topic = {self._topics[channel]: count for channel, count in self._kept.items()}
        report.messages = sum(self._kept.values())
        if report.messages and self._epoch_ns is not None:
            report.last_s = (self._last_ns - self._epoch_ns) / 1e9
        report.has_result = not self._ours or RESULT in self._records
        if self._ours and any(damage.content for damage in scan.damage):
            gone = {channel: last + 1 - self._kept[channel] for channel, last in self._last_sequence.items()}
            report.missing = {self._topics[channel]: count for channel, count in gone.items() if count > 0}
        return report

    def _block(self, block: Block) -> None:
        channels = self._channels
        for channel_id, sequence, log_ns, publish_ns, data in messages(block):
            if channel_id not in channels:
                self._define(channel_id, block)
                if channel_id not in channels:
                    self._report.nameless += 1
                    continue
            self.writer.add_message(channels[channel_id], log_ns, data, publish_ns, sequence)
            self._kept[channel_id] += 1
            self._last_ns = max(self._last_ns, log_ns)
            self._last_sequence[channel_id] = sequence

    def _define(self, channel_id: int, block: Block) -> None:
        """Take the channel from the chunk; where the chunk with it is lost, ours are always the same."""
        for found in definitions(block):
            self.take(found)
        if channel_id in self._channels or not self._ours:
            return
        for topic in TOPICS:
            if topic.id == channel_id:
                self.take(Schema(topic.id, topic.schema_bytes(), "jsonschema", topic.schema_name))
                self.take(Channel(topic.id, topic.name, "json", {}, topic.id))

    def _channel(self, channel: Channel) -> None:
        if channel.id in self._channels:
            return
        old = self._old_schemas.get(channel.schema_id)
        if channel.schema_id not in self._schemas and old is not None:
            self._schemas[channel.schema_id] = self.writer.register_schema(old.name, old.encoding, old.data)
        self._channels[channel.id] = self.writer.register_channel(
            channel.topic, channel.message_encoding, self._schemas.get(channel.schema_id, 0), channel.metadata
        )
        self._topics[channel.id] = channel.topic
