"""DAD 141.1: the manual's strings first, then everything a serial line can do to them."""

from __future__ import annotations

import pytest

from drivers.dad141 import Dad141
from drivers.dad141_filter import delay_s, output_interval_s
from drivers.dad141_lines import LineCutter, checksum, parse_combined
from drivers.errors import CrcError, DeviceTimeout, DriverError, ExceptionReply, Overload
from drivers.loadcell import ForceSample
from drivers.wire import Link, complete
from tests.drivers.scripted import Reply, port_of, scripted_link

# docs/devices.md 3.1.1: the DAD 143 manual's worked example, whose checksum follows the rule; the sample line of the
# DAD 141
# and EM 100 manuals ends in 0F, which does not.
WORKED = b"W+000100+00110001AF"
MISPRINT = b"W+000100+001100010F"

Script = list[tuple[bytes, Reply]]

CONNECT: Script = [
    (b"ID\r", b"D:1410\r"),
    (b"IV\r", b"V:0101\r"),
    (b"GG\r", b"G+001.100\r"),
    (b"FL\r", b"F+00000\r"),
    (b"FM\r", b"M+00000\r"),
    (b"UR\r", b"U+00000\r"),
]
STOP: Script = [(b"ID\r", b"D:1410\r")]


def with_checksum(body: bytes) -> bytes:
    """A combined string's body with its checksum, worked out by hand: 256 less the low byte of the sum."""
    return body + f"{(256 - sum(body) % 256) % 256:02X}".encode()


def opened(script: Script, *, connect: Script | None = None, **options: object) -> tuple[Dad141, Link]:
    link = scripted_link([*(CONNECT if connect is None else connect), *script], "load_cell", baudrate=115200)
    cell = Dad141(link, **options)  # type: ignore[arg-type]
    complete(cell.connect(), link)
    return cell, link


def streaming(stream: Reply, **options: object) -> tuple[Dad141, Link]:
    cell, link = opened([(b"SW\r", stream), *STOP], **options)
    complete(cell.start(), link)
    return cell, link


def drain(cell: Dad141, link: Link, until_s: float = 1.0) -> list[ForceSample]:
    """Everything that comes until the port has nothing more (or `until_s` has passed)."""
    samples = cell.samples()
    end_s = link.clock.now() + until_s
    while link.clock.now() < end_s:
        link.clock.wait([link.port], end_s)
        link.service()
        samples += cell.samples()
    return samples


def test_the_checksum_of_the_worked_example() -> None:
    assert sum(WORKED[:17]) == 0x351
    assert checksum(WORKED[:17]) == 0xAF
    reading = parse_combined(WORKED, strict=True)
    assert reading is not None
    assert (reading.net, reading.gross, reading.flags) == (100, 1100, ("stable",))


def test_the_misprinted_line_is_refused_only_when_strict() -> None:
    assert parse_combined(MISPRINT, strict=True) is None
    reading = parse_combined(MISPRINT, strict=False)
    assert reading is not None
    assert reading.gross == 1100


def test_status_digits() -> None:
    reading = parse_combined(with_checksum(b"W-000001+000002E7"), strict=True)
    assert reading is not None
    assert (reading.net, reading.gross) == (-1, 2)
    assert reading.flags == ("stable", "zeroed", "tared", "output_0", "output_1", "output_2")


@pytest.mark.parametrize("end", [b"\r", b"\n", b"\r\n"])
@pytest.mark.parametrize("size", [1, 2, 7, 19, 20, 100])
def test_lines_are_cut_however_they_come(end: bytes, size: int) -> None:
    data = b"".join(b"W%04d" % number + end for number in range(20))
    cutter = LineCutter()
    lines = [line for start in range(0, len(data), size) for line, _behind in cutter.feed(data[start : start + size])]
    assert lines == [b"W%04d" % number for number in range(20)]


def test_the_cutter_says_what_came_behind_each_line() -> None:
    assert LineCutter().feed(b"one\r\ntwo\rth") == [(b"one", 7), (b"two", 2)]


def test_noise_without_an_end_does_not_pile_up() -> None:
    cutter = LineCutter()
    assert sum(len(line) for line, _ in cutter.feed(b"x" * 1000)) == 1000


def test_connect_identifies_and_reads_the_settings() -> None:
    link = scripted_link(CONNECT, "load_cell")
    cell = Dad141(link, newtons_per_unit=1e-3)
    identity = complete(cell.connect(), link)
    assert identity.details["id"] == "1410"
    assert identity.details["firmware"] == "0101"
    assert identity.details["decimals"] == 3
    assert identity.details["resolution_N"] == pytest.approx(1e-6)
    assert (identity.details["filter"], identity.details["filter_mode"], identity.details["update_rate"]) == (0, 0, 0)
    assert port_of(link).finished


def test_connect_ends_a_stream_that_is_still_running() -> None:
    """The stream's last lines, one of them cut off by the reply, come before it."""
    remnants = b"0+00110001AF\r" + WORKED + b"\r\n" + b"W+0001D:1410\r\n"
    cell, link = opened([], connect=[(b"ID\r", remnants), *CONNECT[1:]])
    assert cell.decimals == 3
    assert link.traffic.retries == 0


