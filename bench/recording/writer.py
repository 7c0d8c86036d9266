"""The recorder of a run: typed calls in, one MCAP file out.

`publish_time` is when something was measured, `log_time` when the host had it; both are nanoseconds since 1970 from
the bench's clock. Sequence numbers count from 0 in each channel, also over what could not be written, so that a
reader can tell how many samples are missing.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Mapping
from pathlib import Path
from types import TracebackType
from typing import Any, Literal, Self

from bench.errors import InputError
from bench.recording.encode import (
    event_json,
    flags_fragment,
    force_json,
    log_json,
    motor_json,
    step_json,
    strings,
)
from bench.recording.mcap_file import claim
from bench.recording.schemas import (
    BENCH_FILE,
    EVENT,
    FORMAT,
    HOST,
    LOAD_CELL,
    LOG,
    LOG_LEVELS,
    MOTOR,
    RESULT,
    RUN,
    SIMULATION,
    STEP,
    TOUCH_OFF,
)
from bench.recording.space import must_fit, need_bytes
from bench.recording.store import InlineStore, Store
from bench.recording.truth_block import without_truth
from bench.recording.types import StepMark
from drivers.wire import Clock

FLUSH_S = 0.04
"""Longest time a message waits in the memory of the process that writes the file. A killed run may lose a tenth of a
second: the rest of it is for the way through the pipe, and for a processor that is busy with something else."""

HOST_SIZE = 4096
"""The host record is padded to a multiple of so many bytes: it differs between two runs of one seed, and must not
shift the rest of the file."""

OVERLOAD = "overload"

FIRST_EPOCH_NS = 86_400_000_000_000
"""MCAP's times are unsigned: a clock that begins in 1970 is moved by a day, so that there is room before its zero."""

_MOTOR, _LOAD_CELL = MOTOR.id, LOAD_CELL.id

Mode = Literal["inline", "process"]


