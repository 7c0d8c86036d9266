"""How long from a force beyond the limit to the stop on the wire, at 500 turns a second on pseudo-terminals?"""

from __future__ import annotations

import multiprocessing
import os
import select
import subprocess
import sys
import time
import tty
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path

import numpy as np

import drivers
from bench.errors import Stopped
from bench.run.axis import Axis
from bench.run.loop import Loop, Script
from bench.run.rig import Rig
from bench.run.safety import Envelope, Monitor
from drivers.clock import WallClock
from drivers.spec import LoadCellSpec, MotorSpec
from drivers.wire import Exchange
from tests.benchmarks.report import Goal, Section, Table

TITLE = "From a limit to the stop on the wire"
RATE_HZ = 500.0
ROUNDS = 150
STALL_S = 0.001
WANTED_PERIODS = 1.0

HOW = f"""
The loop of a run on the wall clock, with its Orca and DAD 141.1 drivers, on two pseudo-terminals, {RATE_HZ:g} commands
a second. At the other ends a process of its own answers for the motor at once (no wire time) and sends force lines of
2 N, steadily, then one of 30 N, which is beyond the limit: it notes when it wrote that line, and when the motor's stop
arrived: the next frame that is not the stream's, here the change to sleep mode. {ROUNDS} crossings each, in loop
periods of {1e3 / RATE_HZ:g} ms. "One busy core": a process beside it that computes without end. Host stalls are given
apart: crossings during which the kernel kept one of the two processes waiting for a processor for more than
{1e3 * STALL_S:g} ms (schedstat). What the wire takes comes on top of all (a `SW` line 1.8 ms at 115,200 baud, an Orca
command 0.1 ms at 1,000,000).
"""


@dataclass
class Crossings:
    """Seconds from the line beyond the limit to the stop's first byte, and whether the host was stalled meanwhile."""

    latency_s: np.ndarray
    stalled: np.ndarray


def line(gross_N: float) -> bytes:
    """A combined string of the DAD with three decimals (docs/devices.md 3.1)."""
    body = f"W{round(gross_N * 1e3):+07d}{round(gross_N * 1e3):+07d}01".encode()
    return body + f"{-sum(body) & 0xFF:02X}\r\n".encode()


def crc(frame: bytes) -> bytes:
    """CRC-16/Modbus."""
    value = 0xFFFF
    for byte in frame:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return bytes((value & 0xFF, value >> 8))


def kept_waiting_s(process: int) -> float:
    """How long a process has waited for a processor so far; 0 where the kernel does not tell."""
    try:
        return 1e-9 * int(Path(f"/proc/{process}/schedstat").read_text().split()[1])
    except (OSError, IndexError, ValueError):
        return 0.0


def far_end(motor: int, cell: int, near: int, crossing_after_s: float) -> tuple[float, float]:
    """Answer for both devices until the stop has come; its latency, and how long the two were kept waiting (s).

    A latency below 0: the loop was stopped by a stall of the machine before there was a force to stop for.
    """
    still = bytes((1, 0x64)) + bytes(15)
    still += crc(still)
    started = time.perf_counter()
    next_line = started
    crossed = waited = 0.0
    while True:
        select.select([motor], [], [], 1e-4)
        now = time.perf_counter()
        try:
            request = os.read(motor, 64)
        except BlockingIOError:
            request = b""
        for begin in range(0, len(request), 9):
            if request[begin + 1 : begin + 2] == b"\x64":
                os.write(motor, still)
            elif not crossed:
                return -1.0, 0.0
            else:
                return now - crossed, kept_waiting_s(near) + kept_waiting_s(os.getpid()) - waited
        if now >= next_line:
            next_line += 1.0 / 550.0
            beyond = not crossed and now - started > crossing_after_s
            if beyond:
                waited = kept_waiting_s(near) + kept_waiting_s(os.getpid())
                crossed = time.perf_counter()
            os.write(cell, line(30.0 if crossed else 2.0 + 1e-3 * (int(now * 1e6) % 17)))
        if now - started > crossing_after_s + 5.0:
            return float("nan"), 0.0


