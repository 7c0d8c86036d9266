"""A `Recording` out of an MCAP file: whole, torn or damaged."""

from __future__ import annotations

import json
import mmap
import os
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from mcap.records import Attachment, Channel, Metadata
from numpy.typing import NDArray

from bench.errors import InputError
from bench.recording.records import MAGIC, Block, Buffer, definitions, messages
from bench.recording.scan import Scan
from bench.recording.schemas import (
    EVENT,
    EXTRA,
    HOST,
    LIBRARY,
    LOAD_CELL,
    MOTOR,
    NO_SURFACE,
    RECOVERED,
    RESULT,
    RUN,
    STEP,
    TOPICS,
    TOUCH_OFF,
    epoch_of,
)
from bench.recording.types import Array, Event, ForceChannel, MotorChannel, Recording, StepMark

BATCH = 20_000
"""So many messages of a topic are held as bytes before they become numbers."""


@contextmanager
def mapped(path: Path) -> Iterator[Buffer]:
    """The bytes of a file without loading it whole; raises `InputError` where it cannot be read."""
    try:
        with path.open("rb") as file:
            empty = file.seek(0, os.SEEK_END) == 0
            data = None if empty else mmap.mmap(file.fileno(), 0, access=mmap.ACCESS_READ)
    except OSError as error:
        raise InputError(str(path), f"cannot be read ({error.strerror})") from None
    if data is None:
        yield b""
        return
    with data:
        yield data


def read_mcap(path: Path) -> Recording:
    """Read an MCAP recording; what could not be read stands in `Recording.lost`.

    Raises `InputError` where the file is no MCAP, or holds no topic of a padbench recording.
    """
    with mapped(path) as data:
        if not data:
            raise InputError(str(path), "is empty", "the run ended before anything was written: there is nothing in it")
        if data[: len(MAGIC)] != MAGIC:
            cure = "is it a recording? if it is a damaged one: padbench recover"
            raise InputError(str(path), "is not an MCAP file (it does not begin with MCAP's magic bytes)", cure)
        return _Reading(path).read(Scan(data))


@dataclass
class _Column:
    """Messages of one topic: stamps as ns, JSON not yet read, then objects."""

    publish_ns: list[int] = field(default_factory=list)
    log_ns: list[int] = field(default_factory=list)
    texts: list[bytes] = field(default_factory=list)
    count: int = 0
    last_sequence: int = -1
    bad: int = 0
    parts: dict[str, list[NDArray[Any]]] = field(default_factory=dict)
    objects: list[dict[str, Any]] = field(default_factory=list)


SAMPLE_FIELDS = {
    MOTOR.name: ("position_mm", "command_mm", "force_N"),
    LOAD_CELL.name: ("force_N", "gross_N", "overload"),
}


