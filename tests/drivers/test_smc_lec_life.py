"""An SMC LEC from YAML alone against the emulated controller: its life, and what coils and step data can do wrong."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

import drivers
from drivers.errors import DeviceFault, DeviceTimeout
from drivers.modbus import ModbusClient
from drivers.registers import RegisterMotor
from drivers.spec import MotorSpec
from drivers.wire import call, complete
from sim.devices.smc_lec import SmcLec
from sim.world import World, register, unregister
from tests.drivers.contract_motor import pace
from tests.drivers.emulated_bench import settings
from tests.sim.world_tools import Client

HOLD, SVON, RESET, SERIAL = 0x18, 0x19, 0x1B, 0x30


@contextmanager
def bench(**motor: Any) -> Iterator[tuple[RegisterMotor, World, ModbusClient]]:
    spec: dict[str, Any] = {"driver": "smc_lec", "baudrate": 115200, "stroke": (-10.0, 20.0)} | motor
    world = World(settings({"motor": spec, "load_cell": {"driver": "dad141", "capacity": 50.0}}, "lec", "virtual"))
    register(world)
    try:
        axis = drivers.open_motor(MotorSpec(port="sim://lec/motor", **spec), world.clock)
        assert isinstance(axis, RegisterMotor)
        complete(axis.connect(), axis.link)
        yield axis, world, ModbusClient(axis.link, 1)
        axis.link.close()
    finally:
        unregister("lec")


def homed(axis: RegisterMotor) -> None:
    complete(axis.energise(), axis.link)
    complete(axis.home(), axis.link)


def wait(axis: RegisterMotor, seconds: float) -> float:
    pace(axis.link, axis.link.clock.now() + seconds)
    return call(axis.read(), axis.link).position_mm


def faults(axis: RegisterMotor) -> tuple[str, ...]:
    for _ in range(3):  # a block a poll
        sample = call(axis.read(), axis.link)
    return axis.fault_names(sample.fault)


@pytest.mark.parametrize("direction", [1, -1])
def test_a_whole_life(direction: int) -> None:
    with bench(direction=direction) as (axis, world, _):
        homed(axis)
        for target_mm in (3.0, -2.5, 0.01):
            complete(axis.move(target_mm, 30.0, 3000.0), axis.link)
            assert complete(axis.is_homed(), axis.link) is True  # on the way too: SETON, and not INP
            assert wait(axis, 0.6) == pytest.approx(target_mm, abs=0.02)
            assert world.plant.position_mm == pytest.approx(target_mm, abs=0.02)
        assert complete(axis.safe_state("hold"), axis.link)["servo_on"] is True
        assert complete(axis.safe_state("release"), axis.link)["servo_on"] is False
        traffic = axis.link.traffic
        assert (traffic.timeouts, traffic.bad_frames, traffic.refusals, traffic.stray_bytes) == (0, 0, 0, 0)
        device = world.devices["motor"]
        assert isinstance(device, SmcLec)
        assert device.starts == 3


def test_hold_taken_back_lets_a_move_go_on() -> None:
    """What the emulator takes HOLD for, and why a stop must do more."""
    with bench() as (axis, _, modbus):
        homed(axis)
        complete(axis.move(6.0, 10.0, 3000.0), axis.link)
        wait(axis, 0.2)
        call(modbus.write_coil(HOLD, True), axis.link)
        held_mm = wait(axis, 0.3)
        assert 1.0 < held_mm < 4.0
        assert wait(axis, 0.3) == pytest.approx(held_mm, abs=0.02)
        call(modbus.write_coil(HOLD, False), axis.link)
        assert wait(axis, 0.8) == pytest.approx(6.0, abs=0.02)


def test_after_a_stop_hold_can_be_taken_back_and_nothing_moves() -> None:
    with bench() as (axis, _, modbus):
        homed(axis)
        complete(axis.move(6.0, 10.0, 3000.0), axis.link)
        wait(axis, 0.2)
        complete(axis.stop(), axis.link)
        stopped_mm = wait(axis, 0.1)
        call(modbus.write_coil(HOLD, False), axis.link)
        assert wait(axis, 0.8) == pytest.approx(stopped_mm, abs=0.02)
        complete(axis.move(1.0, 20.0, 3000.0), axis.link)
        assert wait(axis, 0.8) == pytest.approx(1.0, abs=0.02)


def test_return_to_origin_can_be_stopped() -> None:
    with bench() as (axis, _, modbus):
        complete(axis.energise(), axis.link)
        call(modbus.write_coil(0x1C, True), axis.link)
        wait(axis, 0.1)
        complete(axis.stop(), axis.link)
        assert complete(axis.is_homed(), axis.link) is False
        complete(axis.home(), axis.link)
        assert complete(axis.is_homed(), axis.link) is True


@pytest.mark.parametrize("spoil", ["no origin", "servo off", "beyond the stroke", "too fast"])
def test_an_alarm_is_told_is_kept_by_a_stop_and_ended_by_energising(spoil: str) -> None:
    with bench(max_speed=200.0) as (axis, world, modbus):
        complete(axis.energise(), axis.link)
        if spoil != "no origin":
            complete(axis.home(), axis.link)
        if spoil == "servo off":
            call(modbus.write_coil(SVON, False), axis.link)
        before_mm = world.plant.position_mm
        target_mm, speed_mm_s = {"beyond the stroke": (25.0, 20.0), "too fast": (1.0, 500.0)}.get(spoil, (1.0, 20.0))
        complete(axis.move(target_mm, speed_mm_s, 3000.0), axis.link)
        wait(axis, 0.3)
        assert faults(axis) == ("alarm",)
        assert world.plant.position_mm == pytest.approx(before_mm, abs=0.02)
        complete(axis.stop(), axis.link)
        assert faults(axis) == ("alarm",)
        complete(axis.energise(), axis.link)
        assert faults(axis) == ()


def test_homing_with_an_alarm_is_a_fault() -> None:
    with bench() as (axis, _, _modbus), pytest.raises(DeviceFault, match="return to origin does not end: alarm"):
        complete(axis.home(), axis.link)  # never energised


def test_without_serial_drive_no_coil_is_heard() -> None:
    with bench() as (axis, _, modbus):
        call(modbus.write_coil(SERIAL, False), axis.link)
        call(modbus.write_coil(SVON, True), axis.link)
        complete(axis._signals.refresh(["servo_on"]), axis.link)
        assert axis._signals.bits["servo_on"] is False


def test_a_start_that_is_not_answered_is_sent_once() -> None:
    """The emulator is deaf from the start on: the device acts on each write of 9100, so none is repeated."""
    with bench() as (axis, world, _):
        homed(axis)
        steps = axis.move(2.0, 20.0, 3000.0)
        call(next(steps), axis.link)
        call(steps.send(None), axis.link)
        start = steps.send(None)
        world.devices["motor"].server.address = 9  # type: ignore[attr-defined]
        with pytest.raises(DeviceTimeout):
            call(start, axis.link)
        assert axis.link.traffic.retries == 0


def test_the_documented_reply_to_a_read_of_the_position() -> None:
    """150.00 mm: `01 03 90 00 00 02` is answered `01 03 04 00 00 3A 98` (docs/devices.md 7.1)."""
    with bench(stroke=(-1.0, 160.0)) as (axis, world, _):
        homed(axis)
        complete(axis.move(150.0, 500.0, 5000.0), axis.link)
        wait(axis, 1.0)
        axis.link.close()
        assert Client(world, "motor").modbus("01 03 90 00 00 02") == "01 03 04 00 00 3a 98"
