"""Register maps: the shipped ones on the manuals' bytes, an unlike device from YAML alone, and maps that are wrong."""

from __future__ import annotations

import struct
from pathlib import Path
from typing import Any

import pytest
import yaml
from pydantic import ValidationError

from drivers.errors import DeviceFault, DeviceTimeout, DriverError, ReadbackError, UnexpectedReply
from drivers.maps import shipped_map, shipped_maps
from drivers.modbus import rtu_frame
from drivers.motor import MotorLimits
from drivers.registers import RegisterMotor
from drivers.registers_cell import RegisterLoadCell
from drivers.regmap import LoadCellMap, MotorMap, load_map
from drivers.wire import Link, call, complete
from tests.drivers.scripted import AnsweringPort, ManualClock, Reply, octets, port_of, scripted_link

Script = list[tuple[bytes, Reply]]
LIMITS = MotorLimits(speed_mm_s=200, acceleration_mm_s2=5000, force_N=20, position_mm=(-5, 6), watchdog_s=0.1)


def bitwise_crc(body: bytes) -> bytes:
    """CRC-16/Modbus bit by bit, low byte first: written from the standard, so that it owes nothing to a library."""
    crc = 0xFFFF
    for byte in body:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
    return crc.to_bytes(2, "little")


def framed(text: str) -> bytes:
    body = octets(text)
    return body + bitwise_crc(body)


def iai(script: Script, direction: int = 1) -> tuple[RegisterMotor, Link]:
    link = scripted_link(script)
    return RegisterMotor(link, load_map("iai", None, "motor"), direction=direction), link


SERVO, HOMED, IN_POSITION = 1 << 12, 1 << 4, 1 << 3
MODBUS, MOVING, HOMING = 1 << 8, 1 << 5, 1 << 11
STATUS_READ = framed("01 03 90 00 00 0C")


def iai_status(position: int = 0, alarm: int = 0, dss1: int = SERVO | HOMED, dsse: int = MODBUS) -> bytes:
    """The reply to a poll of 9000h to 900Bh: PNOW, ALMC, DIPM, DOPM, DSS1, DSS2, DSSE, STAT, VNOW."""
    return rtu_frame(b"\x01\x03\x18" + struct.pack(">iHHHHHHIi", position, alarm, 0, 0, dss1, 0, dsse, 0, 0))


# -- IAI ---------------------------------------------------------------------------------------------------------------


def test_a_move_is_one_message_of_nine_words() -> None:
    """50 mm, band 0.05 mm, 100 mm/s, 0.3 G: the manual's example 1 (7.1), band apart, with 9907 and 9908 cleared."""
    request = framed("01 10 99 00 00 09 12 00 00 13 88 00 00 00 05 00 00 27 10 00 1E 00 00 00 00")
    motor, link = iai([(request, octets("01 10 99 00 00 09 2E 93"))])
    complete(motor.move(50.0, 100.0, 0.3 * 9806.65), link)
    assert port_of(link).finished


def test_a_move_against_the_devices_direction() -> None:
    request = framed("01 10 99 00 00 09 12 FF FF EC 78 00 00 00 05 00 00 27 10 00 1E 00 00 00 00")
    motor, link = iai([(request, octets("01 10 99 00 00 09 2E 93"))], direction=-1)
    complete(motor.move(50.0, 100.0, 0.3 * 9806.65), link)


@pytest.mark.parametrize(
    ("move", "what"),
    [((50.0, 100.0, 10.0), "acceleration"), ((50.0, 0.001, 3000.0), "speed"), ((20000.0, 100.0, 3000.0), "target")],
)
def test_what_the_device_cannot_take_is_refused_not_clipped(move: tuple[float, float, float], what: str) -> None:
    motor, link = iai([])
    with pytest.raises(DriverError, match=f"{what} .* outside of what it takes"):
        complete(motor.move(*move), link)


def test_what_the_device_makes_of_a_move() -> None:
    motor, _ = iai([])
    target, speed, acceleration = motor.as_written(1.234, 33.333, 5000.0)
    assert (target, speed) == (pytest.approx(1.23), pytest.approx(33.33))
    assert acceleration == pytest.approx(0.51 * 9806.65)


def test_a_poll_gives_position_alarm_and_whether_it_moves() -> None:
    motor, link = iai([(STATUS_READ, iai_status(-1234, 0xB3, dsse=MODBUS | MOVING))], direction=-1)
    sample = call(motor.read(), link)
    assert sample.position_mm == pytest.approx(12.34)
    assert sample.moving is True
    assert sample.force_N is None
    assert motor.fault_names(sample.fault) == ("code 0x00b3",)