class _Reading:
    """Collects one file."""

    def __init__(self, path: Path) -> None:
        self.path = path
        self.columns: dict[str, _Column] = {topic.name: _Column() for topic in TOPICS}
        self.by_id: dict[int, _Column | None] = {}
        self.channels: dict[int, Channel] = {}
        self.metadata: dict[str, dict[str, str]] = {}
        self.attachments: dict[str, bytes] = {}
        self.library: str | None = None
        self.epoch_ns: int | None = None

    def read(self, scan: Scan) -> Recording:
        for found in scan.records():
            self.library = scan.header.library if scan.header is not None else None
            if isinstance(found, Block):
                self._block(found)
            elif isinstance(found, Channel):
                self._channel(found)
            elif isinstance(found, Metadata):
                self.metadata.setdefault(found.name, found.metadata)
            elif isinstance(found, Attachment):
                self.attachments[found.name] = found.data
        for name, column in self.columns.items():
            _digest(name, column)
        self._must_be_ours(scan)
        return self._recording(scan)

    def _channel(self, channel: Channel) -> None:
        self.channels[channel.id] = channel
        column = self.columns.get(channel.topic)
        if column is not None and channel.message_encoding != "json":
            raise InputError(
                str(self.path),
                f"topic {channel.topic} is encoded as {channel.message_encoding or 'nothing known'}, not as JSON",
                "padbench reads recordings of its own; export others as CSV",
            )
        self.by_id[channel.id] = column
        if self.epoch_ns is None:
            self.epoch_ns = epoch_of(channel.metadata)

    def _block(self, block: Block) -> None:
        by_id = self.by_id
        for channel_id, sequence, log_ns, publish_ns, text in messages(block):
            if channel_id not in by_id:
                self._define(channel_id, block)
            column = by_id[channel_id]
            if column is not None:
                column.publish_ns.append(publish_ns)
                column.log_ns.append(log_ns)
                column.texts.append(text)
                column.last_sequence = sequence
        for name, column in self.columns.items():
            if len(column.texts) >= BATCH:
                _digest(name, column)

    def _define(self, channel_id: int, block: Block) -> None:
        """Find out what a channel is that no index has told of."""
        for found in definitions(block):
            if isinstance(found, Channel):
                self._channel(found)
        if channel_id not in self.by_id:
            # Its definition stood in a chunk that is damaged. Channels of ours are always the same.
            ours = self.library is None or self.library.startswith(LIBRARY)
            names = {topic.id: topic.name for topic in TOPICS} if ours else {}
            self.by_id[channel_id] = self.columns.get(names.get(channel_id, ""))

    def _must_be_ours(self, scan: Scan) -> None:
        known = [c.topic for c in self.channels.values() if c.topic in (MOTOR.name, LOAD_CELL.name)]
        if known or RUN in self.metadata or (not self.channels and not scan.finished):
            return
        there = ", ".join(sorted(c.topic for c in self.channels.values())) or "none"
        raise InputError(
            str(self.path),
            f"is an MCAP file, but no padbench recording: it has no {MOTOR.name} and no {LOAD_CELL.name}",
            f"topics in it: {there}",
        )

    def _recording(self, scan: Scan) -> Recording:
        run = self.metadata.get(RUN, {})
        epoch = epoch_of(run)
        if epoch is not None:
            self.epoch_ns = epoch
        if self.epoch_ns is None:
            first = [int(part[0]) for c in self.columns.values() for part in c.parts.get("log_ns", [])[:1] if part.size]
            self.epoch_ns = min(first, default=0)
        motor, cell = self.columns[MOTOR.name], self.columns[LOAD_CELL.name]
        overload = _array(cell, "overload")
        recording = Recording(
            source=self.path,
            motor=MotorChannel(
                time_s=self._seconds(motor, "publish_ns"),
                position_mm=_array(motor, "position_mm"),
                command_mm=_array(motor, "command_mm"),
                force_N=_array(motor, "force_N"),
                received_s=self._seconds(motor, "log_ns"),
            ),
            load_cell=ForceChannel(
                time_s=self._seconds(cell, "publish_ns"),
                force_N=_array(cell, "force_N"),
                gross_N=_array(cell, "gross_N"),
                received_s=self._seconds(cell, "log_ns"),
                flagged=np.nan_to_num(overload) != 0.0,
            ),
            events=self._events(),
            steps=self._steps(),
            run=run,
            result=self.metadata.get(RESULT),
            host=self.metadata.get(HOST, {}),
            attachments=self.attachments,
            lost=self._lost(scan),
        )
        recording.surface_mm, recording.surface_std_mm = _surface(recording)
        self._extra(recording)
        return recording

    def _seconds(self, column: _Column, stamps: str) -> Array:
        assert self.epoch_ns is not None
        parts = column.parts.pop(stamps, None)  # one of the two is enough in memory
        if not parts:
            return np.empty(0)
        ns: Array = (np.concatenate(parts) - self.epoch_ns) / 1e9
        return ns

    def _events(self) -> list[Event]:
        column = self.columns[EVENT.name]
        times = self._seconds(column, "publish_ns")
        return [
            Event(float(t), str(o.get("name", "")), {k: v for k, v in o.items() if k != "name"})
            for t, o in zip(times, column.objects, strict=True)
        ]

    def _steps(self) -> list[StepMark]:
        column = self.columns[STEP.name]
        times = self._seconds(column, "publish_ns")
        return [
            StepMark(
                float(t),
                str(o.get("name", "")),
                str(o.get("phase", "")),
                str(o.get("kind", "")),
                _number(o.get("target_mm")),
                _number(o.get("speed_mm_s")),
            )
            for t, o in zip(times, column.objects, strict=True)
        ]

    def _extra(self, recording: Recording) -> None:
        column = self.columns[EXTRA.name]
        recording.extra_time_s = self._seconds(column, "publish_ns")
        names = dict.fromkeys(name for o in column.objects for name in o)
        for name in names:
            values = [o.get(name) for o in column.objects]
            if any(isinstance(v, str) for v in values):
                recording.extra_text[name] = ["" if v is None else str(v) for v in values]
            else:
                recording.extra[name] = np.array([_number(v) for v in values])

    def _lost(self, scan: Scan) -> str | None:
        lost = [str(damage) for damage in scan.damage if damage.content]
        recovered = self.metadata.get(RECOVERED, {}).get("lost")
        if recovered is not None:
            lost.append(f"lost before it was recovered: {recovered}")
        elif scan.header is None or scan.header.library.startswith(LIBRARY):
            for name, column in self.columns.items():
                missing = column.last_sequence + 1 - column.count
                if missing > 0:
                    lost.append(f"{missing} messages missing in {name}")
        bad = sum(column.bad for column in self.columns.values())
        if bad:
            lost.append(f"{bad} messages are not JSON objects")
        if not scan.finished and not lost:
            lost.append("the file was never finished: what was measured last may be missing")
        return "; ".join(lost) or None


