"""Recordings: written while a run goes on, read back whatever happened to the file, converted and repaired.

`Recorder` writes MCAP, `read_recording` reads MCAP (torn and damaged ones too), run folders and CSV,
`write_csv` and `convert` go between the forms, `recover` rewrites a torn file as a whole one.
"""

from __future__ import annotations

from bench.recording.columns import parse_columns, parse_units
from bench.recording.convert import convert
from bench.recording.csv_write import write_csv
from bench.recording.reader import read_recording
from bench.recording.recover import RecoverReport, recover
from bench.recording.types import Event, ForceChannel, Measurement, MotorChannel, Recording, StepMark
from bench.recording.unfinished import Left, left_behind
from bench.recording.writer import Recorder

__all__ = [
    "Event",
    "ForceChannel",
    "Left",
    "Measurement",
    "MotorChannel",
    "Recorder",
    "RecoverReport",
    "Recording",
    "StepMark",
    "convert",
    "left_behind",
    "parse_columns",
    "parse_units",
    "read_recording",
    "recover",
    "write_csv",
]
