"""Ctrl-C, SIGTERM and SIGHUP during a run: noted, never thrown, so that they break neither the loop nor the file.

The first stops the run softly, the second hard, and any further one finds the stop under way. A signal also ends the
wait that the loop is in: its number comes through a pipe that the loop waits on beside its ports.
"""

from __future__ import annotations

import contextlib
import os
import signal
from collections.abc import Iterator
from types import FrameType

SIGNALS = tuple(getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name))


class Operator:
    """What the person at the bench (or the system) has asked for by signals.

    `strikes`: how many have come; `wish`: what the first of them was, as the cause of a stop.
    """

    def __init__(self) -> None:
        self.strikes = 0
        self.wish: str | None = None
        self.waker: Waker | None = None

    def strike(self, wish: str) -> None:
        """Somebody wants the run to stop; once more, and harder."""
        self.strikes += 1
        if self.wish is None:
            self.wish = wish

    def on_signal(self, number: int, frame: FrameType | None) -> None:
        """The handler."""
        name = signal.Signals(number).name
        self.strike("stopped by the operator (Ctrl-C)" if name == "SIGINT" else f"stopped by signal {name}")


class Waker:
    """A pipe that has a byte in it when a signal came: something a wait on descriptors wakes up for."""

    def __init__(self) -> None:
        self.reader, self.writer = os.pipe()
        os.set_blocking(self.reader, False)
        os.set_blocking(self.writer, False)

    def fileno(self) -> int:
        """Descriptor to wait on."""
        return self.reader

    def read(self, size: int = 1, /) -> bytes:
        """The signals' numbers that have come, as bytes; empty where none has."""
        try:
            return os.read(self.reader, size)
        except BlockingIOError:
            return b""

    def write(self, data: bytes, /) -> int | None:
        """Nothing: it is written by signals."""
        return None

    def close(self) -> None:
        """Close both ends."""
        os.close(self.reader)
        os.close(self.writer)


@contextlib.contextmanager
def listening(operator: Operator) -> Iterator[None]:
    """Have the signals told to `operator` meanwhile. Not in the main thread: there somebody else has them."""
    try:
        before = {number: signal.signal(number, operator.on_signal) for number in SIGNALS}
    except ValueError:
        yield
        return
    operator.waker = Waker()
    woken_before = signal.set_wakeup_fd(operator.waker.writer, warn_on_full_buffer=False)
    try:
        yield
    finally:
        signal.set_wakeup_fd(woken_before)
        for number, handler in before.items():
            signal.signal(number, handler)
        operator.waker.close()
        operator.waker = None
