"""Devices that answer anything: each driver's conversation against replies that are right, nearly right, or noise."""

from __future__ import annotations

import random
import struct
from collections.abc import Callable, Sequence
from contextlib import suppress
from functools import cache
from pathlib import Path
from typing import Any

from drivers.dad141 import Dad141
from drivers.dad141_lines import checksum
from drivers.errors import DriverError
from drivers.maps import shipped_maps
from drivers.modbus import ModbusClient, rtu_frame
from drivers.motor import MotorLimits
from drivers.mt_sics import MtSics
from drivers.orca import Orca
from drivers.registers import RegisterMotor
from drivers.registers_cell import RegisterLoadCell
from drivers.regmap import LoadCellMap, MotorMap, load_map
from drivers.wire import Link, Pause, Port, Steps
from tests.fuzz.mutate import spoiled_bytes

PATIENCE_S = 400.0
"""No conversation takes longer on its own clock: homing, the longest, gives up after less."""

TURNS = 100_000


class Time:
    """A clock that jumps to whatever happens next."""

    epoch_ns = 0

    def __init__(self) -> None:
        self.now_s = 0.0
        self.turns = 0

    def now(self) -> float:
        return self.now_s

    def wait(self, ports: Sequence[Port], until_s: float) -> Sequence[Port]:
        self.turns += 1
        assert self.turns < TURNS and self.now_s < PATIENCE_S, "a conversation without an end"
        due = min([port.due_s for port in ports if isinstance(port, Stranger)], default=float("inf"))
        assert min(due, until_s) < float("inf"), "nothing would ever wake this wait"
        self.now_s = max(self.now_s, min(due, until_s))
        return ports


class Stranger:
    """The other end of a line: `answer(request)` makes bytes, which come in up to three pieces."""

    def __init__(self, clock: Time, answer: Callable[[bytes], bytes], pick: random.Random) -> None:
        self.clock, self.answer, self.pick = clock, answer, pick
        self.coming: list[tuple[float, bytes]] = []

    @property
    def due_s(self) -> float:
        return self.coming[0][0] if self.coming else float("inf")

    def write(self, data: bytes, /) -> int:
        self.say(self.answer(bytes(data)))
        return len(data)

    def say(self, data: bytes) -> None:
        at_s = self.clock.now_s + self.pick.choice((1e-4, 1e-3, 0.02, 0.3))
        while data:
            size = len(data) if self.pick.random() < 0.7 else self.pick.randrange(1, len(data) + 1)
            self.coming.append((at_s, data[:size]))
            data, at_s = data[size:], at_s + self.pick.choice((0.0, 1e-4, 0.01))
        self.coming.sort(key=lambda piece: piece[0])

    def read(self, size: int = 1, /) -> bytes:
        data = b""
        while self.coming and self.coming[0][0] <= self.clock.now_s and len(data) < size:
            data += self.coming.pop(0)[1]
        return data[:size]

    def close(self) -> None:
        return


def _linked(answer: Callable[[bytes], bytes], pick: random.Random) -> tuple[Link, Stranger]:
    clock = Time()
    port = Stranger(clock, _now_and_then_wrong(answer, pick), pick)
    return Link("device", port, clock, baudrate=pick.choice((0, 9600, 1_000_000)), attempts=2), port


def _now_and_then_wrong(answer: Callable[[bytes], bytes], pick: random.Random) -> Callable[[bytes], bytes]:
    share = pick.choice((0.0, 0.1, 0.5, 1.0))

    def wrong(request: bytes) -> bytes:
        reply = answer(request)
        if pick.random() >= share:
            return reply
        what = pick.randrange(5)
        if what == 0:
            return b""
        if what == 1:
            return pick.randbytes(pick.randrange(300))
        if what == 2:
            return request + reply
        return spoiled_bytes(reply, pick)[:2000]

    return wrong


def _talk(steps: Steps[Any], link: Link) -> Any:
    """The conversation to its end; a `DriverError` is an answer."""
    reply: Any = None
    failure: DriverError | None = None
    try:
        while True:
            item = steps.throw(failure) if failure is not None else steps.send(reply)
            reply, failure = None, None
            until_s = link.clock.now() + item.seconds if isinstance(item, Pause) else float("inf")
            if not isinstance(item, Pause):
                link.submit(item)
            while link.clock.now() < until_s and (isinstance(item, Pause) or not item.done):
                link.clock.wait([link.port], min(until_s, link.wake_at()))
                link.service()
            if not isinstance(item, Pause):
                reply, failure = item.value, item.error
    except StopIteration as stop:
        return stop.value
    except DriverError:
        return None


