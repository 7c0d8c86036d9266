"""Modbus frames: byte pairs from manuals, then every way in which a reply can be wrong."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from drivers.errors import CrcError, DeviceTimeout, DriverError, ExceptionReply, FrameError, UnexpectedReply
from drivers.modbus import ModbusClient, rtu_frame, rtu_gap_s
from drivers.values import NumberType, WordOrder, decode, encode
from drivers.wire import Exchange, call
from tests.drivers.scripted import Reply, octets, port_of, scripted_link

Build = Callable[[ModbusClient], Exchange[object]]

# Request and reply as the manuals print them (docs/devices.md 7.1, 7.2).
PAIRS: list[tuple[str, Build, str, str, object]] = [
    (
        "IAI move, 9 words",
        lambda m: m.write_registers(0x9900, [0, 5000, 0, 10, 0, 10000, 30]),
        "01 10 99 00 00 07 0E 00 00 13 88 00 00 00 0A 00 00 27 10 00 1E 50 CF",
        "01 10 99 00 00 07 AF 57",
        None,
    ),
    (
        "IAI push change",
        lambda m: m.write_registers(0x9907, [0x7F, 0x06]),
        "01 10 99 07 00 02 04 00 7F 00 06 C5 C5",
        "01 10 99 07 00 02 DE 95",
        None,
    ),
    ("IAI start on", lambda m: m.write_coil(0x040C, True), "01 05 04 0C FF 00 4D 09", "01 05 04 0C FF 00 4D 09", None),
    (
        "IAI start off",
        lambda m: m.write_coil(0x040C, False),
        "01 05 04 0C 00 00 0C F9",
        "01 05 04 0C 00 00 0C F9",
        None,
    ),
    ("IAI CLBR", lambda m: m.write_coil(0x0426, True), "01 05 04 26 FF 00 6C C1", "01 05 04 26 FF 00 6C C1", None),
    ("IAI POSR", lambda m: m.write_register(0x0D03, 1), "01 06 0D 03 00 01 BA A6", "01 06 0D 03 00 01 BA A6", None),
    (
        "IAI DRG1",
        lambda m: m.write_register(0x0D00, 0x1000),
        "01 06 0D 00 10 00 86 A6",
        "01 06 0D 00 10 00 86 A6",
        None,
    ),
    (
        "SMC position",
        lambda m: m.read_holding(0x9000, 2),
        "01 03 90 00 00 02 E9 0B",
        "01 03 04 00 00 3A 98 E9 39",
        [0, 15000],
    ),
    (
        "Orca mode",
        lambda m: m.write_register(3, 3),
        "01 06 00 03 00 03 39 CB",
        "01 06 00 03 00 03 39 CB",
        None,
    ),
]


@pytest.mark.parametrize(("build", "request_", "reply", "value"), [p[1:] for p in PAIRS], ids=[p[0] for p in PAIRS])
def test_byte_pairs_of_the_manuals(build: Build, request_: str, reply: str, value: object) -> None:
    link = scripted_link([(octets(request_), octets(reply))])
    assert call(build(ModbusClient(link, 1)), link) == value
    assert port_of(link).finished
    assert link.traffic.bytes_out == len(octets(request_))
    assert link.traffic.bytes_in == len(octets(reply))


def test_the_orcas_position_request_of_the_vendors_sdk() -> None:
    reply = rtu_frame(octets("01 03 04 04 D2 00 00"))
    link = scripted_link([(octets("01 03 01 56 00 02 25 E7"), reply)])
    assert call(ModbusClient(link, 1).read_holding(342, 2), link) == [1234, 0]


def test_bits_come_in_the_order_of_their_addresses() -> None:
    # Modbus application protocol 1.1b3, 6.2: 22 inputs from 197, reply AC DB 35 (unit 1 put before, checksum behind).
    request = rtu_frame(octets("01 02 00 C4 00 16"))
    link = scripted_link([(request, rtu_frame(octets("01 02 03 AC DB 35")))])
    bits = call(ModbusClient(link, 1).read_bits("discrete", 0xC4, 22), link)
    assert "".join(str(int(bit)) for bit in bits) == "0011010111011011101011"


def test_input_registers_coils_and_read_write() -> None:
    link = scripted_link(
        [
            (rtu_frame(octets("07 04 00 08 00 01")), rtu_frame(octets("07 04 02 00 0A"))),
            (rtu_frame(octets("07 0F 00 13 00 0A 02 CD 01")), rtu_frame(octets("07 0F 00 13 00 0A"))),
            (
                rtu_frame(octets("07 17 00 03 00 06 00 0E 00 03 06 00 FF 00 FF 00 FF")),
                rtu_frame(octets("07 17 0C 00 FE 0A CD 00 01 00 03 00 0D 00 FF")),
            ),
        ]
    )
    modbus = ModbusClient(link, 7)
    assert call(modbus.read_input(8), link) == [10]
    # The examples of the Modbus application protocol 1.1b3, sections 6.4, 6.11 and 6.17.
    coils = [bool(int(bit)) for bit in "1011001110"]
    call(modbus.write_coils(0x13, coils), link)
    assert call(modbus.readwrite(3, 6, 14, [0xFF, 0xFF, 0xFF]), link) == [0xFE, 0x0ACD, 1, 3, 0x0D, 0xFF]


GOOD = octets("01 03 04 00 00 3A 98 E9 39")
READ = octets("01 03 90 00 00 02 E9 0B")


def read_position(*replies: Reply) -> tuple[object, object]:
    """Read with these replies to the attempts; the value, and the traffic."""
    link = scripted_link([(READ, reply) for reply in replies])
    exchange = ModbusClient(link, 1).read_holding(0x9000, 2)
    link.submit(exchange)
    while not exchange.done:
        link.clock.wait([link.port], link.wake_at())
        link.service()
    assert port_of(link).finished
    return exchange.error if exchange.error is not None else exchange.value, link.traffic


@pytest.mark.parametrize(
    ("frame", "error", "message"),
    [
        (GOOD[:-1] + b"\x00", CrcError, "wrong checksum"),
        (GOOD[:4] + b"\x01" + GOOD[5:], CrcError, "wrong checksum"),
        (GOOD[:5], DeviceTimeout, "only 5 bytes"),
        (rtu_frame(octets("02 03 04 00 00 3A 98")), UnexpectedReply, "from address 2"),
        (rtu_frame(octets("01 04 04 00 00 3A 98")), UnexpectedReply, "function 0x04"),
        (rtu_frame(octets("01 03 02 3A 98")), UnexpectedReply, "carries 2 bytes where 4"),
        (READ, FrameError, "local echo"),
    ],
    ids=["crc", "data", "short", "address", "function", "count", "echo"],
)
def test_a_bad_frame_is_named_and_asked_for_again(frame: bytes, error: type[DriverError], message: str) -> None:
    outcome, _ = read_position(frame, frame, frame)
    assert isinstance(outcome, error)
    assert message in str(outcome)
    outcome, traffic = read_position(frame, GOOD)
    assert outcome == [0, 15000]
    assert traffic.retries == 1  # type: ignore[attr-defined]


@pytest.mark.parametrize("noise", [b"\x00", b"\xff\xff", b"\x01", b"\x01\x00\x01", b"\x7f\x03\x01"])
def test_stray_bytes_before_a_good_frame_are_skipped(noise: bytes) -> None:
    outcome, traffic = read_position(noise + GOOD)
    assert outcome == [0, 15000]
    assert traffic.stray_bytes == len(noise)  # type: ignore[attr-defined]
    in_pieces, _ = read_position([(0.001, noise + GOOD[:1]), (0.002, GOOD[1:4]), (0.003, GOOD[4:])])
    assert in_pieces == [0, 15000]


def test_a_second_frame_glued_behind_is_no_answer_to_the_next_request() -> None:
    other = rtu_frame(octets("01 03 04 00 00 00 00"))
    link = scripted_link([(READ, GOOD + other), (READ, GOOD)])
    modbus = ModbusClient(link, 1)
    assert call(modbus.read_holding(0x9000, 2), link) == [0, 15000]
    assert call(modbus.read_holding(0x9000, 2), link) == [0, 15000]
    assert link.traffic.stray_bytes == len(other)


@pytest.mark.parametrize(
    ("code", "meaning"), [(1, "illegal function"), (2, "illegal data address"), (6, "device busy"), (99, "not define")]
)
def test_a_refusal_carries_its_code_and_name(code: int, meaning: str) -> None:
    outcome, traffic = read_position(rtu_frame(bytes((1, 0x83, code))))
    assert isinstance(outcome, ExceptionReply)
    assert outcome.code == code
    assert meaning in str(outcome)
    assert traffic.refusals == 1  # type: ignore[attr-defined]


def test_a_refusal_with_a_bad_checksum_is_no_refusal() -> None:
    outcome, _ = read_position(b"\x01\x83\x02\x00\x00", GOOD)
    assert outcome == [0, 15000]


def test_a_write_that_is_confirmed_with_another_value_is_refused() -> None:
    wrong = rtu_frame(octets("01 06 0D 03 00 02"))
    link = scripted_link([(octets("01 06 0D 03 00 01 BA A6"), wrong)])
    with pytest.raises(UnexpectedReply, match="confirms something else"):
        call(ModbusClient(link, 1).write_register(0x0D03, 1, repeatable=False), link)


def test_the_sample_time_is_the_middle_between_request_and_reply_on_the_wire() -> None:
    # 19200 baud, 11 bits: 8 bytes take 4.583 ms, 9 bytes 5.156 ms. The device answers 2 ms after the request's end.
    byte_s = 11 / 19200
    end_s = 8 * byte_s + 0.002 + 9 * byte_s
    link = scripted_link([(READ, [(end_s, GOOD)])], baudrate=19200, bits_per_byte=11)
    modbus = ModbusClient(link, 1)
    time_s = call(modbus.sample_registers("holding", 0x9000, 2, lambda _words, time_s, _received_s: time_s), link)
    assert time_s == pytest.approx(8 * byte_s + 0.001)


def test_the_deadline_leaves_room_for_both_frames_on_the_wire() -> None:
    byte_s = 10 / 9600
    link = scripted_link([(READ, None)], baudrate=9600, attempts=1)
    exchange = ModbusClient(link, 1, turnaround_s=0.05).read_holding(0x9000, 2)
    with pytest.raises(DeviceTimeout):
        call(exchange, link)
    assert exchange.received_s == pytest.approx(0.05 + (8 + 9) * byte_s)


def test_silence_between_frames() -> None:
    assert rtu_gap_s(19200, 11) == pytest.approx(3.5 * 11 / 19200)
    assert rtu_gap_s(115200, 11) == 0.00175


# -- TCP -----------------------------------------------------------------------------------------------------------

TCP_READ = octets("00 01 00 00 00 06 11 03 00 6B 00 03")
TCP_GOOD = octets("00 01 00 00 00 09 11 03 06 02 2B 00 00 00 64")


def read_tcp(*replies: Reply) -> object:
    link = scripted_link([(TCP_READ, reply) for reply in replies])
    exchange = ModbusClient(link, 0x11, transport="tcp").read_holding(0x6B, 3)
    link.submit(exchange)
    while not exchange.done:
        link.clock.wait([link.port], link.wake_at())
        link.service()
    return exchange.error if exchange.error is not None else exchange.value


def test_tcp_frames_of_the_standard() -> None:
    """The read of 1.1b3 section 6.3 behind the header of the Modbus TCP implementation guide, section 3.1.3."""
    assert read_tcp(TCP_GOOD) == [0x022B, 0, 0x64]
    assert read_tcp([(0.001, TCP_GOOD[:7]), (0.002, TCP_GOOD[7:])]) == [0x022B, 0, 0x64]


def test_a_tcp_reply_to_an_earlier_request_is_skipped() -> None:
    stale = octets("00 00 00 00 00 05 11 03 02 00 01")
    assert read_tcp(stale + TCP_GOOD) == [0x022B, 0, 0x64]


def test_a_sample_over_tcp_that_comes_late_is_nobodys() -> None:
    """A second try would bear the same number: the late reply would pass for a value of that later time."""
    link = scripted_link([(TCP_READ, [(0.2, TCP_GOOD)])], attempts=3)
    modbus = ModbusClient(link, 0x11, transport="tcp", turnaround_s=0.05)
    sample = modbus.sample_registers("holding", 0x6B, 3, lambda words, time_s, _received_s: (words, time_s))
    with pytest.raises(DeviceTimeout):
        call(sample, link)
    assert link.traffic.retries == 0


@pytest.mark.parametrize(
    ("frame", "error", "message"),
    [
        (octets("00 01 00 00 00 03 11 83 02"), ExceptionReply, "illegal data address"),
        (octets("00 01 00 00 00 09 12 03 06 02 2B 00 00 00 64"), UnexpectedReply, "unit 18"),
        (octets("00 01 00 00 00 05 11 03 02 02 2B"), UnexpectedReply, "bytes where 8 were expected"),
        (b"HTTP/1.1 400 Bad Request\r\n", FrameError, "no Modbus TCP"),
        (TCP_GOOD[:9], DeviceTimeout, "only 9 bytes"),
    ],
)
def test_tcp_errors_are_named(frame: bytes, error: type[DriverError], message: str) -> None:
    outcome = read_tcp(frame, frame, frame)
    assert isinstance(outcome, error)
    assert message in str(outcome)


# -- numbers in registers --------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("number", "kind", "order", "words"),
    [
        (15000, "i32", "high_first", [0, 0x3A98]),
        (-1, "i32", "high_first", [0xFFFF, 0xFFFF]),
        (-4321, "i32", "low_first", [0xEF1F, 0xFFFF]),
        (70000, "u32", "low_first", [0x1170, 1]),
        (-2, "i16", "low_first", [0xFFFE]),
        (65535, "u16", "high_first", [0xFFFF]),
        (1.5, "f32", "high_first", [0x3FC0, 0]),
        (1.5, "f32", "low_first", [0, 0x3FC0]),
    ],
)
def test_numbers_in_registers(number: float, kind: NumberType, order: WordOrder, words: list[int]) -> None:
    assert encode(number, kind, order) == words
    assert decode(words, kind, order) == number


@pytest.mark.parametrize(("number", "kind"), [(65536, "u16"), (-1, "u32"), (40000, "i16"), (float("nan"), "i32")])
def test_a_number_that_does_not_fit_is_refused(number: float, kind: NumberType) -> None:
    with pytest.raises(ValueError, match="cannot be written|does not fit"):
        encode(number, kind, "high_first")
