"""What faults do to bytes, ports and clocks, seen from the host's end of the line."""

from __future__ import annotations

from typing import Any

import pytest
import serial

from sim.axis_kernel import MAX_FORCE
from sim.faults import KINDS, FaultError
from tests.sim.world_tools import DAD, SPRING, Client, bench, crc, framed

READ = "01 03 01 56 00 02"
CLEAN = framed("01 03 04 00 00 00 00")
"""An Orca's answer to where it is, at 0 and without noise."""


def reply(fault: dict[str, Any], wait_s: float = 0.2) -> bytes:
    """What comes back of one request to the motor while it has the fault."""
    with bench(faults=[{"device": "motor", "at_s": 0, "duration_s": 100, **fault}]) as world:
        client = Client(world, "motor")
        client.port.write(framed(READ))
        client.sleep(wait_s)
        return client.port.read(4096)


def test_without_a_fault():
    assert reply({"kind": "late", "by_s": 0.0}) == CLEAN


@pytest.mark.parametrize("count", [1, 3])
def test_bytes_lost_and_repeated(count):
    lost = reply({"kind": "bytes_lost", "count": count})
    assert len(lost) == len(CLEAN) - count
    assert any(CLEAN[:k] + CLEAN[k + count :] == lost for k in range(len(CLEAN)))
    twice = reply({"kind": "bytes_repeated", "count": count})
    assert len(twice) == len(CLEAN) + count
    assert any(CLEAN[: k + count] + CLEAN[k:] == twice for k in range(len(CLEAN)))


def test_one_bit_is_flipped():
    changed = reply({"kind": "bytes_corrupted"})
    assert sum((a ^ b).bit_count() for a, b in zip(changed, CLEAN, strict=True)) == 1


def test_noise_comes_before():
    assert reply({"kind": "line_noise", "count": 4})[4:] == CLEAN


def test_an_address_that_is_wrong_under_a_checksum_that_is_right():
    other = reply({"kind": "wrong_address"})
    assert other[0] == 2 and other[1:-2] == CLEAN[1:-2] and other[-2:] == crc(other[:-2])


def test_a_checksum_that_is_wrong_over_bytes_that_are_right():
    bad = reply({"kind": "crc_error"})
    assert bad[:-2] == CLEAN[:-2] and bad[-2:] != CLEAN[-2:]


def test_a_line_of_text_with_a_wrong_checksum_is_still_a_line():
    with bench(faults=[{"kind": "crc_error", "device": "load_cell", "at_s": 0, "duration_s": 9}]) as world:
        line = Client(world, "load_cell").ask(b"GW\r")
        assert line.endswith(b"\r\n") and len(line) == 21
        body = line.rstrip()
        assert int(body[-2:], 16) != -sum(body[:-2]) & 0xFF


@pytest.mark.parametrize("by_s", [0.01, 0.15])
def test_late_is_so_much_later(by_s):
    def arrived(late_s: float) -> float:
        with bench(faults=[{"kind": "late", "device": "motor", "at_s": 0, "duration_s": 9, "by_s": late_s}]) as world:
            client = Client(world, "motor")
            client.port.write(framed(READ))
            assert client.clock.wait([client.port], 1.0)
            return client.clock.now()

    assert arrived(by_s) - arrived(0.0) == pytest.approx(by_s, abs=1e-9)


def test_a_split_frame_is_whole_only_after_the_gap():
    fault = {"kind": "frame_split", "device": "motor", "at_s": 0, "duration_s": 9, "gap_s": 0.05}
    with bench(faults=[fault]) as world:
        client = Client(world, "motor")
        client.port.write(framed(READ))
        client.sleep(0.03)
        first = client.port.read(100)
        client.sleep(0.05)
        assert 0 < len(first) < len(CLEAN) and first + client.port.read(100) == CLEAN


def test_glued_frames_come_in_one_piece():
    with bench(faults=[{"kind": "frames_glued", "device": "motor", "at_s": 0}]) as world:
        client = Client(world, "motor")
        assert client.ask(framed(READ)) == b""
        assert client.ask(framed(READ)) == CLEAN + CLEAN


