"""The shipped maps of an SMC LEC and a Laumas TLB on the manuals' bytes."""

from __future__ import annotations

import struct
from typing import Any

import pytest

from drivers.errors import DeviceTimeout
from drivers.registers import RegisterMotor
from drivers.registers_cell import RegisterLoadCell
from drivers.regmap import load_map
from drivers.wire import Link, call, complete
from tests.drivers.scripted import port_of, scripted_link
from tests.drivers.test_registers import Script, first_sample, framed

# -- SMC LEC, by YAML alone --------------------------------------------------------------------------------------------

MOTION_READ = framed("01 03 90 00 00 06")
OUTPUTS_READ = framed("01 02 00 40 00 10")


def lec_motion(position: int) -> bytes:
    return framed("01 03 0C " + struct.pack(">iHHi", position, 0, 0, 0).hex(" "))


def lec_outputs(*bits: int) -> bytes:
    word = sum(1 << bit - 0x40 for bit in bits)
    return framed("01 02 02 " + word.to_bytes(2, "little").hex(" "))


def lec(script: Script) -> tuple[RegisterMotor, Link]:
    link = scripted_link(script)
    return RegisterMotor(link, load_map("smc_lec", None, "motor")), link


def test_lec_position_of_the_manual() -> None:
    """150.00 mm is 00 00 3A 98 in the documented reply (7.1), here the first words of the block."""
    motor, link = lec([(OUTPUTS_READ, lec_outputs(0x48, 0x49)), (MOTION_READ, lec_motion(15000))])
    sample = call(motor.read(), link)
    assert sample.position_mm == pytest.approx(150.0)
    assert sample.moving is True
    assert sample.fault == 0


def test_lec_alarm_from_another_block_is_a_fault() -> None:
    motor, link = lec([(OUTPUTS_READ, lec_outputs(0x4F)), (MOTION_READ, lec_motion(0))])
    sample = call(motor.read(), link)
    assert motor.fault_names(sample.fault) == ("alarm",)


def test_lec_move_is_a_block_and_a_start() -> None:
    block = (
        "01 10 91 02 00 10 20 00 01 00 32 00 00 04 D2 0B B8 0B B8 00 00 00 00 00 00 00 64 00 00 00 00 00 00 00 00 "
        "00 00 00 05"
    )
    script: Script = [
        (framed(block), framed("01 10 91 02 00 10")),
        (framed("01 05 00 18 00 00"), framed("01 05 00 18 00 00")),
        (framed("01 06 91 00 00 01"), framed("01 06 91 00 00 01")),
    ]
    motor, link = lec(script)
    complete(motor.move(12.34, 50.0, 3000.0), link)
    assert port_of(link).finished


def test_lec_start_is_an_edge() -> None:
    script: Script = [
        (
            framed(
                "01 10 91 02 00 10 20 00 01 00 32 00 00 04 D2 0B B8 0B B8 00 00 00 00 00 00 00 64 00 00 00 00 00 00 "
                "00 00 00 00 00 05"
            ),
            framed("01 10 91 02 00 10"),
        ),
        (framed("01 05 00 18 00 00"), framed("01 05 00 18 00 00")),
        (framed("01 06 91 00 00 01"), None),
    ]
    motor, link = lec(script)
    with pytest.raises(DeviceTimeout):
        complete(motor.move(12.34, 50.0, 3000.0), link)
    assert link.traffic.retries == 0


@pytest.mark.parametrize("alarm", [False, True])
def test_lec_stop_forgets_the_rest_of_the_way_but_no_alarm(alarm: bool) -> None:
    hold, reset, back = (framed(text) for text in ("01 05 00 18 FF 00", "01 05 00 1B FF 00", "01 05 00 1B 00 00"))
    standing = lec_outputs(0x49, 0x4A, *((0x4F,) if alarm else ()))
    script: Script = [(hold, hold), (OUTPUTS_READ, lec_outputs(0x48, 0x49)), (OUTPUTS_READ, standing)]
    script += [(OUTPUTS_READ, standing), *([] if alarm else [(reset, reset)]), (back, back)]
    motor, link = lec(script)
    complete(motor.stop(), link)
    assert port_of(link).finished


