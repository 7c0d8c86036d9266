"""Where the recorder's bytes go: a store, and the one that writes in the run's own process."""

from __future__ import annotations

from pathlib import Path
from typing import Protocol

from bench.recording.mcap_file import McapFile
from bench.recording.schemas import RUN_TOPICS, Topic
from bench.recording.space import running_out

NEVER_NS = 1 << 62

WAITING_LIMIT = 32 << 20
"""Bytes kept in memory while the disk takes none: the end of a run, in case that room is made."""


class Store(Protocol):
    """Takes encoded messages in order. No call raises: what goes wrong is kept in `problem`, the first one."""

    problem: str | None
    lost: int
    """Messages that could not be taken."""

    @property
    def pid(self) -> int | None:
        """The process that writes, if it is another one."""
        ...

    def message(self, channel_id: int, log_ns: int, data: bytes, publish_ns: int, sequence: int) -> None:
        """One message."""
        ...

    def metadata(self, name: str, fields: dict[str, str]) -> None:
        """One metadata record."""
        ...

    def attachment(self, name: str, media_type: str, data: bytes, log_ns: int) -> None:
        """One attachment."""
        ...

    def boundary(self) -> None:
        """A step begins: everything before it is to be safe."""
        ...

    def tick(self, now_ns: int) -> None:
        """Time passes, on the bench's clock; messages that waited too long are written."""
        ...

    def close(self) -> None:
        """Finish the file."""
        ...


class InlineStore:
    """Writes in the caller's process, for the virtual clock: same calls, same bytes.

    The flush timer runs on the bench's clock, from the first message that waits. The disk is synced at the end only:
    what a power cut takes from a simulated run, the same seed brings back. Raises OSError where no file can begin.
    """

    def __init__(self, path: Path, epoch_ns: int, flush_ns: int, topics: tuple[Topic, ...] = RUN_TOPICS) -> None:
        self.problem: str | None = None
        self.lost = 0
        self._path = path
        self._flush_ns = flush_ns
        self._due_ns = NEVER_NS
        self._closed = False
        self._file = McapFile(path, topics, epoch_ns)
        self._add = self._file.add_message

    @property
    def pid(self) -> int | None:
        """None: it is this process."""
        return None

    def message(self, channel_id: int, log_ns: int, data: bytes, publish_ns: int, sequence: int) -> None:
        """One message; see `Store`."""
        if self.problem is not None and self._file.waiting > WAITING_LIMIT:
            self.lost += 1
            return
        try:
            self._add(channel_id, log_ns, data, publish_ns, sequence)
        except OSError as error:
            self._fail(error)
        if log_ns >= self._due_ns:
            self.boundary()
        elif self._due_ns == NEVER_NS:
            self._due_ns = log_ns + self._flush_ns

    def metadata(self, name: str, fields: dict[str, str]) -> None:
        """One metadata record; see `Store`."""
        try:
            self._file.metadata(name, fields)
        except OSError as error:
            self._fail(error)

    def attachment(self, name: str, media_type: str, data: bytes, log_ns: int) -> None:
        """One attachment; see `Store`."""
        try:
            self._file.attachment(name, media_type, data, log_ns)
        except OSError as error:
            self._fail(error)

    def boundary(self) -> None:
        """Flush; see `Store`."""
        self._due_ns = NEVER_NS
        try:
            self._file.flush()
        except OSError as error:
            self._fail(error)
        if self.problem is None:
            self.problem = running_out(self._path.parent)

    def tick(self, now_ns: int) -> None:
        """Flush when the oldest message has waited long enough; see `Store`."""
        if now_ns >= self._due_ns:
            self.boundary()

    def close(self) -> None:
        """Finish the file; see `Store`."""
        if self._closed:
            return
        self._closed = True
        try:
            self._file.finish()
        except OSError as error:
            self._fail(error)
            self._file.abandon()

    def _fail(self, error: OSError) -> None:
        """Keep the first problem; what the disk did not take is tried again with the next flush."""
        if self.problem is None:
            self.problem = f"cannot write {self._path}: {error.strerror or error}"
