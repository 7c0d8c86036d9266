"""An IAI through its whole life, our driver against the emulated controller; then everything that can go wrong."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

import drivers
from drivers.errors import DeviceFault, DeviceTimeout, DriverError, ExceptionReply
from drivers.modbus import ModbusClient
from drivers.registers import RegisterMotor
from drivers.regmap import load_map
from drivers.spec import MotorSpec
from drivers.wire import Link, call, complete
from sim.model import Model
from sim.world import World, WorldSettings, register, unregister
from tests.drivers.contract_motor import LIMITS, pace
from tests.drivers.scripted import octets, port_of, scripted_link
from tests.sim.world_tools import FREE_AIR, SPRING, SPRING_N_mm

SURFACE_mm = 5.0
MAX_FORCE_N = 150.0
"""What the emulated drive gives at 100 % push (`sim.axis.ServoSettings`)."""

G_mm_s2 = 9806.65


@contextmanager
def bench(model: dict[str, Any] = SPRING, **motor: Any) -> Iterator[tuple[RegisterMotor, World]]:
    spec: dict[str, Any] = {"driver": "iai", "baudrate": 115200, "stroke": (-10.0, 20.0)} | motor
    cell = {"driver": "dad141", "capacity": 50.0}
    world = World(
        WorldSettings("life", Model.from_dict(model), motor=spec, load_cell=cell, clock="virtual", surface=SURFACE_mm)
    )
    register(world)
    try:
        axis = drivers.open_motor(MotorSpec(port="sim://life/motor", **spec), world.clock)
        assert isinstance(axis, RegisterMotor)
        yield axis, world
        axis.link.close()
    finally:
        unregister("life")


def settle(axis: RegisterMotor, within_s: float = 5.0) -> float:
    """Poll until it stands; where."""
    end_s = axis.link.clock.now() + within_s
    while axis.link.clock.now() < end_s:
        pace(axis.link, axis.link.clock.now() + 0.05)
        sample = call(axis.read(), axis.link)
        if not sample.moving:
            return sample.position_mm
    raise AssertionError("it never stands")


def ready(axis: RegisterMotor) -> None:
    complete(axis.energise(), axis.link)
    complete(axis.home(), axis.link)


@pytest.mark.parametrize("direction", [1, -1])
def test_a_whole_life(direction: int) -> None:
    """Connected, clamped (nothing can be), servo on, homed, moved both ways, pushed, stopped, released, and again."""
    with bench(direction=direction) as (axis, world):
        link = axis.link
        identity = complete(axis.connect(), link)
        assert identity.details["bits"] == ["power_ready"]
        assert "watchdog" in complete(axis.prepare(LIMITS), link)["not_clamped"]
        complete(axis.energise(), link)
        assert complete(axis.is_homed(), link) is False
        complete(axis.home(), link)
        assert complete(axis.is_homed(), link) is True
        for target_mm in (3.0, -2.5, 0.0):
            complete(axis.move(target_mm, 30.0, 0.3 * G_mm_s2), link)
            assert settle(axis) == pytest.approx(target_mm, abs=0.02)
            assert world.plant.position_mm == pytest.approx(target_mm, abs=0.02)
        push = "push_up" if direction > 0 else "push_down"
        complete(axis.perform(push, target=4.0, speed=20.0, acceleration=0.3 * G_mm_s2, stroke=6.0, push=20.0), link)
        force_N = 51 / 255 * MAX_FORCE_N
        assert world.plant.force_N == pytest.approx(force_N, rel=0.05)
        assert call(axis.read(), link).position_mm == pytest.approx(SURFACE_mm + force_N / SPRING_N_mm, rel=0.05)
        complete(axis.stop(), link)
        complete(axis.move(0.0, 30.0, 0.3 * G_mm_s2), link)
        assert settle(axis) == pytest.approx(0.0, abs=0.02)
        assert complete(axis.safe_state("hold"), link)["servo_on"] is True
        assert complete(axis.safe_state("release"), link)["servo_on"] is False
        complete(axis.energise(), link)
        assert complete(axis.is_homed(), link) is True
        traffic = link.traffic
        assert (traffic.timeouts, traffic.bad_frames, traffic.refusals, traffic.stray_bytes) == (0, 0, 0, 0)


@pytest.mark.parametrize(("action", "flags"), [("push_down", 6), ("push_up", 2)])
@pytest.mark.parametrize(("push", "power"), [(20.0, 0x33), (50.0, 0x7F), (70.0, 0xB2)])
def test_push_of_the_manual(push: float, power: int, action: str, flags: int) -> None:
    """20 mm from 50 mm with 100 mm/s and 0.3 G, backwards; at 70 % byte for byte the manual's (docs/devices.md 7.1)."""
    axis = RegisterMotor(scripted_link([]), load_map("iai", None, "motor"))
    steps = axis.perform(action, target=50.0, speed=100.0, acceleration=0.3 * G_mm_s2, stroke=20.0, push=push)
    request = next(steps).request
    assert request[:-2] == octets(
        f"01 10 99 00 00 09 12 00 00 13 88 00 00 07 D0 00 00 27 10 00 1E 00 {power:02X} 00 {flags:02X}"
    )
    if push == 70.0 and flags == 6:
        assert request[-2:] == octets("C3 77")


