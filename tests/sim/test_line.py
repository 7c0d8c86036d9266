from __future__ import annotations

import pytest

from sim.clock import SimClock
from sim.line import Line, byte_time_s


class Recorder:
    """A device that notes what arrives, and when."""

    def __init__(self) -> None:
        self.got: list[tuple[bytes, float]] = []

    def receive(self, data: bytes, at_s: float) -> None:
        self.got.append((data, at_s))


def make(baudrate: int = 19200, parity: str = "E", **options: bool | float) -> tuple[SimClock, Line, Recorder]:
    clock = SimClock()
    line = Line(clock, baudrate, parity, **options)  # type: ignore[arg-type]
    device = Recorder()
    line.device = device
    return clock, line, device


@pytest.mark.parametrize(("baudrate", "parity", "bits"), [(19200, "E", 11), (115200, "N", 10), (1_000_000, "O", 11)])
def test_a_byte_is_ten_bits_and_eleven_with_parity(baudrate: int, parity: str, bits: int) -> None:
    assert byte_time_s(baudrate, parity) == bits / baudrate


def test_a_request_arrives_with_its_last_byte() -> None:
    clock, line, device = make()
    line.host_write(b"123456789")
    clock.wait([], 1.0)
    assert device.got == [(b"123456789", pytest.approx(9 * 11 / 19200, abs=1e-12))]


def test_bytes_queue_behind_those_before() -> None:
    clock, line, device = make()
    line.host_write(b"1234")
    line.host_write(b"56")
    assert line.to_device_waiting() == 6
    clock.wait([], 1.0)
    assert [at_s for _, at_s in device.got] == pytest.approx([44 / 19200, 66 / 19200])
    line.host_write(b"7")  # the wire is free: from now
    clock.wait([], 2.0)
    assert device.got[-1][1] == pytest.approx(1.0 + 11 / 19200)


def test_the_host_reads_bytes_as_they_arrive() -> None:
    clock, line, _ = make(9600, "N")
    line.device_write(b"abcd", 0.5)
    byte_s = 10 / 9600
    seen = []
    for k in (0.0, 0.99, 1.01, 2.5, 3.99):
        clock.wait([], 0.5 + k * byte_s)
        seen.append(line.available())
    assert seen == [0, 0, 1, 2, 3]
    assert line.host_read(2) == b"ab"
    assert line.available() == 1
    clock.wait([], 0.5 + 4 * byte_s)
    assert line.host_read(100) == b"cd"
    assert line.host_read(100) == b""


def test_replies_queue_and_say_when_the_wire_is_free() -> None:
    clock, line, _ = make(9600, "N")
    assert line.device_write(b"x" * 10, 1.0) == pytest.approx(1.0 + 100 / 9600)
    assert line.device_write(b"y", 1.0) == pytest.approx(1.0 + 110 / 9600)
    clock.wait([], 2.0)
    assert line.host_read(100) == b"x" * 10 + b"y"


def test_no_wire_time_without_a_baudrate() -> None:
    clock, line, device = make(0, "N")
    line.host_write(b"hello")
    clock.wait([], 0.0)
    assert device.got == [(b"hello", 0.0)]


@pytest.mark.parametrize(("baudrate", "parity"), [(9600, "E"), (19200, "N")])
def test_settings_that_differ_make_garbage_in_both_directions(baudrate: int, parity: str) -> None:
    clock, line, device = make(19200, "E")
    line.set_host(baudrate, parity)
    line.host_write(b"ABC")
    line.device_write(b"DEF", 0.5)
    clock.wait([], 1.0)
    [(data, at_s)] = device.got
    assert at_s == pytest.approx(3 * byte_time_s(baudrate, parity))
    assert not set(data) & set(b"ABC")
    assert line.host_read(10) != b"DEF"
    line.set_host(19200, "E")
    line.host_write(b"ABC")
    clock.wait([], 2.0)
    assert device.got[-1][0] == b"ABC"


def test_on_a_half_duplex_line_both_directions_at_once_destroy_each_other() -> None:
    clock, line, device = make(19200, "E", half_duplex=True)
    line.device_write(b"reply", 0.0)
    clock.wait([], 2.5 * 11 / 19200)
    line.host_write(b"talk")
    clock.wait([], 1.0)
    assert line.collisions == 1
    assert device.got[0][0] != b"talk"
    reply = line.host_read(10)
    assert reply[:2] == b"re"
    assert reply[2:] != b"ply"
    line.device_write(b"again", 1.0)
    clock.wait([], 2.0)
    line.host_write(b"fine")
    clock.wait([], 3.0)
    assert (line.host_read(10), device.got[-1][0], line.collisions) == (b"again", b"fine", 1)


def test_on_a_full_duplex_line_they_do_not() -> None:
    clock, line, device = make(19200, "E")
    line.device_write(b"reply", 0.0)
    line.host_write(b"talk")
    clock.wait([], 1.0)
    assert (line.host_read(10), device.got[0][0]) == (b"reply", b"talk")


def test_latency_delays_what_the_host_sees() -> None:
    clock, line, _ = make(19200, "E", latency_s=0.016)
    line.device_write(b"x", 0.0)
    clock.wait([], 0.016)
    assert line.available() == 0
    clock.wait([], 0.016 + 11 / 19200)
    assert line.available() == 1
