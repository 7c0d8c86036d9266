"""What a search has cost, in simulated samples: a clock would have a busy machine find less than an idle one."""

from __future__ import annotations

from threading import Lock


class Work:
    """Samples simulated on a measurement so far; a few threads count on it at once."""

    def __init__(self) -> None:
        self._samples, self._lock = 0, Lock()

    @property
    def samples(self) -> int:
        """So many, over all numbers and causes tried."""
        return self._samples

    def add(self, samples: int) -> None:
        """One more simulation over so many."""
        with self._lock:
            self._samples += samples
