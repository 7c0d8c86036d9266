"""Ports, exchanges, deadlines and retries: everything between a driver and the bytes.

No call here blocks. A `Link` is one port as a small state machine: requests queue, `service` moves bytes and
finishes exchanges, and `wake_at` says when it must be serviced again although nothing arrived. Whoever owns
several links waits on all of them at once on a clock that is passed in (`Clock.wait`), so that a silent device
never delays the others. Drivers describe longer conversations as generators of exchanges and pauses (`Steps`);
`complete` runs one to its end, the bench's loop interleaves them with everything else.
"""

from __future__ import annotations

import contextlib
from collections import deque
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from typing import Any, Generic, Protocol, TypeAlias, TypeVar

import serial

from drivers.errors import DeviceTimeout, DriverError, FrameError, PortError
from drivers.port import Port as Port
from drivers.port import open_port as open_port
from drivers.port import raw_io

T = TypeVar("T")

BEFORE_REPLY_S = 0.0001
"""On a clock that watches, a link is looked at so long before a reply is due, judging by those before."""

QUIET_AFTER_FAULT_S = 0.002
"""Silence that must pass after a timeout or a broken frame before the next request, so that a late reply
is thrown away and not taken for the next answer."""

MAX_QUIET_S = 0.05
"""A line that never falls silent (a device that sends by itself) is spoken to all the same after so long."""

READ_SIZE = 4096

SILENT_CHECK_S = 0.25
"""A port that gives nothing for so long is asked whether it is still there: a terminal that was unplugged reads as
silent for ever."""


class Clock(Protocol):
    """The bench's clock: the wall's, or a simulated bench's."""

    epoch_ns: int
    """Nanoseconds since 1970 at `now() == 0`."""

    def now(self) -> float:
        """Seconds since the clock was made; never goes back."""
        ...

    def wait(self, ports: Sequence[Port], until_s: float) -> Sequence[Port]:
        """Return as soon as one of the ports has bytes to read, at the latest at `until_s`; returns those that have."""
        ...


@dataclass(slots=True)
class Traffic:
    """Counters of one link, for reports and for tests that must know that bytes crossed."""

    bytes_out: int = 0
    bytes_in: int = 0
    exchanges: int = 0
    retries: int = 0
    timeouts: int = 0
    bad_frames: int = 0
    refusals: int = 0
    stray_bytes: int = 0


class Exchange(Generic[T]):
    """One request and its reply.

    `length(buffer)` returns how many bytes the complete reply has, 0 while that cannot be said or more bytes
    are needed, and raises `FrameError` when the buffer cannot become a reply. It may delete bytes at the buffer's
    front that belong to no reply (line noise, the rest of a stream); they count as stray.
    `parse(frame, sent_s, received_s)` turns the complete frame into the value, and may raise any `DriverError`.
    `repeatable` says whether sending it twice does no harm; only then it is retried. A request of which no reply is
    expected has `length=None`.
    """

    __slots__ = (
        "attempts", "done", "error", "length", "name", "parse", "received_s", "repeatable", "request",
        "sent_s", "timeout_s", "value",
    )  # fmt: skip

    def __init__(
        self,
        name: str,
        request: bytes,
        length: Callable[[bytearray], int] | None,
        parse: Callable[[bytes, float, float], T],
        timeout_s: float,
        repeatable: bool = True,
    ) -> None:
        self.name = name
        self.request = request
        self.length = length
        self.parse = parse
        self.timeout_s = timeout_s
        self.repeatable = repeatable
        self.attempts = 0
        self.done = False
        self.value: T | None = None
        self.error: DriverError | None = None
        self.sent_s = 0.0
        self.received_s = 0.0

    def result(self) -> T:
        """The value; raises the error the exchange ended with."""
        if self.error is not None:
            raise self.error
        assert self.done
        return self.value  # type: ignore[return-value]  # done without error: parse has returned a T


@dataclass(frozen=True, slots=True)
class Pause:
    """In `Steps`: wait so many seconds on the bench's clock."""

    seconds: float


Steps: TypeAlias = Generator["Exchange[Any] | Pause", Any, T]
"""A conversation: yields exchanges (the value, or the error raised inside, comes back) and pauses."""


