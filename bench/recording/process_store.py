"""The store of the wall clock: a process behind a pipe writes the file, so that no disk ever holds the loop.

Sending never blocks. Messages collect in a buffer, which goes into the pipe when it has grown or has waited; what the
pipe does not take stays in the buffer, and what the buffer does not take is counted as lost and is a problem.
The writer process lives in a session of its own: an interrupt or a signal to the run's group does not reach it, and
when the run is killed, it finds the pipe closed and finishes the file with everything that was sent.
"""

from __future__ import annotations

import contextlib
import json
import os
import select
import subprocess
import sys
import time
from pathlib import Path

from bench.errors import InputError
from bench.recording import frames

SEND_SIZE = 16_384
SEND_AFTER_NS = 15_000_000
"""Messages wait at most so long in the run's own memory, which dies with it."""

BUFFER_LIMIT = 32 << 20
"""Some two minutes at 1 kHz and 550 force samples a second."""

PIPE_SIZE = 1 << 20
START_TIMEOUT_S = 30.0
CLOSE_TIMEOUT_S = 60.0


class ProcessStore:
    """See `bench.recording.store.Store`; POSIX only. Raises `InputError` where the process cannot begin."""

    def __init__(self, path: Path, epoch_ns: int, flush_ns: int) -> None:
        self.problem: str | None = None
        self.lost = 0
        self._path = path
        self._buffer = bytearray()
        self._send_at_ns = 0
        self._unread = b""
        self._words: list[str] = []
        self._dead = False
        self._closed = False
        arguments = [str(path), str(epoch_ns), str(flush_ns / 1e9)]
        self._process = subprocess.Popen(
            [sys.executable, "-m", "bench.recording.writer_process", *arguments],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            bufsize=0,
            start_new_session=True,
        )
        assert self._process.stdin is not None
        self._pipe = self._process.stdin.fileno()
        self._enlarge_pipe()
        os.set_blocking(self._pipe, False)
        if not self._reply("ready", START_TIMEOUT_S):
            self._process.kill()
            self._reap(START_TIMEOUT_S)
            raise InputError(str(path), f"no recording can begin: {self.problem or self._last_words()}")

    @property
    def pid(self) -> int | None:
        """The writer's process id."""
        return self._process.pid

    def message(self, channel_id: int, log_ns: int, data: bytes, publish_ns: int, sequence: int) -> None:
        """One message into the buffer; see `Store`."""
        buffer = self._buffer
        if self._dead or len(buffer) > BUFFER_LIMIT:
            self._overflow()
            return
        size = len(data)
        buffer += frames.MESSAGE_HEAD.pack(
            frames.MESSAGE, size + frames.MESSAGE_FIXED, channel_id, sequence, log_ns, publish_ns
        )
        buffer += data
        if log_ns >= self._send_at_ns or len(buffer) > SEND_SIZE:
            self._send_at_ns = log_ns + SEND_AFTER_NS
            self._send()

    def metadata(self, name: str, fields: dict[str, str]) -> None:
        """One metadata record; see `Store`."""
        self._buffer += frames.metadata_frame(name, fields)
        self._send()

    def attachment(self, name: str, media_type: str, data: bytes, log_ns: int) -> None:
        """One attachment; see `Store`."""
        self._buffer += frames.attachment_frame(name, media_type, data, log_ns)
        self._send()

    def boundary(self) -> None:
        """The writer flushes and syncs when it comes to this place; see `Store`."""
        self._buffer += frames.BOUNDARY_FRAME
        self._send()

    def tick(self, now_ns: int) -> None:
        """Send what has waited long enough; see `Store`."""
        if self._buffer and now_ns >= self._send_at_ns:
            self._send_at_ns = now_ns + SEND_AFTER_NS
            self._send()

    def close(self) -> None:
        """Send the rest, and wait until the writer has finished the file; see `Store`."""
        if self._closed:
            return
        self._closed = True
        deadline = time.monotonic() + CLOSE_TIMEOUT_S
        while self._buffer and not self._dead and time.monotonic() < deadline:
            select.select([], [self._pipe], [], 0.1)
            self._send()
        assert self._process.stdin is not None
        with contextlib.suppress(OSError):
            self._process.stdin.close()
        done = self._dead or self._reply("messages", max(0.1, deadline - time.monotonic()))
        if not done and self.problem is None:
            self.problem = f"the process that writes {self._path} did not finish: {self._last_words()}"
        self._reap(1.0)

    # -- inside ------------------------------------------------------------------------------------------------

    def _send(self) -> None:
        if self._dead:
            self._buffer.clear()
            return
        self._listen()
        try:
            taken = os.write(self._pipe, self._buffer)
        except BlockingIOError:
            return  # the pipe is full; the buffer keeps it
        except OSError:
            self._dead = True
            self._buffer.clear()
            if not self._reply("problem", 1.0) and self.problem is None:
                self.problem = f"the process that writes {self._path} died: {self._last_words()}"
            return
        del self._buffer[:taken]

    def _listen(self) -> None:
        """Take what the writer has said by now, without waiting."""
        self._reply("problem", 0.0)

    def _overflow(self) -> None:
        self.lost += 1
        if self.problem is None:
            self.problem = f"{self._path} is not written fast enough: the buffer is full; use a faster disk"

    def _reply(self, key: str, timeout_s: float) -> bool:
        """Wait for a line with `key` from the writer; a problem that it reports is kept."""
        assert self._process.stdout is not None
        out = self._process.stdout.fileno()
        deadline = time.monotonic() + timeout_s
        while True:
            *lines, self._unread = self._unread.split(b"\n")
            for line in lines:
                try:
                    said = json.loads(line)
                except ValueError:
                    self._words.append(line.decode(errors="replace"))  # a traceback, or the loader's complaint
                    continue
                if "problem" in said and self.problem is None:
                    self.problem = str(said["problem"])
                if key in said:
                    return True
            left = max(0.0, deadline - time.monotonic())
            if not select.select([out], [], [], left)[0]:
                return False
            data = os.read(out, 65536)
            if not data:
                return False
            self._unread += data

    def _last_words(self) -> str:
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(1.0)
        return self._words[-1] if self._words else f"exit status {self._process.poll()}"

    def _reap(self, timeout_s: float) -> None:
        with contextlib.suppress(subprocess.TimeoutExpired):
            self._process.wait(timeout_s)
        if self._process.stdout is not None:
            self._process.stdout.close()

    def _enlarge_pipe(self) -> None:
        with contextlib.suppress(ImportError, AttributeError, OSError):
            import fcntl  # not everywhere, and a larger pipe is a comfort only

            fcntl.fcntl(self._pipe, fcntl.F_SETPIPE_SZ, PIPE_SIZE)
