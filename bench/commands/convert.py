"""`padbench convert IN OUT`: MCAP or a run folder to CSV, CSV to MCAP."""

from __future__ import annotations

import argparse
from pathlib import Path

from bench.commands.outputs import add_output


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    parser.add_argument("source", type=Path, metavar="IN", help="recording (MCAP), run folder or CSV")
    add_output(parser, "target", kinds=("csv", "mcap"), type=Path, metavar="OUT", help="file to write: .csv or .mcap")
    parser.add_argument("--columns", help="names in a CSV: time=…,position=…,force=…[,force_time=…]")
    parser.add_argument("--units", help="units in a CSV: time=ms,position=m,force=mN")


def main(args: argparse.Namespace) -> int:
    """Convert, and say what was written."""
    from bench.recording import convert, parse_columns, parse_units

    columns = parse_columns(args.columns) if args.columns else None
    units = parse_units(args.units) if args.units else None
    notes = convert(args.source, args.target, columns=columns, units=units)
    print("\n".join([f"wrote {args.target}", *(f"  note: {note}" for note in notes)]))
    return 0
