"""The motor after `padbench` is gone: asked by a plain Modbus exchange of the emulated devices, which live on.

`padbench emulate` serves the bench on pseudo-terminals in a process of its own, as real devices would be. The bench
file of the run names these terminals, so that nothing in the run knows that it is not hardware.
"""

from __future__ import annotations

import contextlib
import math
import os
import select
import signal
import struct
import subprocess
import sys
import time
import tty
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest
import yaml

from bench.recording import read_recording
from tests.bench.run.benches import SHORT, bench_file, merged, protocol_file

ROOT = Path(__file__).parents[3]
DEVICE_S = 60.0
TRIES = 4
STALLED = ("communication watchdog", "the host stalled", "silent", "no answer")
SURFACE_MM = 0.6
PRESS = merged(
    SHORT,
    {"approach": {"speed": 4, "force": 0.05, "retract": 0.3}, "steps": [{"to": 1.0, "speed": 5, "hold": 30}]},
)
PRESSED_N = 2.24 / 0.69 * math.expm1(0.69) * 0.6
"""F^e of the shipped polyurethane pad at 1 mm, relaxed: (9) and (6)."""

PATIENT: dict[str, Any] = {"stale": 1.0}
"""A busy machine that stalls the run for a moment is not what these tests are about."""

pytestmark = pytest.mark.skipif(not hasattr(os, "openpty"), reason="no pseudo-terminals here")


def crc(frame: bytes) -> bytes:
    """CRC-16/Modbus, from its definition (initial FFFF, polynomial A001, low byte first)."""
    value = 0xFFFF
    for byte in frame:
        value ^= byte
        for _ in range(8):
            value = value >> 1 ^ (0xA001 if value & 1 else 0)
    return struct.pack("<H", value)