def test_a_push_outside_of_what_can_be_used_is_refused() -> None:
    axis = RegisterMotor(scripted_link([]), load_map("iai", None, "motor"))
    for push in (15.0, 80.0):
        with pytest.raises(DriverError, match="push .* outside of what it takes"):
            complete(axis.perform("push_up", target=0, speed=10, acceleration=1000, stroke=1, push=push), axis.link)
    assert port_of(axis.link).sent == []


def test_an_action_takes_what_it_takes() -> None:
    axis = RegisterMotor(scripted_link([]), load_map("iai", None, "motor"))
    with pytest.raises(DriverError, match="no action 'dance' .reset_alarm, push_up, push_down."):
        complete(axis.perform("dance"), axis.link)
    with pytest.raises(DriverError, match="takes target, speed, acceleration, stroke, push, all of them"):
        complete(axis.perform("push_up", target=0.0), axis.link)


# -- what can go wrong -------------------------------------------------------------------------------------------------


def alarm(axis: RegisterMotor) -> tuple[str, ...]:
    pace(axis.link, axis.link.clock.now() + 0.05)
    return axis.fault_names(call(axis.read(), axis.link).fault)


def test_a_push_that_meets_nothing_is_a_fault_and_the_axis_goes_on() -> None:
    with bench(FREE_AIR) as (axis, _):
        ready(axis)
        push = axis.perform("push_up", target=1.0, speed=20.0, acceleration=3000.0, stroke=1.0, push=20.0)
        with pytest.raises(DeviceFault, match="the push met nothing"):
            complete(push, axis.link)
        complete(axis.move(0.0, 30.0, 3000.0), axis.link)
        assert settle(axis) == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize(
    ("spoil", "code"),
    [("servo off", 0x80), ("not homed", 0x83), ("beyond the stroke", 0xA3), ("too fast", 0xA3)],
)
def test_an_alarm_is_raised_told_and_reset(spoil: str, code: int) -> None:
    """The emulator's codes (its own choice); what counts: the move is not made, it is told, and a reset helps."""
    with bench() as (axis, world):
        complete(axis.energise(), axis.link)
        if spoil != "not homed":
            complete(axis.home(), axis.link)
        if spoil == "servo off":
            complete(axis.safe_state("release"), axis.link)
        before_mm = world.plant.position_mm
        target_mm, speed_mm_s = {"beyond the stroke": (25.0, 30.0), "too fast": (1.0, 1500.0)}.get(spoil, (1.0, 30.0))
        complete(axis.move(target_mm, speed_mm_s, 3000.0), axis.link)
        assert alarm(axis) == (f"code {code:#06x}",)
        # A further move changes nothing while the alarm is on.
        complete(axis.move(1.0, 30.0, 3000.0), axis.link)
        pace(axis.link, axis.link.clock.now() + 0.2)
        assert world.plant.position_mm == pytest.approx(before_mm, abs=0.02)
        complete(axis.perform("reset_alarm"), axis.link)
        assert alarm(axis) == ()
        ready(axis)
        complete(axis.move(1.0, 30.0, 3000.0), axis.link)
        assert settle(axis) == pytest.approx(1.0, abs=0.02)


