"""`padbench compare RUN…`: the fits of several runs side by side."""

from __future__ import annotations

import argparse
from pathlib import Path

from bench.commands.options import add_columns, add_structure, named_by_file, pads, read_data, status
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
    from bench.report.agreement import lines
    from bench.report.facts import sample_name
    from bench.results import fit_lines

    if len(args.runs) < 2:
        raise InputError("RUN", "one run alone compares with nothing", "name two or more")
    recordings = read_data(args, *args.runs)
    measurements, samples = pads(recordings), [sample_name(recording) for recording in recordings]
    views = []
    for path, measurement, sample in zip(args.runs, measurements, samples, strict=True):
        name = f"{path} ({sample})" if sample else str(path)
        with status(f"fitting {path}") as progress, named_by_file([path], [measurement]):
            fit = identify.fit(
                measurement,
                method=args.method,
                law=args.law,
                order=args.order,
                contact=args.contact,
                degree=args.degree,
                progress=progress,
            )
        print("\n".join([name, *(f"  {line}" for line in fit_lines(fit))]))
        views.append((name, fit_view(fit)))
    print("\n".join(lines([view.json for _, view in views], samples)))
    write_comparison(args.out, views, samples=samples)
    print(f"page: {args.out}")
    return EXIT_DONE
