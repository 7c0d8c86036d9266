"""Modbus masters that owe nothing to pymodbus (mbpoll on libmodbus, minimalmodbus, modbus_tk) against the emulators."""

from __future__ import annotations

import re
import struct
import subprocess
import time
from pathlib import Path
from typing import Any

import pytest

from tests.clients.emulated import (
    DAD,
    IAI,
    LAUMAS,
    ORCA,
    SMC_LEC,
    TRIES,
    emulated,
    needs,
    needs_program,
    run_client,
)

# -- mbpoll ------------------------------------------------------------------------------------------------------------


class Mbpoll:
    """mbpoll on one port: `read` and `write` as a user types them, addresses from 0."""

    def __init__(self, program: str, path: str, baudrate: int, address: int = 1) -> None:
        self.start = [program, "-m", "rtu", "-a", str(address), "-b", str(baudrate), "-P", "none", "-0", "-q", "-1"]
        self.path = path

    def run(self, *options: str, values: tuple[int, ...] = ()) -> str:
        for _ in range(TRIES):
            done = subprocess.run(
                [*self.start, *options, self.path, *map(str, values)], capture_output=True, text=True, timeout=30
            )
            # A write gives status 0 only when confirmed; a read's values are checked by whoever asked for them.
            if done.returncode == 0 and "timed out" not in done.stderr:
                return done.stdout + done.stderr
        raise AssertionError(done.stdout + done.stderr)

    def read(self, kind: str, address: int, count: int) -> list[int]:
        text = self.run("-t", kind, "-r", str(address), "-c", str(count))
        found = re.findall(r"^\[\d+\]:\s+(-?\d+)", text, re.MULTILINE)
        assert len(found) == count, text
        return [int(word) & 0xFFFF for word in found]

    def write(self, kind: str, address: int, *values: int) -> None:
        self.run("-t", kind, "-r", str(address), values=values)


def test_mbpoll_reads_and_drives_an_orca(tmp_path: Path) -> None:
    program = needs_program("mbpoll")
    with emulated(tmp_path, ORCA | {"baudrate": 115200}, DAD) as paths:
        master = Mbpoll(program, paths["motor"], 115200)
        assert master.read("4", 342, 2) == [0, 0]
        master.write("4", 30, 1500, 0)
        master.write("4", 3, 3)
        assert master.read("4", 317, 1) == [3]
        time.sleep(0.5)  # a jump swings
        low, high = master.read("4", 342, 2)
        assert abs((high << 16 | low) - 1500) < 20


def test_mbpoll_takes_an_iai_through_servo_and_home(tmp_path: Path) -> None:
    program = needs_program("mbpoll")
    with emulated(tmp_path, IAI | {"stroke": [-2, 20]}, DAD) as paths:
        master = Mbpoll(program, paths["motor"], 115200)
        master.write("0", 0x0427, 1)
        master.write("0", 0x0403, 1)
        assert master.read("1", 0x0103, 1) == [1]  # status SV
        master.write("0", 0x040B, 0)
        master.write("0", 0x040B, 1)
        for _ in range(100):
            if master.read("1", 0x010B, 1) == [1]:  # HEND
                break
        assert master.read("1", 0x010B, 1) == [1]
        assert master.read("4", 0x9000, 2) in ([0, 0], [0, 1], [0xFFFF, 0xFFFF])


def test_mbpoll_reads_a_laumas(tmp_path: Path) -> None:
    program = needs_program("mbpoll")
    with emulated(tmp_path, ORCA, LAUMAS) as paths:
        master = Mbpoll(program, paths["load_cell"], 115200)
        status, high, low, *_ = master.read("4", 6, 5)
        assert (high, low) == (0, 0)
        assert status >> 12 & 1  # within a quarter of a division of zero


# -- minimalmodbus and modbus_tk ---------------------------------------------------------------------------------------

MINIMAL = """
import json, sys, time
import minimalmodbus
device = minimalmodbus.Instrument(sys.argv[1], 1)
device.serial.baudrate = {baudrate}
device.serial.timeout = 1
"""

TOOLKIT = """
import json, sys, time
import serial
from modbus_tk import defines, modbus_rtu
port = serial.Serial(sys.argv[1], {baudrate}, timeout=1)
master = modbus_rtu.RtuMaster(port)
master.set_timeout(1.0)
"""