def _digest(name: str, column: _Column) -> None:
    """Turn the messages that wait into numbers (samples) or objects (the rest)."""
    if not column.texts:
        return
    try:
        objects = json.loads(b"[" + b",".join(column.texts) + b"]")
        good = len(objects) == len(column.texts) and all(type(o) is dict for o in objects)
    except (ValueError, RecursionError):
        good = False
    if not good:
        objects = _one_by_one(column)
    stamps = column.parts.setdefault("publish_ns", []), column.parts.setdefault("log_ns", [])
    stamps[0].append(np.array(column.publish_ns, dtype=np.uint64).astype(np.int64))
    stamps[1].append(np.array(column.log_ns, dtype=np.uint64).astype(np.int64))
    fields = SAMPLE_FIELDS.get(name)
    if fields is None:
        column.objects += objects
    else:
        for key in fields:
            column.parts.setdefault(key, []).append(_numbers([o.get(key) for o in objects]))
    column.count += len(objects)
    column.publish_ns, column.log_ns, column.texts = [], [], []


def _numbers(values: list[Any]) -> Array:
    """One number a message, NaN where there is none or it is not finite."""
    kinds = set(map(type, values))
    if kinds <= {float, bool, type(None)}:
        numbers = np.array(values, dtype=float)
    else:
        numbers = np.array([_number(v) for v in values], dtype=float)
    numbers[~np.isfinite(numbers)] = np.nan
    return numbers


def _one_by_one(column: _Column) -> list[dict[str, Any]]:
    """The messages that are JSON objects; the others are counted and dropped with their stamps."""
    objects, keep = [], []
    for i, text in enumerate(column.texts):
        try:
            found = json.loads(text)
        except (ValueError, RecursionError):
            found = None
        if isinstance(found, dict):
            objects.append(found)
            keep.append(i)
    column.bad += len(column.texts) - len(keep)
    column.publish_ns = [column.publish_ns[i] for i in keep]
    column.log_ns = [column.log_ns[i] for i in keep]
    return objects


def _array(column: _Column, key: str) -> Array:
    parts = column.parts.pop(key, None)
    return np.concatenate(parts) if parts else np.empty(0)


def _number(value: object) -> float:
    try:
        return float(value) if isinstance(value, int | float) else float("nan")
    except OverflowError:  # a whole number of more than 308 digits
        return float("nan")


def _surface(recording: Recording) -> tuple[float | None, float]:
    """From the last touch-off before the steps (a later one, of a pad that has sunk, would move what was measured)."""
    first_step = next((mark.time_s for mark in recording.steps if mark.phase == "steps"), float("inf"))
    found: tuple[float | None, float] = (None, 0.0)
    for event in recording.events:
        surface = _number(event.data.get("surface_mm"))
        if event.name not in (TOUCH_OFF, NO_SURFACE) or not np.isfinite(surface):
            continue
        if found[0] is None or event.time_s <= first_step:
            std = _number(event.data.get("surface_std_mm", 0.0))
            found = (surface, std if np.isfinite(std) else 0.0)
    return found