def _one(exchange: Any) -> Steps[Any]:
    return (yield exchange)


def _modbus_answer(pick: random.Random) -> Callable[[bytes], bytes]:
    """Replies of the right form with registers of any content."""
    numbers = pick.choice((lambda: 0, lambda: 0xFFFF, lambda: pick.randrange(1 << 16), lambda: pick.randrange(4)))

    def answer(request: bytes) -> bytes:
        head, body = request[:2], request[2:-2]
        if pick.random() < 0.05:
            return rtu_frame(bytes((head[0], head[1] | 0x80, pick.randrange(256))))
        if head[1] in (3, 4, 23):
            count = int.from_bytes(body[2:4], "big")
            return rtu_frame(
                head + bytes((2 * count & 0xFF,)) + b"".join(struct.pack(">H", numbers()) for _ in range(count))
            )
        if head[1] in (1, 2):
            size = (int.from_bytes(body[2:4], "big") + 7) // 8
            return rtu_frame(head + bytes((size & 0xFF,)) + pick.randbytes(size))
        if head[1] == 0x64:
            return rtu_frame(head + pick.randbytes(15))
        return rtu_frame(head + body[:4])

    return answer


LIMITS = MotorLimits(force_N=20.0, speed_mm_s=100.0, acceleration_mm_s2=1000.0, position_mm=(-5.0, 6.0), watchdog_s=0.1)


def _drive(motor: Any, link: Link, pick: random.Random) -> None:
    """A few verbs in any order, as a run or a `doctor` might."""
    verbs: tuple[Callable[[], Any], ...] = (
        motor.connect,
        lambda: motor.prepare(LIMITS),
        motor.energise,
        motor.is_homed,
        motor.home,
        lambda: _one(motor.read()),
        motor.stop,
        lambda: motor.safe_state(pick.choice(("release", "hold"))),
    )
    for verb in pick.sample(verbs, 3):
        _talk(verb(), link)
    if motor.kind == "stream":
        for _ in range(5):
            sample = _talk(_one(motor.stream(pick.uniform(-5, 5))), link)
            if sample is not None:
                motor.fault_names(sample.fault)
    else:
        _talk(motor.move(pick.uniform(-5, 5), 10.0, 100.0), link)


def orca(folder: Path, pick: random.Random) -> None:
    link, _ = _linked(_modbus_answer(pick), pick)
    _drive(Orca(link), link, pick)


@cache
def _map(name: str, device: str) -> Any:
    return load_map(name, None, "motor" if device == "motor" else "load_cell")


def registers(folder: Path, pick: random.Random) -> None:
    if pick.random() < 0.6:
        motor: MotorMap = _map(pick.choice(shipped_maps("motor")), "motor")
        link, _ = _linked(_any_answer(motor, pick), pick)
        _drive(RegisterMotor(link, motor), link, pick)
        return
    cell: LoadCellMap = _map(pick.choice(shipped_maps("load_cell")), "load_cell")
    link, port = _linked(_any_answer(cell, pick), pick)
    _measure(RegisterLoadCell(link, cell, rate_hz=100.0), link, port, pick, lambda: b"")


def _any_answer(device: Any, pick: random.Random) -> Callable[[bytes], bytes]:
    rtu = _modbus_answer(pick)
    return _over_tcp(rtu) if device.link.transport == "tcp" else rtu


def _over_tcp(rtu: Callable[[bytes], bytes]) -> Callable[[bytes], bytes]:
    def answer(request: bytes) -> bytes:
        pdu = rtu(rtu_frame(request[6:]))[:-2]
        return request[:4] + struct.pack(">H", len(pdu)) + pdu

    return answer