def test_an_exception_bears_the_code_and_does_nothing():
    with bench(faults=[{"kind": "exception", "device": "motor", "at_s": 0, "duration_s": 1, "code": 6}]) as world:
        client = Client(world, "motor")
        assert client.modbus("01 06 0003 0003") == "01 86 06"
        assert not world.plant.servo_on
        client.sleep(1.0)
        assert client.modbus("01 06 0003 0003") == "01 06 00 03 00 03"
        assert world.plant.servo_on


def test_an_answer_that_is_that_to_the_request_before():
    with bench(model=SPRING, faults=[{"kind": "stale_answers", "device": "motor", "at_s": 0}]) as world:
        client = Client(world, "motor")
        assert client.ask(framed(READ)) == b""
        assert client.ask(framed("01 03 013d 0001")) == CLEAN, "where it is, not which mode"
        assert client.ask(framed(READ)) == framed("01 03 02 00 01"), "the mode: asleep"


def test_two_that_answer_at_once_or_one_behind_the_other():
    assert len(reply({"kind": "address_twice"})) == len(CLEAN) and reply({"kind": "address_twice"}) != CLEAN
    with bench(faults=[{"kind": "address_twice", "device": "motor", "at_s": 0, "apart_s": 0.03}]) as world:
        client = Client(world, "motor")
        client.port.write(framed("01 03 013d 0001"))
        client.sleep(0.02)
        assert client.port.read(100) == framed("01 03 02 00 01")
        client.sleep(0.03)
        assert client.port.read(100) == framed("01 03 02 00 00"), "the other one has zeros"


def test_an_adapter_hands_over_when_its_timer_runs_out():
    """Lines of 21 bytes at 115200 baud come every 1.8 ms; they are seen at multiples of 16 ms, and none is lost."""
    with bench(faults=[{"kind": "latency_timer", "device": "load_cell", "at_s": 0}], load_cell=DAD) as world:
        client = Client(world, "load_cell")
        client.port.write(b"SW\r")
        seen = b""
        for turn in range(1, 8):
            world.clock.wait((), 0.016 * turn - 0.002)
            assert client.port.in_waiting < 21, "between two times there is nothing whole"
            world.clock.wait((), 0.016 * turn + 1e-9)
            seen += client.port.read(1000)
        lines = seen.split(b"\r\n")
        assert all(len(line) == 19 for line in lines[:-1]) and len(lines) > 50


def test_registers_that_stand_elsewhere():
    """Two further than where the map says: the position is found two before its place, and 0 where nothing is."""
    with bench(model=SPRING, surface=5.0, faults=[{"kind": "other_map", "device": "motor", "at_s": 0.1}]) as world:
        client = Client(world, "motor")
        serial_number = client.modbus("01 03 0196 0002")
        client.clock.wait((), 0.2)
        assert client.modbus("01 03 0194 0002") == serial_number
        assert client.modbus("01 06 0001 0003") == "01 06 00 01 00 03", "it goes to sleep, or wakes, by register 3"
        assert world.plant.servo_on


def test_words_the_other_way_round():
    with bench(faults=[{"kind": "other_map", "device": "motor", "at_s": 0, "what": "swapped_words"}]) as world:
        client = Client(world, "motor")
        client.modbus("01 10 008c 0002 04 0001 0002")
        assert list(world.endpoints["motor"].device.registers[140:142]) == [2, 1]
        assert client.modbus("01 03 008c 0002").endswith("00 01 00 02")


def test_commands_are_answered_and_nothing_is_done():
    fault = {"kind": "commands_ignored", "device": "motor", "at_s": 0, "duration_s": 1.0}
    with bench(model=SPRING, surface=5.0, faults=[fault]) as world:
        client = Client(world, "motor")
        assert client.modbus("01 06 0003 0003") == "01 06 00 03 00 03"
        assert client.modbus("01 10 008c 0002 04 0001 0002") == "01 10 00 8c 00 02"
        assert len(bytes.fromhex(client.modbus("01 64 1e 00 00 03 e8"))) == 17, "a stream's answer"
        assert not world.plant.servo_on
        client.sleep(1.0)
        client.modbus("01 06 0003 0003")
        assert world.plant.servo_on


