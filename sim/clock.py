"""The clock of a simulated bench: virtual, where waiting jumps to the next event, or the wall's.

Everything that happens by itself in a simulated bench (a frame's last byte arrives, a watchdog expires, an
amplifier starts its next line) is an event scheduled here. Events run in time order, and in the order they were
scheduled where times are equal, so that a run is a function of its seed. An event is given the time it was
scheduled for, which on the wall clock can be a little earlier than `now()`.
"""

from __future__ import annotations

import ctypes
import heapq
import math
import select
import sys
import time
from collections.abc import Callable, Sequence
from typing import Any

VIRTUAL_EPOCH_NS = 1_767_225_600_000_000_000
"""Virtual time starts at 2026-01-01T00:00:00Z always: one seed, the same bytes."""

WAKE_MARGIN_S = 6e-5
"""A sleeping process wakes up about this late; the last stretch before an event is spun."""

NAP_S, NAPPING_S = 1e-4, 0.02
"""On the wall clock nobody sleeps longer than a nap until so long after the last bytes: a core that has nothing to do
for some 0.2 ms takes 20 to 40 µs longer to wake, and a conversation is usually going on."""


class Deadlock(RuntimeError):
    """Waiting without end on a virtual clock on which nothing is going to happen."""


class Event:
    """A scheduled callback; `cancel` keeps it from running."""

    __slots__ = ("at_s", "callback")

    def __init__(self, at_s: float, callback: Callable[[float], None]) -> None:
        self.at_s = at_s
        self.callback: Callable[[float], None] | None = callback

    def cancel(self) -> None:
        """Keep it from running; harmless when it has run."""
        self.callback = None


class SimClock:
    """Time of one simulated bench, in seconds since it was made.

    `wall=False`: virtual; `wait` moves the time. `wall=True`: real time passes, the same events run when they are
    due, and ports with a descriptor (pseudo-terminals, sockets) are waited on as well.
    """

    def __init__(self, wall: bool = False) -> None:
        self.wall = wall
        self.epoch_ns = time.time_ns() if wall else VIRTUAL_EPOCH_NS
        self._start_s = time.perf_counter()
        self._now_s = 0.0
        self._events: list[tuple[float, int, Event]] = []
        self._count = 0
        self._arrival = False
        self._unread = 0
        if wall:
            _fine_timers()

    def now(self) -> float:
        """Seconds since the clock was made."""
        return time.perf_counter() - self._start_s if self.wall else self._now_s

    def schedule(self, at_s: float, callback: Callable[[float], None]) -> Event:
        """Have `callback(at_s)` run when the time is `at_s`; what lies in the past runs with the next wait."""
        event = Event(at_s, callback)
        self._count += 1
        heapq.heappush(self._events, (at_s, self._count, event))
        return event

    def next_event_s(self) -> float:
        """When the next event is due; infinity if there is none."""
        events = self._events
        while events and events[0][2].callback is None:
            heapq.heappop(events)
        return events[0][0] if events else float("inf")

    def arrived(self) -> None:
        """A line has delivered a frame to its host: a waiting caller is to look."""
        self._arrival = True
        self._unread += 1

    def taken(self) -> None:
        """A host has read such a frame to its end."""
        self._unread -= 1

    def stall(self, seconds: float) -> None:
        """The host does nothing for so long, while everything else goes on. Called from an event."""
        if self.wall:
            time.sleep(seconds)
            return
        until_s = self._now_s + seconds
        events = self._events
        while events and events[0][0] <= until_s:
            at_s, _, event = heapq.heappop(events)
            if event.callback is not None:
                self._now_s = max(self._now_s, at_s)
                event.callback(at_s)
        self._now_s = max(self._now_s, until_s)
        self._arrival = True

    def wake(self) -> None:
        """Have a waiting caller look, although nothing came. Called from an event."""
        self._arrival = True

    def run_due(self) -> None:
        """Run the events that are due by now; the wall clock's ports do so before they are read."""
        self._run_until(self.now())

    def wait(self, ports: Sequence[Any], until_s: float) -> Sequence[Any]:
        """Return as soon as one of the ports has bytes to read, at the latest at `until_s`; returns those that have.

        `ports` are pyserial ports: `frame_waiting`, `in_waiting`; on the wall clock others are selected on.
        A frame wakes a waiting caller when its last byte has arrived, and not at each byte.

        Raises `Deadlock` on a virtual clock where `until_s` is infinite and nothing is scheduled.
        """
        if self.wall:
            return self._wait_wall(ports, until_s)
        if self._unread:
            ready = [port for port in ports if port.frame_waiting]
            if ready:
                return ready
        events = self._events
        self._arrival = False
        while events and events[0][0] <= until_s:
            at_s, _, event = heapq.heappop(events)
            callback = event.callback
            if callback is None:
                continue
            if at_s > self._now_s:
                self._now_s = at_s
            callback(at_s)
            if self._arrival:
                self._arrival = False
                ready = [port for port in ports if port.frame_waiting]
                if ready:
                    return ready
        if until_s == float("inf"):
            raise Deadlock("waiting for bytes that nothing on this simulated bench is going to send")
        if until_s > self._now_s:
            self._now_s = until_s
        return ()

    def _run_until(self, until_s: float) -> None:
        events = self._events
        while events and events[0][0] <= until_s:
            at_s, _, event = heapq.heappop(events)
            if event.callback is not None:
                event.callback(at_s)

    def _wait_wall(self, ports: Sequence[Any], until_s: float) -> Sequence[Any]:
        simulated = [port for port in ports if hasattr(port, "line")]
        descriptors = [port for port in ports if not hasattr(port, "line")]  # select takes what has a fileno
        naps_until_s = self.now() + NAPPING_S
        while True:
            self.run_due()
            ready = [port for port in simulated if port.in_waiting]
            if ready:
                return ready
            now_s = self.now()
            wake_s = min(until_s, self.next_event_s())
            sleep_s = min(wake_s - now_s - WAKE_MARGIN_S, NAP_S if now_s < naps_until_s else 1.0)
            if descriptors:
                ready = select.select(descriptors, [], [], max(0.0, sleep_s))[0]
                if ready:
                    return ready
            elif sleep_s > 0.0:
                time.sleep(sleep_s)
            if now_s >= until_s:
                return ()