def test_codes_that_the_map_knows_are_said_in_words() -> None:
    form = load_map("iai", {"codes": {0x83: "moved before home return"}}, "motor")
    axis = RegisterMotor(scripted_link([]), form)
    assert axis.fault_names(0x83) == ("code 0x0083 (moved before home return)",)
    assert axis.fault_names(0x84) == ("code 0x0084",)


def test_servo_off_on_the_way_and_on_again_does_not_go_on() -> None:
    with bench() as (axis, _):
        ready(axis)
        complete(axis.move(4.0, 5.0, 3000.0), axis.link)
        pace(axis.link, axis.link.clock.now() + 0.2)
        complete(axis.safe_state("release"), axis.link)
        complete(axis.energise(), axis.link)
        here_mm = settle(axis)
        pace(axis.link, axis.link.clock.now() + 0.5)
        assert 0.2 < here_mm < 3.5
        assert call(axis.read(), axis.link).position_mm == pytest.approx(here_mm, abs=0.02)


def test_a_stop_ends_a_push_where_it_is() -> None:
    with bench() as (axis, world):
        ready(axis)
        push = axis.perform("push_up", target=4.0, speed=20.0, acceleration=3000.0, stroke=12.0, push=20.0)
        complete(push, axis.link)
        pressed_mm = world.plant.position_mm
        complete(axis.stop(), axis.link)
        pace(axis.link, axis.link.clock.now() + 0.3)
        assert world.plant.position_mm == pytest.approx(pressed_mm, abs=0.05)
        assert call(axis.read(), axis.link).moving is False


def test_home_return_can_be_stopped_and_is_then_not_done() -> None:
    with bench() as (axis, _):
        complete(axis.energise(), axis.link)
        call(ModbusClient(axis.link, 1).write_coil(0x040B, False), axis.link)
        call(ModbusClient(axis.link, 1).write_coil(0x040B, True), axis.link)
        pace(axis.link, axis.link.clock.now() + 0.1)
        complete(axis.stop(), axis.link)
        assert complete(axis.is_homed(), axis.link) is False
        complete(axis.home(), axis.link)
        assert complete(axis.is_homed(), axis.link) is True


def test_under_pio_command_moves_are_not_heard() -> None:
    with bench() as (axis, world):
        ready(axis)
        call(ModbusClient(axis.link, 1).write_coil(0x0427, False), axis.link)
        complete(axis.move(2.0, 30.0, 3000.0), axis.link)
        pace(axis.link, axis.link.clock.now() + 0.3)
        assert world.plant.position_mm == pytest.approx(0.0, abs=0.02)


def test_another_address_is_silence_that_says_what_to_check() -> None:
    with bench() as (axis, _):
        axis._modbus.address = 5
        with pytest.raises(DeviceTimeout, match="check power, cable, baudrate, parity and address"):
            call(axis.read(), axis.link)


def test_a_register_that_there_is_not_is_refused_with_the_code() -> None:
    with bench() as (axis, _), pytest.raises(ExceptionReply) as refused:
        call(ModbusClient(axis.link, 1).read_holding(0x0600), axis.link)
    assert refused.value.code == 2


def test_the_wrong_baudrate_is_silence() -> None:
    with bench() as (axis, world):
        world.endpoints["motor"].line.set_device(38400, "N")
        with pytest.raises(DriverError):
            call(axis.read(), axis.link)
        assert isinstance(axis.link, Link)
        assert axis.link.traffic.timeouts + axis.link.traffic.bad_frames > 0
