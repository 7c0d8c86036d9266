"""How late does a 1 kHz loop get while it records? Inline, a writer thread, and a writer process, side by side.

    python -m tests.bench.recording.bench_ticks [SECONDS]     (chrt -f 10 before it keeps other programs out)

Each tick hands over one motor sample, and at 550 Hz a force sample; every second a step begins (flush and sync). The
loop waits as the bench's does (`drivers.clock.WallClock`). Lateness is the time a tick begins after it was due;
`calls` is what the recorder's calls of one tick took. "nothing" records nothing: what the machine itself does.
"""

from __future__ import annotations

import queue
import sys
import tempfile
import threading
from pathlib import Path

import numpy as np

from bench.recording import Recorder, StepMark
from bench.recording.store import InlineStore
from drivers.clock import WallClock


class ThreadStore:
    """What was considered and is not used: the inline store behind a queue in a thread of the same process."""

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


def run(how: str, seconds: float, folder: Path) -> tuple[np.ndarray, np.ndarray]:
    clock = WallClock()
    recorder = None
    if how != "nothing":
        recorder = Recorder(folder / f"{how}.mcap", clock, mode="process" if how == "process" else "inline")
        if how == "thread":
            recorder._store.close()
            recorder._store = ThreadStore(folder / "thread2.mcap", clock.epoch_ns, 250_000_000)
            recorder._send = recorder._store.message
        recorder.begin({}, {})
    count = round(seconds * 1000)
    late, calls = np.zeros(count), np.zeros(count)
    start = clock.now() + 0.05
    forces = 0
    for i in range(count):
        due = start + i * 1e-3
        clock.wait([], due)
        now = clock.now()
        late[i] = now - due
        if recorder is not None:
            recorder.motor(now - 1e-4, now, i * 0.1234567, i * 0.1234567, 1.234567)
            if i * 0.55 >= forces:
                forces += 1
                recorder.force(now - 1e-3, now, i * 0.01234567, i * 0.01234567, ("stable",))
            if i % 1000 == 999:
                recorder.step(StepMark(now, f"steps[{i}]", "steps", "hold"))
            recorder.tick(now)
            calls[i] = clock.now() - now
    if recorder is not None:
        problem = recorder.finish({})
        assert problem is None, problem
    return late, calls


def main() -> None:
    seconds = float(sys.argv[1]) if len(sys.argv) > 1 else 20.0
    print(f"{'':8}  {'lateness, µs':>33}  {'calls of a tick, µs':>33}")
    print(
        f"{'':8}  {'median':>8}{'99 %':>8}{'99.9 %':>8}{'worst':>9}  {'median':>8}{'99 %':>8}{'99.9 %':>8}{'worst':>9}"
    )
    for how in ("nothing", "inline", "thread", "process"):
        with tempfile.TemporaryDirectory() as folder:
            late, calls = run(how, seconds, Path(folder))
        cells = ""
        for values in (late, calls):
            q = [*np.quantile(values, [0.5, 0.99, 0.999]), values.max()]
            cells += "  " + "".join(f"{1e6 * v:8.0f}" for v in q[:3]) + f"{1e6 * q[3]:9.0f}"
        print(f"{how:8}{cells}", flush=True)


if __name__ == "__main__":
    main()
