"""Force-displacement data in CSV as a `Recording` (columns: docs/formats.md, Data)."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from bench.errors import InputError
from bench.recording.columns import NAMES, factors, misread, place_columns
from bench.recording.csv_text import Table, read_table
from bench.recording.types import Array, ForceChannel, MotorChannel, Recording

COMMAND, MOTOR_FORCE, GROSS, OVERLOAD = "command_mm", "motor_force_N", "gross_N", "overload"
"""Further columns with a meaning, which the writer makes from a run's recording; all may be missing."""


_CLOCK = re.compile(r"\d[-/.:]\d{1,2}[-/.:]\d")


def read_csv(path: Path, columns: Mapping[str, str] | None = None, units: Mapping[str, str] | None = None) -> Recording:
    """Read a CSV file; the data are in the pad frame, everything in them counts.

    A position sample stands in each row with a position, at `time_s`; a force sample in each row with a force, at
    `force_time_s` where there is such a column, else at `time_s`. `columns` names the columns (time, position, force,
    force_time), `units` their units. Raises `InputError` with `file:line:column` for whatever is wrong.
    """
    factor = factors(units)
    table = read_table(path)
    place = place_columns(table.header, columns, str(path))
    time = _numbers(table, place["time"]) * factor["time"]
    position = _numbers(table, place["position"]) * factor["position"]
    force = _numbers(table, place["force"]) * factor["force"]
    force_time = time
    if "force_time" in place:
        force_time = _numbers(table, place["force_time"]) * factor["force_time"]
    at_position = _stamped(table, time, ~np.isnan(position), place["time"], place["position"])
    at_force = _stamped(table, force_time, ~np.isnan(force), place.get("force_time", place["time"]), place["force"])
    side = {name: _side_column(table, name, set(place.values())) for name in (COMMAND, MOTOR_FORCE, GROSS, OVERLOAD)}
    gross = side[GROSS][at_force]
    recording = Recording(
        source=path,
        motor=MotorChannel(
            time_s=time[at_position],
            position_mm=position[at_position],
            command_mm=side[COMMAND][at_position],
            force_N=side[MOTOR_FORCE][at_position],
            received_s=time[at_position],
        ),
        load_cell=ForceChannel(
            time_s=force_time[at_force],
            force_N=force[at_force],
            gross_N=np.where(np.isnan(gross), force[at_force], gross),
            received_s=force_time[at_force],
            flagged=np.nan_to_num(side[OVERLOAD][at_force]) != 0.0,
        ),
        surface_mm=0.0,
        notes=[f"{path}: {note}" for note in (*table.notes, *misread(table.header, place, units))],
    )
    row_time = np.where(np.isnan(time), force_time, time)
    rows = np.flatnonzero(~np.isnan(row_time))
    recording.extra_time_s = row_time[rows]
    taken = {table.header[i] for i in place.values()} | set(side)
    for i, name in enumerate(table.header):
        if name and name not in taken:
            _keep(recording, table, i, rows)
    return recording


def _stamped(table: Table, time: Array, sampled: NDArray[np.bool_], time_at: int, value_at: int) -> NDArray[np.intp]:
    """Rows of one channel's samples; every one must have a time, and time must not go back."""
    rows = np.flatnonzero(sampled)
    name, what = table.header[time_at], table.header[value_at]
    if rows.size == 0:
        raise InputError(str(table.path), f"column {what!r} is empty", f"{NAMES['time']} and values are needed")
    bare = rows[np.isnan(time[rows])]
    if bare.size:
        place = table.place(int(bare[0]), time_at)
        raise InputError(place, f"{name!r} is empty in a row that has a value of {what!r}", "give each sample its time")
    back = np.flatnonzero(np.diff(time[rows]) < 0)
    if back.size:
        row, before = int(rows[back[0] + 1]), int(rows[back[0]])
        raise InputError(
            table.place(row, time_at),
            f"time goes back: {table.rows[row][time_at].strip()} after {table.rows[before][time_at].strip()} "
            f"(line {table.lines[before]})",
            "a file holds one measurement in the order of time; were two joined, or the rows sorted otherwise?",
        )
    if rows.size > 1 and time[rows[0]] == time[rows[-1]]:
        raise InputError(str(table.path), f"all samples have the same time in {name!r}", "is it the right column?")
    return rows


def _numbers(table: Table, column: int) -> Array:
    """A column as numbers, NaN where a cell is empty. Raises `InputError` at the first cell that is no number."""
    cells = [row[column] for row in table.rows]
    if table.decimal_comma:
        cells = [cell.replace(",", ".") for cell in cells]
    try:
        values = np.array([float(cell) if cell else math.nan for cell in cells])
    except ValueError:
        values = np.array([_number(cell) for cell in cells])
    odd = np.flatnonzero(~np.isfinite(values))
    for row in odd:
        cell = table.rows[row][column].strip()
        if cell:
            raise InputError(table.place(int(row), column), *_complaint(cell, table, column))
    return values


def _number(cell: str) -> float:
    try:
        return float(cell) if cell.strip() else math.nan
    except ValueError:
        return math.nan


def _complaint(cell: str, table: Table, column: int) -> tuple[str, str]:
    name = table.header[column]
    if cell.lower().lstrip("+-") in ("nan", "inf", "infinity", "1.#qnan", "1.#inf", "n/a", "null", "none"):
        return f"{cell!r} in column {name!r} is no measurement", "leave the cell empty where nothing was sampled"
    if math.isinf(_number(cell)):
        return f"{cell!r} in column {name!r} is too large for a number", ""
    if "," in cell:
        return f"{cell!r} in column {name!r} is not a number", "write decimals with a point"
    if _CLOCK.search(cell):
        return f"{cell!r} in column {name!r} is a date or clock", "write times as seconds, from any beginning"
    if cell == name:
        return f"the header stands there again: {cell!r}", "a file holds one measurement: were two joined?"
    return f"{cell!r} in column {name!r} is not a number", "is there a line of units or remarks? begin it with #"


def _side_column(table: Table, name: str, taken: set[int]) -> Array:
    if name not in table.header or table.header.index(name) in taken:
        return np.full(len(table.rows), np.nan)
    return _numbers(table, table.header.index(name))


def _keep(recording: Recording, table: Table, column: int, rows: NDArray[np.intp]) -> None:
    """An extra column, at `rows`: numbers where all its cells are, else text."""
    words = [table.rows[i][column].strip() for i in rows]
    cells = [cell.replace(",", ".") for cell in words] if table.decimal_comma else words
    try:
        recording.extra[table.header[column]] = np.array([float(cell) if cell else math.nan for cell in cells])
    except ValueError:
        recording.extra_text[table.header[column]] = words
