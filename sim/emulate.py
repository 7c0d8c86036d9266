"""Simulated devices on pseudo-terminals (and sockets), for clients in other processes.

A pseudo-terminal passes bytes at once and knows neither baudrate nor parity, so the line keeps the wire time here:
a request counts as arrived when its last byte would have crossed a real wire, and a reply is handed over when its
last byte would have. On a real wire the first bit leaves when the client writes; here the bytes are seen some 30 µs
later, when kernel and scheduler have passed them on. Each terminal measures at its start how long that takes at the
least, and takes so much for part of the request's time on the wire. What remains is the reply's way through the
terminal, which a serial port's driver has too. (Polling for the next request instead of sleeping was tried: on a
busy machine the scheduler makes it pay for that with milliseconds.)
"""

from __future__ import annotations

import contextlib
import os
import select
import signal
import socket
import sys
import time
from collections.abc import Callable, Iterator
from typing import Any, Protocol, TextIO

from sim.clock import SimClock
from sim.line import Line
from sim.world import Endpoint, World, WorldSettings

LOOK_UP_S = 0.2

LONGEST_WAY_S = 1e-4
"""More than that a terminal is not believed to take: something else had the processor."""


class _Outlet(Protocol):
    """Where a client connects."""

    path: str

    def fileno(self) -> int: ...

    def pump(self) -> None: ...

    def close(self) -> None: ...


class PtyOutlet:
    """One device on a pseudo-terminal; `path` is what a client opens. Both ends are raw."""

    def __init__(self, line: Line) -> None:
        import tty

        self._master, self._slave = os.openpty()
        tty.setraw(self._master)
        tty.setraw(self._slave)  # held open: the terminal outlives its clients
        os.set_blocking(self._master, False)
        self.path = os.ttyname(self._slave)
        self._late_s = way_through_s(self._slave, self._master)
        self._line = line
        line.sink = self._deliver

    def _deliver(self, data: bytes) -> None:
        try:  # noqa: SIM105  # a context manager takes longer, and somebody waits for these bytes
            os.write(self._master, data)
        except BlockingIOError:
            pass  # with nobody reading, the terminal's buffer fills up; a real line would lose the bytes as well

    def fileno(self) -> int:
        """Descriptor to wait on."""
        return self._master

    def pump(self) -> None:
        """Pass on what the client has written."""
        try:
            data = os.read(self._master, 4096)
        except BlockingIOError:
            return
        self._line.host_write(data, self._late_s)

    def close(self) -> None:
        """Take the terminal away."""
        self._line.sink = None
        os.close(self._master)
        os.close(self._slave)


def way_through_s(slave: int, master: int, tries: int = 30) -> float:
    """How long bytes written at one end of a raw terminal take until a sleeper at the other has them: the shortest of
    some tries, so that who counts on it is never early."""
    spans = []
    for _ in range(tries):
        start_s = time.perf_counter()
        os.write(slave, bytes(9))
        select.select([master], [], [], 0.1)
        spans.append(time.perf_counter() - start_s)
        os.read(master, 4096)
    return min(*spans, LONGEST_WAY_S)


class TcpOutlet:
    """One device on a loopback socket, one client at a time; a new client takes the place of the one before."""

    def __init__(self, line: Line) -> None:
        self._server = socket.create_server(("127.0.0.1", 0))
        self._server.setblocking(False)
        self._client: socket.socket | None = None
        self._line = line
        self.path = f"socket://127.0.0.1:{self._server.getsockname()[1]}"
        line.sink = self._deliver

    def _deliver(self, data: bytes) -> None:
        if self._client is not None:
            with contextlib.suppress(OSError):
                self._client.sendall(data)

    def fileno(self) -> int:
        """Descriptor to wait on: the client's, or that on which one can connect."""
        return (self._client or self._server).fileno()

    def pump(self) -> None:
        """Accept a client, pass on what it has sent."""
        with contextlib.suppress(BlockingIOError):
            client, _ = self._server.accept()
            client.setblocking(False)
            client.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._drop_client()
            self._client = client
        if self._client is None:
            return
        try:
            data = self._client.recv(4096)
        except BlockingIOError:
            return
        except OSError:
            data = b""
        if data:
            self._line.host_write(data)
        else:
            self._drop_client()

    def _drop_client(self) -> None:
        if self._client is not None:
            self._client.close()
            self._client = None

    def close(self) -> None:
        """Close the sockets."""
        self._line.sink = None
        self._drop_client()
        self._server.close()


def outlet(endpoint: Endpoint) -> _Outlet:
    """A pseudo-terminal for a serial device; a socket for one on a network, and where there are no terminals."""
    if endpoint.tcp or not hasattr(os, "openpty"):
        return TcpOutlet(endpoint.line)
    return PtyOutlet(endpoint.line)


@contextlib.contextmanager
def outlets(world: World) -> Iterator[dict[str, _Outlet]]:
    """Outlets of all devices of a world, by key; closed in the end."""
    made: dict[str, _Outlet] = {}
    try:
        for key, endpoint in world.endpoints.items():
            made[key] = outlet(endpoint)
        yield made
    finally:
        for one in made.values():
            one.close()


def serve(world: World, out: TextIO, stopped: Callable[[], bool] | None = None) -> None:
    """Print `KEY PATH` a device, flushed, and serve until SIGINT, SIGTERM or until `stopped()`.

    Signals are caught only in the main thread. Raises ValueError for a world on a virtual clock.
    """
    clock: SimClock = world.clock
    if not clock.wall:
        raise ValueError("devices can be emulated on the wall clock only; set 'clock: wall'")
    asked = False

    def stop(number: int, frame: Any) -> None:
        nonlocal asked
        asked = True

    with outlets(world) as made, _signals(stop):
        for key, one in made.items():
            print(key, one.path, file=out, flush=True)
        ports = list(made.values())
        while not asked and not (stopped is not None and stopped()):
            for port in clock.wait(ports, clock.now() + LOOK_UP_S):
                port.pump()


@contextlib.contextmanager
def _signals(handler: Callable[[int, Any], None]) -> Iterator[None]:
    """Have SIGINT and SIGTERM call the handler meanwhile."""
    previous = {}
    with contextlib.suppress(ValueError):  # not the main thread
        for number in (signal.SIGINT, signal.SIGTERM):
            previous[number] = signal.signal(number, handler)
    try:
        yield
    finally:
        for number, before in previous.items():
            signal.signal(number, before)


def main(settings: WorldSettings) -> None:
    """Emulate a bench in this process: paths to standard output, until a signal comes."""
    serve(World(settings), sys.stdout)
