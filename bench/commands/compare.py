"""`padbench compare RUN…`: the fits of several runs side by side."""

from __future__ import annotations

import argparse
from pathlib import Path

from bench.commands.options import add_columns, add_structure, existing
from bench.errors import EXIT_DONE, InputError


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN", help="run folders, recordings or CSV")
    add_structure(parser)
    add_columns(parser)
    parser.add_argument(
        "--out", type=Path, default=Path("comparison.html"), metavar="HTML", help="default: %(default)s"
    )


def main(args: argparse.Namespace) -> int:
    """Fit each, print their parameters, write the page."""
    from bench import identify
    from bench.fitview import fit_view
    from bench.recording import parse_columns, parse_units, read_recording
    from bench.report import write_comparison
    from bench.results import fit_lines

    if len(args.runs) < 2:
        raise InputError("RUN", "one run alone compares with nothing", "name two or more")
    columns = parse_columns(args.columns) if args.columns else None
    units = parse_units(args.units) if args.units else None
    views = []
    for path in args.runs:
        recording = read_recording(existing(path), columns=columns, units=units)
        fit = identify.fit(
            recording.measurement(),
            method=args.method,
            law=args.law,
            order=args.order,
            contact=args.contact,
            degree=args.degree,
        )
        print("\n".join([str(path), *(f"  {line}" for line in fit_lines(fit))]))
        views.append((str(path), fit_view(fit)))
    write_comparison(args.out, views)
    print(f"page: {args.out}")
    return EXIT_DONE