def test_settings_that_are_refused_are_unknown_not_fatal() -> None:
    link = scripted_link([*CONNECT[:3], (b"FL\r", b"ERR\r"), (b"FM\r", b"ERR\r"), (b"UR\r", b"ERR\r")], "load_cell")
    identity = complete(Dad141(link).connect(), link)
    assert identity.details["update_rate"] is None


def test_averaging_makes_samples_older() -> None:
    """Update rate 3: the mean of 8 measurements at 600/s is as old as their middle, 3.5 intervals."""
    cell, _ = opened([], connect=[*CONNECT[:5], (b"UR\r", b"U+00003\r")])
    assert cell.filter_delay_s == pytest.approx(3.5 / 600)
    assert cell.latency_s() > 8 / 600


@pytest.mark.parametrize("level", range(1, 9))
def test_filter_delays_agree_with_the_manuals_settling_times(level: int) -> None:
    """Rev. 2.5, p. 36: two equal poles settle to 0.1 % in 9.233 time constants; their delay is two of them."""
    settling_s = (0.055, 0.122, 0.242, 0.322, 0.482, 0.963, 1.923, 3.847)[level - 1]
    assert delay_s(level, False, 0) == pytest.approx(settling_s * 2 / 9.233, rel=0.08)
    assert delay_s(level, True, 0) == pytest.approx(0.5 * 0.0467 * level, rel=0.01)


def test_output_rates_of_the_manual() -> None:
    """DAS 72.1, p. 39: FIR at FL 4 gives 150 values a second, 37.5 with UR 2; IIR 600, 150 with UR 2."""
    assert 1 / output_interval_s(4, True, 0) == pytest.approx(150)
    assert 1 / output_interval_s(4, True, 2) == pytest.approx(37.5)
    assert 1 / output_interval_s(4, False, 2) == pytest.approx(150)


def test_decimals_from_the_bench_file_are_not_asked_for() -> None:
    cell, link = opened([], connect=[*CONNECT[:2], *CONNECT[3:]], decimals=2)
    assert cell.decimals == 2
    assert port_of(link).finished


def test_an_overloaded_display_has_its_decimals_asked_for() -> None:
    connect = [*CONNECT[:2], (b"GG\r", b"Gooooooo\r"), (b"DP\r", b"P+00004\r"), *CONNECT[3:]]
    cell, _ = opened([], connect=connect)
    assert cell.decimals == 4
    with pytest.raises(Overload, match="out of range"):
        opened([], connect=[*CONNECT[:2], (b"GG\r", b"Gooooooo\r"), (b"DP\r", b"ERR\r")])


def test_a_bus_address_is_opened_first() -> None:
    _, link = opened([], connect=[(b"OP 7\r", b"OK\r"), *CONNECT], address=7)
    assert port_of(link).finished


def test_a_device_that_does_not_answer_is_named() -> None:
    link = scripted_link([(b"ID\r", None)] * 3, "load_cell")
    with pytest.raises(DeviceTimeout, match="load_cell: no answer to 'ID'"):
        complete(Dad141(link).connect(), link)


def test_continuous_samples_in_newtons_with_wire_time_taken_off() -> None:
    byte_s = 10 / 115200
    first_s = 0.010
    cell, link = streaming([(first_s, WORKED + b"\r\n")], newtons_per_unit=-2e-3)
    [sample] = cell.samples()
    assert sample.gross_N == pytest.approx(-2e-3 * 1.1)
    assert sample.flags == ("stable",)
    assert not sample.overload
    # One line feed behind it; the line itself is 20 bytes.
    arrival_s = sample.received_s - byte_s
    assert sample.time_s == pytest.approx(arrival_s - 20 * byte_s, abs=1e-9)
    complete(cell.stop(), link)
    assert port_of(link).finished


def test_a_line_split_over_reads_and_lines_glued_together() -> None:
    lines = [with_checksum(b"W+000000%+07d01" % counts) for counts in (5, 6, 7)]
    data = b"\r".join(lines) + b"\r"
    pieces: Reply = [(0.01, data[:3]), (0.011, data[3:25]), (0.012, data[25:])]
    cell, link = streaming(pieces)
    assert [round(sample.gross_N, 6) for sample in drain(cell, link)] == [0.005, 0.006, 0.007]
    assert link.traffic.bad_frames == 0


@pytest.mark.parametrize(
    "junk",
    [
        b"\x00\xff\x80",
        b"W+000100+00110001A",
        b"W+000100+00110001AE",
        b"W+000100+001100010F",
        b"W+0001W+000100",
        b"G+001.100",
        WORKED[:17],
    ],
)
def test_what_is_no_good_line_is_counted_and_left_out(junk: bytes) -> None:
    cell, link = streaming([(0.01, WORKED + b"\r" + junk + b"\r" + WORKED + b"\r")])
    assert [sample.gross_N for sample in cell.samples()] == [pytest.approx(1.1)] * 2
    assert link.traffic.bad_frames == 1


