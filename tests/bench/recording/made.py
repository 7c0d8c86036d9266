"""Runs made for the tests: a clock that stands still, and a recorder fed with numbers that are easy to check."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from bench.recording import Recorder, StepMark
from bench.recording.writer import Mode
from drivers.wire import Port

EPOCH_NS = 1_767_225_600_000_000_000  # 2026-01-01

BENCH_TEXT = "name: made  # a comment\ntiming: {force_delay: 2e-3, position_delay: 0.5e-3, measured_on: null}\n"
TRUTH_TEXT = "simulation:\n  seed: 7\n  pad: ../pads/secret.yaml\n"


class StillClock:
    """A bench clock that is set by hand."""

    def __init__(self, epoch_ns: int = EPOCH_NS) -> None:
        self.epoch_ns = epoch_ns
        self.time_s = 0.0

    def now(self) -> float:
        return self.time_s

    def wait(self, ports: Sequence[Port], until_s: float) -> None:
        self.time_s = until_s


def position_at(i: int) -> float:
    return 1.25 + 1e-3 * i


def force_at(i: int) -> float:
    return 0.1 + 1e-4 * i


def write_run(
    path: Path,
    *,
    seconds: float = 3.0,
    mode: Mode = "inline",
    host: dict[str, object] | None = None,
    finish: bool = True,
) -> Recorder:
    """A run: motor at 1 kHz, load cell at 500 Hz (half a period beside it), touch-off, three marks, a log line."""
    clock = StillClock()
    recorder = Recorder(path, clock, mode=mode)
    recorder.begin(
        {"protocol": "made", "seed": 7, "sample": "A1"},
        host or {"python": "3.11", "started": "2026-01-01T00:00:00"},
        simulation={"surface_mm": 1.5, "noise": {"force": 0.01}},
        attachments={"protocol.yaml": "name: made\n", "bench.yaml": BENCH_TEXT + TRUTH_TEXT, "model.yaml": "pad: {}\n"},
    )
    for i in range(round(seconds * 1000)):
        t = 1e-3 * i
        clock.time_s = t
        if i == 100:
            recorder.step(StepMark(t, "approach", "approach", "ramp", speed_mm_s=2.0))
        if i == 500:
            recorder.event(t, "touch_off", {"surface_mm": 1.5, "surface_std_mm": 0.004, "exponent": 1.5})
            recorder.log("info", "surface found")
        if i == 1000:
            recorder.step(StepMark(t, "steps[0]", "steps", "ramp", target_mm=1.0, speed_mm_s=80.0))
        if i == 2000:
            recorder.step(StepMark(t, "steps[0]", "steps", "hold", target_mm=1.0))
        recorder.motor(t - 2e-4, t, position_at(i), position_at(i) + 0.01 if i >= 100 else None)
        if i % 2 == 0:
            flags = ("stable", "overload") if i == 1500 else ("stable",)
            recorder.force(t + 3e-4, t + 4e-4, force_at(i), force_at(i) + 0.5, flags)
        recorder.tick(t)
    if finish:
        assert recorder.finish({"status": "done", "traffic": {"bytes_in": 3}}) is None
    return recorder
