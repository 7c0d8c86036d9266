"""Where a run leaves its files: one folder a run."""

from __future__ import annotations

import datetime
import re
from pathlib import Path

from bench.errors import InputError

RECORDING = "recording.mcap"
MODEL = "model.yaml"
FIT = "fit.json"
REPORT = "report.html"


def make_folder(protocol_name: str, out: Path | None, now: datetime.datetime) -> Path:
    """Make `out`, or `runs/<local date>_<time>_<protocol>[_n]/` in the working directory.

    Raises `InputError` where `out` is not empty, or cannot be made.
    """
    if out is not None:
        if out.exists() and (not out.is_dir() or any(out.iterdir())):
            raise InputError(str(out), "is not an empty folder", "give --out a new folder: no run overwrites another")
        folder = out
    else:
        stem = f"{now:%Y-%m-%d_%H%M%S}_{re.sub(r'[^A-Za-z0-9._-]+', '-', protocol_name)}"
        folder = Path("runs") / stem
        n = 2
        while folder.exists():
            folder = Path("runs") / f"{stem}_{n}"
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
