"""A recording whose process was killed opens, and has lost a tenth of a second at most."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from bench.recording import Recording, read_recording, recover

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="process groups and SIGKILL are POSIX")

LOST_AT_MOST_S = 0.1


class Victim:
    """The run in a process group of its own, and the last time it says it has handed over."""

    def __init__(self, path: Path, mode: str, lives_s: float) -> None:
        command = [sys.executable, "-m", "tests.bench.recording.killed_run", str(path), mode]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, start_new_session=True)
        assert self.process.stdout is not None
        self.out = self.process.stdout
        self.writer = int(self.out.readline())
        first = float(self.out.readline())
        self.last = first
        while self.last < first + lives_s:
            self.last = float(self.out.readline())

    def kill(self, *, writer_too: bool) -> float:
        if writer_too and self.writer:
            os.kill(self.writer, signal.SIGSTOP)  # what it would still do while the others die does not count
        os.killpg(self.process.pid, signal.SIGKILL)
        if writer_too and self.writer:
            os.kill(self.writer, signal.SIGKILL)
        lines = self.out.read().splitlines()
        self.process.wait()
        self.out.close()
        return float(lines[-1]) if lines else self.last


def seen_whole(path: Path, recording: Recording, last_s: float) -> None:
    count = recording.motor.time_s.size
    assert recording.motor.position_mm.tolist() == [float(i) for i in range(count)], "every sample up to the end"
    assert last_s - recording.motor.time_s[-1] <= LOST_AT_MOST_S
    assert recording.result is None
    assert recording.run["protocol"] == "endless"
    out, report = recover(path)
    assert report.per_topic["/motor"] == count and not report.has_result
    again = read_recording(out)
    assert np.array_equal(again.motor.time_s, recording.motor.time_s)
    assert np.array_equal(again.load_cell.force_N, recording.load_cell.force_N)


@pytest.mark.parametrize("lives_s", [0.13, 0.71, *(pytest.param(s, marks=pytest.mark.long) for s in (0.37, 1.1))])
@pytest.mark.parametrize("mode", ["inline", "process"])
def test_everything_is_killed_at_once(tmp_path, mode, lives_s):
    path = tmp_path / "run.mcap"
    last_s = Victim(path, mode, lives_s).kill(writer_too=True)
    recording = read_recording(path)
    assert recording.lost
    seen_whole(path, recording, last_s)


@pytest.mark.parametrize("lives_s", [0.19, 0.83])
def test_the_writer_outlives_the_run_and_finishes_the_file(tmp_path, lives_s):
    path = tmp_path / "run.mcap"
    victim = Victim(path, "process", lives_s)
    last_s = victim.kill(writer_too=False)
    deadline = time.monotonic() + 20
    while (recording := read_recording(path)).lost and time.monotonic() < deadline:
        time.sleep(0.05)
    assert recording.lost is None, "the writer wrote the index, though nobody was left to tell it to"
    seen_whole(path, recording, last_s)
    while running(victim.writer) and time.monotonic() < deadline:
        time.sleep(0.05)
    assert not running(victim.writer), "it has nothing left to do"


def running(pid: int) -> bool:
    """Not gone, and no zombie that nobody has asked for."""
    state = subprocess.run(["ps", "-o", "stat=", "-p", str(pid)], capture_output=True, text=True).stdout.strip()
    return bool(state) and not state.startswith("Z")
