"""The same contract for every driver over every transport: simulated port, pseudo-terminal, pymodbus's own server."""

from __future__ import annotations

import json
import subprocess
import sys
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager
from pathlib import Path
from typing import Any

import pytest

import drivers
from drivers.clock import WallClock
from drivers.errors import DriverError
from drivers.loadcell import LoadCell
from drivers.motor import Motor
from drivers.spec import LoadCellSpec, MotorSpec
from drivers.wire import Clock
from sim.world import World, lookup, register, unregister
from tests.drivers import contract_load_cell, contract_motor
from tests.drivers.emulated_bench import settings

ROOT = Path(__file__).parents[2]

MOTORS: dict[str, dict[str, Any]] = {
    "orca": {"driver": "orca", "baudrate": 1_000_000, "stroke": (-20.0, 20.0)},
    "orca_turned": {"driver": "orca", "baudrate": 115200, "direction": -1, "stroke": (-20.0, 20.0)},
    "iai": {"driver": "iai", "baudrate": 115200, "stroke": (-20.0, 20.0)},
    "iai_turned": {"driver": "iai", "direction": -1, "stroke": (-20.0, 20.0)},
    "smc_lec": {"driver": "smc_lec", "stroke": (-20.0, 20.0)},
    "smc_lec_turned": {"driver": "smc_lec", "baudrate": 115200, "direction": -1, "stroke": (-20.0, 20.0)},
}
LOAD_CELLS: dict[str, dict[str, Any]] = {
    "dad141": {"driver": "dad141", "baudrate": 115200, "capacity": 50.0, "decimals": 3},
    "dad141_asked": {"driver": "dad141", "capacity": 50.0, "unit": "g", "sign": -1},
    "dad141_poll": {"driver": "dad141", "capacity": 50.0, "mode": "poll", "rate": 100.0},
    "dad141_modbus": {"driver": "dad141_modbus", "capacity": 50.0},
    "laumas_tlb": {"driver": "laumas_tlb", "baudrate": 115200, "capacity": 50.0},
    "laumas_slow": {"driver": "laumas_tlb", "baudrate": 19200, "capacity": 50.0, "sign": -1},
    "mt_sics": {"driver": "mt_sics", "baudrate": 38400, "capacity": 50.0, "unit": "g"},
    "mt_sics_slow": {"driver": "mt_sics", "capacity": 50.0, "unit": "N", "sign": -1},
    "mt_sics_poll": {"driver": "mt_sics", "baudrate": 38400, "capacity": 50.0, "mode": "poll", "rate": 60.0},
}
RATES_HZ = {
    "dad141": 500.0,
    "dad141_asked": 500.0,
    "dad141_poll": 80.0,
    "dad141_modbus": 50.0,
    # 8 + 15 bytes of 10 bits, 2 ms of the device and the gap between frames (docs/devices.md 6: 250 at 2 ms).
    "laumas_tlb": 150.0,
    "laumas_slow": 60.0,
    # 100 a second as the device is set; 53 on the wire at 9600 baud (docs/devices.md 3.2).
    "mt_sics": 95.0,
    "mt_sics_slow": 50.0,
    "mt_sics_poll": 55.0,
}


def devices(motor: str, load_cell: str) -> dict[str, dict[str, Any]]:
    # What a simulated device needs to know; how it is read (`mode`, `rate`) is the driver's own affair.
    return {
        "motor": MOTORS[motor],
        "load_cell": {key: value for key, value in LOAD_CELLS[load_cell].items() if key not in ("mode", "rate")},
    }


@contextmanager
def simulated(motor: str, load_cell: str) -> Iterator[tuple[dict[str, str], Clock]]:
    world = World(settings(devices(motor, load_cell), "contract", "virtual"))
    register(world)
    try:
        yield {key: f"sim://contract/{key}" for key in world.endpoints}, world.clock
    finally:
        unregister("contract")


@contextmanager
def process(*arguments: str) -> Iterator[subprocess.Popen[str]]:
    with subprocess.Popen(
        [sys.executable, "-m", *arguments],
        cwd=ROOT,
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        text=True,
    ) as child:
        try:
            yield child
        finally:
            child.terminate()