class Link:
    """One port, one request in flight.

    `bits_per_byte` and `baudrate` give the wire time (`wire_s`), 0 baud for ports without one (TCP).
    `gap_s` is the silence the device wants between a reply and the next request.
    `shared`: other devices' replies may come on this line.
    Bytes that belong to no exchange go to `listener(data, received_s)` if one is set, else they count as stray.
    """

    shared = False

    def __init__(
        self,
        name: str,
        port: Port,
        clock: Clock,
        *,
        baudrate: int = 0,
        bits_per_byte: int = 10,
        gap_s: float = 0.0,
        attempts: int = 3,
    ) -> None:
        self.name = name
        self.port = port
        self.clock = clock
        self.traffic = Traffic()
        self.listener: Callable[[bytes, float], None] | None = None
        self.byte_s = bits_per_byte / baudrate if baudrate else 0.0
        self.gap_s = gap_s
        self.attempts = attempts
        self.broken: DriverError | None = None
        self._queue: deque[Exchange[Any]] = deque()
        self._current: Exchange[Any] | None = None
        self._buffer = bytearray()
        self._deadline_s = 0.0
        self._due_s = 0.0
        self._usual_s: dict[str, float] = {}
        self._watches = bool(getattr(clock, "watches", False))
        self._free_at_s = 0.0
        self._quiet_limit_s = 0.0
        self._check_at_s = 0.0
        self._asked_s = 0.0
        self._gave_up = False
        self._read, self._write = raw_io(port)

    def wire_s(self, byte_count: int) -> float:
        """Time that so many bytes take on the wire, seconds."""
        return byte_count * self.byte_s

    @property
    def idle(self) -> bool:
        """Nothing in flight and nothing queued."""
        return self._current is None and not self._queue

    def submit(self, exchange: Exchange[T], *, urgent: bool = False) -> Exchange[T]:
        """Queue a request; an urgent one goes before everything that is not yet on the wire."""
        if self.broken is not None:
            exchange.error = self.broken
            exchange.done = True
            return exchange
        if urgent:
            self._queue.appendleft(exchange)
        else:
            self._queue.append(exchange)
        if self._current is None:
            self._send_next(self.clock.now())
        return exchange

    def drop_queue(self) -> list[Exchange[Any]]:
        """Forget what is queued but not on the wire (a stop goes out before everything else); returns what it was."""
        dropped = list(self._queue)
        self._queue.clear()
        return dropped

    def wake_at(self) -> float:
        """When `service` must be called although no byte came (bench clock); infinity if never."""
        if self._current is not None:
            return self._due_s if self._watches and self.clock.now() < self._due_s else self._deadline_s
        return self._free_at_s if self._queue else float("inf")

    def service(self) -> None:
        """Take what has come, finish or retry the exchange in flight, send the next. Never blocks."""
        if self.broken is not None:
            return
        try:
            data = self._read(READ_SIZE)
            now = self.clock.now()
            if data:
                self._check_at_s = now + SILENT_CHECK_S
            elif now >= self._check_at_s:
                self._check_at_s = now + SILENT_CHECK_S
                getattr(self.port, "in_waiting", 0)
        except (OSError, serial.SerialException) as error:
            self._break(PortError(self.name, f"the port was lost ({error}); check cable and adapter"))
            return
        if data:
            self._take(data, now)
        if self._current is not None and now >= self._deadline_s:
            self._fail(DeviceTimeout(self.name, self._timeout_message(self._current)), now)
        if self._current is None and self._queue:
            self._send_next(now)

    def close(self) -> None:
        """Close the port; what is in flight ends with `PortError`."""
        if self.broken is None:
            self._break(PortError(self.name, "the port is closed"))
        with contextlib.suppress(OSError, serial.SerialException):
            self.port.close()

    # -- inside ------------------------------------------------------------------------------------------------

    def _take(self, data: bytes, now: float) -> None:
        self.traffic.bytes_in += len(data)
        exchange = self._current
        if exchange is None or now < self._asked_s:
            self._stray(data, now)
            return
        self._buffer += data
        assert exchange.length is not None
        size = 0
        try:
            held = len(self._buffer)
            size = exchange.length(self._buffer)
            self.traffic.stray_bytes += held - len(self._buffer)
            if size == 0 or size > len(self._buffer):
                return
            frame = bytes(self._buffer[:size])
            exchange.value = exchange.parse(frame, exchange.sent_s, now)
        except FrameError as error:
            self._fail(error, now)
            return
        except DriverError as error:
            self.traffic.refusals += 1
            exchange.error = error
        rest = bytes(self._buffer[size:])
        self._finish(exchange, now)
        if rest:
            self._stray(rest, now)

    def _stray(self, data: bytes, now: float) -> None:
        if self.listener is not None:
            self.listener(data, now)
            return
        self.traffic.stray_bytes += len(data)
        if now < self._quiet_limit_s:
            # A late reply, still coming: the silence counts from its end.
            self._free_at_s = min(now + max(self.gap_s, QUIET_AFTER_FAULT_S), self._quiet_limit_s)

    def _finish(self, exchange: Exchange[Any], now: float) -> None:
        exchange.received_s = now
        exchange.done = True
        took_s = now - exchange.sent_s
        usual_s = self._usual_s.get(exchange.name, took_s)
        # The shortest of late, forgotten slowly: one late reply must not have the next one looked for too late.
        self._usual_s[exchange.name] = took_s if took_s < usual_s else usual_s + 0.02 * (took_s - usual_s)
        self.traffic.exchanges += 1
        self._current = None
        self._buffer.clear()
        self._free_at_s = now + self.gap_s

    def _fail(self, error: DriverError, now: float) -> None:
        exchange = self._current
        assert exchange is not None
        if isinstance(error, DeviceTimeout):
            self.traffic.timeouts += 1
            self._gave_up = self._asked_s == 0.0
        else:
            self.traffic.bad_frames += 1
        self.traffic.stray_bytes += len(self._buffer)
        self._current = None
        self._buffer.clear()
        self._free_at_s = now + max(self.gap_s, QUIET_AFTER_FAULT_S)
        self._quiet_limit_s = now + max(self.gap_s, MAX_QUIET_S)
        if exchange.repeatable and exchange.attempts < self.attempts:
            self.traffic.retries += 1
            self._queue.appendleft(exchange)
        else:
            exchange.error = error
            exchange.received_s = now
            exchange.done = True

    def _send_next(self, now: float) -> None:
        if now < self._free_at_s or not self._queue:
            return
        exchange = self._queue.popleft()
        try:
            self._write(exchange.request)
        except (OSError, serial.SerialException) as error:
            exchange.error = PortError(self.name, f"cannot write to the port ({error})")
            exchange.done = True
            self._break(exchange.error)
            return
        self.traffic.bytes_out += len(exchange.request)
        exchange.attempts += 1
        exchange.sent_s = now
        if exchange.length is None:
            exchange.value = exchange.parse(b"", now, now)
            self._finish(exchange, now)
            self._free_at_s = now + self.wire_s(len(exchange.request)) + self.gap_s
            return
        self._current = exchange
        # What comes after a time-out before this request can have left the wire answers the one that was given up.
        self._asked_s = now + self.wire_s(len(exchange.request)) if self._gave_up else 0.0
        self._gave_up = False
        self._quiet_limit_s = 0.0
        self._buffer.clear()
        self._deadline_s = now + exchange.timeout_s + self.wire_s(len(exchange.request))
        self._due_s = now + self._usual_s.get(exchange.name, 0.0) - BEFORE_REPLY_S

    def _timeout_message(self, exchange: Exchange[Any]) -> str:
        got = f", only {len(self._buffer)} bytes" if self._buffer else ""
        return (
            f"no answer to '{exchange.name}' within {exchange.timeout_s * 1e3:.0f} ms{got}; "
            "check power, cable, baudrate, parity and address"
        )

    def _break(self, error: DriverError) -> None:
        self.broken = error
        for exchange in [self._current, *self._queue]:
            if exchange is not None and not exchange.done:
                exchange.error = error
                exchange.done = True
        self._current = None
        self._queue.clear()


