from __future__ import annotations

import contextlib
import io
import json
import os
import select
import signal
import socket
import struct
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import pytest
import serial
from pymodbus.client import ModbusSerialClient

from sim import emulate
from sim.model import Model
from sim.world import World, WorldSettings
from tests.sim.world_tools import DAD, FREE_AIR, IAI, ORCA, framed

pytestmark = pytest.mark.skipif(not hasattr(os, "openpty"), reason="there are no pseudo-terminals here")

PROCESS = """
import json, sys
from sim.emulate import main
from sim.model import Model
from sim.world import WorldSettings
given = json.loads(sys.argv[1])
main(WorldSettings(model=Model.from_dict(given.pop("model")), **given))
"""


@contextmanager
def emulated(**settings: Any) -> Iterator[tuple[dict[str, str], subprocess.Popen[str]]]:
    """A bench emulated in another process: where its devices are, and the process."""
    given = {"name": "e", "clock": "wall", "model": FREE_AIR, "motor": ORCA, "load_cell": DAD} | settings
    process = subprocess.Popen(
        [sys.executable, "-c", PROCESS, json.dumps(given)],
        stdout=subprocess.PIPE,
        text=True,
        cwd=Path(__file__).parents[2],
    )
    assert process.stdout is not None
    try:
        paths = dict(process.stdout.readline().split() for _ in range(2))
        assert list(paths) == ["motor", "load_cell"]
        yield paths, process
    finally:
        process.terminate()
        process.wait(30)
        process.stdout.close()


def read_for(descriptor: int, size: int, seconds: float = 10.0) -> bytes:
    """`size` bytes of a non-blocking descriptor, or what came in the time."""
    data = b""
    until_s = time.monotonic() + seconds
    while len(data) < size and time.monotonic() < until_s:
        if select.select([descriptor], [], [], 0.1)[0]:
            data += os.read(descriptor, size - len(data))
    return data


def test_raw_bytes_on_both_terminals_keep_wire_time() -> None:
    with emulated() as (paths, process):
        motor = os.open(paths["motor"], os.O_RDWR | os.O_NOCTTY)
        cell = os.open(paths["load_cell"], os.O_RDWR | os.O_NOCTTY)
        try:
            for _ in range(20):
                start_s = time.monotonic()
                os.write(motor, framed("01 64 1e 000003e8"))
                assert len(read_for(motor, 19)) == 19
                # never faster than 28 bytes of 8E1 at 115200 and the motor's 2 ms
                assert time.monotonic() - start_s >= 28 * 11 / 115200 + 0.002
            os.write(cell, b"SW\r")
            start_s = time.monotonic()
            lines = read_for(cell, 100 * 21)
            assert time.monotonic() - start_s >= 99 * 210 / 115200
            assert lines[:15] == b"W+000000+000000"
            assert lines.count(b"\r\n") == 100
        finally:
            os.close(motor)
            os.close(cell)
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == 0


def test_a_terminal_outlives_its_clients() -> None:
    with emulated() as (paths, _):
        for _ in range(3):
            with serial.Serial(paths["load_cell"], 115200, timeout=10) as port:
                port.write(b"ID\r")
                assert port.read(8) == b"D:1410\r\n"


def gone(path: str, opened: int) -> bool:
    """Whether a terminal is gone for who has it open, and for who looks for it."""
    try:
        os.write(opened, b"x")
        hung_up = os.read(opened, 100) == b""
    except BlockingIOError:
        return False
    except OSError:
        hung_up = True
    return hung_up and not Path(path).exists()