def test_two_faults_that_refuse_on_one_device_both_do():
    soon, later = (
        {"kind": "exception", "device": "motor", "at_s": at_s, "duration_s": 0.1, "code": code}
        for at_s, code in ((0.0, 4), (0.5, 6))
    )
    with bench(faults=[soon, later]) as world:
        client = Client(world, "motor")
        assert client.modbus("01 06 0003 0003") == "01 86 04"
        world.clock.wait((), 0.51)
        assert client.modbus("01 06 0003 0003") == "01 86 06"


def test_a_loose_contact_opens_and_closes_and_heat_grows():
    loose = {"kind": "cable_open", "at_s": 1.0, "reads": "zero", "open_s": 0.02, "closed_s": 0.02}
    with bench(faults=[loose], seed=3) as world:
        amplifier = world.endpoints["load_cell"].device.amplifier
        readings = [amplifier.distortions[0](5.0, 0.001 * k) if k < 1000 else None for k in range(1000)]
        assert set(readings) == {5.0}
        world.clock.wait((), 1.0)
        after = [amplifier.distortions[0](5.0, 1.0 + 0.001 * k) for k in range(4000)]
    assert set(after) == {0.0, 5.0}
    assert abs(after.count(0.0) - 2000) < 5 * (4000 * 10) ** 0.5, "as long open as closed, some 100 times each"
    with bench(faults=[{"kind": "gain_drift", "at_s": 0, "share_per_s": 0.5}]) as world:
        hot = world.endpoints["load_cell"].device.amplifier.distortions[0]
        assert hot(2.0, 0.0) == 2.0 and hot(2.0, 2.0) == pytest.approx(2.0 * 2.718281828459045)


def test_an_axis_that_creeps_away_says_nothing_of_it():
    fault = {"kind": "position_drift", "at_s": 0.1, "rate_mm_s": 2.0, "duration_s": 0.5}
    with bench(model=SPRING, surface=9.0, faults=[fault]) as world:
        client = Client(world, "motor")
        while client.clock.now() < 1.0:
            client.ask(framed("01 64 1e 00 00 03 e8"))
        assert world.plant.position_mm == pytest.approx(1.0 + 2.0 * 0.5, abs=0.01)
        low, high = client.ask(framed(READ))[3:5], client.ask(framed(READ))[5:7]
        assert int.from_bytes(high + low, "big") == pytest.approx(1000, abs=10), "µm, as it was told"


def test_a_port_that_is_pulled_out_and_plugged_in_again():
    with bench(faults=[{"kind": "unplugged", "device": "motor", "at_s": 0.1, "duration_s": 0.2}]) as world:
        client = Client(world, "motor")
        assert client.ask(framed(READ)) == CLEAN
        client.sleep(0.1)
        for use in (lambda: client.port.read(1), lambda: client.port.write(b"x"), lambda: client.port.in_waiting):
            with pytest.raises(OSError, match="Input/output"):
                use()
        with pytest.raises(serial.SerialException, match="could not open port"):
            serial.serial_for_url("sim://test/motor")
        client.sleep(0.2)
        assert Client(world, "motor").ask(framed(READ)) == CLEAN


def test_a_waiting_host_is_woken_when_its_port_goes():
    with bench(faults=[{"kind": "unplugged", "device": "motor", "at_s": 0.1}]) as world:
        client = Client(world, "motor")
        assert client.clock.wait([client.port], 5.0) == [client.port]
        assert client.clock.now() == pytest.approx(0.1)


def test_a_restarted_motor_sleeps_and_hears_nothing_that_was_under_way():
    with bench(model=SPRING, surface=5.0, faults=[{"kind": "restart", "device": "motor", "at_s": 0.1}]) as world:
        client = Client(world, "motor")
        while client.clock.now() < 0.095:
            client.ask(framed("01 64 1e 00 00 03 e8"))
        assert world.plant.servo_on
        client.clock.wait((), 0.0995)
        client.port.write(framed("01 64 1e 00 00 03 e8"))  # its last byte comes when the power is gone
        client.sleep(0.1)
        assert not world.plant.servo_on and client.port.read(100) == b""
        client.sleep(0.6)
        assert client.modbus("01 03 013d 0001") == "01 03 02 00 01", "asleep"


