"""The process that writes a recording of the wall clock: `python -m bench.recording.writer_process PATH EPOCH FLUSH`.

Frames come by standard input (`bench.recording.frames`), one JSON line each on standard output says `ready`,
what went wrong, and how much was written. It outlives the run by as long as it takes to finish the file: interrupts
are not for it, and the end of the pipe, or the death of the run, is its order to finish.
"""

from __future__ import annotations

import json
import os
import select
import signal
import sys
import threading
import time
from pathlib import Path

from bench.recording import frames
from bench.recording.mcap_file import McapFile
from bench.recording.schemas import RUN_TOPICS
from bench.recording.space import running_out
from bench.recording.store import WAITING_LIMIT

READ_SIZE = 1 << 18
NICENESS = 5


class Writing:
    """The file and what still waits for its flush; times are of this process's monotonic clock.

    The first thing that goes wrong is told at once (`problem`), and writing goes on as far as the disk takes it.
    """

    def __init__(self, path: Path, epoch_ns: int, flush_s: float) -> None:
        self.file = McapFile(path, RUN_TOPICS, epoch_ns)
        self.messages = 0
        self.problem: str | None = None
        self._path = path
        self._flush_s = flush_s
        self._buffer = bytearray()
        self._due_s: float | None = None
        self._sync: threading.Thread | None = None
        self._sync_again = False

    def take(self, data: bytes) -> None:
        """Write the frames that are complete now."""
        self._buffer += data
        for kind, body in frames.split(self._buffer):
            try:
                self._frame(kind, body)
            except OSError as error:
                self._fail(error)

    def _frame(self, kind: int, body: bytes) -> None:
        if kind == frames.MESSAGE:
            if self.problem is not None and self.file.waiting > WAITING_LIMIT:
                return
            self.messages += 1
            if self._due_s is None:
                self._due_s = time.monotonic() + self._flush_s
            channel_id, sequence, log_ns, publish_ns, text = frames.read_message(body)
            self.file.add_message(channel_id, log_ns, text, publish_ns, sequence)
        elif kind == frames.METADATA:
            self.file.metadata(*frames.read_metadata(body))
        elif kind == frames.ATTACHMENT:
            self.file.attachment(*frames.read_attachment(body))
        else:
            self._flush()
            self._sync_soon()

    def wait_s(self) -> float:
        """How long one may wait for more before the flush is due."""
        return self._flush_s if self._due_s is None else max(0.0, self._due_s - time.monotonic())

    def tick(self) -> None:
        """Flush when the oldest message has waited long enough."""
        if self._due_s is not None and time.monotonic() >= self._due_s:
            self._flush()
        if self._sync_again:
            self._sync_soon()

    def finish(self) -> bool:
        """Finish the file; False where the disk does not take it."""
        if self._sync is not None:
            self._sync.join()
        try:
            self.file.finish()
        except OSError as error:
            self._fail(error)
            self.file.abandon()
            return False
        return True

    def _flush(self) -> None:
        self._due_s = None
        try:
            self.file.flush()
        except OSError as error:
            self._fail(error)
        if self.problem is None:
            self._tell(running_out(self._path.parent))

    def _sync_soon(self) -> None:
        """In a thread: a slow disk takes longer over it than a sample may wait for its flush."""
        self._sync_again = self._sync is not None and self._sync.is_alive()
        if not self._sync_again:
            self._sync = threading.Thread(target=self._sync_now)
            self._sync.start()

    def _sync_now(self) -> None:
        try:
            self.file.sync()
        except OSError as error:
            self._fail(error)

    def _fail(self, error: OSError) -> None:
        self._tell(f"cannot write {self._path}: {error.strerror or error}")

    def _tell(self, problem: str | None) -> None:
        if problem is not None and self.problem is None:
            self.problem = problem
            _say(problem=problem)


def _give_way() -> None:
    """Let the run's loop go first where the two share a processor; the pipe holds what comes meanwhile.

    A batch process does not push aside the one that has just written into its pipe.
    """
    os.nice(NICENESS)
    if hasattr(os, "SCHED_BATCH"):
        os.sched_setscheduler(0, os.SCHED_BATCH, os.sched_param(0))


def _say(**fields: object) -> None:
    try:
        print(json.dumps(fields), flush=True)
    except OSError:
        sys.stdout = None  # nobody listens any more; the file is what matters


def main(arguments: list[str]) -> int:
    """Write until the pipe ends; returns the exit status (1: the disk did not take it all)."""
    for name in ("SIGINT", "SIGTERM", "SIGHUP"):
        signal.signal(getattr(signal, name), signal.SIG_IGN)
    path, epoch_ns, flush_s = Path(arguments[0]), int(arguments[1]), float(arguments[2])
    parent = os.getppid()
    _give_way()
    try:
        writing = Writing(path, epoch_ns, flush_s)
    except OSError as error:
        _say(problem=f"cannot write {path}: {error.strerror or error}")
        return 1
    _say(ready=True)
    while True:
        readable, _, _ = select.select([0], [], [], writing.wait_s())
        if readable:
            data = os.read(0, READ_SIZE)
            if not data:
                break
            writing.take(data)
        elif os.getppid() != parent:
            break  # the run is dead, and a process it left behind keeps the pipe open
        writing.tick()
    done = writing.finish()
    _say(messages=writing.messages)
    return 0 if done else 1


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
