"""`padbench compare RUN…`: the fits of several runs side by side."""

from __future__ import annotations

import argparse
from pathlib import Path

from bench.commands.options import add_columns, add_structure, pads, read_data, status
from bench.commands.outputs import add_output
from bench.errors import EXIT_DONE, InputError


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    parser.add_argument("runs", nargs="+", type=Path, metavar="RUN", help="run folders, recordings or CSV")
    add_structure(parser)
    add_columns(parser)
    add_output(
        parser,
        "--out",
        kinds=("html",),
        type=Path,
        default=Path("comparison.html"),
        metavar="HTML",
        help="default: %(default)s",
    )


def main(args: argparse.Namespace) -> int:
    """Fit each, print their parameters, write the page."""
    from bench import identify
    from bench.fitview import fit_view
    from bench.report import write_comparison
    from bench.results import fit_lines

    if len(args.runs) < 2:
        raise InputError("RUN", "one run alone compares with nothing", "name two or more")
    measurements = pads(read_data(args, *args.runs))
    views = []
    for path, measurement in zip(args.runs, measurements, strict=True):
        with status(f"fitting {path}") as progress:
            fit = identify.fit(
                measurement,
                method=args.method,
                law=args.law,
                order=args.order,
                contact=args.contact,
                degree=args.degree,
                progress=progress,
            )
        print("\n".join([str(path), *(f"  {line}" for line in fit_lines(fit))]))
        views.append((str(path), fit_view(fit)))
    write_comparison(args.out, views)
    print(f"page: {args.out}")
    return EXIT_DONE
