"""A whole day at 100 Hz in virtual time: does memory stay where it is, and is all of it in the recording?

`python -m tests.benchmarks.day --hours 1` runs less of it; `--folder DIR` keeps the recording.
"""

from __future__ import annotations

import argparse
import json
import os
import subprocess
import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
import yaml

from bench.config import load_bench
from bench.preflight import check
from bench.protocol import load_protocol
from bench.recording import read_recording
from bench.run.folder import RECORDING
from bench.run.runner import run_protocol
from bench.shipped import find_file
from tests.benchmarks.report import Goal, Section, Table

TITLE = "A day at 100 Hz"
HOURS = 24.0
RATE_HZ = 100.0
DEPTHS_MM = (0.6, 1.2, 1.8, 1.2)
HOLD_S = 900.0
LOOK_S = 60.0
MOST_MB = 4.0

HOW = f"""
Steps with holds of {HOLD_S / 60:g} minutes, over and over, on the shipped bench `simulated` with motor and
load cell (polled) at {RATE_HZ:g} Hz: the run's own loop, real drivers, simulated devices, virtual time, recorded to
MCAP, in a process of its own. Resident memory is looked at every {LOOK_S:g} s of bench time. The slope is a straight
line's through what was seen after the first hour (of a shorter run: the first quarter), with the scatter about it.
"""


def write_files(folder: Path, hours: float) -> tuple[Path, Path]:
    """Protocol and bench file for so many hours, into a folder."""
    bench = yaml.safe_load(find_file("bench", "simulated").read_text(encoding="utf-8"))
    bench["motor"]["rate"] = RATE_HZ
    bench["load_cell"].update(mode="poll", rate=RATE_HZ)
    cycles = max(1, round(hours * 3600.0 / HOLD_S / len(DEPTHS_MM)))
    hold_s = hours * 3600.0 / cycles / len(DEPTHS_MM)
    steps = [{"to": depth, "speed": 20, "hold": hold_s} for depth in DEPTHS_MM]
    protocol = {
        "name": "day",
        "approach": {"speed": 2, "force": 0.05, "retract": 0.5},
        "limits": {"force": 16, "depth": 3},
        "steps": [{"block": "hour", "repeat": cycles, "steps": steps}],
    }
    files = folder / "day.yaml", folder / "bench.yaml"
    for file, content in zip(files, (protocol, bench), strict=True):
        file.write_text(yaml.safe_dump(content), encoding="utf-8")
    return files


def resident_MB() -> float:
    """Memory of this process that is in the computer's; not a number where the system does not tell."""
    try:
        return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGE_SIZE") / 1e6
    except OSError:
        return float("nan")


def child(hours: float, folder: Path) -> None:
    """The run; says what memory it has, as lines of JSON, and at the end how it went."""
    protocol_file, bench_file = write_files(folder, hours)
    protocol, bench = load_protocol(str(protocol_file)), load_bench(str(bench_file))
    plan = check(protocol, bench, None).plan
    due_s = 0.0

    def look(at_s: float, _label: str) -> None:
        nonlocal due_s
        if at_s >= due_s:
            due_s += LOOK_S
            print(json.dumps({"at_s": at_s, "MB": resident_MB()}), flush=True)

    started, used = time.perf_counter(), time.process_time()
    outcome = run_protocol(protocol, bench, plan, folder, progress=look)
    end = {"cause": outcome.cause, "bench_s": outcome.bench_seconds, "wall_s": time.perf_counter() - started}
    counts = {"motor": outcome.motor_samples, "force": outcome.force_samples, "steps": len(plan.segments)}
    print(json.dumps({**end, **counts, "processor_s": time.process_time() - used}), flush=True)


def read_back(folder: Path) -> None:
    """What the recording holds, and what it takes to read it."""
    before_MB, used = resident_MB(), time.process_time()
    run = read_recording(folder)
    processor_s = time.process_time() - used
    gaps = [float(np.diff(times).max()) for times in (run.motor.time_s, run.load_cell.time_s)]
    found = {"motor": run.motor.time_s.size, "force": run.load_cell.time_s.size, "gap_s": max(gaps), "lost": run.lost}
    print(json.dumps({**found, "before_MB": before_MB, "MB": resident_MB(), "processor_s": processor_s}))


