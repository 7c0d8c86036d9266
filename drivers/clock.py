"""The wall's clock, for ports that are real."""

from __future__ import annotations

import select
import time
from collections.abc import Sequence
from typing import Any, cast

from drivers.wire import Port

SPIN_S = 0.0001
"""The last stretch before a deadline is spun, since a sleeping process wakes up about that late."""


class WallClock:
    """Seconds since it was made, by the monotonic clock; waits on the descriptors of the ports.

    A clock that the operating system steps (NTP, suspend) does not move it; `epoch_ns` is read once.
    """

    def __init__(self) -> None:
        self._start_s = time.perf_counter()
        self.epoch_ns = time.time_ns()

    def now(self) -> float:
        """Seconds since the clock was made."""
        return time.perf_counter() - self._start_s

    def wait(self, ports: Sequence[Port], until_s: float) -> Sequence[Port]:
        """Return when a port has bytes to read, at the latest at `until_s` (see `drivers.wire.Clock`)."""
        while True:
            left = until_s - self.now()
            timeout = 0.0 if left < SPIN_S else min(left - SPIN_S / 2, 1.0)
            # Also where it is late already: a caller that is always late would never see what has come.
            ready: Sequence[Any] = select.select(cast(Any, ports), [], [], timeout)[0]
            if ready or left <= 0:
                return ready
