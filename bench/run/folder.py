"""Where a run leaves its files: one folder a run."""

from __future__ import annotations

import contextlib
import datetime
import re
from pathlib import Path

from bench.errors import InputError

RECORDING = "recording.mcap"
MODEL = "model.yaml"
FIT = "fit.json"
REPORT = "report.html"
RUNS = "runs"


def must_be_free(out: Path) -> None:
    """Raises `InputError` where there is anything already: no run overwrites another."""
    try:
        taken = out.exists() and (not out.is_dir() or any(out.iterdir()))
    except OSError as error:
        raise InputError(str(out), f"cannot be read: {error.strerror}", "choose another place with --out") from error
    if taken:
        what = "is not empty" if out.is_dir() else "is a file, not a folder"
        raise InputError(str(out), what, "give --out a new folder: no run overwrites another")


def discard(folder: Path) -> None:
    """Take away the folder of a run that never began, with its recording of nothing."""
    with contextlib.suppress(OSError):
        (folder / RECORDING).unlink(missing_ok=True)
        folder.rmdir()
        if folder.parent.name == RUNS:
            folder.parent.rmdir()  # only if this was to be its first run: others keep it


def make_folder(protocol_name: str, out: Path | None, now: datetime.datetime) -> Path:
    """Make `out`, or `runs/<local date>_<time>_<protocol>[_n]/` in the working directory.

    Raises `InputError` where `out` is not empty, or cannot be made.
    """
    if out is not None:
        must_be_free(out)
        folder = out
    else:
        stem = f"{now:%Y-%m-%d_%H%M%S}_{re.sub(r'[^A-Za-z0-9._-]+', '-', protocol_name)}"
        folder = Path(RUNS) / stem
        n = 2
        while folder.exists():
            folder = Path(RUNS) / f"{stem}_{n}"
            n += 1
    try:
        folder.mkdir(parents=True, exist_ok=True)
        probe = folder / ".writable"
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise InputError(
            str(folder), f"cannot be written: {error.strerror}", "choose another place with --out"
        ) from error
    return folder
