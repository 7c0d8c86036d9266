"""Room on the disk: enough for the run before it begins, and a reserve while it goes on."""

from __future__ import annotations

import shutil
from pathlib import Path

from bench.errors import InputError

RESERVE = 32 << 20
"""Bytes that a recording leaves free: the motion must still end, and model, fit and report be written."""

SAMPLE_SIZE = 70
"""Bytes a sample takes in the file at most: 30 to 60 were measured."""

CHUNK_COST, CHUNKS_PER_S = 340, 25
"""And what each chunk takes beside its samples, with its place in the index; slow devices fill them with little."""

UNTOLD_S = 600.0
UNTOLD_PER_S = 2000.0
"""Assumed of a run whose length and rate nobody told."""


def free_bytes(folder: Path) -> int | None:
    """Bytes that may still be written into a folder; None where the system does not tell."""
    try:
        return shutil.disk_usage(folder).free
    except OSError:
        return None


def need_bytes(planned_s: float | None, samples_per_s: float | None) -> int:
    """Bytes that a run of so many seconds takes, both devices' samples together, with the reserve."""
    seconds = UNTOLD_S if planned_s is None else planned_s
    rate = UNTOLD_PER_S if samples_per_s is None else samples_per_s
    per_s = max(0.0, rate) * SAMPLE_SIZE + min(max(0.0, rate), CHUNKS_PER_S) * CHUNK_COST
    return RESERVE + round(max(0.0, seconds) * per_s)


def must_fit(folder: Path, need: int) -> None:
    """Raises `InputError`, naming folder and need, where a folder's disk has less free."""
    free = free_bytes(folder)
    if free is not None and free < need:
        raise InputError(
            str(folder),
            f"the run may need {in_words(need)} there, {in_words(free)} are free",
            "make room, or choose a folder on another disk with --out",
        )


def running_out(folder: Path) -> str | None:
    """Why a recording should end now, or None while the reserve is there."""
    free = free_bytes(folder)
    if free is None or free >= RESERVE:
        return None
    return f"the disk of {folder} is nearly full: {in_words(free)} are free, {in_words(RESERVE)} are kept free"


def in_words(count: int) -> str:
    """`1.4 MB`."""
    return f"{count / 1e9:.1f} GB" if count >= 1e9 else f"{count / 1e6:.1f} MB"
