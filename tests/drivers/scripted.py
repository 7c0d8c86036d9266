"""The wire, scripted: a port that must be sent exactly these bytes and gives exactly those, on a clock that waits."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence

from drivers.wire import Link, Port

Reply = bytes | Sequence[tuple[float, bytes]] | None
"""Bytes that come at once, pieces with the delay of each after the request (seconds), or nothing at all."""


def octets(text: str) -> bytes:
    """Bytes as the manuals print them: `01 64 1e`."""
    return bytes.fromhex(text)


class ManualClock:
    """Time that passes only by waiting for it."""

    epoch_ns = 0

    def __init__(self) -> None:
        self.now_s = 0.0

    def now(self) -> float:
        return self.now_s

    def wait(self, ports: Sequence[Port], until_s: float) -> None:
        arrivals = [port.next_arrival_s() for port in ports if isinstance(port, ScriptedPort)]
        until_s = min([until_s, *arrivals])
        assert until_s < float("inf"), "nothing would ever wake this wait"
        self.now_s = max(self.now_s, until_s)


class ScriptedPort:
    """Expects the requests of `script` in order and answers each; `finished` says whether all of them came."""

    def __init__(self, clock: ManualClock, script: Iterable[tuple[bytes, Reply]] = ()) -> None:
        self.clock = clock
        self.script = list(script)
        self.sent: list[bytes] = []
        self.incoming: list[tuple[float, bytes]] = []
        self.closed = False
        self.error: OSError | None = None

    def write(self, data: bytes, /) -> int:
        self.sent.append(bytes(data))
        assert self.script, f"nothing was expected any more, {data.hex(' ')} was sent"
        expected, reply = self.script.pop(0)
        assert bytes(data) == expected, f"expected {expected.hex(' ')} ({expected!r}), sent {data.hex(' ')} ({data!r})"
        if isinstance(reply, bytes):
            reply = [(0.001, reply)]
        for delay_s, piece in reply or ():
            self.feed(piece, delay_s)
        return len(data)

    def feed(self, data: bytes, delay_s: float = 0.0) -> None:
        self.incoming.append((self.clock.now_s + delay_s, data))
        self.incoming.sort(key=lambda item: item[0])

    def read(self, size: int = 1, /) -> bytes:
        if self.error is not None:
            raise self.error
        data = b""
        while self.incoming and self.incoming[0][0] <= self.clock.now_s:
            data += self.incoming.pop(0)[1]
        assert len(data) <= size
        return data

    def close(self) -> None:
        self.closed = True

    def next_arrival_s(self) -> float:
        return self.incoming[0][0] if self.incoming else float("inf")

    @property
    def finished(self) -> bool:
        return not self.script


def scripted_link(script: Iterable[tuple[bytes, Reply]], name: str = "motor", **options: object) -> Link:
    """A link on a scripted port with its own clock."""
    clock = ManualClock()
    return Link(name, ScriptedPort(clock, script), clock, **options)  # type: ignore[arg-type]


def port_of(link: Link) -> ScriptedPort:
    assert isinstance(link.port, ScriptedPort)
    return link.port


class AnsweringPort(ScriptedPort):
    """Answers whatever is sent by a function, for devices that are too talkative for a script."""

    def __init__(self, clock: ManualClock, answer: Callable[[bytes], Reply]) -> None:
        super().__init__(clock)
        self.answer = answer

    def write(self, data: bytes, /) -> int:
        self.script = [(bytes(data), self.answer(bytes(data)))]
        return super().write(data)
