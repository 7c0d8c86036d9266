"""What a run is doing, in one line of the terminal, at a price that a 1 kHz loop can pay.

No thread, no colour: some ten microseconds five times a second. A terminal that takes nothing (Ctrl-S) is passed over:
it must not hold up the motor.
"""

from __future__ import annotations

import select
import shutil
import sys
import time
from typing import TextIO

EVERY_S = 0.2
BAR = 24


class Progress:
    """Redrawn in place on a terminal, silent elsewhere; a context manager that wipes its line in the end."""

    def __init__(self, total_s: float, out: TextIO | None = None) -> None:
        self._total_s = total_s
        self._out = sys.stderr if out is None else out
        self._shown = self._out.isatty()
        self._next_s = 0.0

    def tell(self, bench_s: float, label: str) -> None:
        """Called in every turn of the loop: cheap unless it is time to draw."""
        if not self._shown:
            return
        now_s = time.perf_counter()
        if now_s < self._next_s:
            return
        self._next_s = now_s + EVERY_S
        done = round(BAR * min(bench_s / self._total_s, 1.0))
        self._draw(f"{'█' * done}{'·' * (BAR - done)} {bench_s:6.1f} of {self._total_s:.0f} s at most  {label}")

    def __enter__(self) -> Progress:
        return self

    def __exit__(self, *_: object) -> None:
        if self._shown:
            self._draw("")

    def _draw(self, text: str) -> None:
        try:
            if select.select([], [self._out], [], 0.0)[1]:
                columns = shutil.get_terminal_size().columns
                self._out.write(f"\r\x1b[K{text[: columns - 1]}")
                self._out.flush()
        except (OSError, ValueError):
            self._shown = False  # the terminal is gone: that is no reason to stop a motor in mid-air
