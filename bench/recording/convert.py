"""Recordings from one form into another: MCAP or run folder to CSV, CSV to MCAP, CSV to CSV of our columns."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench.errors import InputError
from bench.recording.csv_file import COMMAND, GROSS, MOTOR_FORCE, OVERLOAD
from bench.recording.csv_write import Column, write_csv
from bench.recording.encode import event_json, flags_fragment, force_json, motor_json, object_json, strings
from bench.recording.mcap_file import McapFile
from bench.recording.measure import Delays, delays_of, increasing
from bench.recording.reader import is_mcap, read_recording, recording_file
from bench.recording.schemas import EVENT, EXTRA, FORMAT, LOAD_CELL, MOTOR, RESULT, RUN, TOPICS, TOUCH_OFF
from bench.recording.types import Array, Recording


def convert(
    source: str | Path,
    target: str | Path,
    columns: Mapping[str, str] | None = None,
    units: Mapping[str, str] | None = None,
) -> list[str]:
    """Read `source` and write `target`, whose suffix (.csv, .mcap) says what it becomes; returns notes for a person.

    In CSV the position is in the pad frame, stamps are corrected by the bench's timing, and steps and events are
    left behind. Raises `InputError`.
    """
    source, target = Path(source), Path(target)
    suffix = target.suffix.lower()
    if suffix not in (".csv", ".mcap"):
        raise InputError(str(target), "ends neither in .csv nor in .mcap", "the ending says what it is to become")
    file = recording_file(source)
    if target.exists() and target.samefile(file):
        raise InputError(str(target), "is the input itself", "name another file")
    if suffix == ".mcap" and is_mcap(file):
        raise InputError(str(source), "is MCAP already", "to mend a torn one: padbench recover")
    recording = read_recording(source, columns, units)
    notes = list(recording.notes)
    if recording.lost:
        notes.append(f"{source}: {recording.lost}")
    if suffix == ".csv":
        return notes + recording_to_csv(recording, target)
    return notes + recording_to_mcap(recording, target)


def recording_to_csv(recording: Recording, target: Path) -> list[str]:
    """Write a recording as CSV; returns what a person should know of it. Raises `InputError`."""
    notes = []
    motor, cell = recording.motor, recording.load_cell
    if not motor.time_s.size and not cell.time_s.size:
        raise InputError(str(recording.source), "holds no sample")
    surface = recording.surface_mm
    if surface is None:
        notes.append("no touch-off in it: position_mm is in the motor frame")
        surface = 0.0
    elif recording.surface_std_mm > 0.0:
        notes.append(
            f"a CSV has no place for the doubt of the surface (± {1e3 * recording.surface_std_mm:.2g} µm): a fit to it"
            " takes 0 mm for certain, and states too small errors of the law; fit the recording itself"
        )
    delays = delays_of(recording)
    if delays != Delays():
        notes.append("stamps are corrected by the bench's timing")
    position_time, force_time = motor.time_s - delays.position_s, cell.time_s - delays.force_s
    side: dict[str, Column] = {}
    for name, time, values in (
        (COMMAND, position_time, motor.command_mm - surface),
        (MOTOR_FORCE, position_time, motor.force_N),
        (GROSS, force_time, cell.gross_N),
        (OVERLOAD, force_time, np.where(cell.flagged, 1.0, np.nan)),
    ):
        if np.isfinite(values).any() and not (name == GROSS and np.array_equal(values, cell.force_N)):
            side[name] = _finite(time, values)
    order = _first_of_each(recording.extra_time_s)
    for name, values in recording.extra.items():
        side[name] = (recording.extra_time_s[order], values[order])
    for name, words in recording.extra_text.items():
        side[name] = (recording.extra_time_s[order], [words[i] for i in order])
    write_csv(target, *_finite(position_time, motor.position_mm - surface), *_finite(force_time, cell.force_N), side)
    return notes


def recording_to_mcap(recording: Recording, target: Path) -> list[str]:
    """Write CSV data as an MCAP recording; returns what a person should know of it. Raises `InputError`.

    Its clock begins a whole second before the first sample, at 1970 or later, since MCAP's times are unsigned.
    """
    motor, cell = recording.motor, recording.load_cell
    first = min([*motor.time_s[:1], *cell.time_s[:1], *recording.extra_time_s[:1]])
    epoch = max(0, int(np.ceil(-first)) + 1) * 1_000_000_000
    samples = _Samples(epoch)
    for i, (t, x, command, force) in enumerate(
        zip(motor.time_s, motor.position_mm, motor.command_mm, motor.force_N, strict=True)
    ):
        samples.add(t, MOTOR.id, i, motor_json(x, command, force))
    for i, (t, net, gross, bad) in enumerate(zip(cell.time_s, cell.force_N, cell.gross_N, cell.flagged, strict=True)):
        flags = (OVERLOAD,) if bad else ()
        samples.add(t, LOAD_CELL.id, i, force_json(net, gross, flags_fragment(flags, bool(bad))))
    samples.add(first, EVENT.id, 0, event_json(TOUCH_OFF, {"surface_mm": 0.0, "surface_std_mm": 0.0}))
    names = [*recording.extra, *recording.extra_text]
    for i, t in enumerate(recording.extra_time_s if names else ()):
        row: dict[str, object] = {name: values[i] for name, values in recording.extra.items()}
        row |= {name: words[i] for name, words in recording.extra_text.items()}
        samples.add(t, EXTRA.id, i, object_json(row))
    sha = hashlib.sha256(recording.source.read_bytes()).hexdigest()
    run = {"format": FORMAT, "epoch_ns": epoch, "converted_from": recording.source.name, "source_sha256": sha}
    result = {"status": "converted", "motor_samples": motor.time_s.size, "force_samples": cell.time_s.size}
    try:
        file = McapFile(target, TOPICS, epoch)
        file.metadata(RUN, strings(run))
        for ns, channel_id, sequence, data in sorted(samples.messages):
            file.add_message(channel_id, ns, data, ns, sequence)
        file.metadata(RESULT, strings(result))
        file.finish()
    except OSError as error:
        raise InputError(str(target), f"cannot be written ({error.strerror})", "name another place for it") from None
    return ["stamps are whole nanoseconds now"]


@dataclass
class _Samples:
    """Messages before they are put in order: (ns, channel id, sequence, data)."""

    epoch_ns: int

    def __post_init__(self) -> None:
        self.messages: list[tuple[int, int, int, bytes]] = []

    def add(self, time_s: float, channel_id: int, sequence: int, data: bytes) -> None:
        self.messages.append((self.epoch_ns + round(float(time_s) * 1e9), channel_id, sequence, data))


def _finite(time_s: Array, values: Array) -> tuple[Array, Array]:
    good = np.isfinite(values)
    return increasing(time_s[good], values[good])


def _first_of_each(time_s: Array) -> NDArray[np.intp]:
    """Indices of the first row of each time, in the order of time."""
    return np.unique(time_s, return_index=True)[1]
