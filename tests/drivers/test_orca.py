"""Orca: frames computed from the vendor's layout (docs/devices.md 7.2), then a register image that misbehaves."""

from __future__ import annotations

import struct

import pytest

from drivers.errors import (
    CrcError,
    DeviceFault,
    DeviceTimeout,
    DriverError,
    ExceptionReply,
    ReadbackError,
    UnexpectedReply,
)
from drivers.modbus import rtu_frame
from drivers.motor import MotorLimits
from drivers.orca import Orca, default_gap_s
from drivers.orca_frames import Command, command_frame, error_names
from drivers.wire import Link, call, complete
from tests.drivers.scripted import AnsweringPort, ManualClock, Reply, octets, port_of, scripted_link

LIMITS = MotorLimits(speed_mm_s=200, acceleration_mm_s2=5000, force_N=20, position_mm=(-5, 6), watchdog_s=0.1)
REPLY = octets("01 64 00 00 04 d2 ff ff fe 0c 00 07 1f 5d c0 00 00 f7 c6")
"""Position 1234 µm, force -500 mN, 7 W, 31 °C, 24000 mV, no error."""


@pytest.mark.parametrize(
    ("code", "value", "frame"),
    [
        (Command.POSITION, 5000, "01 64 1e 00 00 13 88 a6 b0"),
        (Command.POSITION, -4321, "01 64 1e ff ff ef 1f a6 3a"),
        (Command.FORCE, 2000, "01 64 1c 00 00 07 d0 d1 8a"),
        (Command.SLEEP, 0, "01 64 00 00 00 00 00 03 e4"),
    ],
)
def test_stream_frames(code: int, value: int, frame: str) -> None:
    assert command_frame(1, code, value) == octets(frame)


@pytest.mark.parametrize(("direction", "frame"), [(1, "01 64 1e 00 00 13 88 a6 b0"), (-1, None)])
def test_stream_exchange(direction: int, frame: str | None) -> None:
    request = octets(frame) if frame else command_frame(1, Command.POSITION, -5000)
    link = scripted_link([(request, REPLY)])
    sample = call(Orca(link, direction=direction).stream(5.0), link)
    assert sample.position_mm == pytest.approx(1.234 * direction)
    assert sample.force_N == pytest.approx(-0.5 * direction)
    assert sample.fault == 0
    assert (link.traffic.bytes_out, link.traffic.bytes_in) == (9, 19)


def test_a_position_is_rounded_to_a_micrometre() -> None:
    link = scripted_link([(command_frame(1, Command.POSITION, 5000), REPLY)])
    call(Orca(link).stream(4.9996), link)


def test_the_sample_time_takes_the_wire_off() -> None:
    """1 Mbaud, 11 bits: 99 µs out, 209 µs back; the motor answers 80 µs after the request."""
    link = scripted_link(
        [(command_frame(1, Command.POSITION, 0), [(99e-6 + 80e-6 + 209e-6, REPLY)])],
        baudrate=1_000_000,
        bits_per_byte=11,
    )
    sample = call(Orca(link).stream(0.0), link)
    assert sample.time_s == pytest.approx(99e-6 + 40e-6, abs=1e-9)
    assert sample.received_s == pytest.approx(388e-6, abs=1e-9)


@pytest.mark.parametrize(
    ("reply", "error"),
    [
        (REPLY[:-1] + b"\x00", CrcError),
        (rtu_frame(b"\x02" + REPLY[1:-2]), UnexpectedReply),
        (rtu_frame(octets("01 e4 01")), ExceptionReply),
    ],
)
def test_bad_stream_replies(reply: bytes, error: type[DriverError]) -> None:
    request = command_frame(1, Command.POSITION, 0)
    link = scripted_link([(request, reply), (request, REPLY)])
    motor = Orca(link)
    with pytest.raises(error):
        call(motor.stream(0.0), link)
    assert call(motor.stream(0.0), link).position_mm == pytest.approx(1.234)


def test_error_names() -> None:
    assert error_names(0) == ()
    assert error_names(1 << 11 | 1 << 6) == ("too hot", "no command in time (communication watchdog)")
    assert error_names(1 << 3) == ("error bit 3",)


def test_gap_by_baudrate() -> None:
    assert default_gap_s(19200) == 0.002
    assert default_gap_s(1_000_000) == 80e-6