def test_minimalmodbus_moves_an_smc_lec(tmp_path: Path) -> None:
    """As docs/devices.md 2.2 has it: coil 30, SVON, SETUP, step data, start, until BUSY goes."""
    needs("minimalmodbus")
    script = """
device.write_bit(0x30, 1); device.write_bit(0x19, 1)
while not device.read_bit(0x49, 2): time.sleep(0.02)
device.write_bit(0x1C, 1)
while not device.read_bit(0x4A, 2): time.sleep(0.05)
home = device.read_long(0x9000, signed=True)
device.write_registers(0x9102, [1, 50, 0, 400, 3000, 3000, 0, 0, 0, 100, 0, 0, 0, 0, 0, 5])
device.write_register(0x9100, 1, functioncode=6)
started = device.read_register(0x9100)
time.sleep(0.05)
busy = device.read_bit(0x48, 2)
while device.read_bit(0x48, 2): time.sleep(0.05)
print(json.dumps({"home": home, "started": started, "busy": busy, "there": device.read_long(0x9000, signed=True),
                  "outputs": device.read_bits(0x48, 8, 2)}))
"""
    said = run_client(tmp_path, (SMC_LEC | {"stroke": [-2, 20]}, DAD), "motor", MINIMAL.format(baudrate=38400) + script)
    assert said["home"] == pytest.approx(0, abs=2)
    assert said["started"] == 0
    assert said["busy"] == 1
    assert said["there"] == pytest.approx(400, abs=2)
    assert said["outputs"] == [0, 1, 1, 1, 0, 0, 0, 0]


def test_minimalmodbus_sees_refusals(tmp_path: Path) -> None:
    needs("minimalmodbus")
    script = """
refused = []
for ask in (lambda: device.read_register(0x0600), lambda: device.write_register(0x9000, 1, functioncode=6),
            lambda: device.read_registers(1, 2, 4)):
    try:
        ask()
        refused.append("")
    except minimalmodbus.ModbusException as error:
        refused.append(type(error).__name__)
print(json.dumps(refused))
"""
    said = run_client(tmp_path, (ORCA, LAUMAS), "load_cell", MINIMAL.format(baudrate=115200) + script)
    assert (
        said == ["SlaveReportedException", "SlaveReportedException", "IllegalRequestError"]
        or said == ["IllegalRequestError"] * 3
    )


def test_modbus_tk_moves_an_iai(tmp_path: Path) -> None:
    """Switch to Modbus, servo on, home, then the manual's nine words for 4 mm at 20 mm/s, and the status block."""
    needs("modbus_tk")
    script = """
def coil(address, on): master.execute(1, defines.WRITE_SINGLE_COIL, address, output_value=on)
def status(): return master.execute(1, defines.READ_HOLDING_REGISTERS, 0x9000, 12)
coil(0x0427, 1); coil(0x0403, 1); coil(0x040B, 0); coil(0x040B, 1)
time.sleep(0.1)
while not status()[5] & 1 << 4: time.sleep(0.05)
block = [0, 400, 0, 10, 0, 2000, 30, 0, 0]
master.execute(1, defines.WRITE_MULTIPLE_REGISTERS, 0x9900, output_value=block)
moving = status()
time.sleep(1.0)
inputs = master.execute(1, defines.READ_DISCRETE_INPUTS, 0x0100, 15)
print(json.dumps({"moving": moving, "there": status(), "inputs": list(inputs)}))
"""
    said = run_client(tmp_path, (IAI | {"stroke": [-2, 20]}, DAD), "motor", TOOLKIT.format(baudrate=115200) + script)
    assert said["moving"][7] & 1 << 5
    position, alarm = struct.unpack(">iH", struct.pack(">3H", *said["there"][:3]))
    assert position == pytest.approx(400, abs=2)
    assert alarm == 0
    # 0100 EMGS … 0102 PWR, 0103 SV, 0105 and 0106 alarms, 010B HEND, 010C PEND (docs/devices.md 2.1)
    inputs: list[Any] = said["inputs"]
    assert (inputs[0], inputs[2], inputs[3], inputs[5], inputs[6], inputs[11], inputs[12]) == (0, 1, 1, 0, 0, 1, 1)


def test_modbus_tk_reads_a_laumas_and_is_refused_too_long_a_query(tmp_path: Path) -> None:
    needs("modbus_tk")
    script = """
from modbus_tk.exceptions import ModbusError
words = master.execute(1, defines.READ_HOLDING_REGISTERS, 6, 5)
try:
    code = len(master.execute(1, defines.READ_HOLDING_REGISTERS, 0, 33))
except ModbusError as error:
    code = -error.get_exception_code()
print(json.dumps({"words": words, "code": code}))
"""
    said = run_client(tmp_path, (ORCA, LAUMAS), "load_cell", TOOLKIT.format(baudrate=115200) + script)
    assert said["words"][1:] == [0, 0, 0, 0]
    assert said["code"] == -3
