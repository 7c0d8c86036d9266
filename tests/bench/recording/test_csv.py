"""CSV in: what is accepted, and what is said of everything else."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from bench.errors import InputError
from bench.recording import parse_columns, parse_units, read_recording
from bench.recording.csv_file import read_csv
from bench.recording.csv_text import read_table

GOOD = "time_s,position_mm,force_N\n0,0,0.1\n0.001,0.5,0.2\n0.002,1.0,0.4\n"


def written(tmp_path: Path, content: str | bytes, name: str = "data.csv") -> Path:
    path = tmp_path / name
    path.write_bytes(content if isinstance(content, bytes) else content.encode())
    return path


# what is in the file → (line:column or "" for the file, words of the message, words of the cure)
WRONG = {
    "empty": ("", "", "is empty", "time_s,position_mm,force_N"),
    "blank": ("\n\n  \n", "", "is empty", ""),
    "one_line": ("time_s,position_mm,force_N\n", "", "no row of data", "two samples"),
    "one_sample": ("time_s,position_mm,force_N\n0,0,0\n", "", "a single row of data", "two samples"),
    "no_header": ("0,0,0.1\n0.001,0.5,0.2\n", "1", "numbers where the columns' names", "time_s,position_mm,force_N"),
    "missing_column": ("time_s,position_mm,Force_n\n0,0,1\n1,1,1\n", "", "no column 'force_N'", "force=Force_n"),
    "other_names": ("t,depth,load\n0,0,1\n1,1,1\n", "", "'time_s', 'position_mm', 'force_N'", "'depth'"),
    "column_twice": ("time_s,force_N,position_mm,force_N\n0,0,1,1\n1,1,1,1\n", "1", "two columns are called", "rename"),
    "word": (GOOD + "0.003,oops,0.4\n", "5:7", "'oops' in column 'position_mm' is not a number", ""),
    "units_line": (
        "time_s,position_mm,force_N\ns,mm,N\n0,0,0.1\n1,1,1\n", "2:1", "'s' in column 'time_s'", "begin it with #",
    ),
    "nan": (GOOD + "0.003,1,NaN\n", "5:9", "'NaN' in column 'force_N' is no measurement", "leave the cell empty"),
    "infinite": (GOOD + "0.003,-inf,1\n", "5:7", "is no measurement", "leave the cell empty"),
    "too_large": (GOOD + "0.003,1e999,1\n", "5:7", "too large", ""),
    "time_back": (GOOD + "0.0015,1,1\n", "5:1", "time goes back: 0.0015 after 0.002 (line 4)", "order of time"),
    "time_stands": (
        "time_s,position_mm,force_N\n1,0,0\n1,1,1\n1,2,2\n", "", "all samples have the same time", "right column",
    ),
    "time_missing": (GOOD + ",1,1\n", "5:1", "'time_s' is empty in a row that has a value", "its time"),
    "force_time_missing": (
        "time_s,position_mm,force_N,force_time_s\n0,0,0,0\n1,1,1,\n", "3:7", "'force_time_s' is empty", "its time",
    ),
    "too_few_cells": (GOOD + "0.003,1\n0.004,1,1\n", "5", "2 cells where the header has 3", ""),
    "cut_off": (GOOD + "0.003,1", "5", "2 cells where the header has 3", "was the file cut off"),
    "decimal_comma": (
        "time_s,position_mm,force_N\n0,001,1,5,0,2\n0,002,1,6,0,3\n", "2", "6 cells", "decimal commas",
    ),
    "two_separators": ("time_s;position_mm;force_N\n0,0,1\n1,1,1\n", "2", "1 cells", "semicolons"),
    "no_force": ("time_s,position_mm,force_N\n0,0,\n1,1,\n", "", "column 'force_N' is empty", "values"),
    "open_quote": (GOOD + '0.003,"1,1\n', "5", "is not CSV", ""),
    "binary": (bytes(range(256)) * 20, "", "neither a recording nor text", "time_s,position_mm,force_N"),
}  # fmt: skip


@pytest.mark.parametrize("case", WRONG)
def test_one_clear_message_names_the_place(tmp_path, case):
    content, place, message, cure = WRONG[case]
    path = written(tmp_path, content)
    with pytest.raises(InputError) as caught:
        read_recording(path)
    assert caught.value.place == (f"{path}:{place}" if place else str(path))
    assert message in caught.value.message
    assert cure in caught.value.cure
    assert caught.value.status == 2


ACCEPTED = {
    "plain": GOOD,
    "byte_order_mark": b"\xef\xbb\xbf" + GOOD.encode(),
    "crlf": GOOD.replace("\n", "\r\n"),
    "no_last_line_break": GOOD.rstrip("\n"),
    "blank_lines": GOOD.replace("\n", "\n\n"),
    "comments": "# rig 3\n" + GOOD + "# end\n",
    "spaces": GOOD.replace(",", " , "),
    "quotes": GOOD.replace("time_s", '"time_s"').replace("0.5", '"0.5"'),
    "semicolons": GOOD.replace(",", ";"),
    "tabs": GOOD.replace(",", "\t"),
    "european": GOOD.replace(",", ";").replace(".", ","),
    "utf_16": GOOD.encode("utf-16"),
    "other_order": "force_N,time_s,position_mm\n0.1,0,0\n0.2,0.001,0.5\n0.4,0.002,1.0\n",
}


@pytest.mark.parametrize("case", ACCEPTED)
def test_what_people_export_is_read(tmp_path, case):
    recording = read_recording(written(tmp_path, ACCEPTED[case]))
    assert recording.motor.time_s.tolist() == [0, 0.001, 0.002]
    assert recording.motor.position_mm.tolist() == [0, 0.5, 1.0]
    assert recording.load_cell.force_N.tolist() == [0.1, 0.2, 0.4]
    assert recording.surface_mm == 0.0 and recording.surface_std_mm == 0.0
    taken_for_something = case in ("semicolons", "tabs", "european", "utf_16")
    assert bool(recording.notes) == taken_for_something


def test_channels_of_their_own_rates_leave_cells_empty(tmp_path):
    text = "time_s,position_mm,force_N\n0,0,\n0.1,,5\n0.2,1,6\n0.3,,7\n"
    recording = read_recording(written(tmp_path, text))
    assert recording.motor.time_s.tolist() == [0, 0.2]
    assert recording.load_cell.time_s.tolist() == [0.1, 0.2, 0.3]
    assert recording.load_cell.force_N.tolist() == [5, 6, 7]


def test_the_force_may_have_a_clock_of_its_own(tmp_path):
    text = "time_s,position_mm,force_time_s,force_N\n0,0,0.05,1\n0.1,1,0.15,2\n,,0.25,3\n"
    recording = read_recording(written(tmp_path, text))
    assert recording.motor.time_s.tolist() == [0, 0.1]
    assert recording.load_cell.time_s.tolist() == [0.05, 0.15, 0.25]


def test_extra_columns_are_kept(tmp_path):
    text = "time_s,position_mm,force_N,gap_mm,phase\n0,0,1,17.5,down\n1,1,2,,down\n2,2,3,15.5,hold\n,,,,note\n"
    recording = read_recording(written(tmp_path, text))
    assert recording.extra_time_s.tolist() == [0, 1, 2]
    assert np.array_equal(recording.extra["gap_mm"], [17.5, math.nan, 15.5], equal_nan=True)
    assert recording.extra_text["phase"] == ["down", "down", "hold"]


@pytest.mark.parametrize(
    ("header", "units", "said"),
    [
        ("t_ms,way (mm),load [mN]", "", {"t_ms": "time=ms", "load [mN]": "force=mN"}),
        ("t_ms,way (mm),load [mN]", "time=ms,force=N", {}),
        ("t,way/µm,force kN", "", {"way/µm": "position=µm", "force kN": "force=kN"}),
        ("time_s,way_in_pad,force_total", "", {}),
    ],
)
def test_a_unit_in_a_column_s_name_that_is_not_the_one_it_is_read_in_is_told(tmp_path, header, units, said):
    names = header.split(",")
    columns = dict(zip(("time", "position", "force"), names, strict=True))
    text = header + "\n0,0,0.1\n1,0.5,0.2\n2,1,0.4\n"
    notes = read_recording(written(tmp_path, text), columns, parse_units(units) if units else None).notes
    assert len(notes) == len(said)
    for (name, unit), note in zip(said.items(), notes, strict=True):
        assert repr(name) in note and f"--units {unit}" in note


def test_columns_and_units_are_mapped(tmp_path):
    text = "t;way;load;mine\n0;0;1000;3\n500;0.001;2000;4\n"
    columns = parse_columns("time=t, position=way,force=load")
    units = parse_units("time=ms,position=m,force=mN")
    recording = read_recording(written(tmp_path, text), columns, units)
    assert recording.motor.time_s.tolist() == [0, 0.5]
    assert recording.load_cell.time_s.tolist() == [0, 0.5], "the force's clock has the time's unit"
    assert recording.motor.position_mm.tolist() == [0, 1.0]
    assert recording.load_cell.force_N.tolist() == [1.0, 2.0]
    assert list(recording.extra) == ["mine"]


@pytest.mark.parametrize(
    ("units", "position", "force"),
    [
        ("position=um,force=kN", 1e-3, 1e3),
        ("position=\u00b5m,force=\u03bcN", 1e-3, 1e-6),
        ("position=in,force=lbf", 25.4, 4.4482216152605),  # exact by definition: lb 0.45359237 kg, g 9.80665 m/s²
        ("position=cm,force=g", 10.0, 9.80665e-3),
        ("position=nm,force=kg", 1e-6, 9.80665),
        ("position=-mm,force=-kN", -1.0, -1e3),  # a machine that counts compression as negative
    ],
)
def test_units(tmp_path, units, position, force):
    recording = read_recording(written(tmp_path, GOOD), None, parse_units(units))
    assert recording.motor.position_mm[2] == pytest.approx(position, rel=1e-12)
    assert recording.load_cell.force_N[2] == pytest.approx(0.4 * force, rel=1e-12)


@pytest.mark.parametrize(
    ("parse", "text", "message", "cure"),
    [
        (parse_columns, "time", "'time' is not WHAT=COLUMN", "time=t,position=travel"),
        (parse_columns, "tme=t", "'tme' is not known", "did you mean 'time'?"),
        (parse_columns, "time=t,time=u", "given twice", ""),
        (parse_columns, "", "is not WHAT=COLUMN", "as in --columns"),
        (parse_units, "position=miles", "'miles' is no unit of position", "mm"),
        (parse_units, "force=mm", "'mm' is no unit of force", "mN"),
        (parse_units, "force=", "is not WHAT=UNIT", "as in --units"),
    ],
)
def test_options_are_checked(parse, text, message, cure):
    with pytest.raises(InputError) as caught:
        parse(text)
    assert message in caught.value.message and cure in caught.value.cure
    assert caught.value.place in ("--columns", "--units")


def test_a_mapping_to_nothing(tmp_path):
    path = written(tmp_path, GOOD)
    with pytest.raises(InputError, match="no column 'load'"):
        read_recording(path, parse_columns("force=load"))
    with pytest.raises(InputError, match="names one column twice"):
        read_recording(path, parse_columns("force=position_mm"))


def test_data_that_are_not_there_or_not_data(tmp_path):
    written(tmp_path, GOOD, "measured.csv")
    with pytest.raises(InputError, match=r"did you mean .*measured\.csv"):
        read_recording(tmp_path / "mesured.csv")
    with pytest.raises(InputError, match="no folder"):
        read_recording(tmp_path / "none" / "x.csv")
    with pytest.raises(InputError, match=r"no run folder: it has no recording\.mcap"):
        read_recording(tmp_path)
    with pytest.raises(InputError, match="not an MCAP file"):
        read_recording(written(tmp_path, GOOD, "named.mcap"))
    with pytest.raises(InputError, match="is empty"):
        read_recording(written(tmp_path, b"", "empty.mcap"))
    with pytest.raises(InputError, match="no padbench recording"):
        read_recording(foreign(tmp_path / "foreign.mcap", "/imu", "json"))
    with pytest.raises(InputError, match="encoded as cdr"):
        read_recording(foreign(tmp_path / "ros.mcap", "/motor", "cdr"))


def foreign(path: Path, topic: str, encoding: str) -> Path:
    from mcap.writer import Writer

    with path.open("wb") as file:
        writer = Writer(file)
        writer.start("ros2", "someone else")
        channel = writer.register_channel(topic, encoding, 0)
        writer.add_message(channel, 1, b'{"x": 1}', 1, 0)
        writer.finish()
    return path


@pytest.mark.parametrize(
    ("name", "text", "kind"),
    [
        ("m.yaml", "pad:\n  elastic: {law: exponential, m: 2.24, b: 0.69}\n", "YAML"),
        ("m.txt", "pad:\n  elastic: {law: exponential, m: 2.24, b: 0.69}\n", "YAML"),
        ("p.csv", "# a protocol\nname: quick\nsteps:\n  - {to: 1, speed: 5}\n", "YAML"),
        ("fit.json", '{"law": "exponential",\n "order": 2}\n', "JSON"),
        ("fit.txt", '{"law": "exponential",\n "order": 2}\n', "JSON"),
        ("report.csv", "<!doctype html>\n<p>a, b</p>\n", "HTML"),
    ],
)
def test_another_kind_of_file_is_called_by_its_name(tmp_path, name, text, kind):
    path = tmp_path / name
    path.write_text(text)
    with pytest.raises(InputError, match=f"is {kind}.*, and no measured data"):
        read_csv(path)


@pytest.mark.parametrize("header", ["time_s,position_mm,force_N", "time_s:,position_mm:,force_N:", '"time_s","x","F"'])
def test_a_table_is_none_of_them(tmp_path, header):
    path = tmp_path / "data.txt"
    path.write_text(f"{header}\n0,0,0\n1,1,1\n")
    assert len(read_table(path).rows) == 2


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("Specimen: gel 7\nspeed: 5\ntime_s,position_mm,force_N\n0,0,0\n1,1,1\n", r":1: 'Specimen: gel 7' .*line 3"),
        ("gel 7, pressed\ntime_s;position_mm;force_N\n0;0;0\n1;1;1\n", r":1: 'gel 7, pressed' .*line 2"),
        (
            "time_s,position_mm,force_N\n2026-03-12T14:00:00,0,0\n2026-03-12T14:00:01,0,0\n",
            "a date or clock\n.*seconds",
        ),
        ("time_s,position_mm,force_N\n14:00:00.0,0,0\n14:00:01.0,0,0\n", "a date or clock\n.*seconds"),
        ("time_s,position_mm,force_N\n0,0,0\ntime_s,position_mm,force_N\n0,0,0\n", ":3:1: the header .* again\n?.*"),
        ("Time (s),x,F\n0,0,0\n1,1,1\n", r"--columns 'time=Time \(s\),"),
    ],
)
def test_what_exports_have_about_a_table_is_refused_with_its_cure(tmp_path, text, said):
    path = tmp_path / "export.csv"
    path.write_text(text)
    with pytest.raises(InputError, match=said):
        read_csv(path)
