"""Two devices on one RS485 line: turns, a silent one, late answers, and what each of them is told."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import pytest

import drivers
from drivers.bus import Bus, BusLink
from drivers.errors import DeviceTimeout, PortError
from drivers.modbus import ModbusClient, rtu_frame
from drivers.motor import MotorSample
from drivers.regmap import LinkMap
from drivers.spec import LoadCellSpec, MotorSpec
from drivers.wire import Exchange, Link, call, complete
from sim.devices.bus import join
from sim.world import World, register, unregister
from tests.drivers import contract_load_cell, contract_motor
from tests.drivers.emulated_bench import settings
from tests.drivers.scripted import ManualClock, ScriptedPort

PORT = "sim://line/motor"
MOTOR: dict[str, Any] = {"driver": "iai", "baudrate": 115200, "address": 1, "stroke": (-20.0, 20.0)}
CELL: dict[str, Any] = {"driver": "laumas_tlb", "baudrate": 115200, "address": 2, "capacity": 50.0}


@contextmanager
def line() -> Iterator[World]:
    """An IAI and a Laumas on the motor's line."""
    world = World(settings({"motor": MOTOR, "load_cell": CELL}, "line", "virtual"))
    join(world.endpoints["motor"].line, [world.endpoints[key].device for key in ("motor", "load_cell")])  # type: ignore[misc]
    register(world)
    try:
        yield world
    finally:
        unregister("line")


def opened(world: World, cell_address: int = 2, rate_hz: float = 50.0) -> tuple[Any, Any]:
    motor = drivers.open_motor(MotorSpec(port=PORT, **MOTOR), world.clock)
    spec = LoadCellSpec(port=PORT, rate=rate_hz, **CELL | {"address": cell_address})
    return motor, drivers.open_load_cell(spec, world.clock)


def serve(motor: Any, cell: Any, seconds: float, rate_hz: float) -> tuple[list[float], list[Any]]:
    """Both polled for so long, as a bench does: when the motor's answers came, and the cell's samples."""
    clock = motor.link.clock
    end_s = next_s = clock.now()
    end_s += seconds
    answers: list[float] = []
    samples: list[Any] = []
    poll: Exchange[MotorSample] | None = None
    while clock.now() < end_s:
        if poll is not None and poll.done:
            if poll.error is None:
                answers.append(poll.received_s)
            poll = None
        if poll is None and clock.now() >= next_s:
            poll = motor.link.submit(motor.read())
            next_s = max(next_s + 1.0 / rate_hz, clock.now())
        samples += cell.samples()
        due_s = cell.next_poll_s()
        wake_s = min(end_s, motor.link.wake_at(), cell.link.wake_at(), end_s if due_s is None else due_s)
        clock.wait([motor.link.port], min(wake_s, end_s if poll is not None else max(next_s, clock.now())))
        motor.link.service()
        cell.link.service()
    return answers, samples


def test_motor_and_load_cell_keep_their_contracts_on_one_port() -> None:
    with line() as world:
        motor, cell = opened(world)
        assert motor.link.port is cell.link.port
        contract_motor.check_all(motor)
        contract_load_cell.check_all(cell, 0.0, at_least_hz=45.0)
        motor.link.close()
        cell.link.close()
        assert not motor.link.port.is_open


def test_both_are_polled_at_their_rates() -> None:
    with line() as world:
        motor, cell = opened(world)
        complete(cell.start(), cell.link)
        answers, samples = serve(motor, cell, 1.0, 50.0)
        assert len(answers) >= 49
        assert len(samples) >= 49
        for traffic in (motor.link.traffic, cell.link.traffic):
            assert (traffic.timeouts, traffic.bad_frames, traffic.stray_bytes) == (0, 0, 0)
        assert world.endpoints["motor"].line.collisions == 0


def test_a_silent_load_cell_leaves_the_motor_at_its_rate_but_for_time_outs() -> None:
    """Nobody has address 9. Between two answers of the motor lies one time-out of the cell at the most, never three."""
    with line() as world:
        motor, cell = opened(world, cell_address=9)
        complete(cell.start(), cell.link)
        timeout_s = cell._exchange().timeout_s + cell.link.wire_s(8)
        answers, samples = serve(motor, cell, 2.0, 50.0)
        assert samples == []
        assert cell.link.traffic.timeouts > 20
        assert motor.link.traffic.timeouts == motor.link.traffic.retries == 0
        exchange_s = 0.006 + motor.link.wire_s(8 + 29) + 2 * 0.00175 + 0.002
        gaps_s = [second - first for first, second in zip(answers, answers[1:], strict=False)]
        assert max(gaps_s) < max(0.02, exchange_s) + timeout_s + exchange_s
        assert len(answers) > 0.9 * 2.0 / (exchange_s + timeout_s)


def test_a_silent_motor_leaves_the_load_cell_its_turns() -> None:
    with line() as world:
        motor, cell = opened(world)
        motor._modbus.address = 7  # nobody's
        complete(cell.start(), cell.link)
        answers, samples = serve(motor, cell, 2.0, 50.0)
        assert answers == []
        assert cell.link.traffic.timeouts == 0
        timeout_s = motor.read().timeout_s + motor.link.wire_s(8)
        assert len(samples) > 0.8 * 2.0 / (timeout_s + 0.01)


