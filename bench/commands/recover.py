"""`padbench recover MCAP [OUT]`: a whole, indexed recording of what a torn or damaged one still holds."""

from __future__ import annotations

import argparse
from pathlib import Path

from bench.commands.outputs import add_output
from bench.errors import EXIT_DONE, EXIT_LOST


def arguments(parser: argparse.ArgumentParser) -> None:
    """What the command takes."""
    parser.add_argument("source", type=Path, metavar="MCAP", help="the torn or damaged recording")
    add_output(
        parser,
        "target",
        kinds=("mcap",),
        type=Path,
        metavar="OUT",
        nargs="?",
        help="default: NAME.recovered.mcap beside it",
    )


def main(args: argparse.Namespace) -> int:
    """Recover, say what was kept and lost; status 3 where something was lost."""
    from bench.recording import recover

    out, report = recover(args.source, args.target)
    print("\n".join(report.lines()))
    print(f"wrote {out}")
    return EXIT_LOST if report.status else EXIT_DONE
