"""A run on the wall clock that prints the time of each sample it has handed to the recorder, until it is killed.

`python -m tests.bench.recording.killed_run PATH inline|process`; the first line is the writer's process id.
"""

from __future__ import annotations

import os
import sys
from pathlib import Path

from bench.recording import Recorder
from drivers.clock import WallClock


def main() -> None:
    clock = WallClock()
    recorder = Recorder(Path(sys.argv[1]), clock, mode="process" if sys.argv[2] == "process" else "inline")
    recorder.begin({"protocol": "endless", "bench": "lab", "simulated": False}, {})
    os.write(1, f"{recorder.writer_pid or 0}\n".encode())
    start, i = clock.now(), 0
    while True:
        clock.wait([], start + i * 1e-3)
        now = clock.now()
        recorder.motor(now, now, float(i))
        if i % 2:
            recorder.force(now, now, 0.1, 0.1)
        recorder.tick(now)
        os.write(1, f"{now:.6f}\n".encode())
        i += 1


if __name__ == "__main__":
    main()