def test_devices_on_one_line_need_the_same_settings() -> None:
    with line() as world:
        motor = drivers.open_motor(MotorSpec(port=PORT, **MOTOR), world.clock)
        with pytest.raises(PortError, match=r"load_cell: .* is motor's too, set to 115200 baud, 8N1, and 9600 baud"):
            drivers.open_load_cell(LoadCellSpec(port=PORT, **CELL | {"baudrate": 9600}), world.clock)
        motor.link.close()


# -- on a scripted port ------------------------------------------------------------------------------------------------


def pair(script: list[Any]) -> tuple[ScriptedPort, BusLink, BusLink]:
    clock = ManualClock()
    port = ScriptedPort(clock, script)
    bus = Bus("here", port, clock, LinkMap())
    options = {"baudrate": 115200, "gap_s": 0.001}
    return port, BusLink("motor", bus, **options), BusLink("load_cell", bus, **options)


def reading(address: int, value: int) -> bytes:
    return rtu_frame(bytes((address, 3, 2, value >> 8, value & 0xFF)))


def asking(address: int, place: int = 0) -> bytes:
    return rtu_frame(bytes((address, 3, 0, place, 0, 1)))


def finish(*exchanges: tuple[Link, Exchange[Any]]) -> None:
    links = [link for link, _ in exchanges]
    while not all(exchange.done for _, exchange in exchanges):
        links[0].clock.wait([links[0].port], min(link.wake_at() for link in links))
        for link in links:
            link.service()


def test_a_late_answer_of_another_device_is_thrown_away() -> None:
    """Device 2 answers 30 ms late, while device 1 is asked, whose own answer follows 2 ms later."""
    late = [(0.030, reading(2, 222))]
    port, motor, cell = pair([(asking(2), late), (asking(1), [(0.006, reading(1, 111))])])
    cell.attempts = 1
    asked_cell = cell.submit(ModbusClient(cell, 2, turnaround_s=0.025).read_holding(0))
    asked_motor = motor.submit(ModbusClient(motor, 1, turnaround_s=0.025).read_holding(0))
    finish((motor, asked_motor), (cell, asked_cell))
    assert asked_motor.result() == [111]
    with pytest.raises(DeviceTimeout):
        asked_cell.result()
    assert motor.traffic.bad_frames == motor.traffic.retries == 0
    assert port.finished


def test_what_comes_before_the_question_has_left_is_no_answer() -> None:
    """Device 1 gives its old value 28.6 ms after it was asked: the time-out was at 26.3 ms (25 ms, and 15 bytes of
    wire), the question was put again 2 ms later, and takes 0.7 ms to leave."""
    port, motor, _ = pair(
        [(asking(1), [(0.0286, reading(1, 5))]), (asking(1), [(0.003, reading(1, 6))])],
    )
    asked = motor.submit(ModbusClient(motor, 1, turnaround_s=0.025).read_holding(0))
    finish((motor, asked))
    assert asked.result() == [6]
    assert motor.traffic.stray_bytes == 7
    assert port.finished


def test_a_repeated_request_waits_for_its_turn() -> None:
    script = [(asking(2), None), (asking(1), reading(1, 1)), (asking(2), None), (asking(1, 4), reading(1, 2))]
    port, motor, cell = pair([*script, (asking(2), None)])
    silent = cell.submit(ModbusClient(cell, 2, turnaround_s=0.01).read_holding(0))
    client = ModbusClient(motor, 1, turnaround_s=0.01)
    first, second = motor.submit(client.read_holding(0)), motor.submit(client.read_holding(4))
    finish((motor, first), (motor, second), (cell, silent))
    assert (first.result(), second.result()) == ([1], [2])
    assert port.finished


def test_an_urgent_request_is_the_lines_next() -> None:
    port, motor, cell = pair([(asking(2), reading(2, 1)), (asking(1), reading(1, 9)), (asking(2, 1), reading(2, 2))])
    client = ModbusClient(cell, 2, turnaround_s=0.01)
    first, second = cell.submit(client.read_holding(0)), cell.submit(client.read_holding(1))
    stop = motor.submit(ModbusClient(motor, 1, turnaround_s=0.01).read_holding(0), urgent=True)
    finish((motor, stop), (cell, first), (cell, second))
    assert stop.received_s < second.received_s
    assert port.finished


def test_a_lost_port_is_told_to_each_in_its_own_name() -> None:
    port, motor, cell = pair([(asking(1), None)])
    asked = motor.submit(ModbusClient(motor, 1).read_holding(0))
    port.error = OSError("gone")
    motor.service()
    assert isinstance(asked.error, PortError) and asked.error.device == "motor"
    assert cell.broken is not None and cell.broken.device == "load_cell"


def test_one_may_leave_and_the_other_goes_on() -> None:
    port, motor, cell = pair([(asking(1), reading(1, 3))])
    cell.close()
    assert not port.closed
    assert call(ModbusClient(motor, 1).read_holding(0), motor) == [3]
    motor.close()
    assert port.closed
