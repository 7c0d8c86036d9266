"""Several devices on one RS485 line: their links share a port, and take turns.

Each device keeps its own `Link`, with its own queue, deadlines, counters and name, so that no driver knows of another.
What they share is a `Bus`: one request is in flight on the line; whoever has waited longest is next; a request that is
repeated waits for its turn again, so that a silent device costs the others one time-out a turn and no more. Bytes go to
whoever asked last: what another device says late is thrown away there (see `ModbusClient`), not taken for an answer.
"""

from __future__ import annotations

import contextlib
from typing import Any

import serial

from drivers.errors import DriverError, PortError
from drivers.port import Port, open_port
from drivers.regmap import LinkMap
from drivers.wire import Clock, Exchange, Link, T


class Bus:
    """A line and the links on it, the one that has waited longest first."""

    def __init__(self, url: str, port: Port, clock: Clock, settings: LinkMap) -> None:
        self.url = url
        self.port = port
        self.clock = clock
        self.settings = settings
        self.links: list[BusLink] = []
        self.holder: BusLink | None = None
        self.last: BusLink | None = None
        self.free_at_s = 0.0

    def next(self, now: float) -> BusLink | None:
        """Whose turn it is: of those that have something to send and may, the one that has waited longest."""
        if self.holder is not None or now < self.free_at_s:
            return None
        return next((link for link in self.links if link.wants_to_send(now)), None)

    def taken(self, link: BusLink) -> None:
        """A link has sent a request; it is the last in the queue from now on."""
        self.holder = self.last = link
        self.links.remove(link)
        self.links.append(link)

    def release(self, link: BusLink, now: float, free_at_s: float) -> None:
        """A link's exchange is over: every device gets its silence before the next request."""
        if self.holder is link:
            self.holder = None
        self.free_at_s = max(free_at_s, now + max((each.gap_s for each in self.links), default=0.0))


class BusLink(Link):
    """One device's link on a line that others may use too."""

    shared = True

    def __init__(self, name: str, bus: Bus, **options: Any) -> None:
        super().__init__(name, bus.port, bus.clock, **options)
        self.bus = bus
        bus.links.append(self)

    def wants_to_send(self, now: float) -> bool:
        """Whether something is queued, and the device's own silence is over."""
        return bool(self._queue) and now >= self._free_at_s and self.broken is None

    def submit(self, exchange: Exchange[T], *, urgent: bool = False) -> Exchange[T]:
        """As any link's; an urgent request is also the line's next."""
        if urgent and self.broken is None:
            self.bus.links.remove(self)
            self.bus.links.insert(0, self)
        return super().submit(exchange, urgent=urgent)

    def wake_at(self) -> float:
        """When `service` must be called although no byte came: also for the request of another that is in flight."""
        if self.bus.holder is not None:
            return Link.wake_at(self.bus.holder)
        return max(self._free_at_s, self.bus.free_at_s) if self._queue else float("inf")

    def service(self) -> None:
        """Serve whoever's request is in flight, then let the next one send."""
        if self.broken is not None:
            return
        bus = self.bus
        Link.service(bus.holder or bus.last or self)
        now = self.clock.now()
        link = bus.next(now)
        if link is not None:
            link._send_next(now)

    def close(self) -> None:
        """Leave the line; the last one closes the port."""
        if self.broken is None:
            super()._break(PortError(self.name, "the port is closed"))
        bus = self.bus
        if self in bus.links:
            bus.links.remove(self)
        bus.holder = None if bus.holder is self else bus.holder
        bus.last = None if bus.last is self else bus.last
        if not bus.links:
            _open.discard(bus)
            with contextlib.suppress(OSError, serial.SerialException):
                self.port.close()

    # -- inside ------------------------------------------------------------------------------------------------

    def _send_next(self, now: float) -> None:
        bus = self.bus
        if bus.next(now) is not self:
            return
        bus.taken(self)
        super()._send_next(now)
        if self._current is None:  # no answer is expected, or the port is gone
            bus.release(self, now, self._free_at_s)

    def _finish(self, exchange: Exchange[Any], now: float) -> None:
        super()._finish(exchange, now)
        self.bus.release(self, now, self._free_at_s)

    def _fail(self, error: DriverError, now: float) -> None:
        super()._fail(error, now)
        self.bus.release(self, now, self._free_at_s)

    def _stray(self, data: bytes, now: float) -> None:
        super()._stray(data, now)
        self.bus.free_at_s = max(self.bus.free_at_s, self._free_at_s)

    def _break(self, error: DriverError) -> None:
        """The port is gone for all of them."""
        for link in list(self.bus.links):
            if link.broken is None:
                Link._break(link, PortError(link.name, error.message))
        self.bus.holder = None


_open: set[Bus] = set()
"""Lines with at least one link; a port is opened once a process."""


def bus_link(name: str, url: str, clock: Clock, settings: LinkMap, **options: Any) -> BusLink:
    """A link on the line at a port: one that is open already (on the same clock), or a new one.

    Raises `PortError` where the port cannot be opened, or another device on the line wants other settings of it.
    """
    for bus in _open:
        if bus.url == url and bus.clock is clock:
            first = bus.settings
            if first.model_copy(update={"gap_us": None}) != settings.model_copy(update={"gap_us": None}):
                others = ", ".join(link.name for link in bus.links)
                message = f"{url!r} is {others}'s too, set to {_words(first)}, and {_words(settings)} is wanted here"
                raise PortError(name, f"{message}; devices on one line need the same")
            return BusLink(name, bus, **options)
    port = open_port(name, url, settings.baudrate, parity=settings.parity, stopbits=settings.stopbits)
    bus = Bus(url, port, clock, settings)
    _open.add(bus)
    return BusLink(name, bus, **options)


def _words(settings: LinkMap) -> str:
    return f"{settings.baudrate} baud, 8{settings.parity}{settings.stopbits}"
