"""A CSV file as text cells: encoding, separator, header, rows of equal length."""

from __future__ import annotations

import codecs
import csv
import io
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from bench.errors import InputError

MAX_SIZE = 256 << 20
"""Bytes of a CSV file; as cells they take some ten times as much memory. Three channels at 1 kHz for two hours."""

_SEPARATORS = {",": "comma", ";": "semicolon", "\t": "tab"}


_OTHER_KINDS = {".yaml": "YAML", ".yml": "YAML", ".json": "JSON", ".html": "HTML", ".htm": "HTML"}
_YAML_KEY = re.compile(r"[A-Za-z_][\w-]*:(\s[^,;\t]*)?$")


@dataclass
class Table:
    """Header and rows; `lines[i]` is the line in the file on which row i ends (from 1)."""

    path: Path
    header: list[str]
    rows: list[list[str]]
    lines: list[int]
    separator: str
    decimal_comma: bool
    notes: list[str]

    def place(self, row: int, column: int | None = None) -> str:
        """`file:line[:column]` of a row or of a cell, for messages."""
        if column is None:
            return f"{self.path}:{self.lines[row]}"
        at = 1 + sum(len(cell) + 1 for cell in self.rows[row][:column])
        return f"{self.path}:{self.lines[row]}:{at}"


def read_table(path: Path) -> Table:
    """Read a CSV file with a header line. Separators are found out; lines that begin with `#` are comments.

    Raises `InputError` that names the place: empty file, no header, no data, rows of another length, decimal commas
    between comma separators, bytes that are no text.
    """
    notes: list[str] = []
    text = _decode(path, notes)
    first = next((line for line in text.splitlines() if line.strip() and not line.startswith("#")), None)
    if first is None:
        raise InputError(str(path), "is empty", _WANTED)
    _must_be_rows(path, text, first)
    separator = max(_SEPARATORS, key=first.count)
    if first.count(separator) == 0:
        separator = ","
    reader = csv.reader(io.StringIO(text, newline=""), delimiter=separator, strict=True)
    header: list[str] | None = None
    rows: list[list[str]] = []
    lines: list[int] = []
    try:
        for row in reader:
            if not row or (len(row) == 1 and not row[0].strip()) or row[0].startswith("#"):
                continue
            if header is None:
                header = [cell.strip() for cell in row]
                _check_header(header, path, reader.line_num)
            else:
                rows.append(row)
                lines.append(reader.line_num)
    except csv.Error as error:
        raise InputError(f"{path}:{reader.line_num}", f"is not CSV: {error}", _WANTED) from None
    if header is None:
        raise InputError(str(path), "is empty", _WANTED)
    decimal_comma = separator != "," and _uses_decimal_comma(rows)
    if separator != ",":
        notes.append(f"{_SEPARATORS[separator]} taken as separator")
    if decimal_comma:
        notes.append("decimal commas taken as decimal points")
    table = Table(path, header, rows, lines, separator, decimal_comma, notes)
    if rows and len(rows[0]) != len(header):
        _must_begin(path, text, first)
    _check_lengths(table)
    if len(rows) < 2:
        count = "no row" if not rows else "a single row"
        raise InputError(str(path), f"has a header and {count} of data", "two samples at the least are needed")
    return table


_WANTED = "wanted: a header line time_s,position_mm,force_N and one line a sample"


def _decode(path: Path, notes: list[str]) -> str:
    try:
        with path.open("rb") as stream:
            data = stream.read(MAX_SIZE + 1)
    except OSError as error:
        raise InputError(str(path), f"cannot be read ({error.strerror})") from None
    if len(data) > MAX_SIZE:
        cure = "give it in parts, or fewer samples: nothing here needs a gigabyte"
        raise InputError(str(path), f"is larger than {MAX_SIZE >> 20} MB", cure)
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        notes.append("read as UTF-16")
        encoding = "utf-16"
    else:
        encoding = "utf-8-sig"
        if b"\0" in data[:65536]:
            raise InputError(str(path), "is neither a recording nor text", _WANTED)
    try:
        return data.decode(encoding)
    except UnicodeDecodeError:
        pass
    try:
        text = data.decode("cp1252")
    except UnicodeDecodeError:
        raise InputError(str(path), "is neither a recording nor text", _WANTED) from None
    notes.append("read as Windows text (cp1252), since it is not UTF-8")
    return text


