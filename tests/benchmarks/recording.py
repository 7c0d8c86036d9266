"""What recording costs a sample, how fast a recording is read, and how late a loop gets while it records."""

from __future__ import annotations

import queue
import tempfile
import threading
import time
from pathlib import Path

import numpy as np
from mcap.reader import make_reader

from bench.recording import Recorder, Recording, StepMark, read_recording
from bench.recording.store import InlineStore
from drivers.clock import WallClock
from tests.bench.recording.made import StillClock
from tests.benchmarks.report import Section, Table, middle

TITLE = "Recording"
ROUNDS = 5
RUN_S = 60
TICKS_S = 4.0

HOW = f"""
Cost: {RUN_S} s of a run (motor at 1 kHz, load cell at 550 a second, a mark every second) handed to the recorder as
fast as it takes them, in this process as in virtual time. Reading: that file, whole, to arrays; beside it the mcap
library's own reader over the same messages, which leaves them as undecoded bytes.

Lateness: a loop on the wall clock that waits as the bench's does, 1000 turns a second for {TICKS_S:g} s, and hands over
the same samples. Late is how long after it was due a turn began; calls is what the recorder's calls of one turn took.
`process` is what a run uses on the wall clock; `thread` is what was considered and is not used; `nothing` records
nothing: what the machine itself does.
"""


class ThreadStore:
    """The inline store behind a queue in a thread of the same process."""

    def __init__(self, path: Path, epoch_ns: int, flush_ns: int) -> None:
        self.problem = None
        self.lost = 0
        self.pid = None
        self._store = InlineStore(path, epoch_ns, flush_ns)
        self._queue: queue.SimpleQueue[tuple[str, tuple[object, ...]] | None] = queue.SimpleQueue()
        self._thread = threading.Thread(target=self._work)
        self._thread.start()

    def _work(self) -> None:
        while (job := self._queue.get()) is not None:
            getattr(self._store, job[0])(*job[1])

    def message(self, *arguments: object) -> None:
        self._queue.put(("message", arguments))

    def metadata(self, *arguments: object) -> None:
        self._queue.put(("metadata", arguments))

    def attachment(self, *arguments: object) -> None:
        self._queue.put(("attachment", arguments))

    def boundary(self) -> None:
        self._queue.put(("boundary", ()))

    def tick(self, now_ns: int) -> None:
        pass

    def close(self) -> None:
        self._queue.put(None)
        self._thread.join()
        self._store.close()


def feed(recorder: Recorder, k: int, now_s: float) -> None:
    """The samples of the k-th millisecond."""
    recorder.motor(now_s - 1e-4, now_s, k * 0.001, k * 0.001 + 0.0005, 1.234)
    if int(k * 0.55) != int((k - 1) * 0.55):
        recorder.force(now_s - 1e-3, now_s, k * 0.002 + 0.001, k * 0.002, ("stable",))
    if k % 1000 == 999:
        recorder.step(StepMark(now_s, f"steps[{k}]", "steps", "hold"))
    recorder.tick(now_s)


def _written(path: Path) -> tuple[float, int]:
    """Processor seconds to record a run at `path`, and its samples."""
    clock = StillClock()
    start = time.process_time()
    recorder = Recorder(path, clock)
    recorder.begin({}, {})
    for k in range(RUN_S * 1000):
        clock.time_s = k * 1e-3
        feed(recorder, k, clock.time_s)
    assert recorder.finish({}) is None
    totals = recorder.totals()
    return time.process_time() - start, totals["motor_samples"] + totals["force_samples"]


def _read(path: Path) -> tuple[float, Recording]:
    start = time.process_time()
    recording = read_recording(path)
    return time.process_time() - start, recording


def _read_by_library(path: Path) -> float:
    start = time.process_time()
    with path.open("rb") as stream:
        for _ in make_reader(stream).iter_messages():
            pass
    return time.process_time() - start


def costs(folder: Path) -> Table:
    """Microseconds a sample, written and read."""
    write, read, library = [], [], []
    for n in range(ROUNDS):
        path = folder / f"{n}.mcap"
        seconds, samples = _written(path)
        write.append(1e6 * seconds / samples)
        seconds, recording = _read(path)
        assert len(recording.motor.time_s) + len(recording.load_cell.time_s) == samples
        read.append(1e6 * seconds / samples)
        library.append(1e6 * _read_by_library(path) / samples)
    table = Table(
        (
            f"{samples:,} samples, {path.stat().st_size / samples:.0f} bytes each on disk",
            "µs of processor time a sample",
        )
    )
    table.rows += [
        ("recorded", middle(write, "{:.2f}")),
        ("read to arrays", middle(read, "{:.2f}")),
        ("read by the mcap library, not decoded", middle(library, "{:.2f}")),
    ]
    return table


def _loop(how: str, folder: Path) -> tuple[np.ndarray, np.ndarray]:
    """Lateness of each turn and time in the recorder, seconds."""
    clock = WallClock()
    recorder = None
    if how != "nothing":
        recorder = Recorder(folder / f"{how}.mcap", clock, mode="process" if how == "process" else "inline")
        if how == "thread":
            recorder._store.close()
            recorder._store = ThreadStore(folder / "thread2.mcap", clock.epoch_ns, 250_000_000)
            recorder._send = recorder._store.message
        recorder.begin({}, {})
    count = round(TICKS_S * 1000)
    late, calls = np.zeros(count), np.zeros(count)
    start = clock.now() + 0.05
    for k in range(count):
        due = start + k * 1e-3
        clock.wait([], due)
        now = clock.now()
        late[k] = now - due
        if recorder is not None:
            feed(recorder, k, now)
            calls[k] = clock.now() - now
    if recorder is not None:
        problem = recorder.finish({})
        assert problem is None, problem
    return late, calls


def lateness(folder: Path) -> Table:
    """How late a 1 kHz loop gets, by where the file is written."""
    quantiles = ("median", "99 %", "99.9 %", "worst")
    table = Table(("recorded by", *(f"late, {q}, µs" for q in quantiles), *(f"calls, {q}, µs" for q in quantiles)))
    for how in ("nothing", "inline", "thread", "process"):
        cells = [
            f"{1e6 * v:.0f}" for values in _loop(how, folder) for v in np.quantile(values, [0.5, 0.99, 0.999, 1.0])
        ]
        table.rows.append((how, *cells))
    return table


def run() -> Section:
    """Costs, then lateness."""
    started = time.perf_counter()
    with tempfile.TemporaryDirectory() as folder:
        tables = [costs(Path(folder)), lateness(Path(folder))]
    return Section(TITLE, HOW, tables, [], time.perf_counter() - started)
