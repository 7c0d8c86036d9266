"""Drivers against simulated devices where a script of bytes would prove little: watchdog, homing, overload, time."""

from __future__ import annotations

from collections.abc import Iterator
from itertools import pairwise

import pytest

import drivers
from drivers.dad141 import Dad141
from drivers.errors import DriverError
from drivers.modbus import ModbusClient
from drivers.motor import MotorLimits
from drivers.orca import Orca
from drivers.registers import RegisterMotor
from drivers.spec import LoadCellSpec, MotorSpec
from drivers.wire import call, complete
from sim.world import World, register, unregister
from tests.drivers import contract_load_cell
from tests.drivers.contract_motor import go, pace
from tests.drivers.emulated_bench import settings

LIMITS = MotorLimits(
    speed_mm_s=100.0, acceleration_mm_s2=2000.0, force_N=20.0, position_mm=(-10.0, 10.0), watchdog_s=0.1
)
ORCA = {"driver": "orca", "baudrate": 1_000_000, "stroke": (-20.0, 20.0)}
IAI = {"driver": "iai", "baudrate": 38400, "stroke": (-20.0, 20.0)}
DAD = {"driver": "dad141", "baudrate": 115200, "capacity": 50.0}


def world_of(motor: dict[str, object]) -> World:
    world = World(settings({"motor": motor, "load_cell": DAD}, "drivers", "virtual"))
    register(world)
    return world


@pytest.fixture
def orca() -> Iterator[Orca]:
    world = world_of(ORCA)
    motor = drivers.open_motor(MotorSpec.model_validate(ORCA | {"port": "sim://drivers/motor"}), world.clock)
    assert isinstance(motor, Orca)
    yield motor
    motor.link.close()
    unregister("drivers")


@pytest.fixture
def iai() -> Iterator[RegisterMotor]:
    world = world_of(IAI)
    motor = drivers.open_motor(MotorSpec.model_validate(IAI | {"port": "sim://drivers/motor"}), world.clock)
    assert isinstance(motor, RegisterMotor)
    yield motor
    motor.link.close()
    unregister("drivers")


@pytest.fixture
def dad() -> Iterator[Dad141]:
    world = world_of(ORCA)
    cell = drivers.open_load_cell(LoadCellSpec.model_validate(DAD | {"port": "sim://drivers/load_cell"}), world.clock)
    assert isinstance(cell, Dad141)
    yield cell
    cell.link.close()
    unregister("drivers")


def test_an_orca_left_alone_reports_its_watchdog_and_can_be_energised_again(orca: Orca) -> None:
    complete(orca.prepare(LIMITS), orca.link)
    complete(orca.energise(), orca.link)
    pace(orca.link, orca.link.clock.now() + 0.3)
    sample = call(orca.read(), orca.link)
    assert orca.fault_names(sample.fault) == ("no command in time (communication watchdog)",)
    complete(orca.energise(), orca.link)
    assert call(orca.read(), orca.link).fault == 0


def test_an_orca_homes_where_its_zero_mode_allows(orca: Orca) -> None:
    link = orca.link
    with pytest.raises(DriverError, match="register 171 = 2"):
        complete(orca.home(), link)
    call(ModbusClient(link, 1).write_register(171, 2), link)
    complete(orca.home(), link)
    assert complete(orca.is_homed(), link) is True
    assert link.traffic.timeouts == 0


def test_an_orca_streams_a_thousand_positions_a_second(orca: Orca) -> None:
    """28 bytes of 11 bits at 1 Mbaud, and 80 µs before the reply and the next request, take 468 µs."""
    complete(orca.energise(), orca.link)
    begin_s = orca.link.clock.now()
    for _ in range(100):
        call(orca.stream(0.0), orca.link)
    assert (orca.link.clock.now() - begin_s) / 100 < 0.001


def test_an_iai_refuses_a_move_before_it_is_homed(iai: RegisterMotor) -> None:
    complete(iai.energise(), iai.link)
    complete(iai.move(1.0, 10.0, 1000.0), iai.link)
    pace(iai.link, iai.link.clock.now() + 0.05)
    sample = call(iai.read(), iai.link)
    assert any(name.startswith("code") for name in iai.fault_names(sample.fault))
    # An alarm does not keep it from being released, and energising clears it.
    assert complete(iai.safe_state("release"), iai.link)["servo_on"] is False
    complete(iai.energise(), iai.link)
    assert call(iai.read(), iai.link).fault == 0


def test_an_iai_says_whether_it_moves(iai: RegisterMotor) -> None:
    complete(iai.home(), iai.link)
    start_mm = call(iai.read(), iai.link).position_mm
    samples = go(iai, start_mm + 3.0, 10.0, until_s=0.6)
    assert samples[2].moving is True
    assert samples[-1].moving is False
    assert samples[-1].position_mm == pytest.approx(start_mm + 3.0, abs=0.02)


def test_the_stream_of_a_dad_is_stamped_evenly(dad: Dad141) -> None:
    """Lines of 21 bytes at 115200 follow each other in 1.823 ms: 548.6 a second."""
    complete(dad.connect(), dad.link)
    complete(dad.start(), dad.link)
    samples = contract_load_cell.gather(dad, 2.0)
    steps = [second.time_s - first.time_s for first, second in pairwise(samples)][100:]
    assert min(steps) == pytest.approx(210 / 115200, abs=2e-6)
    assert max(steps) == pytest.approx(210 / 115200, abs=2e-6)
    # Nothing but the line itself lies between its start and its last byte's receipt.
    age_s = [sample.received_s - sample.time_s for sample in samples[100:]]
    assert max(age_s) == pytest.approx(210 / 115200, abs=2e-6)


def test_a_dad_that_was_left_streaming_connects(dad: Dad141) -> None:
    complete(dad.connect(), dad.link)
    complete(dad.start(), dad.link)
    pace(dad.link, dad.link.clock.now() + 0.01)
    identity = complete(dad.connect(), dad.link)
    assert identity.details["id"] == "1410"
    assert dad.link.traffic.timeouts == 0