def modbus(folder: Path, pick: random.Random) -> None:
    transport = pick.choice(("rtu", "tcp"))
    rtu = _modbus_answer(pick)
    link, _ = _linked(_over_tcp(rtu) if transport == "tcp" else rtu, pick)
    client = ModbusClient(link, 1, transport="tcp" if transport == "tcp" else "rtu")
    count = pick.choice((1, 2, 7, 125))
    exchanges = [
        client.read_holding(1, count),
        client.read_input(1, count),
        client.read_bits("coil", 1, count),
        client.read_bits("discrete", 1, count),
        client.write_register(1, 2),
        client.write_registers(1, [1] * min(count, 100)),
        client.write_coil(1, True),
        client.write_coils(1, [True] * count),
        client.readwrite(1, count, 5, [1, 2]),
    ]
    exchange = pick.choice(exchanges)
    value = _talk(_one(exchange), link)
    if exchange.error is None and isinstance(value, list):
        assert len(value) == count


def _measure(cell: Any, link: Link, port: Stranger, pick: random.Random, line: Callable[[], bytes]) -> None:
    """Connect, start, some samples, stop; a stream of lines comes meanwhile where the device sends by itself."""
    _talk(cell.connect(), link)
    port.say(b"".join(line() for _ in range(pick.choice((0, 3, 50)))))
    _talk(cell.start(), link)
    for _ in range(10):
        port.say(line())
        link.clock.wait([port], link.clock.now() + 0.01)
        link.service()
        with suppress(DriverError):
            for sample in cell.samples():
                assert isinstance(sample.gross_N, float)
    cell.latency_s()
    _talk(cell.stop(), link)


def dad141(folder: Path, pick: random.Random) -> None:
    def line() -> bytes:
        body = pick.choice(
            (b"W%+07d%+07d" % (pick.randrange(10**6), -pick.randrange(10**6)), b"W------uuuuuu-", b"WWWW")
        )
        body += b"%02X" % pick.randrange(256)
        good = body + b"%02X\r\n" % checksum(body)
        return good if pick.random() < 0.7 else spoiled_bytes(good, pick)[:500]

    def answer(request: bytes) -> bytes:
        replies = {b"ID": b"D:1411", b"IV": b"V:0123", b"GG": b"G+001.234", b"FL": b"FL:3", b"UR": b"UR:1", b"SW": b""}
        command = request.strip()
        if command == b"GW":
            return line()
        odd = (
            b"ERR",
            b"OK",
            b"",
            b"G" + b"9" * 40,
            b"D:" + b"9" * 5000,
            b"FL:" + b"9" * 30,
            b"\xb2:\xb2",
            b"UR:-1",
            b"FL:99",
        )
        reply = replies.get(command, b"OK") if pick.random() < 0.8 else pick.choice(odd)
        return reply + pick.choice((b"\r\n", b"\r", b"\n"))

    link, port = _linked(answer, pick)
    mode = pick.choice(("continuous", "poll"))
    strict = pick.random() < 0.7
    cell = Dad141(
        link, mode="poll" if mode == "poll" else "continuous", strict=strict, rate_hz=pick.choice((None, 100.0))
    )
    _measure(cell, link, port, pick, line)


def mt_sics(folder: Path, pick: random.Random) -> None:
    def line() -> bytes:
        value = pick.choice((b"%10.3f" % pick.uniform(-100, 100), b"1e400", b"9" * 400, b"+.5", b"--1", b"1.2.3"))
        good = b"S %s %s g\r\n" % (pick.choice((b"S", b"D", b"I", b"+")), value)
        return good if pick.random() < 0.7 else spoiled_bytes(good, pick)[:500]

    def answer(request: bytes) -> bytes:
        command = request.strip().split(b" ")[0]
        if command in (b"S", b"SI", b"SIR"):
            return line()
        odd = (b"ES", b"EL", b"ET", b'%s A "' % command, b"%s I" % command, b"TA A %s g" % (b"9" * 400), b'UPD A "0"')
        usual = {b"TA": b"TA A 0.000 g", b"UPD": b'UPD A "20"'}.get(command, b'%s A "text 1.0"' % command)
        return (usual if pick.random() < 0.8 else pick.choice(odd)) + b"\r\n"

    link, port = _linked(answer, pick)
    mode = pick.choice(("continuous", "poll"))
    cell = MtSics(link, unit="g", mode="poll" if mode == "poll" else "continuous", rate_hz=pick.choice((None, 20.0)))
    _measure(cell, link, port, pick, line)


TARGETS: dict[str, Callable[[Path, random.Random], Any]] = {
    "orca": orca,
    "registers": registers,
    "modbus": modbus,
    "dad141": dad141,
    "mt_sics": mt_sics,
}