def test_an_alarm_bit_is_a_fault_by_name() -> None:
    motor, link = iai([(STATUS_READ, iai_status(alarm=0xE8, dss1=1 << 10 | 1 << 15))])
    sample = call(motor.read(), link)
    assert sample.fault
    assert motor.fault_names(sample.fault) == ("emergency_stop", "major_alarm", "code 0x00e8")


def test_no_fault_is_zero() -> None:
    motor, link = iai([(STATUS_READ, iai_status())])
    assert call(motor.read(), link).fault == 0


def test_energise_in_the_manuals_order() -> None:
    off = iai_status(dss1=HOMED)
    script: Script = [
        (STATUS_READ, off),
        (framed("01 05 04 27 FF 00"), framed("01 05 04 27 FF 00")),
        (STATUS_READ, off),
        (framed("01 05 04 07 FF 00"), framed("01 05 04 07 FF 00")),
        (framed("01 05 04 07 00 00"), framed("01 05 04 07 00 00")),
        (framed("01 05 04 03 FF 00"), framed("01 05 04 03 FF 00")),
        (STATUS_READ, off),
        (STATUS_READ, iai_status()),
    ]
    motor, link = iai(script)
    complete(motor.energise(), link)
    assert port_of(link).finished


def test_energise_with_the_emergency_stop_pressed_writes_nothing() -> None:
    motor, link = iai([(STATUS_READ, iai_status(dss1=1 << 15))])
    with pytest.raises(DeviceFault, match="emergency stop is pressed"):
        complete(motor.energise(), link)


def test_a_servo_that_does_not_come_on_is_named_with_its_bit() -> None:
    def answer(request: bytes) -> Reply:
        return iai_status(dss1=HOMED) if request == STATUS_READ else request

    clock = ManualClock()
    link = Link("motor", AnsweringPort(clock, answer), clock)
    motor = RegisterMotor(link, load_map("iai", None, "motor"))
    with pytest.raises(DeviceTimeout, match="the servo does not come on within 2 s .servo_on is off."):
        complete(motor.energise(), link)


def test_home_gives_an_edge_and_waits_for_its_end() -> None:
    script: Script = [
        (framed("01 05 04 27 FF 00"), framed("01 05 04 27 FF 00")),
        (framed("01 05 04 03 FF 00"), framed("01 05 04 03 FF 00")),
        (STATUS_READ, iai_status(dss1=SERVO)),
        (framed("01 05 04 0B 00 00"), framed("01 05 04 0B 00 00")),
        (framed("01 05 04 0B FF 00"), framed("01 05 04 0B FF 00")),
        (STATUS_READ, iai_status(dss1=SERVO, dsse=MODBUS | MOVING | HOMING)),
        (STATUS_READ, iai_status()),
        (framed("01 05 04 0B 00 00"), framed("01 05 04 0B 00 00")),
        (STATUS_READ, iai_status()),
    ]
    motor, link = iai(script)
    complete(motor.home(), link)
    assert port_of(link).finished


def test_an_alarm_while_homing_is_a_fault() -> None:
    script: Script = [
        (framed("01 05 04 27 FF 00"), framed("01 05 04 27 FF 00")),
        (framed("01 05 04 03 FF 00"), framed("01 05 04 03 FF 00")),
        (STATUS_READ, iai_status(dss1=SERVO)),
        (framed("01 05 04 0B 00 00"), framed("01 05 04 0B 00 00")),
        (framed("01 05 04 0B FF 00"), framed("01 05 04 0B FF 00")),
        (STATUS_READ, iai_status(alarm=0xBE, dss1=1 << 10)),
    ]
    motor, link = iai(script)
    with pytest.raises(DeviceFault, match="major_alarm"):
        complete(motor.home(), link)


def test_an_edge_is_never_sent_twice() -> None:
    """The start of home return goes unanswered: it may have been taken, so it is not repeated."""
    script: Script = [
        (framed("01 05 04 27 FF 00"), framed("01 05 04 27 FF 00")),
        (framed("01 05 04 03 FF 00"), framed("01 05 04 03 FF 00")),
        (STATUS_READ, iai_status(dss1=SERVO)),
        (framed("01 05 04 0B 00 00"), framed("01 05 04 0B 00 00")),
        (framed("01 05 04 0B FF 00"), None),
    ]
    motor, link = iai(script)
    with pytest.raises(DeviceTimeout):
        complete(motor.home(), link)
    assert port_of(link).finished


def test_stop_is_the_first_thing_on_the_wire() -> None:
    stop = framed("01 05 04 2C FF 00")
    script: Script = [(stop, stop), (STATUS_READ, iai_status(dsse=MODBUS | MOVING)), (STATUS_READ, iai_status())]
    motor, link = iai(script)
    complete(motor.stop(), link)
    assert port_of(link).sent[0] == stop


