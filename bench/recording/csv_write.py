"""CSV out: every stamp of every channel in one table, a cell empty where a channel was not sampled."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path

import numpy as np

from bench.errors import InputError
from bench.recording.columns import NAMES
from bench.recording.types import Array

Column = tuple[Array, Sequence[float] | Sequence[str] | Array]
"""Times (strictly increasing, seconds) and the values at them."""

DIGITS = 12
"""Significant digits of values; times are written so that they read back as the same number."""


def write_csv(
    path: Path,
    position_time_s: Array,
    position_mm: Array,
    force_time_s: Array,
    force_N: Array,
    extra: Mapping[str, Column] | None = None,
) -> None:
    """Write positions (pad frame) and forces, each shape (n,) at its own strictly increasing times, and extra columns.

    Raises `InputError` where the file cannot be written, ValueError where times do not increase strictly.
    """
    columns: dict[str, Column] = {
        NAMES["position"]: (position_time_s, position_mm),
        NAMES["force"]: (force_time_s, force_N),
        **(extra or {}),
    }
    stamps = np.unique(np.concatenate([np.asarray(times, dtype=float) for times, _ in columns.values()]))
    cells = [[repr(t) for t in stamps.tolist()]]
    cells += [_cells(stamps, times, values) for times, values in columns.values()]
    lines = [",".join(map(_quoted, [NAMES["time"], *columns]))]
    lines += map(",".join, zip(*cells, strict=True))
    there = path.exists()
    try:
        path.write_text("\n".join(lines) + "\n", encoding="utf-8", newline="")
    except OSError as error:
        if not there:  # a part of a table looks like a whole one
            with suppress(OSError):
                path.unlink(missing_ok=True)
        raise InputError(str(path), f"cannot be written ({error.strerror})", "name another place for it") from None


def _cells(stamps: Array, times: Array, values: Sequence[float] | Sequence[str] | Array) -> list[str]:
    if np.any(np.diff(times) <= 0):
        raise ValueError("times must increase strictly")
    cells = [""] * stamps.size
    for row, value in zip(np.searchsorted(stamps, times).tolist(), values, strict=True):
        cells[row] = _quoted(value) if isinstance(value, str) else _number(value)
    return cells


def _number(value: float) -> str:
    return f"{value:.{DIGITS}g}" if math.isfinite(value) else ""


def _quoted(text: str) -> str:
    if any(c in text for c in ',"\r\n') or text.startswith("#"):
        return '"' + text.replace('"', '""') + '"'
    return text
