"""What a long run must keep until its file is finished, without keeping it in memory."""

from __future__ import annotations

import contextlib
import io
import tempfile
from collections.abc import Iterator
from pathlib import Path

IN_MEMORY = 1 << 20
"""Bytes kept in memory before they go to a file: a run of seven minutes has no such file."""

PIECE = 1 << 18


class Spool:
    """Bytes that are appended now and read once at the end; the file has no name, and goes with its process.

    Never raises: what the disk does not take stays in memory.
    """

    def __init__(self, folder: Path) -> None:
        self._folder = folder
        self._open = contextlib.ExitStack()
        self._tail = bytearray()  # behind what is in the file
        self._file: io.FileIO | None = None
        self._size = 0  # of the file's part
        self._try_at = IN_MEMORY

    def append(self, data: bytes) -> None:
        """More bytes, behind those before."""
        self._tail += data
        if len(self._tail) >= self._try_at:
            self._hand_over()

    def pieces(self) -> Iterator[bytes]:
        """All of it from the beginning, some at a time. Raises OSError where the file cannot be read back."""
        if self._file is not None:
            self._file.seek(0)
            left = self._size
            while left > 0:
                piece = self._file.read(min(PIECE, left))
                if not piece:
                    raise OSError(f"{left} bytes of the index are missing")
                left -= len(piece)
                yield piece
        yield bytes(self._tail)

    def close(self) -> None:
        """Forget all of it."""
        self._tail = bytearray()
        self._open.close()

    def _hand_over(self) -> None:
        """From memory to the file, all of it or nothing; a full disk is asked again when there is twice as much."""
        tail = self._tail
        try:
            if self._file is None:
                with contextlib.ExitStack() as stack:
                    self._file = stack.enter_context(tempfile.TemporaryFile(buffering=0, dir=self._folder))
                    self._open = stack.pop_all()
            done = 0
            while done < len(tail):
                done += self._file.write(memoryview(tail)[done:]) or 0
        except OSError:
            self._try_at = 2 * len(tail)
            if self._file is not None:
                with contextlib.suppress(OSError):
                    self._file.seek(self._size)
            return
        self._size += done
        self._tail, self._try_at = bytearray(), IN_MEMORY