def test_release_works_with_an_alarm_on_and_is_read_back() -> None:
    off = framed("01 05 04 03 00 00")
    alarm = iai_status(alarm=0xE8, dss1=1 << 10)
    motor, link = iai([(off, off), (STATUS_READ, alarm), (STATUS_READ, alarm), (STATUS_READ, alarm)])
    proof = complete(motor.safe_state("release"), link)
    assert proof["servo_on"] is False
    assert "major_alarm" in proof["errors"]


@pytest.mark.parametrize("state", ["hold", "retract"])
def test_hold_needs_the_servo_on(state: Any) -> None:
    stop = framed("01 05 04 2C FF 00")
    motor, link = iai(
        [(stop, stop), (STATUS_READ, iai_status()), (STATUS_READ, iai_status()), (STATUS_READ, iai_status())]
    )
    assert complete(motor.safe_state(state), link)["servo_on"] is True


def test_a_device_without_clamps_says_so() -> None:
    motor, link = iai([])
    held = complete(motor.prepare(LIMITS), link)
    assert held == {"not_clamped": ["acceleration", "force", "position_high", "position_low", "speed", "watchdog"]}
    assert not motor.has_watchdog


def test_the_manuals_time_out() -> None:
    """3 · 1 ms + 5 ms + wire (7.1), and what the host itself may take."""
    link = scripted_link([(STATUS_READ, None)], baudrate=38400, attempts=1)
    exchange = RegisterMotor(link, load_map("iai", None, "motor")).read()
    link.submit(exchange)
    while not exchange.done:
        link.clock.wait([link.port], link.wake_at())
        link.service()
    assert link.clock.now() == pytest.approx(0.008 + 0.020 + (8 + 29) * 10 / 38400)


def test_connect_lists_what_is_on() -> None:
    motor, link = iai([(STATUS_READ, iai_status(500)), (STATUS_READ, iai_status(500))])
    identity = complete(motor.connect(), link)
    assert identity.details["position_mm"] == pytest.approx(5.0)
    assert identity.details["bits"] == ["homed", "modbus_in_command", "servo_on"]


# -- clamps and watchdog of a device that has them ---------------------------------------------------------------------


def with_clamps(**changes: Any) -> MotorMap:
    content = shipped_map("iai")
    content["values"] = content["values"] | {
        "speed_limit": {"address": 0x100, "type": "u16", "unit": "mm/s"},
        "watchdog": {"address": 0x101, "type": "u16", "unit": "ms"},
        "low": {"address": 0x102, "type": "i32", "scale": 0.01, "unit": "mm"},
    }
    content["clamps"] = {"speed": "speed_limit", "watchdog": "watchdog", "position_low": "low"}
    return MotorMap.model_validate(content | changes)


def clamp_script(held_watchdog: str = "00 64") -> Script:
    return [
        (framed("01 10 01 00 00 01 02 00 C8"), framed("01 10 01 00 00 01")),
        (framed("01 03 01 00 00 01"), framed("01 03 02 00 C8")),
        (framed("01 10 01 01 00 01 02 00 64"), framed("01 10 01 01 00 01")),
        (framed("01 03 01 01 00 01"), framed(f"01 03 02 {held_watchdog}")),
        (framed("01 10 01 02 00 02 04 FF FF FE 0C"), framed("01 10 01 02 00 02")),
        (framed("01 03 01 02 00 02"), framed("01 03 04 FF FF FE 0C")),
    ]


def test_clamps_are_written_in_the_devices_units_and_read_back() -> None:
    link = scripted_link(clamp_script())
    motor = RegisterMotor(link, with_clamps())
    held = complete(motor.prepare(LIMITS), link)
    assert held["speed"] == 200
    assert held["not_clamped"] == ["acceleration", "force", "position_high"]
    assert motor.has_watchdog
    assert port_of(link).finished


def test_a_clamp_that_the_device_changes_is_an_error() -> None:
    link = scripted_link(clamp_script("00 00")[:4])
    with pytest.raises(ReadbackError, match="watchdog"):
        complete(RegisterMotor(link, with_clamps()).prepare(LIMITS), link)


# -- DAD 141.1 over Modbus TCP -----------------------------------------------------------------------------------------


def dad_script(gross: bytes, qualifier: int = 0x0010) -> Script:
    def reply(transaction: int, data: bytes) -> bytes:
        return struct.pack(">HHHBBB", transaction, 0, 3 + len(data), 1, 3, len(data)) + data

    def request(transaction: int, address: int, count: int) -> bytes:
        return struct.pack(">HHHBBHH", transaction, 0, 6, 1, 3, address, count)

    return [
        (request(1, 0x202C, 2), reply(1, octets("00 00 05 83"))),
        (request(2, 0x202E, 2), reply(2, octets("00 00 01 01"))),
        (request(3, 0x2034, 2), reply(3, octets("00 00 00 2A"))),
        (request(4, 0x3500, 5), reply(4, gross + octets("00 00 00 00") + qualifier.to_bytes(2, "big"))),
        (request(5, 0x3500, 5), reply(5, gross + octets("00 00 00 00") + qualifier.to_bytes(2, "big"))),
    ]


