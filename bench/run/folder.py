"""Where a run leaves its files: one folder a run."""

from __future__ import annotations

import contextlib
import datetime
import re
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from bench.errors import InputError, Refused
from bench.recording.lock import holding

RECORDING = "recording.mcap"
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
    """Take away the folder of a run that never began, if nothing is in it; for whoever made it."""
    with contextlib.suppress(OSError):
        folder.rmdir()
        if folder.parent.name == RUNS:
            folder.parent.rmdir()  # only if this was to be its first run: others keep it


@contextmanager
def own_folder(protocol_name: str, out: Path | None, now: datetime.datetime) -> Iterator[Path]:
    """`out`, or `runs/<local date>_<time>_<protocol>[_n]/` in the working directory, this run's alone until the end.

    Who comes second to one folder is refused and leaves it as it is, however close behind. A run that is refused
    inside, or stopped before there is anything in it, leaves no folder where there was none.
    Raises `InputError` where `out` is not empty or another run has it, or where it cannot be made.
    """
    folder, made = _made(protocol_name, out, now)
    with holding(folder) as ours:
        if not ours:
            raise InputError(str(folder), "another run has it", "give --out a new folder: no run overwrites another")
        must_be_free(folder)  # by now another may have begun and ended there
        try:
            _try_writing(folder)
            yield folder
        except (InputError, Refused, KeyboardInterrupt):
            if made:
                discard(folder)  # which takes away an empty one only
            raise


def _made(protocol_name: str, out: Path | None, now: datetime.datetime) -> tuple[Path, bool]:
    """The folder, and whether it was made here: one that was there already (and is empty) is somebody else's."""
    try:
        if out is not None:
            must_be_free(out)
            out.parent.mkdir(parents=True, exist_ok=True)
            return out, _made_now(out)
        stem = f"{now:%Y-%m-%d_%H%M%S}_{re.sub(r'[^A-Za-z0-9._-]+', '-', protocol_name)}"
        folder, n = Path(RUNS) / stem, 2
        folder.parent.mkdir(exist_ok=True)
        while not _made_now(folder):
            folder, n = Path(RUNS) / f"{stem}_{n}", n + 1
    except OSError as error:
        raise _unwritable(folder if out is None else out, error) from error
    return folder, True


def _made_now(folder: Path) -> bool:
    try:
        folder.mkdir()
    except FileExistsError:
        return False
    return True


def _try_writing(folder: Path) -> None:
    probe = folder / ".writable"
    try:
        probe.touch()
        probe.unlink()
    except OSError as error:
        raise _unwritable(folder, error) from error


def _unwritable(folder: Path, error: OSError) -> InputError:
    if isinstance(error, FileExistsError | NotADirectoryError):
        file = next((str(above) for above in (folder, *folder.parents) if above.is_file()), "something there")
        return InputError(str(folder), f"cannot be made: {file} is a file", "choose another place with --out")
    return InputError(str(folder), f"cannot be written: {error.strerror}", "choose another place with --out")