def test_a_weak_motor_stays_weak_whatever_it_is_told():
    with bench(faults=[{"kind": "stall", "at_s": 0.1, "duration_s": 0.1}]) as world:
        full_N = world.plant.settings.max_force_N
        world.clock.wait((), 0.15)
        world.plant.limit_force(full_N)
        assert world.plant._s[MAX_FORCE] == 0.0
        world.clock.wait((), 0.25)
        assert world.plant._s[MAX_FORCE] == full_N


def test_a_stalled_host_sees_nothing_and_the_bench_goes_on():
    with bench(faults=[{"kind": "host_stall", "at_s": 0.1, "for_s": 0.5}]) as world:
        cell = Client(world, "load_cell")
        cell.port.write(b"SW\r")
        cell.clock.wait((), 0.1 - 1e-6)
        cell.port.read(1 << 20)
        cell.clock.wait([cell.port], 1.0)
        assert cell.clock.now() == pytest.approx(0.6)
        assert cell.port.read(1 << 20).count(b"\n") == pytest.approx(0.5 * 115200 / 210, abs=2)


@pytest.mark.parametrize("by_s", [2.0, -2.0])
def test_a_clock_that_is_set_moves_the_host_alone(by_s):
    fault = {"kind": "clock_step", "at_s": 1.0, "by_s": by_s}
    with bench(faults=[fault], load_cell=DAD | {"baudrate": 9600}) as world:
        clock = world.clock
        clock.wait((), 0.9)
        assert clock.now() == pytest.approx(0.9)
        clock.wait((), 1.1)
        assert world.true_clock.now() == pytest.approx(1.1)
        assert clock.now() == pytest.approx(1.1 + by_s)
        clock.wait((), clock.now() + 0.5)
        assert world.true_clock.now() == pytest.approx(1.6)


def test_a_wait_on_a_clock_that_was_set_ends_when_it_is_time():
    """However the numbers are rounded: a loop that waits for a time and finds it not yet come would turn for ever."""
    with bench(faults=[{"kind": "clock_step", "at_s": 0.1, "by_s": -0.3}]) as world:
        world.clock.wait((), 0.2)
        for k in range(1000):
            until_s = world.clock.now() + 0.1 / (k + 7)
            world.clock.wait((), until_s)
            assert world.clock.now() >= until_s


@pytest.mark.parametrize("driver", ["orca", "iai", "smc_lec"])
def test_every_kind_of_the_motor_is_simulated_for_every_motor(driver):
    for kind in KINDS.values():
        if "motor" in kind.devices:
            fault = {"kind": kind.name, "device": "motor", "at_s": 1e6}
            with bench(motor={"driver": driver, "baudrate": 38400, "stroke": (-20.0, 20.0)}, faults=[fault]) as world:
                world.clock.wait((), 0.01)


IN_LINES = {"wrong_address", "address_twice", "other_map"}
"""Kinds that a device without Modbus has no place for."""


@pytest.mark.parametrize(
    ("driver", "not_for"),
    [
        ("dad141", IN_LINES),
        ("mt_sics", IN_LINES | {"crc_error"}),
        ("laumas_tlb", set()),
        ("dad141_modbus", {"foreign_requests", "foreign_answers", "address_twice"}),
    ],
)
def test_every_kind_of_the_load_cell_is_simulated_or_says_why_not(driver, not_for):
    cannot = set()
    for kind in KINDS.values():
        if "load_cell" not in kind.devices:
            continue
        fault = {"kind": kind.name, "device": "load_cell", "at_s": 1e6}
        try:
            with bench(load_cell={"driver": driver, "capacity": 50.0}, faults=[fault]) as world:
                world.clock.wait((), 0.01)
        except FaultError as error:
            assert "not simulated" in error.message or "line" in error.message or "network" in error.message
            cannot.add(kind.name)
    assert cannot == not_for
