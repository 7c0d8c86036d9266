"""What faults do to bytes, ports and clocks, seen from the host's end of the line."""

from __future__ import annotations

from typing import Any

import pytest
import serial

from sim.axis_kernel import MAX_FORCE
from sim.faults import KINDS
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


@pytest.mark.parametrize("driver", ["orca", "iai"])
def test_every_kind_of_the_motor_is_simulated_for_every_motor(driver):
    for kind in KINDS.values():
        if "motor" in kind.devices:
            fault = {"kind": kind.name, "device": "motor", "at_s": 1e6}
            with bench(motor={"driver": driver, "baudrate": 38400, "stroke": (-20.0, 20.0)}, faults=[fault]) as world:
                world.clock.wait((), 0.01)