class Image:
    """The motor as a register image that answers functions 03, 06, 10h and 64h: what a driver does with each answer.

    Not a simulation: nothing moves. Tests set `stuck` registers, `errors`, and what auto zero ends in.
    """

    def __init__(self) -> None:
        self.registers = [0] * 973
        self.registers[406:411] = [0x0302, 0x0001, 7, 2, 2]
        self.registers[411:413] = [0xBEEF, 0x00DE]
        self.registers[171] = 2
        self.registers[317] = 1
        self.registers[418] = 0
        self.registers[482:485] = [0x4240, 0x000F, 80]
        self.stuck: set[int] = set()
        self.persistent_errors = 0
        self.auto_zero_reads = 3
        self.auto_zero_fails = False
        self.streamed: list[tuple[int, int]] = []
        self.modes: list[int] = []
        self.place(1234, -500)

    def place(self, position_um: int, force_mN: int) -> None:
        words = struct.unpack(">4H", struct.pack(">ii", position_um, force_mN))
        self.registers[342:344] = [words[1], words[0]]
        self.registers[348:350] = [words[3], words[2]]

    def write(self, address: int, value: int) -> None:
        if address in self.stuck:
            return
        self.registers[address] = value
        if address == 3:
            self.modes.append(value)
            self.registers[317] = value
            if value == 1:
                self.registers[432] = self.persistent_errors

    def read(self, address: int, count: int) -> list[int]:
        words = self.registers[address : address + count]
        if address == 317 and self.registers[317] == 55:
            self.auto_zero_reads -= 1
            if self.auto_zero_reads == 0:
                self.registers[317] = 3
                self.registers[321] |= 0 if self.auto_zero_fails else 1
                self.registers[432] |= (1 << 13 if self.auto_zero_fails else 0) | 1 << 11
        return words

    def answer(self, request: bytes) -> Reply:
        assert rtu_frame(request[:-2]) == request
        function = request[1]
        if function == 0x03:
            address, count = struct.unpack(">HH", request[2:6])
            words = self.read(address, count)
            return rtu_frame(bytes((1, 3, 2 * count)) + struct.pack(f">{count}H", *words))
        if function == 0x06:
            address, value = struct.unpack(">HH", request[2:6])
            self.write(address, value)
            return request
        if function == 0x10:
            address, count = struct.unpack(">HH", request[2:6])
            for index, value in enumerate(struct.unpack(f">{count}H", request[7:-2])):
                self.write(address + index, value)
            return rtu_frame(request[:6])
        assert function == 0x64
        code, value = struct.unpack(">Bi", request[2:7])
        self.streamed.append((code, value))
        if 317 not in self.stuck:
            self.registers[317] = {28: 2, 30: 3}.get(code, 1)
        low, high = self.registers[342:344]
        force_low, force_high = self.registers[348:350]
        return rtu_frame(
            struct.pack(">BBHHHHHBHH", 1, 0x64, high, low, force_high, force_low, 7, 31, 24000, self.registers[432])
        )


def image_link(image: Image) -> Link:
    clock = ManualClock()
    return Link("motor", AnsweringPort(clock, image.answer), clock)


def test_connect_tells_who_it_is() -> None:
    link = image_link(Image())
    identity = complete(Orca(link).connect(), link)
    assert identity.model == "ORCA-6-24"
    assert identity.details["serial_number"] == 0x0001_0302
    assert identity.details["firmware"] == "7.2.2"
    assert identity.details["commit"] == "00debeef"
    assert identity.details["device_baudrate"] == 1_000_000
    assert identity.details["device_gap_us"] == 80
    assert identity.details["zero_mode"] == "auto zero"


def test_another_device_is_not_taken_for_an_orca() -> None:
    image = Image()
    image.registers[418] = 77
    link = image_link(image)
    with pytest.raises(DriverError, match="check 'driver'"):
        complete(Orca(link).connect(), link)


def test_prepare_writes_clamps_low_word_first_and_reads_them_back() -> None:
    image = Image()
    link = image_link(image)
    held = complete(Orca(link, gains={"p": 200, "i": 60, "dv": 1200, "de": 0}).prepare(LIMITS), link)
    assert image.registers[140:142] == [20000, 0]
    assert image.registers[163] == 100
    assert image.registers[133:137] == [200, 60, 1200, 0]
    assert image.registers[1] == 1 << 10
    assert held["max_force_N"] == pytest.approx(20.0)
    assert held["watchdog_s"] == pytest.approx(0.1)


@pytest.mark.parametrize("stuck", [140, 163])
def test_a_clamp_that_does_not_hold_is_an_error(stuck: int) -> None:
    image = Image()
    image.stuck = {stuck}
    link = image_link(image)
    with pytest.raises(ReadbackError, match=f"register {stuck}"):
        complete(Orca(link).prepare(LIMITS), link)


@pytest.mark.parametrize("gains", [{"p": 1.0}, {"p": 1.0, "i": 2.0, "dv": 3.0, "de": 70000.0}])
def test_gains_must_be_complete_and_fit(gains: dict[str, float]) -> None:
    with pytest.raises(DriverError, match="gains"):
        Orca(scripted_link([]), gains=gains)


def test_energise_sleeps_first_then_holds_where_it_is() -> None:
    image = Image()
    image.registers[432] = 1 << 6
    link = image_link(image)
    complete(Orca(link).energise(), link)
    assert image.modes == [1]
    assert image.streamed == [(30, 1234)]
    assert image.registers[317] == 3


