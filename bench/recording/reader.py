"""Whatever a person gives as DATA, as a `Recording`."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path

from bench.errors import InputError
from bench.recording.csv_file import read_csv
from bench.recording.mcap_read import read_mcap
from bench.recording.records import MAGIC
from bench.recording.types import Recording

RECORDING_FILE = "recording.mcap"
"""What a run folder calls its recording (docs/formats.md)."""


def read_recording(
    path: str | Path, columns: Mapping[str, str] | None = None, units: Mapping[str, str] | None = None
) -> Recording:
    """Read an MCAP file (whole, torn or damaged), a run folder, or a CSV file.

    `columns` and `units` apply to CSV alone (`bench.recording.columns`). Raises `InputError` with what is wrong and
    what to do about it; what a damaged MCAP has lost stands in `Recording.lost`.
    """
    path = Path(path)
    file = recording_file(path)
    if is_mcap(file):
        if columns or units:
            raise InputError(str(file), "is a recording: --columns and --units are for CSV files")
        return read_mcap(file)
    return read_csv(file, columns, units)


def recording_file(path: Path) -> Path:
    """The file itself, or the recording inside a run folder. Raises `InputError` where there is none."""
    try:
        path.stat()
    except FileNotFoundError:
        pass
    except (OSError, ValueError) as error:
        raise InputError(str(path), f"cannot be read ({getattr(error, 'strerror', None) or error})") from None
    if path.is_dir():
        file = path / RECORDING_FILE
        if not file.is_file():
            raise InputError(str(path), f"is no run folder: it has no {RECORDING_FILE}", "name a run folder or a file")
        return file
    if not path.exists():
        raise InputError(str(path), "does not exist", _nearest(path))
    if not path.is_file():
        raise InputError(str(path), "is no file", "name a recording, a run folder or a CSV file")
    return path


def is_mcap(file: Path) -> bool:
    """By its first bytes, else by its name. Raises `InputError` where it cannot be read."""
    try:
        with file.open("rb") as stream:
            return stream.read(len(MAGIC)) == MAGIC or file.suffix.lower() == ".mcap"
    except OSError as error:
        raise InputError(str(file), f"cannot be read ({error.strerror})") from None


def _nearest(path: Path) -> str:
    import difflib

    try:
        there = [entry.name for entry in path.parent.iterdir()]
    except OSError:
        return f"there is no folder {path.parent} either"
    near = difflib.get_close_matches(path.name, there, 1, 0.6)
    return f"did you mean {path.parent / near[0]}?" if near else ""