@contextmanager
def emulated(motor: str, load_cell: str) -> Iterator[tuple[dict[str, str], Clock]]:
    with process("tests.drivers.emulated_bench", json.dumps(devices(motor, load_cell))) as child:
        assert child.stdout is not None
        paths = dict(child.stdout.readline().split() for _ in range(2))
        yield paths, WallClock()


@contextmanager
def served(name: str) -> Iterator[tuple[str, Clock]]:
    with process("tests.drivers.modbus_server", name) as child:
        assert child.stdout is not None
        yield child.stdout.readline().strip(), WallClock()


TRIES = 6
"""On the wall clock: a busy machine gives the other process the processor some tens of milliseconds late, now and then
beyond the deadline of a reply. The contract is then tried anew; whatever fails without a late reply fails at once."""


def on_the_wall(
    serve: Callable[[], AbstractContextManager[tuple[Any, Clock]]],
    open_device: Callable[[Any, Clock], Any],
    check: Callable[[Any], None],
) -> None:
    """The contract with a device in another process, and a new one of both where the machine was late."""
    for left in reversed(range(TRIES)):
        with serve() as (port, clock):
            device = open_device(port, clock)
            try:
                check(device)
                return
            except (AssertionError, DriverError):
                if not left or device.link.traffic.timeouts == 0:
                    raise
            finally:
                device.link.close()


def open_motor(name: str, port: str, clock: Clock) -> Motor:
    return drivers.open_motor(MotorSpec(port=port, **MOTORS[name]), clock)


def open_load_cell(name: str, port: str, clock: Clock) -> LoadCell:
    return drivers.open_load_cell(LoadCellSpec(port=port, **LOAD_CELLS[name]), clock)


@pytest.mark.parametrize("name", MOTORS)
def test_motor_over_a_simulated_port(name: str) -> None:
    with simulated(name, "dad141") as (ports, clock):
        motor = open_motor(name, ports["motor"], clock)
        contract_motor.check_all(motor)
        line = lookup(ports["motor"]).line
        # The other end counted the same bytes.
        assert (line.bytes_to_device, line.bytes_to_host) == (motor.link.traffic.bytes_out, motor.link.traffic.bytes_in)
        motor.link.close()


@pytest.mark.parametrize("name", LOAD_CELLS)
def test_load_cell_over_a_simulated_port(name: str) -> None:
    with simulated("orca", name) as (ports, clock):
        cell = open_load_cell(name, ports["load_cell"], clock)
        contract_load_cell.check_all(cell, 0.0, at_least_hz=RATES_HZ[name])
        line = lookup(ports["load_cell"]).line
        assert line.bytes_to_device == cell.link.traffic.bytes_out
        assert line.bytes_to_host == cell.link.traffic.bytes_in
        cell.link.close()


@pytest.mark.parametrize("name", ["orca", *(pytest.param(n, marks=pytest.mark.long) for n in ("iai", "smc_lec"))])
def test_motor_over_a_pseudo_terminal(name: str) -> None:
    on_the_wall(
        lambda: emulated(name, "dad141"),
        lambda ports, clock: open_motor(name, ports["motor"], clock),
        contract_motor.check_all,
    )


@pytest.mark.parametrize(
    "name", ["dad141", "mt_sics", *(pytest.param(n, marks=pytest.mark.long) for n in ("dad141_modbus", "laumas_tlb"))]
)
def test_load_cell_over_a_pseudo_terminal_or_socket(name: str) -> None:
    on_the_wall(
        lambda: emulated("orca", name),
        lambda ports, clock: open_load_cell(name, ports["load_cell"], clock),
        lambda cell: contract_load_cell.check_all(cell, 0.0, at_least_hz=0.6 * RATES_HZ[name]),
    )


@pytest.mark.parametrize("name", ["orca", "iai", "smc_lec"])
def test_motor_against_pymodbus(name: str) -> None:
    on_the_wall(lambda: served(name), lambda port, clock: open_motor(name, port, clock), contract_motor.check_all)


@pytest.mark.parametrize(("name", "force_N"), [("dad141_modbus", 1.25), ("laumas_tlb", -1.25)])
def test_load_cell_against_pymodbus(name: str, force_N: float) -> None:
    on_the_wall(
        lambda: served(name),
        lambda port, clock: open_load_cell(name, port, clock),
        lambda cell: contract_load_cell.check_all(cell, force_N, at_least_hz=50.0),
    )