def test_lec_release_is_read_from_discrete_inputs() -> None:
    off = framed("01 05 00 19 00 00")
    script: Script = [
        (off, off),
        (OUTPUTS_READ, lec_outputs(0x49)),
        (OUTPUTS_READ, lec_outputs(0x4A)),
        (OUTPUTS_READ, lec_outputs(0x4A)),
        (MOTION_READ, lec_motion(0)),
        (OUTPUTS_READ, lec_outputs(0x4A)),
    ]
    motor, link = lec(script)
    assert complete(motor.safe_state("release"), link)["servo_on"] is False


# -- Laumas TLB --------------------------------------------------------------------------------------------------------


def laumas(status: int, gross: int, **options: Any) -> tuple[RegisterLoadCell, Link]:
    """Status 6, gross 7 and 8 and net 9 and 10, high word first (docs/devices.md 3.3)."""
    reply = framed("01 03 0A " + struct.pack(">HII", status, gross, 0).hex(" "))
    link = scripted_link([(framed("01 03 00 06 00 05"), reply)], "load_cell", baudrate=9600)
    source = options.pop("source", None)
    return RegisterLoadCell(link, load_map("laumas_tlb", source, "load_cell"), **options), link


@pytest.mark.parametrize(
    ("status", "gross", "force_N", "flags"),
    [
        (0, 12_345, 12.345, ()),
        (1 << 7, 12_345, -12.345, ()),
        (1 << 7 | 1 << 11, 70_000, -70.0, ("stable",)),  # 70000 takes both words
        (1 << 8, 5, 0.005, ()),  # the net value's sign is none of gross's
        (1 << 12 | 1 << 10, 0, 0.0, ("near_zero", "net_shown")),
    ],
)
def test_laumas_weight_has_its_sign_in_the_status(
    status: int, gross: int, force_N: float, flags: tuple[str, ...]
) -> None:
    cell, link = laumas(status, gross, capacity_N=100.0)
    sample = first_sample(cell, link)
    assert sample.gross_N == pytest.approx(force_N)
    assert sample.flags == flags
    assert not sample.overload


@pytest.mark.parametrize("bit", [0, 1, 2, 3, 4])
def test_laumas_errors_are_overloads(bit: int) -> None:
    cell, link = laumas(1 << bit, 1000, capacity_N=100.0)
    assert first_sample(cell, link).overload


def test_a_cell_asked_faster_than_it_answers_does_not_ask_to_be_woken_meanwhile() -> None:
    """10 000 polls a second at 9600 baud: while one is on its way, waiting ends with its answer, not at once."""
    cell, link = laumas(0, 1000, capacity_N=100.0, rate_hz=10_000.0)
    complete(cell.start(), link)
    assert cell.next_poll_s() == link.clock.now()
    assert cell.samples() == []
    assert cell.next_poll_s() is None
    while not link.idle:
        link.clock.wait([link.port], link.wake_at())
        link.service()
    due_s = cell.next_poll_s()
    assert due_s is not None and due_s <= link.clock.now()


def test_laumas_other_decimals_are_a_key_of_the_bench_file() -> None:
    cell, link = laumas(0, 12_345, source={"values": {"gross": {"scale": 0.1}}}, capacity_N=5000.0)
    assert first_sample(cell, link).gross_N == pytest.approx(1234.5)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"values": {"gross": {"negative": "cold"}}}, "no 'cold'"),
        (
            {"bits": {"gross_negative": {"address": 0, "bit": 7}}, "blocks": {"x": {"address": 0, "count": 1}}},
            "one block",
        ),
        ({"identify": ["gross"]}, "without the bit of its sign"),
        (
            {"bits": {"far": {"address": 0, "bit": 0}}, "blocks": {"x": {"address": 0, "count": 1}}, "flags": ["far"]},
            "'far'",
        ),
    ],
)
def test_a_load_cell_map_that_cannot_work_is_refused(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        load_map("laumas_tlb", change, "load_cell")
