"""What the last run left behind: a motor that nobody took to its safe state, and where it was seen last.

A run that is going on looks like one that was killed: its recording has no end. But its file is held by whoever writes
it (`lock`), and nobody holds that of a run that was killed.
"""

from __future__ import annotations

import time
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import takewhile
from pathlib import Path

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Metadata

from bench.errors import InputError, Refused
from bench.recording.lock import is_alive, is_held
from bench.recording.mcap_read import mapped, read_mcap
from bench.recording.reader import RECORDING_FILE
from bench.recording.records import RECORD, Block, Buffer, Damaged, parse, read_index
from bench.recording.scan import Scan
from bench.recording.schemas import HOST, RESULT, RUN
from bench.recording.types import Array

FINISHING_S = 2.0
"""The writer of a run that was killed is given so long to finish its file."""


@dataclass(frozen=True)
class Left:
    """A run on real hardware that did not end as it should; positions in the motor frame, mm, forces in N.

    What was not measured is None. `pressing`: the probe stood deeper than the surface when last seen.
    """

    folder: Path
    bench: str
    why: str
    position_mm: float | None
    force_N: float | None
    surface_mm: float | None

    @property
    def pressing(self) -> bool:
        """The probe was in the pad when last seen."""
        return self.position_mm is not None and self.surface_mm is not None and self.position_mm > self.surface_mm

    def __str__(self) -> str:
        seen = []
        if self.position_mm is not None:
            where = ", in the pad" if self.pressing else ""
            seen.append(f"the motor at {self.position_mm:.3f} mm{where}")
        if self.force_N is not None:
            seen.append(f"{self.force_N:.2f} N on the load cell")
        last = f"; seen last: {', '.join(seen)}" if seen else "; nothing was measured"
        return f"{self.folder}: {self.why}{last}"


def notice(left: Left) -> str:
    """What whoever starts the next run must know, and see to before anything is energised."""
    return (
        f"NOTICE: the last run on bench '{left.bench}' was not made safe\n  {left}\n"
        "  see that the probe is clear of the pad before the motor is energised (`padbench release` lets go of it)"
    )


def left_behind(runs: Path, bench: str | None = None) -> Left | None:
    """What the newest run on real hardware under `runs` left, or None where it ended well (or there is none).

    `bench`: look at runs of the bench of this name only. Simulated runs, and recordings that cannot be read, are
    passed over. A run that is going on has left nothing yet, and those before it are its own affair.
    """
    for file, records in _real_runs(_newest_first(runs), bench):
        run, result = records[RUN], records.get(RESULT)
        if being_written(file) is not None:
            return None
        if result is None:
            return _left(file, run, "the run did not come to its end, and nobody made the motor safe")
        if result.get("not_safe"):
            return _left(file, run, f"the motor's safe state could not be read back ({result['not_safe']})")
        return None
    return None


def must_be_idle(runs: Path, bench: str) -> None:
    """Raises `Refused` where a run on real hardware, on the bench of this name, is going on under `runs`."""
    held = [file for file in _newest_first(runs) if is_held(file)]  # quickly asked, where there are many runs
    for file, _ in _real_runs(held, bench):
        writer = being_written(file)
        if writer is not None:
            raise Refused(
                f"the run {file.parent} on bench '{bench}' is going on{writer}\n"
                "  wait for its end, or stop it where it was started (Ctrl-C); where this is another bench, "
                "give its file another `name`"
            )


def being_written(file: Path) -> str | None:
    """None where nobody writes the recording; else ` (process N)`, or nothing where the file does not tell who.

    The process that writes the file outlives a run that was killed by some moments, which are waited for.
    """
    until_s = time.monotonic() + FINISHING_S
    while is_held(file):
        process = _records(file).get(HOST, {}).get("process", "")
        if not process.isdecimal():
            return ""
        if is_alive(int(process)) or time.monotonic() > until_s:
            return f" (process {process})"
        time.sleep(FINISHING_S / 40)
    return None


def _real_runs(files: Iterable[Path], bench: str | None) -> Iterator[tuple[Path, dict[str, dict[str, str]]]]:
    """Those of the recordings that are of runs on real hardware, with their records."""
    for file in files:
        records = _records(file)
        run = records.get(RUN)
        if run is not None and run.get("simulated") != "true" and bench in (None, run.get("bench")):
            yield file, records


def _newest_first(runs: Path) -> list[Path]:
    try:
        files = [folder / RECORDING_FILE for folder in runs.iterdir()]
        dated = [(file.stat().st_mtime_ns, file) for file in files if file.is_file()]
    except OSError:
        return []
    return [file for _, file in sorted(dated, reverse=True)]


def _records(file: Path) -> dict[str, dict[str, str]]:
    """The metadata records; by the index where there is one, so that a long run is not read through.

    Of a file that is still being written those before its first sample: others there are none.
    """
    try:
        with mapped(file) as data:
            found = Scan(data).records()
            if is_held(file):
                found = takewhile(lambda record: not isinstance(record, Block), found)
            return _indexed(data) or {f.name: f.metadata for f in found if isinstance(f, Metadata)}
    except InputError:
        return {}


def _indexed(data: Buffer) -> dict[str, dict[str, str]]:
    index = read_index(data)
    found = {}
    for at, length in index.of_kind(int(Opcode.METADATA)) if index is not None else ():
        try:
            record = parse(int(Opcode.METADATA), data[at + RECORD.size : at + length])
        except Damaged:
            return {}
        if isinstance(record, Metadata):
            found[record.name] = record.metadata
    return found


def _left(file: Path, run: dict[str, str], why: str) -> Left:
    bench = run.get("bench", "")
    try:
        recording = read_mcap(file)
    except InputError:
        return Left(file.parent, bench, why, None, None, None)
    motor, cell = recording.motor, recording.load_cell
    return Left(file.parent, bench, why, _last(motor.position_mm), _last(cell.force_N), recording.surface_mm)


def _last(values: Array) -> float | None:
    good = values[np.isfinite(values)]
    return float(good[-1]) if good.size else None