def _must_be_rows(path: Path, text: str, first: str) -> None:
    """Other kinds of text, told by the ending or by their first line: what they lack of a table is not the fault."""
    kind = _OTHER_KINDS.get(path.suffix.lower())
    if kind is None and first.lstrip().startswith(("{", "[")):
        kind = "JSON"
    if kind is None and first.lstrip().startswith("<"):
        kind = "HTML or XML"
    if kind is None and (first.startswith(("---", "%YAML")) or _YAML_KEY.match(first)):
        _must_begin(path, text, first)
        kind = "YAML"
    if kind is not None:
        what = "; a model, bench or protocol file?" if kind == "YAML" else ""
        raise InputError(str(path), f"is {kind}, and no measured data{what}", _WANTED)


def _must_begin(path: Path, text: str, first: str) -> None:
    """Raises `InputError` where a table stands further down, below lines that are none of it."""
    if begins := _table_begins(text):
        said = f"{first!r} is no header: the table begins in line {begins}"
        raise InputError(f"{path}:1", said, "begin what is above it with #")


def _table_begins(text: str) -> int:
    """The line of the first header over rows of numbers, from 1; 0: there is none."""
    lines = text.splitlines()
    for separator in _SEPARATORS:
        cells = [line.split(separator) for line in lines]
        for i, (names, one, two) in enumerate(zip(cells, cells[1:], cells[2:], strict=False), 1):
            numbers = all(_is_number(cell.replace(",", ".")) for row in (one, two) for cell in row)
            if len(names) == len(one) == len(two) > 2 and numbers and not any(_is_number(cell) for cell in names):
                return i
    return 0


def _check_header(header: Sequence[str], path: Path, line: int) -> None:
    place = f"{path}:{line}"
    if any(_is_number(cell) for cell in header):
        raise InputError(place, "the first line holds numbers where the columns' names should stand", _WANTED)
    for i, name in enumerate(header):
        if name and name in header[:i]:
            raise InputError(place, f"two columns are called {name!r}", "rename one of them")


def _check_lengths(table: Table) -> None:
    width = len(table.header)
    for i, row in enumerate(table.rows):
        if len(row) == width:
            continue
        message = f"{len(row)} cells where the header has {width}"
        cure = ""
        if table.separator == "," and len(row) > width and _comma_decimals(row):
            cure = "are those decimal commas? export with decimal points, or with semicolons as separators"
        elif table.separator != "," and len(row) == 1 and "," in row[0]:
            cure = f"the header is separated by {_SEPARATORS[table.separator]}s, this line is not"
        elif i == len(table.rows) - 1:
            cure = "the last line is not complete: was the file cut off? remove the line"
        raise InputError(table.place(i), message, cure or "each line needs a cell for each column, empty or not")


def _comma_decimals(row: Sequence[str]) -> bool:
    """Whether a row looks like numbers that were torn apart at their decimal commas."""
    return all(cell.strip().lstrip("+-").isdecimal() for cell in row if cell.strip())


def _uses_decimal_comma(rows: Sequence[Sequence[str]]) -> bool:
    for row in rows[:1000]:
        for cell in row:
            if "," in cell and _is_number(cell.replace(",", ".", 1)) and "." not in cell:
                return True
    return False


def _is_number(cell: str) -> bool:
    try:
        float(cell)
    except ValueError:
        return False
    return cell.strip().lower().lstrip("+-") not in ("nan", "inf", "infinity")
