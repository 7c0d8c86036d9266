"""The wall's clock, for ports that are real."""

from __future__ import annotations

import ctypes
import select
import sys
import time
from collections.abc import Sequence
from typing import Any, cast

from drivers.wire import Port

SPIN_S = 0.0001
"""The last stretch before a deadline is spun, since a sleeping process wakes up about that late."""

WATCHING_S = 0.0004
"""The first stretch of a wait is spun where a reply is due: a process that sleeps then sees it 20 to 60 µs late."""

NAP_S, NAPPING_S = 0.0001, 0.005
"""For the first 5 ms of a wait nobody sleeps longer than a nap: a core that has nothing to do for some 0.2 ms takes 20
to 40 µs longer to wake, and by then most replies have come."""


class WallClock:
    """Seconds since it was made, by the monotonic clock; waits on the descriptors of the ports.

    A clock that the operating system steps (NTP, suspend) does not move it; `epoch_ns` is read once.
    """

    watches = True
    """Waits begin wide awake: a link asks to be looked at just before its reply is due (`Link.wake_at`)."""

    def __init__(self) -> None:
        self._start_s = time.perf_counter()
        self.epoch_ns = time.time_ns()
        _fine_timers()

    def now(self) -> float:
        """Seconds since the clock was made."""
        return time.perf_counter() - self._start_s

    def wait(self, ports: Sequence[Port], until_s: float) -> Sequence[Port]:
        """Return when a port has bytes to read, at the latest at `until_s` (see `drivers.wire.Clock`)."""
        now = self.now()
        watch_until_s, naps_until_s = now + WATCHING_S, now + NAPPING_S
        while now < until_s:
            left = until_s - now
            longest = NAP_S if now < naps_until_s else 1.0
            timeout = 0.0 if left < SPIN_S or now < watch_until_s else min(left - SPIN_S / 2, longest)
            ready: Sequence[Any] = select.select(cast(Any, ports), [], [], timeout)[0]
            if ready:
                return ready
            now = self.now()
        return ()


def _fine_timers() -> None:
    """Have Linux wake this thread from sleeps to the microsecond, not 50 µs later (a timer's default slack)."""
    if sys.platform == "linux":
        pr_set_timerslack = 29
        ctypes.CDLL(None).prctl(pr_set_timerslack, 1000, 0, 0, 0)
