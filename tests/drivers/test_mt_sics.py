"""MT-SICS: the manual's lines (docs/devices.md 3.2, 7.4), refusals, units, overload, a stream, the emulated balance."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from typing import Any

import pytest

import drivers
from drivers.errors import DeviceTimeout, DriverError, ExceptionReply, Overload, ReadbackError, UnexpectedReply
from drivers.loadcell import ForceSample
from drivers.mt_sics import MtSics
from drivers.spec import LoadCellSpec
from drivers.wire import Link, complete
from sim.world import World, register, unregister
from tests.drivers.contract_load_cell import gather
from tests.drivers.contract_motor import pace
from tests.drivers.emulated_bench import settings
from tests.drivers.scripted import AnsweringPort, ManualClock, Reply, scripted_link

G_N = 9.80665e-3
"""Newtons in a gram, standard gravity."""

IDENTITY = {
    "SI": "S S     52.1873 g",
    "I4": 'I4 A "B021002593"',
    "I2": 'I2 A "XS205DU Excellence 220.0000 g"',
    "I3": 'I3 A "3.10 10.28.0.493.142"',
    "I1": 'I1 A "0123" "2.30" "2.20" "1.00" ""',
    "TA": "TA A      0.0000 g",
    "UPD": "ES",
}


def balance(answers: dict[str, str | list[str]], **options: Any) -> tuple[MtSics, Link]:
    """A balance that answers by a table; a list is answered one after the other, the last for ever."""

    def answer(request: bytes) -> Reply:
        text = answers[request.decode().removesuffix("\r\n")]
        if isinstance(text, list):
            text = text.pop(0) if len(text) > 1 else text[0]
        return f"{text}\r\n".encode() if text else None

    clock = ManualClock()
    link = Link("load_cell", AnsweringPort(clock, answer), clock, baudrate=9600)
    return MtSics(link, **{"unit": "g", "newtons_per_unit": G_N, "capacity_N": 10.0} | options), link


def test_it_says_what_it_is() -> None:
    cell, link = balance(dict(IDENTITY))
    identity = complete(cell.connect(), link)
    assert identity.details["serial_number"] == "B021002593"
    assert identity.details["model"] == "XS205DU Excellence 220.0000 g"
    assert identity.details["tare"] == 0.0
    assert identity.details["update_rate"] is None  # it answered ES
    assert identity.details["flags"] == ["stable"]


def one(line: str, **options: Any) -> ForceSample | None:
    cell, link = balance(IDENTITY | {"SI": line}, mode="poll", rate_hz=10.0, **options)
    complete(cell.start(), link)
    end_s = link.clock.now() + 0.09
    while link.clock.now() < end_s:
        samples = cell.samples()
        if samples:
            return samples[0]
        link.clock.wait([link.port], min(end_s, link.wake_at()))
        link.service()
    return None


@pytest.mark.parametrize(
    ("line", "force_N", "flags", "overload"),
    [
        ("S S     52.1873 g", 52.1873 * G_N, ("stable",), False),
        ("S D     52.1873 g", 52.1873 * G_N, (), False),
        ("S D     -0.0080 g", -0.0080 * G_N, (), False),
        ("S S     1200.00 g", 1200.0 * G_N, ("stable", "overload"), True),  # 11.8 N, above the 10 N of the bench file
        ("S +", 10.0, ("overload",), True),
        ("S -", -10.0, ("overload",), True),
    ],
)
def test_a_value(line: str, force_N: float, flags: tuple[str, ...], overload: bool) -> None:
    sample = one(line)
    assert sample is not None
    assert sample.gross_N == pytest.approx(force_N)
    assert sample.flags == flags
    assert sample.overload is overload
    assert sample.time_s < sample.received_s


@pytest.mark.parametrize("line", ["S I", "S S  52.18x3 g", "S S     52.1873", "ES", "ET"])
def test_what_is_no_value_is_no_sample(line: str) -> None:
    assert one(line) is None


def test_a_turned_cell_turns_its_overload_too() -> None:
    sample = one("S +", newtons_per_unit=-G_N)
    assert sample is not None
    assert sample.gross_N == -10.0


def test_the_devices_tare_is_added_to_make_gross() -> None:
    cell, link = balance(IDENTITY | {"TA": "TA A     10.0000 g"}, mode="poll", rate_hz=10.0)
    identity = complete(cell.connect(), link)
    assert identity.details["tare"] == 10.0
    assert complete(_poll(cell), link).gross_N == pytest.approx((52.1873 + 10.0) * G_N)


def _poll(cell: MtSics) -> Any:
    return (yield cell._reading())


def test_a_tare_set_meanwhile_is_found_at_the_end() -> None:
    cell, link = balance(IDENTITY | {"TA": ["TA A      0.0000 g", "TA A     52.1873 g"]}, mode="poll", rate_hz=10.0)
    complete(cell.connect(), link)
    complete(cell.start(), link)
    with pytest.raises(ReadbackError, match="tare was 0 g and is 52.1873 g"):
        complete(cell.stop(), link)


def test_a_device_without_tare_inquiry_is_taken_as_untared() -> None:
    cell, link = balance(IDENTITY | {"TA": "ES"})
    assert complete(cell.connect(), link).details["tare"] is None
    complete(cell.stop(), link)


def test_another_unit_than_the_files_is_refused() -> None:
    cell, link = balance(IDENTITY | {"SI": "S S      0.0522 kg"})
    with pytest.raises(UnexpectedReply, match="sends kg, the bench file says g"):
        complete(cell.connect(), link)


@pytest.mark.parametrize(
    ("reply", "kind", "words"),
    [
        ("ES", ExceptionReply, "does not know the command"),
        ("ET", ExceptionReply, "check baudrate and parity"),
        ("EL", ExceptionReply, "logical error"),
        ("Z I", ExceptionReply, "not now"),
        ("Z L", ExceptionReply, "wrong parameter"),
        ("Z +", Overload, "overload"),
        ("Z -", Overload, "underload"),
        ("Z ?", UnexpectedReply, "cannot be read"),
    ],
)
def test_refusals_are_told_in_words(reply: str, kind: type[DriverError], words: str) -> None:
    cell, link = balance(IDENTITY | {"Z": reply})
    with pytest.raises(kind, match=words):
        complete(cell.zero(), link)


def test_zero_and_tare() -> None:
    cell, link = balance(IDENTITY | {"ZI": "ZI D", "T": "T S     52.1873 g", "S": "S S      0.0000 g"})
    complete(cell.zero(at_once=True), link)
    assert complete(cell.tare(), link) == pytest.approx(52.1873)
    assert complete(cell.stable(), link).gross_N == pytest.approx(52.1873 * G_N)


def test_a_zero_that_is_not_answered_is_not_sent_again() -> None:
    cell, link = balance(IDENTITY | {"Z": ""})
    with pytest.raises(DeviceTimeout):
        complete(cell.zero(), link)
    assert link.traffic.retries == 0


@pytest.mark.parametrize(("reply", "kind"), [("S I", ExceptionReply), ("S +", Overload)])
def test_no_standstill_and_overload_of_the_stable_value(reply: str, kind: type[DriverError]) -> None:
    cell, link = balance(IDENTITY | {"S": reply})
    with pytest.raises(kind):
        complete(cell.stable(), link)


def test_a_balance_that_was_left_sending_connects() -> None:
    """Its last lines come before the answers, and are none."""
    script: list[tuple[bytes, Reply]] = [
        (b"SI\r\n", b"S D     52.1800 g\r\nS D     52.1900 g\r\n"),
        (b"I4\r\n", b'S D     52.2000 g\r\nI4 A "7"\r\n'),
    ]
    link = scripted_link(script, "load_cell")
    complete(MtSics(link)._end_stream(), link)
    assert link.traffic.refusals == 0


# -- the stream --------------------------------------------------------------------------------------------------------


def streaming(*pieces: tuple[float, bytes]) -> tuple[MtSics, Link, list[ForceSample]]:
    link = scripted_link([(b"SIR\r\n", list(pieces))], "load_cell", baudrate=9600)
    cell = MtSics(link, capacity_N=10.0)
    complete(cell.start(), link)
    samples = cell.samples()
    while link.clock.now() < pieces[-1][0] + 0.01:
        pace(link, link.clock.now() + 0.01)
        samples += cell.samples()
    return cell, link, samples


def test_a_stream_of_stable_and_moving_values() -> None:
    _, link, samples = streaming((0.1, b"S S     10.0000 g\r\nS D  "), (0.2, b"   20.0000 g\r\nS I\r\nS +\r\n"))
    assert [sample.gross_N for sample in samples] == [pytest.approx(10 * G_N), pytest.approx(20 * G_N), 10.0]
    assert [sample.flags for sample in samples] == [("stable",), (), ("overload",)]
    assert all(first.time_s < second.time_s for first, second in pairwise(samples))
    assert link.traffic.bad_frames == 0


def test_broken_lines_of_a_stream_are_counted_and_left_out() -> None:
    """A bit was lost, a line was cut, a unit changed by a keypress: no line has a checksum, but each has its form."""
    lines = b"S S     10.0000 g\r\nS S  \x80  10.0000 g\r\nS S   10.0\r\nS S     10.0000 lb\r\nS S     11.0000 g\r\n"
    _, link, samples = streaming((0.1, lines))
    assert [sample.gross_N for sample in samples] == [pytest.approx(10 * G_N), pytest.approx(11 * G_N)]
    assert link.traffic.bad_frames == 3


def test_a_device_without_a_stream_says_so() -> None:
    link = scripted_link([(b"SIR\r\n", b"ES\r\n")], "load_cell")
    with pytest.raises(ExceptionReply, match="refuses continuous output .SIR.: it does not know"):
        complete(MtSics(link).start(), link)


def test_a_silent_stream_is_a_time_out() -> None:
    link = scripted_link([(b"SIR\r\n", None)], "load_cell")
    with pytest.raises(DeviceTimeout, match="no value within 2 s"):
        complete(MtSics(link).start(), link)


# -- the emulated balance ----------------------------------------------------------------------------------------------


@contextmanager
def emulated(**cell: Any) -> Iterator[tuple[MtSics, World]]:
    spec: dict[str, Any] = {"driver": "mt_sics", "baudrate": 38400, "capacity": 2.0, "unit": "g"} | cell
    motor = {"driver": "orca", "baudrate": 1_000_000, "stroke": (-20.0, 20.0)}
    world = World(settings({"motor": motor, "load_cell": spec}, "balance", "virtual"))
    register(world)
    try:
        opened = drivers.open_load_cell(LoadCellSpec(port="sim://balance/load_cell", **spec), world.clock)
        assert isinstance(opened, MtSics)
        yield opened, world
        opened.link.close()
    finally:
        unregister("balance")


def test_the_stream_is_stamped_evenly() -> None:
    """100 a second, as the emulated device is set; 18 bytes at 38400 baud take 4.69 ms."""
    with emulated() as (cell, _):
        complete(cell.connect(), cell.link)
        assert cell.latency_s() == pytest.approx(0.01 + 180 / 38400)
        complete(cell.start(), cell.link)
        samples = gather(cell, 2.0)
        steps = [second.time_s - first.time_s for first, second in pairwise(samples)][50:]
        assert min(steps) == pytest.approx(0.01, abs=2e-6)
        assert max(steps) == pytest.approx(0.01, abs=2e-6)
        ages = [sample.received_s - sample.time_s for sample in samples[50:]]
        assert max(ages) == pytest.approx(180 / 38400, abs=2e-6)
        assert samples[0].flags == ()
        assert samples[-1].flags == ("stable",)


def test_overload_and_underload_reach_the_driver() -> None:
    """The emulated cell drifts 1 N/s; its display ends at 1.5 times the 2 N of the bench file."""
    for sign in (1, -1):
        with emulated(sign=sign) as (cell, world):
            amplifier = world.devices["load_cell"].amplifier  # type: ignore[attr-defined]
            amplifier.drift_N_s = 1.0
            complete(cell.connect(), cell.link)
            complete(cell.start(), cell.link)
            samples = gather(cell, 4.0)
            assert not samples[0].overload
            assert samples[-1].overload
            assert samples[-1].gross_N == pytest.approx(2.0)
            assert [sample.overload for sample in samples] == sorted(sample.overload for sample in samples)


def test_tare_zero_and_standstill_of_the_emulated_balance() -> None:
    with emulated() as (cell, world):
        amplifier = world.devices["load_cell"].amplifier  # type: ignore[attr-defined]
        complete(cell.connect(), cell.link)
        assert complete(cell.stable(), cell.link).flags == ("stable",)
        amplifier.drift_N_s = 0.5
        with pytest.raises(ExceptionReply, match="not now"):
            complete(cell.zero(), cell.link)
        complete(cell.zero(at_once=True), cell.link)
        amplifier.drift_N_s = 0.0
        assert complete(cell.tare(at_once=True), cell.link) != 0.0
        # Tared or not, the gross value stays what it was.
        sample = complete(_poll(cell), cell.link)
        assert sample.gross_N / G_N == pytest.approx(cell._tare, abs=0.01)
        assert "tared" in sample.flags