class SteppedClock(SimClock):
    """What the host sees of a bench's clock that is set forward or back while the run goes on.

    The devices live on `inner`; `step_s` is by how much the host's is ahead of it.
    """

    def __init__(self, inner: SimClock) -> None:
        super().__init__(False)
        self.wall = inner.wall
        self.epoch_ns = inner.epoch_ns
        self.inner = inner
        self.step_s = 0.0

    def now(self) -> float:
        """Seconds since the clock was made, as the host has them."""
        return self.inner.now() + self.step_s

    def schedule(self, at_s: float, callback: Callable[[float], None]) -> Event:
        """On the devices' clock, at the time that the host means now."""
        return self.inner.schedule(at_s - self.step_s, callback)

    def run_due(self) -> None:
        """As on the inner clock."""
        self.inner.run_due()

    def next_event_s(self) -> float:
        """As the host counts."""
        return self.inner.next_event_s() + self.step_s

    def wait(self, ports: Sequence[Any], until_s: float) -> Sequence[Any]:
        """As on the inner clock, until the host's clock shows `until_s` unless it is set meanwhile."""
        inner_s = until_s - self.step_s
        while inner_s + self.step_s < until_s:  # rounding: who waits must not find himself a hair before his time
            inner_s = math.nextafter(inner_s, math.inf)
        return self.inner.wait(ports, inner_s)


def _fine_timers() -> None:
    """Have Linux wake this thread from sleeps to the microsecond, not 50 µs later (a timer's default slack)."""
    if sys.platform == "linux":
        pr_set_timerslack = 29
        ctypes.CDLL(None).prctl(pr_set_timerslack, 1000, 0, 0, 0)