def _lines(arguments: Sequence[str]) -> list[dict[str, Any]]:
    """What a process of this module says; the last line has the most memory it took."""
    command = [sys.executable, "-m", "tests.benchmarks.day", *arguments]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as process:
        assert process.stdout is not None
        lines = [json.loads(line) for line in process.stdout]
        _, status, usage = os.wait4(process.pid, 0)
        process.returncode = os.waitstatus_to_exitcode(status)
    if process.returncode:
        raise subprocess.CalledProcessError(process.returncode, command)
    return [*lines, {"peak_MB": usage.ru_maxrss * 1024 / 1e6}]


def run(hours: float = HOURS, folder: Path | None = None) -> Section:
    """The run and the reading, each in a process of its own."""
    if folder is None:
        with tempfile.TemporaryDirectory() as scratch:
            return run(hours, Path(scratch))
    started = time.perf_counter()
    *seen, end, most = _lines(["--child", str(hours), "--folder", str(folder)])
    size = (folder / RECORDING).stat().st_size
    found, reading = _lines(["--read", "--folder", str(folder)])
    at_h, memory_MB = (np.array([look[key] for look in seen], dtype=float) for key in ("at_s", "MB"))
    at_h /= 3600.0
    part_h = min(1.0, hours / 4.0)
    first, last = at_h <= part_h, at_h >= at_h[-1] - part_h
    later = at_h > part_h
    slope, level = np.polyfit(at_h[later], memory_MB[later], 1)
    scatter = float(np.std(memory_MB[later] - level - slope * at_h[later]))
    peaks = float(memory_MB[first].max()), float(memory_MB[last].max())
    samples = end["motor"] + end["force"]
    held = found["motor"] == end["motor"] and found["force"] == end["force"] and not found["lost"]
    table = Table(("what", "reached"))
    table.rows += [
        ("bench time", f"{end['bench_s'] / 3600.0:.2f} h, {end['steps']} stretches"),
        ("samples: motor, load cell", f"{end['motor']:,}, {end['force']:,}"),
        ("bench seconds a second of processor time", f"{end['bench_s'] / end['processor_s']:.0f}"),
        ("bench seconds a second on the wall", f"{end['bench_s'] / end['wall_s']:.0f}"),
        (f"peak of memory, first {part_h:g} h and last", f"{peaks[0]:.1f} MB, {peaks[1]:.1f} MB"),
        ("slope after that; scatter about it", f"{slope:+.3f} MB/h; {scatter:.2f} MB"),
        ("peak of all", f"{most['peak_MB']:.0f} MB"),
        ("recording", f"{size / 1e6:.0f} MB, {size / samples:.0f} bytes a sample"),
        ("longest gap between two samples in it", f"{1e3 * found['gap_s']:.1f} ms"),
        ("reading it whole: processor time", f"{found['processor_s']:.0f} s"),
        (
            "memory: after it, at most",
            f"{found['MB'] - found['before_MB']:.0f} MB, {reading['peak_MB'] - found['before_MB']:.0f} MB",
        ),
    ]
    grown_MB = peaks[1] - peaks[0]
    goals = [
        Goal(f"day: memory of {at_h[-1]:.1f} h at 100 Hz", f"grows ≤ {MOST_MB:g} MB", f"{grown_MB:+.1f} MB",
             grown_MB <= MOST_MB),
        Goal("day: the protocol runs to its end", "all of it", end["cause"] or "all of it", end["cause"] is None),
        Goal("day: the recording opens with all samples", "all", f"{found['motor'] + found['force']:,} of {samples:,}",
             held),
    ]  # fmt: skip
    return Section(TITLE, HOW, [table], goals, time.perf_counter() - started)


def main() -> int:
    """A run of another length, or what this module starts itself."""
    parser = argparse.ArgumentParser(prog="python -m tests.benchmarks.day", description=__doc__)
    parser.add_argument("--hours", type=float, default=HOURS)
    parser.add_argument("--folder", type=Path, help="an empty folder that keeps the recording")
    parser.add_argument("--child", type=float, help=argparse.SUPPRESS)
    parser.add_argument("--read", action="store_true", help=argparse.SUPPRESS)
    args = parser.parse_args()
    if args.child is not None:
        child(args.child, args.folder)
    elif args.read:
        read_back(args.folder)
    else:
        section = run(args.hours, args.folder)
        print("\n".join([*section.lines(), *(f"{g.what}: {g.wanted}: {g.reached}" for g in section.goals)]))
        return 0 if all(goal.met for goal in section.goals) else 1
    return 0


if __name__ == "__main__":
    sys.exit(main())