def complete(steps: Steps[T], link: Link, others: Sequence[Link] = ()) -> T:
    """Run a conversation on `link` to its end, servicing `others` meanwhile; for set-up and for tests.

    Raises whatever `DriverError` the conversation ends with.
    """
    links = [link, *others]
    reply: Any = None
    failure: DriverError | None = None
    while True:
        try:
            item = steps.throw(failure) if failure is not None else steps.send(reply)
        except StopIteration as stop:
            return stop.value  # type: ignore[no-any-return]  # StopIteration carries Any
        reply, failure = None, None
        if isinstance(item, Pause):
            _serve(links, link.clock.now() + item.seconds, None)
            continue
        link.submit(item)
        _serve(links, float("inf"), item)
        reply, failure = item.value, item.error


def call(exchange: Exchange[T], link: Link) -> T:
    """Submit one exchange and wait for its value."""
    link.submit(exchange)
    _serve([link], float("inf"), exchange)
    return exchange.result()


def _serve(links: Sequence[Link], until_s: float, exchange: Exchange[Any] | None) -> None:
    clock = links[0].clock
    while not (exchange is not None and exchange.done):
        now = clock.now()
        if now >= until_s:
            return
        ports = [link.port for link in links if link.broken is None]  # a lost one would wake us for ever
        clock.wait(ports, min([until_s, *(link.wake_at() for link in links)]))
        for link in links:
            link.service()
