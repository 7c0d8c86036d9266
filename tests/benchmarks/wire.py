"""How long does an Orca stream exchange take beyond its wire time? Ours beside pymodbus's own client."""

from __future__ import annotations

import contextlib
import os
import struct
import subprocess
import sys
import tempfile
import time
import tty
from collections.abc import Iterator
from pathlib import Path

import numpy as np
import yaml
from pymodbus.client import ModbusSerialClient
from pymodbus.pdu import ModbusPDU

import drivers
from bench.config import load_bench
from drivers.clock import WallClock
from drivers.errors import DriverError
from drivers.orca import Orca, default_gap_s
from drivers.orca_frames import STREAM, STREAM_REPLY_SIZE, Command
from drivers.spec import MotorSpec
from drivers.wire import call
from sim.emulate import way_through_s
from tests.benchmarks.report import Goal, Section, Table

TITLE = "Orca stream exchange on a pseudo-terminal"
BAUDRATES = (115_200, 1_000_000)
WANTED_US = 100.0
ROUNDS = 5
EXCHANGES = 400
OTHERS_EXCHANGES = 100
BITS, BYTES = 11, 9 + STREAM_REPLY_SIZE
PAUSE_S = 3e-4
"""Beyond the gap, between two exchanges."""

HOW = f"""
`padbench emulate` serves the simulated bench in a process of its own, on a core of its own where there are two, and
keeps wire time: {BYTES} bytes of {BITS} bits an exchange, and the interframe gap before the motor answers (80 µs at
1,000,000 baud, 2 ms at 115,200: what drivers and device use when the bench file says nothing). What is given is the
time beyond wire time and gap: the ways through the terminal, with a change of process each, and the work of emulator
and driver. Both clients send the same 0x64 frames one after the other, in turns
in the same run, at ordinary priority: {ROUNDS} rounds of {EXCHANGES} exchanges ({OTHERS_EXCHANGES} by pymodbus's
synchronous client with a custom PDU, which polls with sleeps and so has a floor of 2 ms whatever the baudrate).

What a request takes through the terminal is an artefact of the emulation: on a real wire its first bit leaves with the
write. The emulator measures at its start what it takes at the least, and counts that as wire time already passed
({{way}} µs, measured here in the same way: add it to have the figures without). A reply's way through the terminal is
not counted so: a serial port's driver has that too. "On the line" is from the write of the request to having read the
reply's last byte, "call" adds the client's own work before and after: frame built, reply checked and decoded. That
work is some 10 µs on a processor that has just done the same, and several times that after milliseconds of idling, on
a virtual machine above all.
"""


class StreamReply(ModbusPDU):
    """The stream's reply as pymodbus wants it described."""

    function_code = STREAM
    rtu_frame_size = STREAM_REPLY_SIZE

    def decode(self, data: bytes) -> None:
        self.position_um, self.force_mN = struct.unpack(">ii", data[:8])


class StreamRequest(ModbusPDU):
    """A position command."""

    function_code = STREAM
    rtu_frame_size = 9

    def __init__(self, position_um: int = 0) -> None:
        super().__init__(dev_id=1)
        self.position_um = position_um

    def encode(self) -> bytes:
        return struct.pack(">Bi", Command.POSITION, self.position_um)


@contextlib.contextmanager
def emulated(baudrate: int) -> Iterator[str]:
    """The motor's terminal of an emulator of the shipped bench at that baudrate."""
    bench = yaml.safe_load(load_bench("simulated").text)
    bench["motor"]["baudrate"] = baudrate
    bench["simulation"]["pad"] = "polyurethane"
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "bench.yaml"
        file.write_text(yaml.safe_dump(bench))
        process = subprocess.Popen(
            [sys.executable, "-m", "bench.cli", "emulate", str(file)], stdout=subprocess.PIPE, text=True
        )
        try:
            assert process.stdout is not None
            paths = dict(process.stdout.readline().split() for _ in range(2))
            with _own_cores(process.pid):
                yield paths["motor"]
        finally:
            process.terminate()
            process.wait()


@contextlib.contextmanager
def _own_cores(other: int) -> Iterator[None]:
    """This process on one core, the other on another, where there are two."""
    if not hasattr(os, "sched_setaffinity"):
        yield
        return
    cores = sorted(os.sched_getaffinity(0))
    if len(cores) < 2:
        yield
        return
    os.sched_setaffinity(0, cores[:1])
    os.sched_setaffinity(other, cores[1:])
    try:
        yield
    finally:
        os.sched_setaffinity(0, cores)


