"""What the last run left behind: a motor that nobody took to its safe state, and where it was seen last."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from mcap.opcode import Opcode
from mcap.records import Metadata

from bench.errors import InputError
from bench.recording.mcap_read import mapped, read_mcap
from bench.recording.reader import RECORDING_FILE
from bench.recording.records import RECORD, Buffer, Damaged, parse, read_index
from bench.recording.scan import Scan
from bench.recording.schemas import RESULT, RUN
from bench.recording.types import Array


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
    passed over. A run that is going on at this moment looks like one that was killed: its port is taken, too.
    """
    for file in _newest_first(runs):
        records = _records(file)
        run = records.get(RUN)
        if run is None or run.get("simulated") == "true" or (bench is not None and run.get("bench") != bench):
            continue
        result = records.get(RESULT)
        if result is None:
            return _left(file, run, "the run did not come to its end, and nobody made the motor safe")
        if result.get("not_safe"):
            return _left(file, run, f"the motor's safe state could not be read back ({result['not_safe']})")
        return None
    return None


def _newest_first(runs: Path) -> list[Path]:
    try:
        files = [folder / RECORDING_FILE for folder in runs.iterdir()]
        dated = [(file.stat().st_mtime_ns, file) for file in files if file.is_file()]
    except OSError:
        return []
    return [file for _, file in sorted(dated, reverse=True)]


def _records(file: Path) -> dict[str, dict[str, str]]:
    """The metadata records; by the index where there is one, so that a long run is not read through."""
    try:
        with mapped(file) as data:
            return _indexed(data) or {f.name: f.metadata for f in Scan(data).records() if isinstance(f, Metadata)}
    except InputError:
        return {}


def _indexed(data: Buffer) -> dict[str, dict[str, str]]:
    index = read_index(data)
    found = {}
    for at, (opcode, length) in index.known.items() if index is not None else ():
        try:
            record = parse(opcode, data[at + RECORD.size : at + length]) if opcode == Opcode.METADATA else None
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