def test_an_error_that_sleep_does_not_clear_forbids_energising() -> None:
    image = Image()
    image.persistent_errors = 1 << 9
    link = image_link(image)
    with pytest.raises(DeviceFault) as caught:
        complete(Orca(link).energise(), link)
    assert caught.value.bits == 1 << 9
    assert caught.value.names == ("shaft image failed",)
    assert image.streamed == []


def test_reading_commands_nothing() -> None:
    image = Image()
    image.registers[432] = 1 << 11
    link = image_link(image)
    sample = call(Orca(link, direction=-1).read(), link)
    assert (sample.position_mm, sample.force_N) == (pytest.approx(-1.234), pytest.approx(0.5))
    assert sample.fault == 1 << 11
    assert image.streamed == []
    assert image.modes == []


def test_stop_commands_where_it_is_with_no_question_asked_while_streaming() -> None:
    image = Image()
    link = image_link(image)
    motor = Orca(link)
    call(motor.stream(9.0), link)
    complete(motor.stop(), link)
    assert image.streamed == [(30, 9000), (30, 1234), (30, 1234)]
    assert link.traffic.exchanges == 3


def test_stop_leaves_a_sleeping_motor_asleep() -> None:
    image = Image()
    link = image_link(image)
    complete(Orca(link).stop(), link)
    assert image.streamed == []


def test_stop_brings_a_motor_in_another_mode_to_a_stand() -> None:
    image = Image()
    image.registers[317] = 5
    link = image_link(image)
    complete(Orca(link).stop(), link)
    assert image.streamed == [(30, 1234), (30, 1234)]


@pytest.mark.parametrize(("state", "mode"), [("release", 1), ("hold", 3), ("retract", 3)])
def test_safe_states_are_read_back(state: str, mode: int) -> None:
    image = Image()
    image.registers[317] = 2
    link = image_link(image)
    proof = complete(Orca(link).safe_state(state), link)  # type: ignore[arg-type]
    assert image.registers[317] == mode
    assert proof["mode"] == {1: "sleep", 3: "position"}[mode]
    assert proof["position_mm"] == pytest.approx(1.234)


@pytest.mark.parametrize("state", ["release", "hold"])
def test_a_safe_state_that_is_not_reached_is_an_error(state: str) -> None:
    image = Image()
    image.registers[317] = 2
    image.stuck = {3, 317}
    link = image_link(image)
    with pytest.raises(ReadbackError, match="stays in force mode"):
        complete(Orca(link).safe_state(state), link)  # type: ignore[arg-type]


def test_holding_with_an_active_error_is_no_hold() -> None:
    image = Image()
    image.registers[432] = 1 << 8
    link = image_link(image)
    with pytest.raises(DeviceFault, match="power limit"):
        complete(Orca(link).safe_state("hold"), link)


def test_home_waits_for_the_end_of_auto_zero() -> None:
    image = Image()
    link = image_link(image)
    motor = Orca(link)
    assert complete(motor.is_homed(), link) is False
    complete(motor.home(), link)
    assert image.modes == [1, 55]
    assert complete(motor.is_homed(), link) is True


def test_home_reports_failure_by_name() -> None:
    image = Image()
    image.auto_zero_fails = True
    link = image_link(image)
    with pytest.raises(DeviceFault, match="auto zero failed"):
        complete(Orca(link).home(), link)


@pytest.mark.parametrize("zero_mode", [0, 1, 4])
def test_home_is_refused_where_the_motor_is_not_set_up_for_it(zero_mode: int) -> None:
    image = Image()
    image.registers[171] = zero_mode
    link = image_link(image)
    with pytest.raises(DriverError, match="register 171 = 2"):
        complete(Orca(link).home(), link)
    assert image.modes == []


def test_an_orca_takes_no_moves() -> None:
    with pytest.raises(DriverError, match="stream"):
        Orca(scripted_link([])).move(1.0, 2.0, 3.0)


def test_a_streamed_set_point_is_not_sent_again_the_next_one_takes_its_place() -> None:
    old, new = (command_frame(1, Command.POSITION, value) for value in (2500, 2600))
    link = scripted_link([(old, None), (new, REPLY)])
    motor = Orca(link)
    with pytest.raises(DeviceTimeout):
        call(motor.stream(2.5), link)
    call(motor.stream(2.6), link)
    assert port_of(link).finished
    assert link.traffic.retries == 0


def test_a_stop_is_sent_again_until_it_is_answered() -> None:
    here = command_frame(1, Command.POSITION, 1234)
    link = scripted_link([(here, REPLY), (here, None), (here, REPLY), (here, REPLY)])
    motor = Orca(link)
    call(motor.stream(1.234), link)
    complete(motor.stop(), link)
    assert port_of(link).finished
    assert link.traffic.retries == 1