class Recorder:
    """Writes one run to a new file at `path`.

    `mode` "inline" writes in this process (virtual clock: the same calls give the same bytes), "process" hands
    everything to a process behind a pipe and never blocks (wall clock; where there are no POSIX pipes it is inline).
    Calls never raise because of the disk: ask `problem()`, and look at what `finish` returns. All times are seconds
    on the bench's clock. `planned_s` and `samples_per_s` (both devices together) say how much room the run will need.
    Raises `InputError` where the file exists or cannot be made, or where the disk has not that much room.
    """

    def __init__(
        self,
        path: Path,
        clock: Clock,
        *,
        mode: Mode = "inline",
        flush_s: float = FLUSH_S,
        planned_s: float | None = None,
        samples_per_s: float | None = None,
    ) -> None:
        must_fit(path.parent, need_bytes(planned_s, samples_per_s))
        claim(path)
        self.path = path
        self._clock = clock
        self._epoch_ns = max(clock.epoch_ns, FIRST_EPOCH_NS)
        self._store = _open_store(path, mode, self._epoch_ns, round(flush_s * 1e9))
        self._send = self._store.message
        self._motor_count = 0
        self._force_count = 0
        self._other_counts = {EVENT.id: 0, STEP.id: 0, LOG.id: 0}
        self._fragments: dict[tuple[str, ...], str] = {}
        self._finished = False

    # -- before the first sample ---------------------------------------------------------------------------------

    def begin(
        self,
        run: Mapping[str, object],
        host: Mapping[str, object],
        *,
        simulation: Mapping[str, object] | None = None,
        attachments: Mapping[str, str | bytes] | None = None,
    ) -> None:
        """The records that stand at the start of a run.

        `run`: whatever the data depend on; `host`: what may differ between two runs of one seed (versions, wall-clock
        start); `simulation`: the truth of a simulated bench; `attachments`: file name → content, verbatim, but for
        the `simulation:` block of `bench.yaml`, which goes to the truth. Values that are not text become JSON.
        """
        truth = dict(simulation) if simulation is not None else {}
        files = dict(attachments or {})
        if BENCH_FILE in files:
            text = files[BENCH_FILE]
            rest, block = without_truth(text.decode() if isinstance(text, bytes) else text)
            files[BENCH_FILE] = rest
            if block is not None:
                truth["bench_file_block"] = block
        self._store.metadata(RUN, strings({"format": FORMAT, "epoch_ns": str(self._epoch_ns), **run}))
        self._store.metadata(HOST, _padded(strings({"process": os.getpid(), **host})))
        if truth:
            self._store.metadata(SIMULATION, strings(truth))
        for name, content in files.items():
            self.attach(name, content)

    def attach(self, name: str, content: str | bytes) -> None:
        """One more file inside the recording."""
        data = content.encode() if isinstance(content, str) else content
        self._store.attachment(name, _media_type(name), data, self._epoch_ns)

    # -- during the run --------------------------------------------------------------------------------------------

    def motor(
        self,
        time_s: float,
        received_s: float,
        position_mm: float,
        command_mm: float | None = None,
        force_N: float | None = None,
    ) -> None:
        """One motor sample, motor frame; NaN or None where nothing was commanded or sensed."""
        sequence = self._motor_count
        self._motor_count = sequence + 1
        epoch = self._epoch_ns
        self._send(
            _MOTOR,
            epoch + round(received_s * 1e9),
            motor_json(position_mm, command_mm, force_N),
            epoch + round(time_s * 1e9),
            sequence,
        )

    def force(
        self,
        time_s: float,
        received_s: float,
        net_N: float,
        gross_N: float,
        flags: tuple[str, ...] = (),
        overload: bool = False,
    ) -> None:
        """One load-cell sample, net of the tare and as read; the device's word `overload` marks it as bad too."""
        sequence = self._force_count
        self._force_count = sequence + 1
        key = (*flags, OVERLOAD) if overload else flags
        fragment = self._fragments.get(key)
        if fragment is None:
            fragment = self._fragments[key] = flags_fragment(flags, OVERLOAD in key)
        epoch = self._epoch_ns
        self._send(
            _LOAD_CELL,
            epoch + round(received_s * 1e9),
            force_json(net_N, gross_N, fragment),
            epoch + round(time_s * 1e9),
            sequence,
        )

    def event(self, time_s: float, name: str, data: Mapping[str, Any] | None = None) -> None:
        """Something that happened, with its numbers; raises ValueError where one of them is called `name`."""
        self._note(EVENT.id, time_s, event_json(name, data or {}))

    def surface(self, time_s: float, surface_mm: float, surface_std_mm: float, **data: Any) -> None:
        """The event that readers take the pad's surface from: its place in the motor frame, and its deviation."""
        numbers = {"surface_mm": surface_mm, "surface_std_mm": surface_std_mm, **data}
        self.event(time_s, TOUCH_OFF, numbers)

    def step(self, mark: StepMark) -> None:
        """A stretch of the run begins; everything before it is flushed."""
        self._note(STEP.id, mark.time_s, step_json(mark))
        self._store.boundary()

    def log(self, level: str, text: str, time_s: float | None = None) -> None:
        """A line of text for people; `level`: debug, info, warning, error, fatal."""
        time_s = self._clock.now() if time_s is None else time_s
        self._note(LOG.id, time_s, log_json(self._ns(time_s), LOG_LEVELS[level], text))

    def tick(self, now_s: float) -> None:
        """To be called in every turn of the loop: writes what has waited long enough."""
        self._store.tick(self._epoch_ns + round(now_s * 1e9))

    def problem(self) -> str | None:
        """The first thing that kept data from being recorded, or None."""
        return self._store.problem

    # -- the end ---------------------------------------------------------------------------------------------------

    def finish(self, result: Mapping[str, object]) -> str | None:
        """Write `padbench.result` (with the counts of samples) and finish the file; returns the problem, if any."""
        if not self._finished:
            lost = {"messages_lost": self._store.lost} if self._store.lost else {}
            self._store.metadata(RESULT, strings({**result, **self.totals(), **lost}))
        return self.close()

    def close(self) -> str | None:
        """Finish the file without a result: such a run reads as unfinished. Returns the problem, if any."""
        self._finished = True
        self._store.close()
        return self._store.problem

    @property
    def writer_pid(self) -> int | None:
        """Process id of the writer process, where there is one."""
        return self._store.pid

    def totals(self) -> dict[str, int]:
        """Samples, events and marks handed in so far."""
        return {
            "motor_samples": self._motor_count,
            "force_samples": self._force_count,
            "events": self._other_counts[EVENT.id],
            "steps": self._other_counts[STEP.id],
        }

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()

    # -- inside ------------------------------------------------------------------------------------------------------

    def _ns(self, time_s: float) -> int:
        return self._epoch_ns + round(time_s * 1e9)

    def _note(self, channel_id: int, time_s: float, data: bytes) -> None:
        sequence = self._other_counts[channel_id]
        self._other_counts[channel_id] = sequence + 1
        ns = self._ns(time_s)
        self._send(channel_id, ns, data, ns, sequence)


def _open_store(path: Path, mode: Mode, epoch_ns: int, flush_ns: int) -> Store:
    if mode == "process" and sys.platform != "win32":
        from bench.recording.process_store import ProcessStore

        return ProcessStore(path, epoch_ns, flush_ns)
    try:
        return InlineStore(path, epoch_ns, flush_ns)
    except OSError as error:
        path.unlink(missing_ok=True)  # claimed here, and empty
        raise InputError(
            str(path), f"cannot be written ({error.strerror})", "make room, or name another folder"
        ) from None


def _media_type(name: str) -> str:
    suffixes = {".yaml": "application/yaml", ".json": "application/json", ".csv": "text/csv", ".txt": "text/plain"}
    return suffixes.get(Path(name).suffix, "application/octet-stream")


def _padded(fields: dict[str, str]) -> dict[str, str]:
    """The fields with a last one, `padding`, that rounds the record's size up."""
    size = sum(8 + len(k.encode()) + len(v.encode()) for k, v in fields.items()) + 8 + len("padding")
    return {**fields, "padding": " " * (-size % HOST_SIZE)}