@dataclass
class Emulator:
    """The devices' terminals, and plain questions to the motor."""

    paths: dict[str, str]

    def registers(self, address: int, count: int) -> list[int]:
        """Function 03 by hand, on the terminal itself; again where the answer to the run's last question came first."""
        for _ in range(3):
            reply = self._asked(struct.pack(">BBHH", 1, 3, address, count), 5 + 2 * count)
            if len(reply) == 5 + 2 * count and crc(reply[:-2]) == reply[-2:]:
                return list(struct.unpack(f">{count}H", reply[3:-2]))
            time.sleep(0.02)
        raise AssertionError(reply)

    def _asked(self, request: bytes, size: int) -> bytes:
        fd = os.open(self.paths["motor"], os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        try:
            tty.setraw(fd)
            with contextlib.suppress(BlockingIOError):
                while os.read(fd, 4096):
                    pass  # what was meant for the run
            os.write(fd, request + crc(request))
            reply, end = b"", time.monotonic() + 5.0
            while len(reply) < size and time.monotonic() < end:
                if select.select([fd], [], [], 0.1)[0]:
                    reply += os.read(fd, 256)
        finally:
            os.close(fd)
        return reply


@dataclass
class OrcaNow:
    """Registers 317, 342…349 and 432 of the motor's map (docs/devices.md 1.3)."""

    mode: int
    position_mm: float
    force_N: float
    errors: int


def orca(emulator: Emulator) -> OrcaNow:
    """How the Orca is."""

    def wide(address: int) -> int:
        low, high = emulator.registers(address, 2)
        return int(struct.unpack(">i", struct.pack(">HH", high, low))[0])

    mode, errors = emulator.registers(317, 1)[0], emulator.registers(432, 1)[0]
    return OrcaNow(mode, wide(342) / 1000.0, wide(348) / 1000.0, errors)


def iai_position_mm(emulator: Emulator) -> float:
    """Register 9000 of the controller (docs/devices.md 2.1): hundredths of a millimetre, high word first."""
    high, low = emulator.registers(0x9000, 2)
    return int(struct.unpack(">i", struct.pack(">HH", high, low))[0]) / 100.0


def iai_servo_on(emulator: Emulator) -> bool:
    """Bit 12 of DSS1 (9005)."""
    return bool(emulator.registers(0x9005, 1)[0] >> 12 & 1)


@contextlib.contextmanager
def emulated(folder: Path, base: str, **changes: Any) -> Iterator[tuple[Emulator, Path]]:
    """Devices in another process, and a bench file whose ports are theirs."""
    file = bench_file(folder, base, **merged({"simulation": {"surface": SURFACE_MM}, "limits": PATIENT}, changes))
    process = subprocess.Popen(
        [sys.executable, "-m", "bench.cli", "emulate", str(file)], cwd=ROOT, stdout=subprocess.PIPE, text=True
    )
    try:
        assert process.stdout is not None
        paths = dict(process.stdout.readline().split() for _ in range(2))
        content = yaml.safe_load(file.read_text("utf-8"))
        for key, path in paths.items():
            content[key]["port"] = path
        real = folder / "real.yaml"
        real.write_text(yaml.safe_dump(content, sort_keys=False), "utf-8")
        yield Emulator(paths), real
    finally:
        process.terminate()
        process.communicate(timeout=10)


@contextlib.contextmanager
def running(folder: Path, real: Path, protocol: dict[str, Any], label: str) -> Iterator[subprocess.Popen[str]]:
    """`padbench run` on these terminals, come as far as the step `label`; killed in the end if it is still there.

    A machine that has too much to do may stall the run for longer than the motor's watchdog waits, which stops it
    rightly: it is begun again.
    """
    script = protocol_file(folder, protocol)
    command = [sys.executable, "-m", "bench.cli", "run", script, "--bench", str(real), "--attended"]
    for n in range(TRIES):
        out = folder / "out"
        if out.exists():
            out.rename(folder / f"stalled{n}")
        process = subprocess.Popen(
            [*command, "--out", str(out)],
            cwd=ROOT,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            env={**os.environ, "PYTHONUNBUFFERED": "1"},
        )
        try:
            if comes_to(label, out, process):
                yield process
                return
            said = stopped(process)
            assert any(word in said for word in STALLED), said
        finally:
            process.kill()
            process.communicate(timeout=10)
    if os.getloadavg()[0] > 1.5 * (os.cpu_count() or 1):
        pytest.skip("this machine has too much else to do: it stalls the run for longer than the watchdog waits")
    raise AssertionError(f"stalled {TRIES} times on a machine that has little to do:\n{said}")


def comes_to(label: str, out: Path, process: subprocess.Popen[str]) -> bool:
    """Wait until the recording says that the run has come so far; False where it has ended before."""
    end = time.monotonic() + DEVICE_S
    while time.monotonic() < end and process.poll() is None:
        with contextlib.suppress(Exception):  # not there, or not more than a beginning
            recording = read_recording(out / "recording.mcap")
            if any(event.name == "stopped" for event in recording.events):
                return False
            if any(mark.name == label for mark in recording.steps):
                return True
        time.sleep(0.2)
    return False


def stopped(process: subprocess.Popen[str]) -> str:
    """What it printed up to the word that it was stopped; the fit that follows is not waited for."""
    assert process.stdout is not None
    said = ""
    for line in process.stdout:
        said += line
        if line.startswith("STOPPED"):
            return said
    raise AssertionError(said)


def test_killed_while_it_presses_the_motor_lets_go_by_itself(tmp_path):
    """An Orca: its own watchdog was told 0.1 s, and ends all force."""
    with emulated(tmp_path, "simulated") as (emulator, real), running(tmp_path, real, PRESS, "steps[0]") as process:
        time.sleep(1.0)
        process.send_signal(signal.SIGKILL)
        process.wait(10)
        time.sleep(0.3)
        first = orca(emulator)
        time.sleep(2.0)
        now = orca(emulator)
        assert first.errors & now.errors & 2048, "USER_COMMS_TIMEOUT has run out"
        # It damps (SAFETY_DGAIN) while the pad pushes the axis out of the millimetre, and holds nothing.
        assert SURFACE_MM - 0.1 < now.position_mm < first.position_mm < SURFACE_MM + 1.0
        assert abs(now.force_N) < 0.2 * PRESSED_N


@pytest.mark.long
def test_killed_on_its_way_a_motor_without_watchdog_stands_after_a_short_segment(tmp_path):
    """An IAI controller finishes what it was told, which is never more than a fifth of a second of a move."""
    speed = 2.0
    slow = merged(PRESS, {"approach": {"speed": speed, "retract": 0.3}})
    far = {"simulation": {"surface": 5.5}}
    with (
        emulated(tmp_path, "simulated_iai", **far) as (emulator, real),
        running(tmp_path, real, slow, "approach") as process,
    ):
        process.send_signal(signal.SIGKILL)
        process.wait(10)
        at_once = iai_position_mm(emulator)
        time.sleep(1.0)
        stands = iai_position_mm(emulator)
        assert at_once - 0.02 <= stands <= at_once + speed * 0.25 + 0.02
        assert stands < 4.0, "the limit of its travel was 6 mm, to which the approach was going"
        time.sleep(0.3)
        assert abs(iai_position_mm(emulator) - stands) <= 0.011
        assert iai_servo_on(emulator), "it holds, as its bench file says"


@pytest.mark.parametrize(
    "number", [signal.SIGTERM, *(pytest.param(n, marks=pytest.mark.long) for n in (signal.SIGINT, signal.SIGHUP))]
)
def test_a_signal_leaves_the_safe_state_of_the_bench_file(tmp_path, number):
    for attempt in range(3):
        folder = tmp_path / str(attempt)
        folder.mkdir()
        with emulated(folder, "simulated") as (emulator, real), running(folder, real, PRESS, "steps[0]") as process:
            time.sleep(0.5)
            process.send_signal(number)
            said = stopped(process)
            now = orca(emulator)
        if "communication watchdog" not in said:  # this computer stalled for 0.1 s, and the run was over before
            break
    assert "STOPPED: stopped by" in said, said
    assert now.mode == 1 and now.errors == 0, "asleep, and not by its watchdog"
    assert now.force_N == 0.0
    assert now.position_mm == pytest.approx(SURFACE_MM - 0.3, abs=0.1), "backed out of the pad before it was let go"
    recording = read_recording(folder / "out" / "recording.mcap")
    assert recording.lost is None and recording.result is not None and recording.result["status"] == "stopped"
    assert "not_safe" not in recording.result


def test_the_safe_state_hold_of_a_controller_after_sigterm(tmp_path):
    with emulated(tmp_path, "simulated_iai") as (emulator, real), running(tmp_path, real, PRESS, "steps[0]") as process:
        time.sleep(0.5)
        process.send_signal(signal.SIGTERM)
        said = stopped(process)
        stands = iai_position_mm(emulator)
        time.sleep(0.5)
        assert abs(iai_position_mm(emulator) - stands) <= 0.011 and iai_servo_on(emulator)
    assert "STOPPED: stopped by signal SIGTERM" in said, said
    assert stands == pytest.approx(SURFACE_MM - 0.3, abs=0.1)


@pytest.mark.long
def test_three_signals_do_not_tear_the_recording(tmp_path):
    """Whoever is frightened strikes on until the prompt is back."""
    with emulated(tmp_path, "simulated") as (emulator, real), running(tmp_path, real, PRESS, "steps[0]") as process:
        time.sleep(0.5)
        for pause in (0.0, 0.002, 0.002, 0.002):
            time.sleep(pause)
            process.send_signal(signal.SIGTERM)
        said = stopped(process)
        now = orca(emulator)
    assert now.mode == 1 and now.force_N == 0.0, said
    recording = read_recording(tmp_path / "out" / "recording.mcap")
    assert recording.lost is None and recording.result is not None
    assert recording.result["cause"] == "stopped by signal SIGTERM"
    (stop,) = [event for event in recording.events if event.name == "stop"]
    assert stop.data["manner"] == "hard"
    assert "not fitted" in said and not (tmp_path / "out" / "model.yaml").exists()
