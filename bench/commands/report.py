"""`padbench report RUN`: fit a run again and write its report page anew."""

from __future__ import annotations

import argparse
from pathlib import Path

from bench.commands.options import status
from bench.errors import EXIT_DONE, InputError


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    parser.add_argument("run", type=Path, metavar="RUN", help="run folder")


def main(args: argparse.Namespace) -> int:
    """Write model.yaml, fit.json, diagnosis.json and report.html of a run folder."""
    from bench.results import analyse

    if args.run.is_file():
        raise InputError(
            str(args.run), "is not a run folder", "for a single file use `padbench fit FILE --report HTML`"
        )
    with status("fitting the pad's model") as progress:
        results = analyse(args.run, progress=progress)
    print("\n".join(results.lines()))
    print(f"report: {results.report}")
    return EXIT_DONE