def near_end(motor_path: str, cell_path: str) -> None:
    """One loop of a run until it is stopped, then the stop."""
    clock = WallClock()
    motor = drivers.open_motor(MotorSpec(driver="orca", port=motor_path, baudrate=1_000_000, stroke=(-20, 20)), clock)
    cell = drivers.open_load_cell(
        LoadCellSpec(driver="dad141", port=cell_path, baudrate=115_200, capacity=50.0, decimals=3), clock
    )
    cell._newtons_per_count = 1e-3  # as after `connect`, which the far end does not speak
    cell.link.listener = cell._listen
    envelope = Envelope(20.0, 5.0, 50.0, (-5.0, 6.0), 200.0, 0.5, 0.5)
    rig = Rig(clock, motor, cell, None, [motor.link, cell.link], [motor.link.port, cell.link.port])
    loop = Loop(rig, Axis(motor, 1.0 / RATE_HZ), Monitor(envelope), _Nowhere())
    loop.begin_measuring()
    loop.axis.go_live(0.0)

    def forever() -> Script[None]:
        while True:
            yield

    def stop() -> Script[None]:
        loop.axis.go_silent()
        loop.axis.clear_queue()
        steps = motor.safe_state("release")
        first = next(steps)
        assert isinstance(first, Exchange)
        motor.link.submit(first, urgent=True)
        until = clock.now() + 0.1  # the exchange under way is ended first, and the far end answers no stop
        while clock.now() < until:
            yield

    try:
        loop.run(forever())
    except Stopped:
        loop.monitor.stopping = True
        loop.run(stop())
    rig.close()


class _Nowhere:
    """A sink that keeps nothing."""

    def __getattr__(self, name: str) -> object:
        return lambda *given, **named: None


@contextmanager
def busy(core: bool) -> Iterator[None]:
    """A process that computes without end, where there is to be one."""
    if not core:
        yield
        return
    process = subprocess.Popen([sys.executable, "-c", "while True: pass"])
    try:
        yield
    finally:
        process.kill()
        process.wait()


def crossings(count: int) -> Crossings:
    """So many runs, one after the other, each in a process of its own (forked: nothing to import)."""
    context = multiprocessing.get_context("fork")
    rng = np.random.default_rng(1)
    latency, stalled = [], []
    while len(latency) < count:
        ends = [os.openpty() for _ in range(2)]
        for master, slave in ends:
            tty.setraw(master)
            tty.setraw(slave)
            os.set_blocking(master, False)
        near = context.Process(target=near_end, args=tuple(os.ttyname(slave) for _, slave in ends))
        near.start()
        seconds, waited_s = far_end(ends[0][0], ends[1][0], near.pid or 0, 0.25 + 0.004 * rng.random())
        near.join(5)
        if near.is_alive():
            near.kill()
            near.join()
        for pair in ends:
            for fd in pair:
                os.close(fd)
        if not seconds < 0:
            latency.append(seconds)
            stalled.append(waited_s > STALL_S)
    return Crossings(np.array(latency), np.array(stalled))


def run() -> Section:
    """Alone, and with one core busy."""
    started = time.perf_counter()
    table = Table(("beside it", "crossings", "median, periods", "99 %", "worst", "host stalled", "no stop"))
    goals = []
    for name, core in (("nothing", False), ("one busy core", True)):
        with busy(core):
            found = crossings(ROUNDS)
        lost = np.isnan(found.latency_s)
        good = found.latency_s[~found.stalled & ~lost] * RATE_HZ
        stalled = found.latency_s[found.stalled & ~lost] * RATE_HZ
        worst = f"{len(stalled)}" + (f", worst {stalled.max():.1f}" if len(stalled) else "")
        p99 = float(np.quantile(good, 0.99)) if good.size else float("nan")
        table.rows.append(
            (
                name,
                str(len(found.latency_s)),
                f"{np.median(good) if good.size else np.nan:.2f}",
                f"{p99:.2f}",
                f"{max(good, default=np.nan):.2f}",
                worst,
                str(int(lost.sum())),
            )
        )
        goals.append(
            Goal(
                f"limit to stop, {name} beside it",
                f"≤ {WANTED_PERIODS:g} period at 99 %",
                f"{p99:.2f} periods, {int(lost.sum())} missed",
                p99 <= WANTED_PERIODS and not lost.any(),
            )
        )
    return Section(TITLE, HOW, [table], goals, time.perf_counter() - started)