def ours(path: str, baudrate: int, count: int) -> tuple[np.ndarray, np.ndarray, int]:
    """Seconds of each exchange, call by call and on the line alone, and how many were not answered."""
    clock = WallClock()
    motor = drivers.open_motor(MotorSpec(driver="orca", port=path, baudrate=baudrate, stroke=(-20.0, 20.0)), clock)
    assert isinstance(motor, Orca)
    spans, line, failed = [], [], 0
    try:
        for k in range(count):
            clock.wait([], clock.now() + motor.link.gap_s + PAUSE_S)
            start = time.perf_counter()
            exchange = motor.stream(0.001 * k)
            try:
                call(exchange, motor.link)
            except DriverError:
                failed += 1
                continue
            spans.append(time.perf_counter() - start)
            line.append(exchange.received_s - exchange.sent_s)
    finally:
        motor.link.close()
    return np.array(spans), np.array(line), failed


def pymodbus(path: str, baudrate: int, count: int) -> tuple[np.ndarray, np.ndarray, int]:
    """The same exchanges by pymodbus's synchronous client, which does not say when it sent and received."""
    client = ModbusSerialClient(path, baudrate=baudrate, parity="N", timeout=0.2, retries=0)
    client.register(StreamReply)
    assert client.connect()
    spans, failed = [], 0
    try:
        for k in range(count):
            time.sleep(default_gap_s(baudrate) + PAUSE_S)
            start = time.perf_counter()
            try:
                reply = client.execute(False, StreamRequest(k))
            except Exception:  # whatever its library meets when a reply is late
                failed += 1
                continue
            spans.append(time.perf_counter() - start)
            assert isinstance(reply, StreamReply)
    finally:
        client.close()
    return np.array(spans), np.full(len(spans), np.nan), failed


def _way_us() -> float:
    """What a terminal takes to pass a request on, as the emulator measures it."""
    master, slave = os.openpty()
    try:
        tty.setraw(master)
        tty.setraw(slave)
        return 1e6 * way_through_s(slave, master)
    finally:
        os.close(master)
        os.close(slave)


def run() -> Section:
    """Both clients at both baudrates."""
    started = time.perf_counter()
    way_us = _way_us()
    table = Table(
        (
            "baudrate, client",
            "wire and gap, µs",
            "on the line, median beyond, µs",
            "in each round",
            "call, median beyond, µs",
            "in each round",
            "call, 99 %, µs",
            "no answer",
        )
    )
    goals = []
    for baudrate in BAUDRATES:
        expected_s = BYTES * BITS / baudrate + default_gap_s(baudrate)
        calls: dict[str, list[np.ndarray]] = {"padbench": [], "pymodbus": []}
        lines: dict[str, list[np.ndarray]] = {"padbench": [], "pymodbus": []}
        lost = dict.fromkeys(calls, 0)
        with emulated(baudrate) as path:
            ours(path, baudrate, 100)  # both processes have run everything once
            for _ in range(ROUNDS):
                for name, client, count in (
                    ("padbench", ours, EXCHANGES),
                    ("pymodbus", pymodbus, OTHERS_EXCHANGES),
                ):
                    spans, line, failed = client(path, baudrate, count)
                    calls[name].append(1e6 * (spans - expected_s))
                    lines[name].append(1e6 * (line - expected_s))
                    lost[name] += failed
        for name, parts in calls.items():
            every = np.concatenate(parts)
            own = lines[name] if name == "padbench" else []
            table.rows.append(
                (
                    f"{baudrate:,}, {name}",
                    f"{1e6 * expected_s:.0f}",
                    f"{np.median(np.concatenate(own)):.0f}" if own else "-",
                    ", ".join(f"{np.median(part):.0f}" for part in own) or "-",
                    f"{np.median(every):.0f}",
                    ", ".join(f"{np.median(part):.0f}" for part in parts),
                    f"{np.quantile(every, 0.99):.0f}",
                    str(lost[name]),
                )
            )
        reached = float(np.median(np.concatenate(lines["padbench"])))
        whole = {name: float(np.median(np.concatenate(parts))) for name, parts in calls.items()}
        goals.append(
            Goal(
                f"stream exchange beyond wire time, {baudrate:,} baud",
                f"≤ {WANTED_US:g} µs at the median",
                f"{reached:.0f} µs; call {whole['padbench']:.0f} µs, pymodbus's client {whole['pymodbus']:.0f} µs",
                reached <= WANTED_US,
            )
        )
    how = HOW.format(way=f"{way_us:.0f}")
    return Section(TITLE, how, [table], goals, time.perf_counter() - started)
