"""Simulated devices on pseudo-terminals (and sockets), for clients in other processes.

A pseudo-terminal passes bytes at once and knows neither baudrate nor parity, so the line keeps the wire time here:
a request counts as arrived when its last byte would have crossed a real wire, and a reply is handed over when its
last byte would have. On a real wire the first bit leaves when the client writes; here the bytes are seen some 30 µs
later, when kernel and scheduler have passed them on. Each terminal measures at its start how long that takes at the
least, and takes so much for part of the request's time on the wire. What remains is the reply's way through the
terminal, which a serial port's driver has too. (Polling for the next request instead of sleeping was tried: on a
busy machine the scheduler makes it pay for that with milliseconds.)

A port that a fault pulls out is hung up, and is gone from its path until it is plugged in again: its client meets the
errors of an adapter without its cable, and has to open it anew.
"""

from __future__ import annotations

import contextlib
import os
import select
import signal
import socket
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path
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

    def follow(self) -> bool: ...

    def close(self) -> None: ...


class PtyOutlet:
    """One device on a pseudo-terminal; `path` is what a client opens. Both ends are raw.

    `comes_back`: the port may be pulled out and plugged in again. Its path is then a link, as the system gives a new
    terminal any name.
    """

    def __init__(self, line: Line, comes_back: bool = False) -> None:
        self._line = line
        self._ends: tuple[int, int] | None = None
        self._link = Path(tempfile.mkdtemp(prefix="padbench-"), "port") if comes_back else None
        self._late_s = 0.0
        self.path = str(self._link or "")
        self.follow()
        line.sink = self._deliver

    def follow(self) -> bool:
        """Be there, or not, as the line is; returns whether it is."""
        here = self._line.gone is None
        if here and self._ends is None:
            self._plug()
        elif not here and self._ends is not None:
            self._pull()
        return here

    def _plug(self) -> None:
        import tty

        master, slave = self._ends = os.openpty()
        tty.setraw(master)
        tty.setraw(slave)  # held open: the terminal outlives its clients
        os.set_blocking(master, False)
        self._late_s = way_through_s(slave, master)
        if self._link is not None:
            self._link.symlink_to(os.ttyname(slave))
        else:
            self.path = os.ttyname(slave)

    def _pull(self) -> None:
        """Both ends are closed: who has the terminal open meets an error, and nobody finds it any more."""
        assert self._ends is not None
        ends, self._ends = self._ends, None
        if self._link is not None:
            self._link.unlink()
        for end in ends:
            os.close(end)

    def _deliver(self, data: bytes) -> None:
        if self._ends is None or self._line.gone is not None:
            return
        try:  # noqa: SIM105  # a context manager takes longer, and somebody waits for these bytes
            os.write(self._ends[0], data)
        except BlockingIOError:
            pass  # with nobody reading, the terminal's buffer fills up; a real line would lose the bytes as well

    def fileno(self) -> int:
        """Descriptor to wait on; only while it is there."""
        assert self._ends is not None
        return self._ends[0]

    def pump(self) -> None:
        """Pass on what the client has written."""
        if self._ends is None:
            return
        try:
            data = os.read(self._ends[0], 4096)
        except BlockingIOError:
            return
        if self.follow():
            self._line.host_write(data, self._late_s)

    def close(self) -> None:
        """Take the terminal away."""
        self._line.sink = None
        if self._ends is not None:
            self._pull()
        if self._link is not None:
            self._link.parent.rmdir()


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
        self._client: socket.socket | None = None
        self._line = line
        self._server = self._listen(0)
        self._port = self._server.getsockname()[1]
        self.path = f"socket://127.0.0.1:{self._port}"
        line.sink = self._deliver

    @staticmethod
    def _listen(port: int) -> socket.socket:
        server = socket.create_server(("127.0.0.1", port))
        server.setblocking(False)
        return server

    def follow(self) -> bool:
        """Be there, or not, as the line is; returns whether it is."""
        here = self._line.gone is None
        if not here:
            self._drop_client()
            self._server.close()
        elif self._server.fileno() < 0:
            self._server = self._listen(self._port)
        return here

    def _deliver(self, data: bytes) -> None:
        if self._client is not None and self._line.gone is None:
            with contextlib.suppress(OSError):
                self._client.sendall(data)

    def fileno(self) -> int:
        """Descriptor to wait on: the client's, or that on which one can connect."""
        return (self._client or self._server).fileno()

    def pump(self) -> None:
        """Accept a client, pass on what it has sent."""
        if not self.follow():
            return
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


def outlet(endpoint: Endpoint, comes_back: bool = False) -> _Outlet:
    """A pseudo-terminal for a serial device; a socket for one on a network, and where there are no terminals."""
    if endpoint.tcp or not hasattr(os, "openpty"):
        return TcpOutlet(endpoint.line)
    return PtyOutlet(endpoint.line, comes_back)


@contextlib.contextmanager
def outlets(world: World) -> Iterator[dict[str, _Outlet]]:
    """Outlets of all devices of a world, by key; closed in the end."""
    made: dict[str, _Outlet] = {}
    pulled = {fault.get("device") for fault in world.settings.faults if fault.get("kind") == "unplugged"}
    try:
        for key, endpoint in world.endpoints.items():
            made[key] = outlet(endpoint, comes_back=key in pulled)
        yield made
    finally:
        for one in made.values():
            one.close()


def serve(world: World, out: TextIO, stopped: Callable[[], bool] | None = None) -> None:
    """Print `KEY PATH` a device, flushed, and serve until SIGINT, SIGTERM or until `stopped()`.

    Signals are caught only in the main thread. Faults that strike the process that runs a bench (it is killed, its disk
    is full) strike nobody here: that is the client's. Raises ValueError for a world on a virtual clock.
    """
    clock: SimClock = world.clock
    if not clock.wall:
        raise ValueError("devices can be emulated on the wall clock only; set 'clock: wall'")
    world.host_acts.clear()
    asked = False

    def stop(number: int, frame: Any) -> None:
        nonlocal asked
        asked = True

    with outlets(world) as made, _signals(stop):
        for key, one in made.items():
            print(key, one.path, file=out, flush=True)
        while not asked and not (stopped is not None and stopped()):
            ports = [port for port in made.values() if port.follow()]
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