@pytest.mark.long
def test_a_port_that_is_pulled_out_and_plugged_in_again() -> None:
    """What a client meets with an adapter whose cable is pulled; the other device's terminal knows nothing of it."""
    fault = {"kind": "unplugged", "device": "motor", "at_s": 4.0, "duration_s": 2.0}
    with emulated(faults=[fault]) as (paths, process):
        motor = os.open(paths["motor"], os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            os.write(motor, framed("01 64 1e 000003e8"))
            assert len(read_for(motor, 19)) == 19
            until_s = time.monotonic() + 30.0
            while not gone(paths["motor"], motor) and time.monotonic() < until_s:
                time.sleep(0.05)
            assert gone(paths["motor"], motor)
        finally:
            os.close(motor)
        with serial.Serial(paths["load_cell"], 115200, timeout=10) as port:
            port.write(b"ID\r")
            assert port.read(8) == b"D:1410\r\n"
        while not Path(paths["motor"]).exists() and time.monotonic() < until_s:
            time.sleep(0.05)
        with serial.Serial(paths["motor"], 115200, timeout=10) as port:
            port.write(framed("01 64 1e 000003e8"))
            assert len(port.read(19)) == 19
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == 0, "it was served all the time"
    assert not Path(paths["motor"]).parent.exists()


@pytest.mark.long
def test_a_network_that_is_pulled_out_and_plugged_in_again() -> None:
    fault = {"kind": "unplugged", "device": "load_cell", "at_s": 4.0, "duration_s": 2.0}
    with emulated(load_cell=DAD | {"driver": "dad141_modbus"}, faults=[fault]) as (paths, _):
        host, port = paths["load_cell"].removeprefix("socket://").split(":")
        request = struct.pack(">HHHBBHH", 1, 0, 6, 1, 3, 0x202C, 2)
        with socket.create_connection((host, int(port)), timeout=30) as client:
            client.sendall(request)
            assert len(client.recv(100)) == 13
            with contextlib.suppress(ConnectionResetError):
                assert client.recv(100) == b"", "hung up"
        until_s = time.monotonic() + 30.0
        while time.monotonic() < until_s:
            try:
                with socket.create_connection((host, int(port)), timeout=10) as client:
                    client.sendall(request)
                    assert len(client.recv(100)) == 13
                break
            except (ConnectionRefusedError, ConnectionResetError):
                time.sleep(0.05)
        else:
            pytest.fail("it did not come back")


def test_pymodbus_against_another_process() -> None:
    with emulated(motor=ORCA | {"gap_us": 100}) as (paths, _):
        # no parity: a pseudo-terminal has none, and pyserial cannot then change a setting (docs/devices.md 5)
        client = ModbusSerialClient(paths["motor"], baudrate=115200, parity="N", timeout=10, retries=0)
        assert client.connect()
        try:
            assert client.read_holding_registers(485, count=1, device_id=1).registers == [1]
            assert client.write_register(3, 3, device_id=1).registers == [3]
            assert client.read_holding_registers(317, count=1, device_id=1).registers == [3]
        finally:
            client.close()


def test_minimalmodbus_against_another_process() -> None:
    minimalmodbus = pytest.importorskip("minimalmodbus")
    with emulated(motor=IAI) as (paths, _):
        instrument = minimalmodbus.Instrument(paths["motor"], 1)
        instrument.serial.baudrate = 38400
        instrument.serial.timeout = 2
        assert instrument.read_registers(0x9000, 2) == [0, 0]
        instrument.write_bit(0x0427, 1)
        assert instrument.read_bit(0x0427, 1)
        with pytest.raises(minimalmodbus.IllegalRequestError):
            instrument.read_register(0x0600)
        instrument.serial.close()


def test_a_network_device_is_served_on_a_socket() -> None:
    with emulated(load_cell=DAD | {"driver": "dad141_modbus"}) as (paths, _):
        host, port = paths["load_cell"].removeprefix("socket://").split(":")
        for _ in range(2):
            with socket.create_connection((host, int(port)), timeout=10) as client:
                client.sendall(struct.pack(">HHHBBHH", 1, 0, 6, 1, 3, 0x202C, 2))
                assert client.recv(100) == struct.pack(">HHHBBBi", 1, 0, 7, 1, 3, 4, 1410)


def test_serving_stops_when_told_and_takes_the_terminals_away() -> None:
    settings = WorldSettings(name="here", model=Model.from_dict(FREE_AIR), motor=ORCA, load_cell=DAD, clock="wall")
    out = io.StringIO()
    emulate.serve(World(settings), out, stopped=lambda: True)
    paths = dict(line.split() for line in out.getvalue().splitlines())
    assert list(paths) == ["motor", "load_cell"]
    assert not any(Path(path).exists() for path in paths.values())


def test_a_fault_of_the_host_does_not_strike_the_devices() -> None:
    with emulated(faults=[{"kind": "killed", "at_s": 0.5}, {"kind": "signal", "at_s": 0.6}]) as (paths, process):
        time.sleep(1.5)
        with serial.Serial(paths["load_cell"], 115200, timeout=10) as port:
            port.write(b"ID\r")
            assert port.read(8) == b"D:1410\r\n"
        process.send_signal(signal.SIGINT)
        assert process.wait(30) == 0


def test_virtual_time_cannot_be_emulated() -> None:
    settings = WorldSettings(name="here", model=Model.from_dict(FREE_AIR), motor=ORCA, load_cell=DAD)
    with pytest.raises(ValueError, match="wall"):
        emulate.serve(World(settings), io.StringIO())