def dad(script: Script, source: dict[str, Any] | None = None, **options: Any) -> tuple[RegisterLoadCell, Link]:
    link = scripted_link(script, "load_cell")
    return RegisterLoadCell(link, load_map("dad141_modbus", source, "load_cell"), **options), link


def first_sample(cell: RegisterLoadCell, link: Link) -> Any:
    complete(cell.start(), link)
    samples = cell.samples()
    while not samples:
        link.clock.wait([link.port], link.wake_at())
        link.service()
        samples = cell.samples()
    return samples[0]


def test_dad_combined_read() -> None:
    cell, link = dad(dad_script(struct.pack(">f", 12.5)), newtons_per_unit=-1.0, capacity_N=50.0)
    identity = complete(cell.connect(), link)
    assert identity.details["device_id"] == 1411
    sample = first_sample(cell, link)
    assert sample.gross_N == -12.5
    assert sample.flags == ("stable",)
    assert not sample.overload
    assert port_of(link).finished


@pytest.mark.parametrize(("gross", "qualifier"), [(12.5, 0x0002), (-12.5, 0x0001), (50.0, 0), (-50.0, 0)])
def test_dad_overload_by_qualifier_or_capacity(gross: float, qualifier: int) -> None:
    cell, link = dad(dad_script(struct.pack(">f", gross), qualifier), capacity_N=50.0)
    complete(cell.connect(), link)
    assert first_sample(cell, link).overload


def test_the_wrong_word_order_is_noticed_and_can_be_switched() -> None:
    swapped = struct.pack(">f", 12.5)[2:] + struct.pack(">f", 12.5)[:2]
    cell, link = dad(dad_script(swapped))
    with pytest.raises(UnexpectedReply, match="word_order"):
        complete(cell.connect(), link)
    cell, link = dad(dad_script(swapped), {"word_order": "low_first"})
    complete(cell.connect(), link)
    assert first_sample(cell, link).gross_N == 12.5


# -- maps --------------------------------------------------------------------------------------------------------------


def test_every_shipped_map_is_valid_and_says_where_it_is_from() -> None:
    for name in shipped_maps("motor"):
        assert isinstance(load_map(name, None, "motor"), MotorMap)
    for name in shipped_maps("load_cell"):
        assert isinstance(load_map(name, None, "load_cell"), LoadCellMap)
    for path in (Path(__file__).parents[2] / "drivers" / "maps").glob("*.yaml"):
        assert "# Source: " in path.read_text("utf-8")
        assert shipped_map(path.stem)["name"] == path.stem


def test_a_map_reads_the_same_in_yaml_1_1_and_1_2() -> None:
    """The bench file's reader takes `on` for a word and 010 for ten; nothing in a map may hang on that."""
    for path in (Path(__file__).parents[2] / "drivers" / "maps").glob("*.yaml"):
        for token in yaml.scan(path.read_text("utf-8")):
            if isinstance(token, yaml.ScalarToken) and token.plain:
                assert token.value.lower() not in ("on", "off", "yes", "no")
                assert not (token.value.startswith("0") and token.value[1:].isdigit())


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"bits": {"servo_on": {"address": 1, "bit": 0}}}, "lies in no block"),
        ({"values": {"speed": {"address": 0x9000}}}, "no 'position'"),
        ({"values": {"position": {"address": 0x9000, "unit": "furlong"}}}, "unknown unit 'furlong'"),
        ({"faults": ["fire"]}, "no 'fire'"),
        ({"stop": [{"coil": 1, "register": 2}]}, "exactly one of the keys"),
        ({"stop": [{"wait": {"moving": False}}]}, "within_s"),
        ({"stop": [{"wait": {"asleep": False}, "within_s": 1}]}, "no 'asleep'"),
        ({"move": [{"registers": 1, "fields": [{"from": "fear"}]}]}, "no 'fear'"),
        ({"move": [{"registers": 1, "fields": [{"from": "speed", "to": 1}]}]}, "either 'from'"),
        ({"constants": {"speed": 1.0}}, "cannot be constants"),
        ({"clamps": {"speed": "nothing"}}, "no 'nothing'"),
        ({"unheard": 1}, "Extra inputs"),
    ],
)
def test_a_map_that_cannot_work_is_refused_with_a_plain_word(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ValidationError, match=message):
        MotorMap.model_validate(shipped_map("iai") | change)