def test_a_bad_checksum_passes_only_when_checking_is_off() -> None:
    cell, link = streaming([(0.01, MISPRINT + b"\r")], strict=False)
    assert cell.samples()[0].gross_N == pytest.approx(1.1)
    assert link.traffic.bad_frames == 0


def test_continuous_output_of_nothing_but_bad_lines_says_so() -> None:
    cell, link = opened([(b"SW\r", [(0.01 * k, MISPRINT + b"\r") for k in range(1, 60)])])
    with pytest.raises(CrcError, match="checksum: off"):
        complete(cell.start(), link)


def test_continuous_output_that_never_begins_says_so() -> None:
    cell, link = opened([(b"SW\r", None)])
    with pytest.raises(DeviceTimeout, match="continuous output"):
        complete(cell.start(), link)


def test_refused_continuous_output_is_an_exception_reply() -> None:
    cell, link = opened([(b"SW\r", b"ERR\r")])
    with pytest.raises(ExceptionReply, match="SW"):
        complete(cell.start(), link)


def test_starting_before_connecting_is_refused() -> None:
    link = scripted_link([], "load_cell")
    with pytest.raises(DriverError, match="connect first"):
        complete(Dad141(link).start(), link)


def test_overload_by_capacity() -> None:
    lines = b"".join(with_checksum(b"W+000000%+07d00" % counts) + b"\r" for counts in (49_999, 50_000, -50_001))
    cell, _ = streaming([(0.01, lines)], capacity_N=50.0)
    assert [(sample.overload, "overload" in sample.flags) for sample in cell.samples()] == [
        (False, False),
        (True, True),
        (True, True),
    ]


@pytest.mark.parametrize(("shown", "sign"), [(b"o" * 14, 1), (b"u" * 14, -1), (b"+999999+999999", 1)])
def test_overload_by_the_display(shown: bytes, sign: int) -> None:
    cell, link = streaming([(0.01, with_checksum(b"W" + shown + b"00") + b"\r")])
    [sample] = cell.samples()
    assert sample.overload
    assert sample.gross_N == pytest.approx(sign * 999.999)
    assert link.traffic.bad_frames == 0


def test_stopping_swallows_the_rest_of_the_stream() -> None:
    cell, link = opened([(b"SW\r", [(0.01, WORKED + b"\r")]), (b"ID\r", WORKED + b"\r" + WORKED[:6] + b"D:1410\r")])
    complete(cell.start(), link)
    complete(cell.stop(), link)
    assert port_of(link).finished
    assert cell.next_poll_s() is None


def test_polling_asks_for_the_combined_string() -> None:
    byte_s = 10 / 115200
    polls: Script = [(b"GW\r", [(0.004, WORKED + b"\r")]), (b"GW\r", [(0.004, WORKED + b"\r")]), *STOP]
    cell, link = opened(polls, mode="poll", rate_hz=100.0)
    complete(cell.start(), link)
    samples: list[ForceSample] = []
    start_s = link.clock.now()
    while len(samples) < 2:
        samples += cell.samples()
        due = cell.next_poll_s()
        link.clock.wait([link.port], link.wake_at() if due is None else min(due, link.wake_at()))
        link.service()
    assert [sample.gross_N for sample in samples] == [pytest.approx(1.1)] * 2
    # Sent at start_s, answered 4 ms later: measured between the request's end and the reply's beginning.
    assert samples[0].time_s == pytest.approx(start_s + 0.5 * (3 * byte_s + 0.004 - 20 * byte_s))
    assert samples[1].time_s - samples[0].time_s == pytest.approx(0.01)
    complete(cell.stop(), link)


def test_a_polled_line_with_a_bad_checksum_is_asked_for_again() -> None:
    cell, link = opened([(b"GW\r", MISPRINT + b"\r"), (b"GW\r", WORKED + b"\r")], mode="poll", rate_hz=10.0)
    complete(cell.start(), link)
    samples = cell.samples()
    while not samples:
        link.clock.wait([link.port], link.wake_at())
        link.service()
        samples = cell.samples()
    assert samples[0].gross_N == pytest.approx(1.1)
    assert (link.traffic.bad_frames, link.traffic.retries) == (1, 1)


def test_samples_of_a_regular_stream_are_regular() -> None:
    """549 lines a second, each read up to 1 ms late: stamps that are even, and none after its arrival."""
    lateness = [0.0, 0.4e-3, 0.9e-3, 0.1e-3, 0.7e-3]
    stream: Reply = [(0.01 + k / 549 + lateness[k % 5], WORKED + b"\r") for k in range(1200)]
    cell, link = streaming(stream)
    times = [sample.time_s for sample in drain(cell, link, 2.5)]
    assert len(times) == 1200
    late = [times[k + 1] - times[k] for k in range(600, 1199)]
    assert max(late) - min(late) < 20e-6
    assert sum(late) / len(late) == pytest.approx(1 / 549, rel=1e-4)
